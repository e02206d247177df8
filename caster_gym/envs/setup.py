"""From what a user names to an engine and its spaces, the same for one robot and for a batch."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from gymnasium.spaces import Box

from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.envs.track_task import read_task
from caster_gym.envs.tracking import OBSERVATION_LIMIT
from caster_gym.envs.tracking_engine import TrackingEngine
from caster_gym.paths.specification import PathSpecification, build_trajectories, read_paths
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot, load_robot

RobotLike: TypeAlias = str | Path | Robot
PathLike: TypeAlias = (
    str | Mapping[str, Any] | PathSpecification | Sequence[str | Mapping[str, Any] | PathSpecification]
)


def make_engine(
    robot: RobotLike,
    path: PathLike,
    actuation: str | Sequence[str] | None,
    task: Mapping[str, Any],
    count: int,
    longest: int | None = None,
) -> TrackingEngine:
    """The engine for so many robots; warns if the driven joints cannot push the robot somewhere."""
    chosen = load_robot(robot)
    if actuation is not None:
        chosen = chosen.with_actuation(actuation if isinstance(actuation, str) else tuple(actuation))
    checked = read_task(task)
    warn_if_singular(chosen)
    trajectories = _trajectories(read_paths(path), chosen, checked.control_period)
    return TrackingEngine(chosen, trajectories, checked, count, longest)


@lru_cache(maxsize=32)
def _trajectories(paths: tuple[PathSpecification, ...], robot: Robot, period: float) -> tuple[Trajectory, ...]:
    """Trajectories of specifications, shared between the environments of a process."""
    return build_trajectories(paths, robot, period)


def observation_space(engine: TrackingEngine) -> "Box[np.float32]":
    """Space of one robot's observation."""
    return Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (engine.layout.size,), np.float32)


def action_space(engine: TrackingEngine) -> "Box[np.float32]":
    """Space of one robot's action: a share of its greatest torque for each driven motor."""
    return Box(-1.0, 1.0, (len(engine.robot.driven),), np.float32)


def refuse_rendering(render_mode: str | None) -> None:
    """Raises ValueError for any render mode, since there is none yet."""
    if render_mode is not None:
        raise ValueError(f"render_mode must be None, since this environment draws nothing, got {render_mode!r}")
