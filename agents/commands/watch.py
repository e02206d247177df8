"""The command `watch`: shows an agent, or a robot that a person drives, in a window or as a video."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from tqdm import tqdm

from caster_gym.agents.commands.selection import choose_agent
from caster_gym.agents.comparison.evaluation import Batch, bare, make_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.control.keyboard import KeyboardDriver, keys_of_window
from caster_gym.agents.control.protocol import Agent
from caster_gym.control.episodes import reset_of
from caster_gym.envs.plan import SPAN
from caster_gym.envs.scene import Scene
from caster_gym.paths.naming import unknown_name
from caster_gym.render.recording import check_target, recording
from caster_gym.render.viewer import MOST, SIZE, Viewer, has_display
from caster_gym.shipped_files import read_settings

KEYBOARD = "keyboard"
FREE = 1e3  # [m] corridor of a person who drives
SURROUNDINGS = 14.0  # floor shown around that person's robot, in reaches of it


def watch(
    agent: str,
    task: str | TaskSettings,
    path: str | int = 0,
    robots: int = 1,
    seed: int = 0,
    save: Path | None = None,
    overwrite: bool = False,
    seconds: float | None = None,
    size: tuple[int, int] = SIZE,
    begin: Callable[[], None] = lambda: None,
) -> int:
    """Show an agent on test paths of a task; returns the number of frames shown.

    task: its settings, or the name of its file. agent: folder of a policy, name of a model-based agent, or "keyboard".
    path: index or name of a test path; with several robots, the first of theirs. Without `save`, a window shows episode
    after episode until it is closed; with it, one episode becomes a film (.mp4 or .gif), a person's drive until the
    window is closed. seconds: stop then. begin is called before the first frame.
    Raises ValueError or OSError, before anything runs, for what cannot be shown or saved.
    """
    driving = agent == KEYBOARD
    _check(driving, robots, seconds)
    if save is not None:
        check_target(save, overwrite, size)
    if (driving or save is None) and not has_display():
        remedy = "" if driving else "; give --save run.mp4 or --save run.gif"
        raise ValueError(f"there is no display to open a window on{remedy}")
    settings = task if isinstance(task, TaskSettings) else read_settings(TaskSettings, "tasks", task)
    if driving:
        free = settings.task.model_copy(update={"corridor": FREE})
        settings = settings.model_copy(update={"task": free, "wrappers": ()})  # a person feels no delay on purpose
    batch = _batch(settings, robots)
    plain = bare(batch)
    engine, period = plain.engine, plain.task.control_period
    paths = (_index(path, batch) + np.arange(robots)) % len(engine.plan.names)
    controller: Agent
    if driving:
        controller = KeyboardDriver(engine.layout, period, keys_of_window)
    else:
        controller = choose_agent(agent, settings, batch).agent
    end = np.inf if seconds is None else round(seconds / period)
    longest = np.inf if driving else int(engine.plan.source.spans[paths, SPAN.periods].max())
    mode = "rgb_array" if save is not None and not driving else "human"
    around = SURROUNDINGS * engine.robot.reach if driving else None
    with ExitStack() as stack:
        writer = None if save is None else stack.enter_context(recording(save, 1.0 / period, overwrite))
        viewer = stack.enter_context(_open(Viewer(mode, size, 1.0 / period, around)))
        bar = stack.enter_context(
            tqdm(
                total=min(end, longest) + 1, unit="frame", desc=controller.name, disable=True if save is None else None
            )
        )
        shown = 0
        begin()
        for scenes in _scenes(controller, batch, paths, seed, once=save is not None and not driving):
            viewer.show(scenes)
            if viewer.closed:
                break
            if writer is not None:
                writer.add(viewer.frame())
            bar.update()
            shown += 1
            if shown > end:
                break
    return shown


def _check(driving: bool, robots: int, seconds: float | None) -> None:
    if not 1 <= robots <= MOST or (driving and robots != 1):
        raise ValueError(f"robots must be 1{' with the keyboard' if driving else f' … {MOST}'}, got {robots}")
    if seconds is not None and not 0.0 < seconds < np.inf:
        raise ValueError(f"seconds must be positive and finite, got {seconds}")


def _batch(settings: TaskSettings, robots: int) -> Batch:
    """So many robots on the test paths; one that has ended its episode waits for the others."""
    return make_batch(settings, settings.test, robots, AutoresetMode.NEXT_STEP, settings.wrappers)


def _index(path: str | int, batch: Batch) -> int:
    """Index of a test path given by its index or name."""
    names = bare(batch).engine.plan.names
    if isinstance(path, str) and not path.isdecimal():
        if path not in names:
            raise ValueError(unknown_name("test path", path, names))
        return names.index(path)
    if not 0 <= int(path) < len(names):
        there = f"a number from 0 to {len(names) - 1}" if len(names) > 1 else "0"
        raise ValueError(f"path must be {there}, or the name of a test path such as {names[0]!r}, got {path}")
    return int(path)


def _scenes(agent: Agent, batch: Batch, paths: NDArray[np.int64], seed: int, once: bool) -> Iterator[list[Scene]]:
    """What there is to see, moment by moment: one episode of every robot, or one after another for ever."""
    engine, reset = bare(batch).engine, reset_of(agent)
    while True:
        observations, _ = batch.reset(seed=seed, options={"path": paths})
        scenes = [engine.scene(i) for i in range(batch.num_envs)]
        running, ended = np.ones(batch.num_envs, dtype=np.bool_), np.zeros(batch.num_envs, dtype=np.bool_)
        reset(running.copy())
        yield scenes
        while running.any():
            observations, _, terminated, truncated, _ = batch.step(agent.act(observations))
            if ended.any():  # this step was the reset of these robots
                reset(ended)
            ended = terminated | truncated
            scenes = [engine.scene(i) if running[i] else scene for i, scene in enumerate(scenes)]
            running &= ~ended
            yield scenes
        if once:
            return
        seed += batch.num_envs


@contextmanager
def _open(viewer: Viewer) -> Iterator[Viewer]:
    try:
        yield viewer
    finally:
        viewer.close()
