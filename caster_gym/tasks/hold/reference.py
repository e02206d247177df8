"""Poses that stay: a timetable with one row for each path."""

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.plan import PlaceName, Span
from caster_gym.envs.tracking import POSE, REFERENCE_ROWS
from caster_gym.paths.specification import AnyPath, build_trajectories
from caster_gym.robot import Robot
from caster_gym.tasks.hold.parameters import HoldParameters
from caster_gym.tasks.task import Way
from caster_gym.tasks.track.reference import Timetable

ARROW = ((0.1, 0.0), (-0.06, 0.06), (-0.06, -0.06), (0.1, 0.0))  # [m] that shows a pose in pictures


class Poses(Timetable):
    """One row of samples for each pose, at rest; whatever the clock and the horizon, that is the reference."""

    __slots__ = ()

    @property
    def place(self) -> PlaceName | None:
        """There are no places along a pose."""
        return None


def lay_out(robot: Robot, paths: tuple[AnyPath, ...], parameters: HoldParameters) -> tuple[Poses, list[Way]]:
    """The pose that is asked for, or those at the ends of all paths."""
    if parameters.target is not None:
        x, y, heading = parameters.target
        ends = {f"pose {x:g}, {y:g}, {heading:g}": (x, y, np.cos(heading), np.sin(heading))}
    else:
        trajectories = build_trajectories(paths, robot, parameters.control_period)
        ends = {trajectory.name: tuple(trajectory.samples[-1, POSE]) for trajectory in trajectories}
    poses = np.array(list(ends.values()))
    samples, rows = np.zeros((len(poses), REFERENCE_ROWS)), np.arange(len(poses))
    samples[:, POSE] = poses
    periods = np.full_like(rows, round(parameters.duration / parameters.control_period))
    spans = np.stack(Span(first=rows, last=rows, periods=periods), axis=1)
    source = Poses(samples, spans, np.zeros(len(parameters.preview), dtype=np.int64))
    return source, [Way(name, _arrow(pose), pose[None], _place) for name, pose in zip(ends, poses, strict=True)]


def _arrow(pose: Array) -> Array:
    x, y, c, s = pose
    return np.array([(x + c * ahead - s * left, y + s * ahead + c * left) for ahead, left in ARROW])


def _place(_index: int) -> str:
    return "at the pose to hold"
