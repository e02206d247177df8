"""From what a user names to an engine and its spaces, the same for one robot and for a batch."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.analysis.tipping import warn_if_lifting
from caster_gym.arena.arena import Arena, read_arena
from caster_gym.arena.beside import draw_beside
from caster_gym.arena.checks import check_free
from caster_gym.arena.packing import hull_of, pack
from caster_gym.engines.time_step import check_time_step
from caster_gym.envs import follow_task, track_task
from caster_gym.envs.follow_task import FollowTask
from caster_gym.envs.following import FollowTerms
from caster_gym.envs.inputs import check_keywords
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.envs.native.reference import Courses, Timetable
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.plan import Pace, Plan, joined
from caster_gym.envs.task import Task
from caster_gym.envs.track_task import TrackTask
from caster_gym.envs.tracking import OBSERVATION_LIMIT, Terms
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import check_slips, robot_on, with_greatest_friction
from caster_gym.mechanics.separation import Surroundings
from caster_gym.paths.specification import AnyPath, build_trajectories, read_paths
from caster_gym.paths.specification import PathLike as PathLike
from caster_gym.robot import Robot, load_robot

RobotLike: TypeAlias = str | Path | Robot | Mapping[str, Any]
ArenaLike: TypeAlias = str | Path | Mapping[str, Any] | Arena | None
Actuation: TypeAlias = str | list[str] | tuple[str, ...] | None

KEYWORDS = (
    "robot",
    "path",
    "actuation",
    "arena",
    "render_mode",
)  # of the environments, beside the fields of their task


def track_engine(
    robot: RobotLike,
    path: PathLike,
    actuation: Actuation,
    arena: ArenaLike,
    fields: Mapping[str, Any],
    count: int,
    longest: int | None = None,
) -> tuple[TaskEngine, TrackTask]:
    """The engine of the tracking task for so many robots; warns if the driven joints cannot push the robot somewhere.

    longest: greatest number of control periods of an episode.
    """
    check_keywords(fields, (*KEYWORDS, *TrackTask.model_fields), "CasterTrack", TrackTask.usual_names)
    task = track_task.read_task(fields)
    chosen = _chosen(robot, actuation, task.slippery)
    check_time_step(chosen, task.time_step, task.substeps)  # first: planning takes longer
    plan = _track_plan(chosen, read_paths(path), read_arena(arena), task, longest)
    return TaskEngine(
        chosen, plan, _pace(task), ObservationLayout(chosen, task.preview, "s", task.nearest), count
    ), task


def follow_engine(
    robot: RobotLike,
    path: PathLike,
    actuation: Actuation,
    arena: ArenaLike,
    fields: Mapping[str, Any],
    count: int,
    longest: int | None = None,
) -> tuple[TaskEngine, FollowTask]:
    """The same for the following task."""
    check_keywords(fields, (*KEYWORDS, *FollowTask.model_fields), "CasterFollow", FollowTask.usual_names)
    task = follow_task.read_task(fields)
    chosen = _chosen(robot, actuation, task.slippery)
    check_time_step(chosen, task.time_step, task.substeps)  # first: planning takes longer
    plan = _follow_plan(chosen, read_paths(path), read_arena(arena), task, longest)
    return TaskEngine(
        chosen, plan, _pace(task), ObservationLayout(chosen, task.preview, "m", task.nearest), count
    ), task


@lru_cache(maxsize=32)
def _track_plan(robot: Robot, paths: tuple[AnyPath, ...], arena: Arena, task: TrackTask, longest: int | None) -> Plan:
    """The plan of a tracking task, shared between the environments of a process."""
    trajectories = build_trajectories(paths, robot, task.control_period)
    tables = tuple(trajectory.samples for trajectory in trajectories)
    samples, rows = joined(tables)
    guide = Timetable(
        samples,
        _spans(rows, rows[:, 1] - rows[:, 0], longest),
        np.array([round(s / task.control_period) for s in task.preview], dtype=np.int64),
        np.array(task.weights()),
    )
    names = tuple(trajectory.name for trajectory in trajectories)
    poses = tuple(table[:, :4] for table in tables)

    def moment(_: int, k: int) -> str:
        return f"at {k * task.control_period:.2f} s"

    around, arenas = _arenas(arena, robot, names, poses, task, moment)
    descriptions = tuple(trajectory.description or trajectory.name for trajectory in trajectories)
    return Plan(guide, names, tables, Terms._fields, around, arenas, descriptions)


@lru_cache(maxsize=32)
def _follow_plan(robot: Robot, paths: tuple[AnyPath, ...], arena: Arena, task: FollowTask, longest: int | None) -> Plan:
    """The same for a following task."""
    from caster_gym.paths.course import build_courses  # late: only those who follow need it

    courses = build_courses(paths, robot, task.speed_limit, task.free_heading, margin=task.margin)
    tables = tuple(course.samples for course in courses)
    samples, rows = joined(tables)
    periods = np.ceil([task.allowance * course.duration / task.control_period for course in courses])
    guide = Courses(
        samples,
        _spans(rows, periods.astype(np.int64), longest),
        np.array([course.spacing for course in courses]),
        np.array(task.preview),
        task.window,
        task.stride,
        task.arrival,
        task.arrival_scale,
        float(task.free_heading),
        np.array(task.weights()),
    )
    names = tuple(course.name for course in courses)
    poses = tuple(table[:, [0, 1, 5, 6]] for table in tables)

    def arc(i: int, k: int) -> str:
        return f"after {k * courses[i].spacing:.2f} m"

    around, arenas = _arenas(arena, robot, names, poses, task, arc)
    descriptions = tuple(course.description or course.name for course in courses)
    return Plan(guide, names, tables, FollowTerms._fields, around, arenas, descriptions)


def _arenas(
    arena: Arena,
    robot: Robot,
    names: Sequence[str],
    poses: Sequence[NDArray[np.float64]],
    task: Task,
    place: Callable[[int, int], str],
) -> tuple[Surroundings, NDArray[np.int64]]:
    """What is around each path, found free of it and of its starts; place(i, k) tells where pose k of path i is."""
    hull = hull_of(robot)
    swing = 2.0 * hull.reach * np.sin(0.5 * task.start_turn) if len(hull.faces) else 0.0
    margin = float(task.start_reach + swing)
    arenas = []
    for i, (name, walked) in enumerate(zip(names, poses, strict=True)):
        around = draw_beside(arena, hull, walked, i, name, margin)
        check_free(around, hull, walked, name, margin, partial(place, i))
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


def _pace(task: Task) -> Pace:
    return Pace(task.substeps, task.time_step, task.corridor, task.start_offset, task.start_turn, task.slippery)


def _spans(rows: NDArray[np.int64], periods: NDArray[np.int64], longest: int | None) -> NDArray[np.int64]:
    """First row, last row and control periods of an episode on each path (paths, 3)."""
    return np.column_stack([rows, periods if longest is None else np.minimum(periods, longest)])


def observation_space(engine: TaskEngine) -> "Box[np.float32]":
    """Space of one robot's observation."""
    return Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (engine.layout.size,), np.float32)


def action_space(engine: TaskEngine) -> "Box[np.float32]":
    """Space of one robot's action: a share of its greatest torque for each driven motor."""
    return Box(-1.0, 1.0, (len(engine.robot.driven),), np.float32)
