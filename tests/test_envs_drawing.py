"""caster_gym.envs.drawing: render modes as Gymnasium defines them, for single robots and for batches."""

import sys
import warnings
from types import SimpleNamespace

import gymnasium as gym
import imageio.v3 as iio
import numpy as np
import pygame
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers.vector import HumanRendering, RecordVideo

from caster_gym.render.viewer import SIZE
from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv

PATH = {"shape": "circle", "radius": 0.5}
SINGLE, BATCH = [CasterFollowEnv, CasterTrackEnv], [CasterFollowVectorEnv, CasterTrackVectorEnv]
EVERY = [*SINGLE, *BATCH]

pytestmark = pytest.mark.usefixtures("no_display")


@pytest.fixture
def no_display(monkeypatch):
    """Windows open on no screen."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def started(kind, render_mode="rgb_array", **arguments):
    env = kind(path=PATH, render_mode=render_mode, **arguments)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("kind", EVERY)
def test_an_unknown_render_mode_is_refused(kind):
    known = r"render_mode must be None or one of \['human', 'rgb_array'(, 'grid')?\], got 'ascii'"
    with pytest.raises(ValueError, match=known):
        kind(path=PATH, render_mode="ascii")


@pytest.mark.parametrize("kind", SINGLE)
def test_gymnasiums_check_includes_drawing(kind):
    """It draws in every mode that the environment says it has."""
    name = kind.__name__.removesuffix("Env")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(f"caster_gym:{name}-v0", path=PATH, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("kind", EVERY)
def test_drawing_before_the_first_reset_is_refused(kind):
    env = kind(path=PATH, render_mode="rgb_array")
    with pytest.raises(RuntimeError, match=r"reset (the environment|every robot) before (it is|they are) drawn"):
        env.render()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "mode"), [*((kind, "rgb_array") for kind in SINGLE), *((kind, "grid") for kind in BATCH)]
)
def test_frames_are_images(kind, mode):
    """That show more than one colour, stay the same as long as nothing moves, and not longer."""
    env = started(kind, mode)
    first, again = env.render(), env.render()
    assert first.dtype == np.uint8
    assert first.ndim == 3
    assert first.shape[2] == 3
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 10
    np.testing.assert_array_equal(first, again)
    for _ in range(10):
        env.step(np.full(env.action_space.shape, 0.3, dtype=np.float32))
    later = env.render()
    assert later.shape == first.shape
    assert (later != first).any()
    env.close()


def test_a_grid_shows_up_to_sixteen_robots():
    """All of a few are drawn; of more only the first, so that a seventeenth changes nothing."""
    few, many = (started(CasterFollowVectorEnv, "grid", num_envs=count) for count in (16, 17))
    np.testing.assert_array_equal(few.render(), many.render())
    before, states = few.render(), few.engine.states
    states[15, :2] += 0.1
    few.engine.states = states
    assert (few.render() != before).any()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "single"), list(zip(BATCH, SINGLE, strict=True)))
def test_a_batch_draws_each_robot_as_its_single_environment(kind, single):
    """To the last pixel, on paths of their own, with what has happened since the reset; SyncVectorEnv agrees."""
    paths = {"path": [PATH, "lemniscate"], "render_mode": "rgb_array"}
    ours, theirs, alone = kind(3, **paths), SyncVectorEnv([lambda: single(**paths)] * 3), kind(1, **paths)
    for env in (ours, theirs, alone):
        env.reset(seed=list[int | None]([0, 1, 0][: env.num_envs]), options={"path": 0})
    for step in range(6):
        action = np.full((3, 6), 0.1 * step, dtype=np.float32)
        for env in (ours, theirs, alone):
            env.step(action[: env.num_envs])
        if step % 3 == 2:
            frames, expected = ours.render(), theirs.render()
            assert type(frames) is type(expected) is tuple
            assert len(frames) == 3
            for frame, other in zip(frames, expected, strict=True):
                np.testing.assert_array_equal(frame, other)
            np.testing.assert_array_equal(alone.render()[0], frames[0])
    np.testing.assert_array_equal(frames[0], frames[2])
    assert (frames[0] != frames[1]).any()
    ours.close()


@pytest.mark.parametrize("mode", ["rgb_array", "grid"])
@pytest.mark.parametrize("kind", BATCH)
def test_what_was_written_into_infos_is_not_drawn(kind, mode):
    ours, theirs = (started(kind, mode, num_envs=2) for _ in range(2))
    for env in (ours, theirs):
        infos = env.step(np.full((2, 6), 0.5, dtype=np.float32))[4]
    for name in ("torque", "reference_pose", "impulse", "pose"):
        infos[name][:] = 0.3
    np.testing.assert_array_equal(ours.render(), theirs.render())


@pytest.mark.parametrize("kind", SINGLE)
def test_what_was_written_into_an_info_is_not_drawn(kind):
    ours, theirs = (started(kind) for _ in range(2))
    for env in (ours, theirs):
        info = env.step(np.full(6, 0.5, dtype=np.float32))[4]
    for name in ("torque", "reference_pose", "impulse", "pose"):
        info[name][:] = 0.3
    np.testing.assert_array_equal(ours.render(), theirs.render())


@pytest.mark.slow
def test_gymnasium_films_a_batch(tmp_path):
    """Its RecordVideo puts the frames of all robots side by side."""
    env = gym.make_vec("caster_gym:CasterFollow-v0", num_envs=4, path=PATH, render_mode="rgb_array")
    env = RecordVideo(env, str(tmp_path / "films"), video_length=3, step_trigger=lambda step: step == 0)
    env.reset(seed=0)
    for _ in range(4):
        env.step(np.full((4, 6), 0.3, dtype=np.float32))
    env.close()
    films = list((tmp_path / "films").glob("*.mp4"))
    assert films
    frames = iio.imread(films[0])
    assert frames.shape[1] * frames.shape[2] == 4 * SIZE[0] * SIZE[1]


def test_gymnasium_shows_a_batch(monkeypatch):
    """In the window of its HumanRendering, which scales frames with OpenCV: here by leaving out rows and columns."""

    def resize(image, size):
        rows, columns = (np.arange(n) * old // n for n, old in zip(size[::-1], image.shape[:2], strict=True))
        return image[rows][:, columns]

    monkeypatch.setitem(sys.modules, "cv2", SimpleNamespace(resize=resize))
    env = HumanRendering(gym.make_vec("caster_gym:CasterFollow-v0", num_envs=4, path=PATH, render_mode="rgb_array"))
    env.reset(seed=0)
    env.step(np.full((4, 6), 0.3, dtype=np.float32))
    assert env.window is not None
    shown = pygame.surfarray.array3d(env.window)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 10
    env.close()


def test_drawing_goes_on_after_somebody_has_quit_pygame():
    """As every environment of Gymnasium's classic control does when it is closed."""
    env = started(CasterTrackEnv)
    before = env.render()
    other = gym.make("CartPole-v1", render_mode="rgb_array")
    other.reset(seed=0)
    other.render()
    other.close()
    assert not pygame.get_init()
    np.testing.assert_array_equal(env.render(), before)
    env.step(np.full(6, 0.3, dtype=np.float32))
    assert (env.render() != before).any()


@pytest.mark.parametrize("kind", EVERY)
def test_without_a_render_mode_nothing_is_drawn(kind):
    env = started(kind, None)
    with pytest.warns(UserWarning, match="render.. draws nothing without a render_mode"):
        assert env.render() is None


@pytest.mark.parametrize("kind", EVERY)
def test_closing_twice_is_closing_once(kind):
    """Before anything was drawn, and after."""
    for drawn in (False, True):
        env = started(kind)
        if drawn:
            env.render()
        env.close()
        env.close()


@pytest.mark.parametrize("kind", EVERY)
def test_a_window_is_no_image(kind):
    """It draws itself at reset and step; render() returns nothing then."""
    env = started(kind, "human")
    env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    assert env.render() is None
    env.close()


@pytest.mark.parametrize("period", [0.02, 0.04])
def test_the_frame_rate_is_that_of_the_control_periods(period):
    env = CasterFollowEnv(path=PATH, control_period=period)
    assert env.metadata["render_fps"] == round(1.0 / period)
    assert CasterFollowEnv.metadata["render_fps"] == 50
