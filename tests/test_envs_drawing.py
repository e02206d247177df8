"""caster_gym.envs.drawing: render modes as Gymnasium defines them, for single robots and for batches."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from caster_gym.envs.caster_follow import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.envs.caster_track import CasterTrackEnv, CasterTrackVectorEnv

PATH = {"shape": "circle", "radius": 0.5}
SINGLE, BATCH = [CasterFollowEnv, CasterTrackEnv], [CasterFollowVectorEnv, CasterTrackVectorEnv]

pytestmark = pytest.mark.usefixtures("no_display")


@pytest.fixture
def no_display(monkeypatch):
    """Windows open on no screen."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def started(kind, render_mode="rgb_array", **arguments):
    env = kind(path=PATH, render_mode=render_mode, **arguments)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("kind", SINGLE + BATCH)
def test_an_unknown_render_mode_is_refused(kind):
    known = r"render_mode must be None or one of \['human', 'rgb_array'\], got 'ascii'"
    with pytest.raises(ValueError, match=known):
        kind(path=PATH, render_mode="ascii")


@pytest.mark.parametrize("kind", SINGLE)
def test_gymnasiums_check_includes_drawing(kind):
    """It draws in every mode that the environment says it has."""
    name = kind.__name__.removesuffix("Env")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(f"caster_gym:{name}-v0", path=PATH, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("kind", SINGLE + BATCH)
def test_drawing_before_the_first_reset_is_refused(kind):
    env = kind(path=PATH, render_mode="rgb_array")
    with pytest.raises(RuntimeError, match=r"reset (the environment|every robot) before (it is|they are) drawn"):
        env.render()


@pytest.mark.parametrize("kind", SINGLE + BATCH)
def test_frames_are_images(kind):
    """That show more than one colour, stay the same as long as nothing moves, and not longer."""
    env = started(kind)
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


def test_a_frame_shows_up_to_sixteen_robots():
    """All of a few are drawn; of more only the first, so that a seventeenth changes nothing."""
    few, many = (started(CasterFollowVectorEnv, num_envs=count) for count in (16, 17))
    np.testing.assert_array_equal(few.render(), many.render())
    before, states = few.render(), few.engine.states
    states[15, :2] += 0.1
    few.engine.states = states
    assert (few.render() != before).any()


@pytest.mark.parametrize("kind", SINGLE + BATCH)
def test_without_a_render_mode_nothing_is_drawn(kind):
    env = started(kind, None)
    with pytest.warns(UserWarning, match="render.. draws nothing without a render_mode"):
        assert env.render() is None


@pytest.mark.parametrize("kind", SINGLE + BATCH)
def test_closing_twice_is_closing_once(kind):
    """Before anything was drawn, and after."""
    for drawn in (False, True):
        env = started(kind)
        if drawn:
            env.render()
        env.close()
        env.close()


@pytest.mark.parametrize("kind", SINGLE + BATCH)
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
