"""The tracking task for any number of robots, moved by compiled code; both environments are thin faces of this."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.engines.numba_compiler import announce_compilation
from caster_gym.engines.threads import over_blocks
from caster_gym.envs import tracking_kernel as kernel
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.track_task import TrackTask
from caster_gym.envs.tracking import Terms
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

DRAW_A_PATH = -1


class Outcome(NamedTuple):
    """What a step brought, one entry per robot along the axes named `robots`."""

    observations: NDArray[np.float32]  # (robots, size)
    rewards: NDArray[np.float64]  # (robots,)
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    reports: NDArray[np.float64]  # (quantities, robots)


class TrackingEngine:
    """Robots of one kind, each following one of several timed trajectories."""

    def __init__(
        self, robot: Robot, trajectories: Sequence[Trajectory], task: TrackTask, count: int, longest: int | None = None
    ) -> None:
        robot.check_time_step(task.time_step)
        announce_compilation(kernel.restart, "the environment")
        self.robot, self.task, self.count = robot, task, count
        self.trajectories = tuple(trajectories)
        self.layout = ObservationLayout(robot, task.preview)
        self._casters = tuple(range(robot.caster_count))
        self._preview = tuple(range(len(task.preview)))
        self._spread = np.array([task.start_offset, task.start_turn])
        self._report_rows = kernel.FIXED_REPORT_ROWS + 2 * robot.caster_count
        samples, spans = _table(self.trajectories, longest)
        self._world = kernel.World(
            blocks=self._fresh_blocks(),
            clocks=np.zeros((2, count), dtype=np.int64),
            seeds=np.zeros((2, count), dtype=np.uint64),
            slots=np.array([robot.driven.index(j) if j in robot.driven else -1 for j in robot.joints], dtype=np.int64),
            samples=samples,
            spans=spans,
            horizons=np.array([round(s / task.control_period) for s in task.preview], dtype=np.int64),
            substeps=task.substeps,
            time_step=task.time_step,
        )

    def _fresh_blocks(self) -> NDArray[np.float64]:
        """Blocks that hold the weights and the robot's parameters."""
        fixed = np.array([(*self.task.weights(), *pack_parameters(robot_parameters(self.robot)))])
        first = kernel.weight_row(self._casters, self._preview)
        blocks = np.zeros((block_count(self.count), (first + fixed.shape[1]) * LANES))
        to_lanes(np.repeat(fixed, self.count, axis=0), blocks, first)
        return blocks

    def seed(self, robot: int, key: int) -> None:
        """Begin a robot's sequence of episodes anew from a key."""
        self._world.seeds[:, robot] = key, 0

    def restart(
        self, selected: NDArray[np.int64], into: Outcome | None = None, path: int | NDArray[np.int64] = DRAW_A_PATH
    ) -> Outcome:
        """Start new episodes of the selected robots; the others' entries are those of `into`, or zero.

        path: index of the trajectory to follow, for all or for each of the selected; DRAW_A_PATH draws one.
        """
        outcome = self._empty() if into is None else into
        views = kernel.Views(outcome.observations, outcome.reports, np.zeros((3, 0)))
        paths = np.broadcast_to(np.asarray(path, dtype=np.int64), selected.shape).copy()
        kernel.restart(selected, paths, self._world, self._spread, views, self._casters, self._preview)
        return outcome

    def checked_path(self, path: Any) -> NDArray[np.int64]:
        """Indices of trajectories, one a robot. Raises ValueError for one that is not there or no whole number."""
        wanted = np.asarray(path)
        if wanted.shape not in ((), (self.count,)):
            raise ValueError(f"path must be one number or an array of shape ({self.count},), got shape {wanted.shape}")
        if (
            wanted.dtype.kind not in "iu"
            or wanted.size == 0
            or wanted.min() < DRAW_A_PATH
            or wanted.max() >= len(self.trajectories)
        ):
            raise ValueError(f"path must be a whole number in 0 … {len(self.trajectories) - 1}, got {path!r}")
        return np.broadcast_to(wanted.astype(np.int64), (self.count,))

    def step(self, actions: NDArray[np.float32]) -> Outcome:
        """Move all robots for one control period under actions (robots, driven joints) in −1 … 1."""
        observations = np.empty((self.count, self.layout.size), dtype=np.float32)
        reports = np.empty((self._report_rows, self.count))
        results = np.empty((3, self.count))
        arguments = (self._world, actions, kernel.Views(observations, reports, results), self._casters, self._preview)
        if self.count == 1:
            kernel.step_single(*arguments)
        else:
            over_blocks(kernel.step_blocks, len(self._world.blocks), *arguments)
        return Outcome(observations, results[0], results[1] > 0.0, results[2] > 0.0, reports)

    def _empty(self) -> Outcome:
        size, count = self.layout.size, self.count
        nothing = np.zeros(count, dtype=np.bool_)
        return Outcome(
            np.zeros((count, size), dtype=np.float32),
            np.zeros(count),
            nothing,
            nothing.copy(),
            np.zeros((self._report_rows, count)),
        )

    @property
    def states(self) -> NDArray[np.float64]:
        """A copy of all states (robots, 7 + 2 N), laid out as in `caster_gym.engines.numba_fleet.Fleet`."""
        return from_lanes(self._world.blocks, 0, kernel.command_row(self._casters), self.count)

    @states.setter
    def states(self, value: NDArray[np.float64]) -> None:
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, 0)

    @property
    def paths(self) -> NDArray[np.int64]:
        """Which trajectory each robot follows (robots,), as a copy."""
        return np.array(self._world.clocks[1])


def _table(trajectories: Sequence[Trajectory], longest: int | None) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All trajectories in one table (rows, 10), with each one's first and last row and control periods (paths, 3)."""
    lengths = np.array([len(t.samples) for t in trajectories])
    ends = np.cumsum(lengths)
    periods = lengths - 1 if longest is None else np.minimum(lengths - 1, longest)
    samples = np.ascontiguousarray(np.concatenate([t.samples for t in trajectories]))
    return samples, np.stack([ends - lengths, ends - 1, periods], axis=1).astype(np.int64)


def info_of(reports: NDArray[np.float64]) -> dict[str, Any]:
    """Named quantities of all robots: arrays (robots,) or (robots, width), reward terms in a dictionary."""
    return _named(reports, lambda first, end: reports[first:end].T)


def info_of_one(report: NDArray[np.float64]) -> dict[str, Any]:
    """Named quantities of one robot: numbers or arrays (width,), reward terms in a dictionary."""
    return _named(report.tolist(), lambda first, end: report[first:end])


def _named(row: Any, rows: Callable[[int, int], NDArray[np.float64]]) -> dict[str, Any]:
    terms = kernel.FIRST_TERM
    pose = terms + kernel.TERMS
    return {
        "position_error": row[2],
        "heading_error": row[kernel.HEADING_SIN],
        "reward_terms": {name: row[terms + i] for i, name in enumerate(Terms._fields)},
        "torque": rows(kernel.FIXED_REPORT_ROWS, len(row)),
        "power": row[5],
        "traction_use": row[6],
        "conditioning": row[7],
        "pose": rows(pose, pose + 4),
        "reference_pose": rows(pose + 4, pose + 8),
        "left_corridor": row[0] > 0.0,
        "not_finite": row[1] > 0.0,
    }
