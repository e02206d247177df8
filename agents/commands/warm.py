"""The command `warm`: compiles the code for robots and tasks ahead of time, piece by piece."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from caster_gym.agents.comparison.task_settings import ChosenTask, TaskSettings
from caster_gym.arena.arena import Arena
from caster_gym.engines.native.compilation import compilations, included
from caster_gym.engines.native.compiled_files import version_folder
from caster_gym.engines.native.fleet import Fleet
from caster_gym.robot import Robot, load_robot
from caster_gym.shipped_files import names_of, read_settings
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.registry import find_task

_FAR = Arena(room=((-100.0, -100.0), (100.0, 100.0)))  # what obstacles there are makes no difference, nor where


class Piece(NamedTuple):
    """Something that is compiled on its own."""

    name: str
    run: Callable[[], None]


class Warmed(NamedTuple):
    """What was done."""

    pieces: int
    compiled: int  # of them; the others were there
    folder: str


def read_pieces(robots: Sequence[str], tasks: Sequence[str], casters: Sequence[int]) -> list[Piece]:
    """All pieces that robots, tasks and other numbers of casters need; those that come with the package, without any.

    Of these, tasks on a floor of finite friction, which take twice as long, only if they are named.
    Raises ValueError for a robot or a task that is not there or wrong, and for fewer than two casters.
    """
    known = [read_settings(TaskSettings, "tasks", name) for name in tasks or names_of("tasks")]
    chosen = [one for one in known if tasks or one.task.slippery is None]
    named = [*robots] if robots or casters else [*names_of("robots"), *(task.robot for task in chosen)]
    by_casters = {robot.caster_count: robot for robot in map(load_robot, named)}
    for count in casters:
        if count < 2:
            raise ValueError(f"a robot has 2 casters or more, got {count}")
        by_casters.setdefault(count, _ring(count))
    pieces: dict[str, Piece] = {}
    for count, robot in sorted(by_casters.items()):
        for task in chosen:
            for piece in _of_task(robot, task):
                pieces.setdefault(piece.name, piece)
        for robots_of_it in (1, 2):
            name = f"{count} casters, mechanics, {_how(robots_of_it)}"
            pieces[name] = Piece(name, partial(_step_fleet, robot, robots_of_it))
    return list(pieces.values())


def warm(pieces: Sequence[Piece], report: Callable[[int, str], None]) -> Warmed:
    """Compile what is not there yet; report(done, name of the next piece). An interrupt loses one piece at most."""
    compiled = 0
    for done, piece in enumerate(pieces):
        report(done, piece.name)
        before = compilations()
        with included():
            piece.run()
        compiled += compilations() > before
    report(len(pieces), "")
    return Warmed(len(pieces), compiled, str(version_folder() or "memory alone, since there is no folder for them"))


def _of_task(robot: Robot, task: ChosenTask) -> list[Piece]:
    """The single environment and the batch of a task, with and without obstacles."""
    floor = "" if task.task.slippery is None else " on a floor of finite friction"
    seen = f"{len(task.task.preview)} previewed points, {task.task.nearest} observed obstacles"
    return [
        Piece(
            f"{robot.caster_count} casters, {task.environment}{words}{floor}, {seen}, {_how(count)}",
            partial(_step_task, robot, task, arena, count),
        )
        for words, arena in (("", None), (" among obstacles", _FAR))
        for count in (1, 2)
    ]


def _step_task(robot: Robot, task: ChosenTask, arena: Arena | None, count: int) -> None:
    fields = task.task.model_dump(exclude_defaults=True)
    definition = find_task(task.environment)
    engine, _ = build_engine(definition, robot, definition.short_path, "all", arena, fields, count)
    engine.restart(np.arange(count))
    action = np.zeros((count, len(engine.robot.driven)), dtype=np.float32)
    if count == 1:
        engine.step_alone(action[0])
    else:
        engine.step(action)


def _step_fleet(robot: Robot, count: int) -> None:
    Fleet(robot, count).step(np.zeros((count, 2 * robot.caster_count)), 1e-5)


def _how(count: int) -> str:
    return "one robot" if count == 1 else "batches"


def _ring(count: int) -> Robot:
    """Some robot with so many casters: one that is known, with its casters in a ring."""
    known = load_robot("chung2008")
    angles = [2.0 * math.pi * i / count for i in range(count)]
    ring = [
        known.casters[0].model_copy(update={"x": 0.1 * math.cos(angle), "y": 0.1 * math.sin(angle)}) for angle in angles
    ]
    return known.model_copy(update={"casters": tuple(ring), "actuation": "all"})
