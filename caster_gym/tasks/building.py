"""From what a user names to an engine, the same for every task, for one robot and for a batch."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.analysis.tipping import warn_if_lifting
from caster_gym.arena.arena import Arena, read_arena
from caster_gym.arena.beside import draw_beside
from caster_gym.arena.checks import check_free
from caster_gym.arena.packing import hull_of, pack
from caster_gym.configuration import parse
from caster_gym.engines.time_step import check_time_step
from caster_gym.envs.inputs import Actuation, ArenaLike, RobotLike, check_keywords
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.plan import SPAN, Pace, Plan
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import check_slips, robot_on, with_greatest_friction
from caster_gym.mechanics.separation import Surroundings
from caster_gym.own_errors import OwnCodeError
from caster_gym.paths.specification import AnyPath, PathLike, read_paths
from caster_gym.robot import Robot, load_robot
from caster_gym.tasks.checks import check_reward
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.task import Task, Way

KEYWORDS = ("robot", "path", "actuation", "arena", "render_mode")  # of environments, beside fields of the parameters


def build_engine(
    task: Task,
    robot: RobotLike,
    path: PathLike | None,
    actuation: Actuation,
    arena: ArenaLike,
    fields: Mapping[str, Any],
    count: int,
    longest: int | None = None,
) -> tuple[TaskEngine, TaskParameters]:
    """The engine of a task for so many robots; warns if the driven joints cannot push the robot somewhere.

    path: the task's own by default. fields: of the task's parameters. longest: greatest number of control periods of an
    episode.
    """
    model = task.parameters
    check_keywords(fields, (*KEYWORDS, *model.model_fields), task.title, model.usual_names)
    parameters = parse(model, fields, f"the task {task.name!r}")
    chosen = _chosen(robot, actuation, parameters.slippery)
    check_time_step(chosen, parameters.time_step, parameters.substeps)  # first: planning takes longer
    paths = read_paths(task.default_path if path is None else path)
    plan = _plan(task, chosen, paths, read_arena(arena), parameters, longest)
    return TaskEngine(chosen, plan, _pace(parameters), observation_layout(task, chosen, parameters), count), parameters


def observation_layout(task: Task, robot: Robot, parameters: Any) -> ObservationLayout:
    """What observations mean."""
    return ObservationLayout(robot, parameters.preview, task.preview_unit, parameters.nearest)


@lru_cache(maxsize=32)
def _plan(
    task: Task, robot: Robot, paths: tuple[AnyPath, ...], arena: Arena, parameters: TaskParameters, longest: int | None
) -> Plan:
    """The plan of a task, shared between the environments of a process."""
    weights = task.weights_of(parameters)
    check_reward(task, task.weights(*weights.tolist()))
    source: Any
    source, ways = task.lay_out(robot, paths, parameters)
    if type(source) is not task.source:
        given, wanted = type(source).__name__, task.source.__name__
        raise OwnCodeError(f"lay_out of task {task.name!r} gives a {given}, and must give a {wanted}, its source")
    spans = source.spans.copy()
    if longest is not None:
        spans[:, SPAN.periods] = np.minimum(spans[:, SPAN.periods], longest)
    source = source._replace(spans=spans, weights=weights)
    around, arenas = _arenas(arena, robot, ways, parameters)
    names, tables = tuple(way.name for way in ways), tuple(way.table for way in ways)
    terms: Any = task.terms
    descriptions = tuple(way.description or way.name for way in ways)
    return Plan(source, names, tables, terms._fields, around, arenas, descriptions)


def _arenas(
    arena: Arena, robot: Robot, ways: Sequence[Way], parameters: TaskParameters
) -> tuple[Surroundings, NDArray[np.int64]]:
    """What is around each path, found free of it and of its starts."""
    hull = hull_of(robot)
    swing = 2.0 * hull.reach * np.sin(0.5 * parameters.start_turn) if len(hull.faces) else 0.0
    margin = float(parameters.start_reach + swing)
    arenas = []
    for i, way in enumerate(ways):
        around = draw_beside(arena, hull, way.poses, i, way.name, margin)
        check_free(around, hull, way.poses, way.name, margin, way.place)
        arenas.append(around)
    obstacles, spans = pack(arenas)
    return Surroundings(hull, obstacles), spans


def _chosen(robot: RobotLike, actuation: Actuation, floor: Floor | None) -> Robot:
    """The robot with its driven joints, and on a floor of finite friction with that friction."""
    chosen = load_robot(robot)
    if actuation is not None:
        chosen = chosen.with_actuation(actuation if isinstance(actuation, str) else tuple(actuation))
    if floor is not None:
        check_slips(chosen)
        chosen = robot_on(chosen, floor)
    warn_if_singular(chosen)
    warn_if_lifting(chosen if floor is None else with_greatest_friction(chosen, floor))
    return chosen


def _pace(task: TaskParameters) -> Pace:
    return Pace(task.substeps, task.time_step, task.corridor, task.start_offset, task.start_turn, task.slippery)
