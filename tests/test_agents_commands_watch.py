"""caster_gym.agents.commands.watch and keyboard: films and windows of real episodes."""

import imageio.v3 as iio
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.agents.commands import watch as module
from caster_gym.agents.commands.selection import choose_agent
from caster_gym.agents.commands.watch import watch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.control.keyboard import (
    KEYS,
    SLOWING,
    KeyboardDriver,
    greatest_twist,
    keys_of_window,
    wanted_shares,
)
from caster_gym.render.pygame_loader import pygame
from caster_gym.render.viewer import Viewer
from caster_gym.shipped_files import read_settings
from caster_gym.tasks.track.environment import CasterTrackVectorEnv

RANDOM = {"shape": "random_paths", "duration": 2.2, "max_speed": 0.3}
STEPS = 110  # of 0.02 s in those seconds
TASK = {
    "train": [{**RANDOM, "seed": 0, "count": 1}],
    "validation": [{**RANDOM, "seed": 1, "count": 1}],
    "test": [{**RANDOM, "seed": 2, "count": 2}, {"shape": "circle"}],
}
AGENT = {"algorithm": "computed torque", "natural_frequencies": [10.0]}
SMALL = (96, 64)


@pytest.fixture
def setup(tmp_path, monkeypatch):
    """A task of short paths and an agent, by their file names, in an empty folder; no display."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    (tmp_path / "agent.yaml").write_text(yaml.safe_dump(AGENT), encoding="utf-8")
    return tmp_path


@pytest.fixture
def window(setup, monkeypatch):
    """A window that nobody sees, as if there were a display; returns a function that presses or releases keys."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(module, "has_display", lambda: True)
    held: set[str] = set()
    monkeypatch.setattr(module, "keys_of_window", lambda: frozenset(held))
    yield held
    pygame.display.quit()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_film_shows_one_episode_from_start_to_end(setup, suffix):
    file = setup / f"run{suffix}"
    assert watch("agent.yaml", "task.yaml", save=file, size=SMALL) == STEPS + 1
    frames = iio.imread(file)
    count = STEPS + 1 if suffix == ".mp4" else STEPS // 2 + 1  # 50 a second, and 25
    assert frames.shape == (count, SMALL[1], SMALL[0], 3)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 50
    assert sorted(path.name for path in setup.iterdir()) == ["agent.yaml", f"run{suffix}", "task.yaml"]


def test_the_same_seed_gives_the_same_film(setup):
    films = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        watch("agent.yaml", "task.yaml", seed=seed, seconds=0.2, save=setup / f"{name}.gif", size=SMALL)
        films.append((setup / f"{name}.gif").read_bytes())
    assert films[0] == films[1]
    assert films[0] != films[2]


def test_several_robots_are_shown_until_the_last_has_ended(setup):
    """The circle takes longer than the random paths; their robots stay where they ended."""
    settings = read_settings(TaskSettings, "tasks", "task.yaml")
    batch = module._batch(settings, 3)
    agent = choose_agent("agent.yaml", settings, batch).agent
    shown = list(module._scenes(agent, batch, np.arange(3), seed=0, once=True))
    times = np.array([[scene.time for scene in scenes] for scenes in shown])
    assert_allclose(times[STEPS], STEPS * 0.02)
    assert_allclose(times[-1, :2], STEPS * 0.02)
    assert times[-1, 2] > 5.0
    assert shown[-1][0] is shown[STEPS][0]


@pytest.mark.parametrize(("path", "index"), [("circle", 2), ("1", 1), (0, 0)])
def test_a_path_is_chosen_by_name_or_index(setup, path, index):
    settings = read_settings(TaskSettings, "tasks", "task.yaml")
    batch = module._batch(settings, 1)
    assert module._index(path, batch) == index


@pytest.mark.slow
def test_without_save_episodes_follow_each_other_until_the_window_is_closed(setup, window, monkeypatch):
    moments = []
    show = Viewer.show

    def seen(viewer, scenes):
        moments.append(scenes[0].time)
        if len(moments) == 2 * STEPS:
            pygame.event.post(pygame.event.Event(pygame.QUIT))
        viewer.fps = 1e4  # no need to wait
        return show(viewer, scenes)

    monkeypatch.setattr(Viewer, "show", seen)
    watch("agent.yaml", "task.yaml", size=SMALL)
    assert len(moments) == 2 * STEPS
    assert moments.count(0.0) == 2
    assert not pygame.display.get_init()


def drive(held, steps, robot="chung2008"):
    """Twists of a robot (steps, 3) while keys are held, from rest."""
    batch = CasterTrackVectorEnv(1, robot, "circle", corridor=1e3)
    driver = KeyboardDriver(batch.engine.layout, batch.task.control_period, lambda: frozenset(held))
    observations, _ = batch.reset(seed=0)
    twists = []
    for _ in range(steps):
        observations, *_ = batch.step(driver.act(observations))
        twists.append(batch.engine.states[0, 4:7])
    return np.array(twists)


@pytest.mark.parametrize(
    ("held", "shares"), [({"w"}, (1, 0, 0)), ({"right"}, (0, -1, 0)), ({"s", "q"}, (-1, 0, 1)), (set(), (0, 0, 0))]
)
def test_held_keys_bring_the_robot_to_their_twist(held, shares):
    """After two seconds, eight time constants: 3e-4 of the way is left, and the discrete control's ripple."""
    wanted = greatest_twist(load_robot("chung2008")) * shares
    assert_allclose(drive(held, 100)[-1], wanted, rtol=0, atol=0.02)


def test_a_held_key_is_followed_at_the_rate_that_is_told():
    """What is left of the way falls as exp(−4 t); a rate that is held without regard to the period falls 0.34 % faster.

    Straight ahead, once the casters trail; observations are in single precision.
    """
    left = 1.0 - drive({"w"}, 90)[:, 0] / greatest_twist(load_robot("chung2008"))[0]
    assert_allclose(left[71:] / left[70:-1], np.exp(-SLOWING * 0.02), rtol=3e-4)


def test_opposite_keys_cancel_and_unknown_ones_do_nothing():
    assert_allclose(wanted_shares(frozenset({"w", "s", "left", "q", "x"})), (0.0, 1.0, 1.0))
    assert_allclose(wanted_shares(frozenset({"w", "up"})), (1.0, 0.0, 0.0))  # twice the same is once


def test_every_key_has_a_name_that_pygame_knows(window):
    """key_code raises ValueError for others."""
    pygame.display.init()
    pygame.display.set_mode((64, 64))
    assert all(pygame.key.key_code(key) > 0 for key in KEYS)
    assert keys_of_window() == frozenset()


def test_a_person_drives_where_the_keys_say(setup, window, monkeypatch):
    window.add("w")
    scenes = []
    show = Viewer.show

    def seen(viewer, what):
        scenes.append(what[0])
        viewer.fps = 1e4
        return show(viewer, what)

    monkeypatch.setattr(Viewer, "show", seen)
    shown = watch("keyboard", "task.yaml", seconds=1.5, size=SMALL, save=setup / "drive.gif")
    assert shown == 76
    ahead = scenes[-1].pose[:2] - scenes[0].pose[:2]
    assert ahead @ scenes[0].pose[2:] > 0.4  # [m] of 0.6 at most, and straight ahead
    assert iio.imread(setup / "drive.gif").shape[0] == 38


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"save": None}, "there is no display to open a window on; give --save run.mp4 or --save run.gif"),
        ({"agent": "keyboard"}, "there is no display to open a window on"),
        ({"save": "run.avi"}, r"a video must be saved as \.mp4 or \.gif, got 'run.avi'"),
        ({"robots": 0}, "robots must be 1 … 16, got 0"),
        ({"agent": "keyboard", "robots": 2}, "robots must be 1 with the keyboard, got 2"),
        ({"seconds": 0.0}, "seconds must be positive and finite, got 0.0"),
        ({"agent": "nobody"}, "a model-based agent called 'nobody'"),
        ({"agent": "ppo"}, "agent 'ppo' must be trained first: `caster-gym train ppo"),
        ({"task": "nowhere"}, "there is no 'nowhere' in tasks"),
        ({"path": 3}, "path must be a number from 0 to 2, or the name of a test path such as 'random_paths 0', got 3"),
        ({"path": "circel"}, "unknown test path 'circel'; did you mean 'circle'?"),
        ({"size": (97, 64)}, "an .mp4 needs an even width and height, got 97 × 64"),
    ],
)
def test_mistakes_are_told_before_anything_is_written(setup, changes, message):
    arguments = {"agent": "agent.yaml", "task": "task.yaml", "save": "run.mp4", "size": SMALL, **changes}
    if arguments["save"] is not None:
        arguments["save"] = setup / arguments["save"]
    with pytest.raises(ValueError, match=message):
        watch(**arguments)
    assert sorted(path.name for path in setup.iterdir()) == ["agent.yaml", "task.yaml"]


def test_an_interrupted_film_leaves_nothing(setup, monkeypatch):
    calls = []

    def interrupted(viewer, scenes):
        calls.append(scenes)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return np.zeros((64, 96, 3), dtype=np.uint8)

    monkeypatch.setattr(Viewer, "show", interrupted)
    monkeypatch.setattr(Viewer, "frame", lambda _: np.zeros((64, 96, 3), dtype=np.uint8))
    with pytest.raises(KeyboardInterrupt):
        watch("agent.yaml", "task.yaml", save=setup / "run.mp4", size=SMALL)
    assert sorted(path.name for path in setup.iterdir()) == ["agent.yaml", "task.yaml"]
