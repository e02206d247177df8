"""caster_gym.render.viewer: frames for Gymnasium, with and without a display."""

import copy
import os
import pickle
import subprocess
import sys

import gymnasium as gym
import imageio.v3 as iio
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo
from numpy.testing import assert_array_equal

from caster_gym.render import palette
from caster_gym.render.pygame_loader import pygame
from caster_gym.render.viewer import MOST, Viewer
from tests.scenes import ROBOT, centroid, obstacles, scene

SMALL = (200, 160)


@pytest.fixture
def dummy_display(monkeypatch):
    """A display that nobody sees, whatever the machine has."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.display.quit()


@pytest.mark.parametrize("size", [(200, 160), (160, 200), (300, 200), (64, 64)])
def test_a_frame_has_the_size_asked_for(size):
    frame = Viewer("rgb_array", size).show([scene()])
    assert frame is not None and frame.shape == (size[1], size[0], 3)
    assert frame.dtype == np.uint8


def test_the_same_scenes_give_the_same_frame():
    one, other = Viewer("rgb_array", SMALL), Viewer("rgb_array", SMALL)
    for time in (0.0, 0.02, 0.04):
        first = one.show([scene(1.0, time, time=time)])
        assert_array_equal(first, other.show([scene(1.0, time, time=time)]))
        assert_array_equal(first, one.show([scene(1.0, time, time=time)]))  # asked again


@pytest.mark.parametrize(
    "changes",
    [
        {"y": 0.05},
        {"turn": 0.2},
        {"directions": np.tile([0.0, 1.0], (3, 1))},
        {"ground_forces": np.full((3, 2), 1.5)},
        {"torque": np.full(6, 0.05)},
        {"reference": np.array([1.1, 0.0, 0.0, 1.0])},
        {"twist": np.array([0.3, 0.0, 0.0])},
        {"obstacles": obstacles(pillars=[(0.0, 0.0, 0.1)])},
        {"corridor": 0.3},
        {"time": 0.5},
        {"failed": True},
    ],
)
def test_different_states_give_different_frames(changes):
    first, second = (Viewer("rgb_array", (480, 320)).show([what]) for what in (scene(), scene(**changes)))
    assert np.any(first != second)


def test_a_frame_stays_as_it_was():
    """It is not a view of what is drawn next."""
    viewer = Viewer("rgb_array", SMALL)
    frame = viewer.show([scene()])
    assert frame is not None
    kept = frame.copy()
    viewer.show([scene(0.0, 0.0, time=0.02)])
    assert_array_equal(frame, kept)
    frame[:] = 0
    assert viewer.frame().any()


def test_a_new_episode_begins_without_a_trace():
    viewer = Viewer("rgb_array", SMALL)
    fresh = viewer.show([scene()])
    for time in (0.02, 0.04):
        viewer.show([scene(1.0, 10 * time, time=time)])
    assert_array_equal(viewer.show([scene()]), fresh)


def test_another_path_gives_another_floor():
    """Also when the viewer had drawn the old one already, and again when it comes back."""
    viewer = Viewer("rgb_array", SMALL)
    first = viewer.show([scene()])
    second = viewer.show([scene(path=scene().path * (1.0, 0.4))])
    assert np.any(first != second)
    assert_array_equal(viewer.show([scene()]), first)


def test_each_robot_of_a_batch_is_in_its_cell():
    viewer = Viewer("rgb_array", (600, 600))
    places = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    frame = viewer.show([scene(*place) for place in places])
    assert frame is not None
    for i, place in enumerate(places):
        area = viewer.view(i).area
        left, top = 300 * (i % 2), 300 * (i // 2)
        assert left <= area.left < area.left + area.width <= left + 300
        cell = frame[top : top + 300, left : left + 300]
        seen = np.add(centroid(cell, palette.CENTRE), (left, top))
        assert np.hypot(*(seen - viewer.view(i).pixels(place))) < 1.0  # a pixel


def test_robots_of_a_batch_have_traces_of_their_own():
    together, alone = Viewer("rgb_array", (400, 200)), Viewer("rgb_array", (400, 200))
    for time in (0.0, 0.02):
        frame = together.show([scene(1.0, 10 * time, time=time), scene(-1.0, 0.0, time=0.0)])
    still = alone.show([scene(1.0, 0.2, time=0.02), scene(-1.0, 0.0, time=0.0)])
    assert frame is not None and still is not None
    assert (frame[:, :200] != still[:, :200]).any()
    assert_array_equal(frame[:, 200:], still[:, 200:])


def test_of_a_large_batch_the_first_are_shown():
    viewer = Viewer("rgb_array", (320, 320))
    many = [scene(1.0, 0.1 * i) for i in range(MOST + 5)]
    assert_array_equal(viewer.show(many), Viewer("rgb_array", (320, 320)).show(many[:MOST]))
    with pytest.raises(ValueError, match=f"robot {MOST} has not been shown; {MOST} robots have been"):
        viewer.view(MOST)


def test_arrays_need_no_display(monkeypatch):
    def refused(*_, **__):
        raise AssertionError("a display was opened")

    for function in ("init", "set_mode"):
        monkeypatch.setattr(pygame.display, function, refused)
    viewer = Viewer("rgb_array", SMALL)
    viewer.show([scene()])
    viewer.close()
    viewer.close()


HEADLESS = """
import os, sys
sys.platform = "linux"  # elsewhere a display is taken for granted
from tests.scenes import scene
from caster_gym.render.viewer import Viewer
from caster_gym.render.pygame_loader import pygame
frame = Viewer("rgb_array", (200, 160)).show([scene()])
assert not pygame.display.get_init() and "SDL_VIDEODRIVER" not in os.environ
window = Viewer("human", (200, 160), fps=1000.0)
assert window.show([scene()]) is None and pygame.display.get_driver() == "dummy"
assert (window.frame() == frame).all()
window.close()
assert not pygame.display.get_init()
print(frame.sum())
"""


def test_a_machine_without_a_display_draws_the_same():
    blind = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    environment = {key: value for key, value in os.environ.items() if key not in blind}
    result = subprocess.run([sys.executable, "-c", HEADLESS], env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == [
        str(np.asarray(Viewer("rgb_array", SMALL).show([scene()])).sum())
    ]  # and no greeting


def test_drawing_is_not_imported_before_it_is_needed():
    code = "import sys, caster_gym; print([m for m in ('pygame', 'caster_gym.render', 'moviepy') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_without_pygame_it_says_what_to_install():
    code = "import sys; sys.modules['pygame'] = None; import caster_gym.render.viewer"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "drawing needs pygame-ce, which is not installed: pip install 'caster_gym[render]'" in result.stderr


def test_a_window_shows_what_an_array_holds(dummy_display):
    window, array = Viewer("human", SMALL, fps=1000.0), Viewer("rgb_array", SMALL)
    assert window.show([scene()]) is None
    surface = pygame.display.get_surface()
    assert surface is not None
    shown = pygame.surfarray.array3d(surface).transpose(1, 0, 2)
    assert_array_equal(shown, array.show([scene()]))
    window.close()
    assert not pygame.display.get_init()


def test_a_window_is_paced(dummy_display, monkeypatch):
    asked = []
    viewer = Viewer("human", SMALL, fps=50.0)
    monkeypatch.setattr(viewer, "_clock", type("Clock", (), {"tick": lambda _, fps: asked.append(fps)})())
    viewer.show([scene()])
    viewer.show([scene(time=0.02)])
    assert asked == [50.0, 50.0]


def test_a_closed_window_stays_closed(dummy_display):
    viewer = Viewer("human", SMALL, fps=1000.0)
    viewer.show([scene()])
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    viewer.show([scene()])
    assert viewer.closed
    assert viewer.show([scene()]) is None
    assert not pygame.display.get_init()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"render_mode": "ansi"}, "render_mode must be one of human, rgb_array, got 'ansi'"),
        ({"size": (10, 100)}, r"size must lie in 64 … 8192 pixels along both axes, got \(10, 100\)"),
        ({"fps": 0.0}, "fps must be positive, got 0.0"),
        ({"follow": -1.0}, "follow must be a positive width in metres or None, got -1.0"),
    ],
)
def test_wrong_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Viewer(**{"render_mode": "rgb_array", **arguments})


def test_nothing_to_show_is_an_error():
    viewer = Viewer("rgb_array", SMALL)
    with pytest.raises(ValueError, match="there must be at least one scene"):
        viewer.show([])
    with pytest.raises(ValueError, match="nothing has been shown yet"):
        viewer.frame()


class Circling(gym.Env):
    """A robot that goes round and round, as far as a video can tell."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 as Gymnasium has it
    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))
    render_mode = "rgb_array"

    def __init__(self):
        self.viewer, self.steps = Viewer("rgb_array", SMALL), 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.zeros(1, dtype=np.float32), 0.0, self.steps >= 20, False, {}

    def render(self):
        time = 0.02 * self.steps
        return self.viewer.show([scene(np.cos(time), np.sin(time), 1.6 + time, time, robot=ROBOT)])


def test_gymnasium_records_it(tmp_path):
    environment = RecordVideo(Circling(), str(tmp_path / "videos"), episode_trigger=lambda _: True, disable_logger=True)
    environment.reset(seed=0)
    while not environment.step(np.zeros(1, dtype=np.float32))[2]:
        pass
    environment.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    frames = iio.imread(video)
    assert frames.shape == (21, SMALL[1], SMALL[0], 3)  # the start and twenty steps
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 50


def test_a_robot_whose_numbers_have_gone_is_drawn_where_it_was_last():
    viewer = Viewer("rgb_array", SMALL)
    viewer.show([scene(1.0, 0.1, time=0.02)])
    lost = viewer.show([scene(np.nan, 0.1, time=0.04)])
    known = Viewer("rgb_array", SMALL)
    known.show([scene(1.0, 0.1, time=0.02)])
    assert_array_equal(lost, known.show([scene(1.0, 0.1, time=0.04, failed=True)]))


def test_events_that_nobody_reads_do_not_pile_up(dummy_display):
    """Else a full queue would lose the wish to close the window."""
    viewer = Viewer("human", SMALL, fps=1000.0)
    viewer.show([scene()])
    pygame.event.post(pygame.event.Event(pygame.USEREVENT))
    viewer.show([scene()])
    assert not pygame.event.peek(pygame.USEREVENT)
    viewer.close()


def test_fonts_and_windows_that_somebody_has_quit_are_made_anew(dummy_display):
    """Whether pygame was quit as a whole or in part, and whether others have started it again since."""
    viewer = Viewer("human", SMALL, fps=1000.0)
    still = Viewer("rgb_array", SMALL)
    before = still.show([scene(time=1.0)])

    def quit_and_start_anew():
        pygame.quit()
        pygame.init()

    endings = [pygame.quit, pygame.font.quit, pygame.display.quit, quit_and_start_anew]
    for step, end in enumerate(endings):
        viewer.show([scene(time=step)])
        end()
        viewer.show([scene(time=step + 0.123)])  # a time that no text has been drawn of before
        assert pygame.display.get_surface() is not None
        assert not viewer.closed
        assert_array_equal(still.show([scene(time=1.0)]), before)
    viewer.close()
    viewer.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "pickle"])
def test_a_copy_draws_what_the_original_draws(copied):
    """The trace of the robot included; afterwards each its own."""
    original = Viewer("rgb_array", SMALL)
    for step in range(5):
        original.show([scene(0.1 * step, 0.0, time=step), scene(0.0, 0.1 * step, time=step)])
    other = copied(original)
    last = [scene(0.6, 0.2, time=6.0), scene(0.1, 0.5, time=6.0)]
    frame = original.show(last)
    assert_array_equal(other.show(last), frame)
    other.show([scene(3.0, 0.0, time=7.0), scene(0.0, 0.0, time=7.0)])
    assert_array_equal(original.show(last), frame)


def test_an_old_pygame_that_imports_a_deprecated_package_loads_without_a_warning(tmp_path):
    (tmp_path / "pygame.py").write_text(
        "import warnings\n"
        "warnings.warn('pkg_resources is deprecated as an API. See its page', DeprecationWarning, stacklevel=2)\n",
        encoding="utf-8",
    )
    code = "import caster_gym.render.pygame_loader as loader; print(loader.pygame.__file__)"
    places = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    found = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": places},
    )
    assert found.stdout.strip() == str(tmp_path / "pygame.py")
