"""The tracking task for any number of robots, moved by compiled code; both environments are thin faces of this."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.envs import tracking_kernel as kernel
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.track_task import TrackTask
from caster_gym.envs.tracking import Terms
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

PARALLEL_FROM = 8  # blocks, below which waking a second thread costs more than it brings


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
        self.robot, self.task, self.count = robot, task, count
        self.trajectories = tuple(trajectories)
        self.layout = ObservationLayout(robot, task.preview)
        self._casters = tuple(range(robot.caster_count))
        self._preview = tuple(range(len(task.preview)))
        self._parallel = block_count(count) >= PARALLEL_FROM
        self._table(longest)
        self._slots = np.array([robot.driven.index(j) if j in robot.driven else -1 for j in robot.joints])
        self._spread = np.array([task.start_offset, task.start_turn])
        self._report_rows = kernel.FIXED_REPORT_ROWS + 2 * robot.caster_count

        blocks = block_count(count)
        fixed = np.array([(*task.weights(), *pack_parameters(robot_parameters(robot)))])
        first = kernel.weight_row(self._casters, self._preview)
        self._blocks = np.zeros((blocks, (first + fixed.shape[1]) * LANES))
        to_lanes(np.repeat(fixed, count, axis=0), self._blocks, first)
        self._clocks = np.zeros((2, count), dtype=np.int64)
        self._seeds = np.zeros((2, count), dtype=np.uint64)

    def _table(self, longest: int | None) -> None:
        """All trajectories in one table, with each one's first and last row and number of steps."""
        self._samples = np.ascontiguousarray(np.concatenate([t.samples for t in self.trajectories]))
        ends = np.cumsum([len(t.samples) for t in self.trajectories])
        starts = ends - [len(t.samples) for t in self.trajectories]
        steps = ends - starts - 1
        limit = steps if longest is None else np.minimum(steps, longest)
        self._spans = np.stack([starts, ends - 1, limit], axis=1).astype(np.int64)
        self._horizons = np.array([round(s / self.task.control_period) for s in self.task.preview], dtype=np.int64)

    def seed(self, robot: int, key: int) -> None:
        """Begin a robot's sequence of episodes anew from a key."""
        self._seeds[:, robot] = key, 0

    def restart(self, selected: NDArray[np.int64], into: Outcome | None = None) -> Outcome:
        """Start new episodes of the selected robots; the others' entries are those of `into`, or zero."""
        outcome = self._empty() if into is None else into
        kernel.restart(
            selected, self._blocks, self._clocks, self._seeds, self._samples, self._spans, self._horizons, self._spread,
            outcome.observations, outcome.reports, self._casters, self._preview,
        )  # fmt: skip
        return outcome

    def step(self, actions: NDArray[np.float32]) -> Outcome:
        """Move all robots for one control period under actions (robots, driven joints) in −1 … 1."""
        observations = np.empty((self.count, self.layout.size), dtype=np.float32)
        reports = np.empty((self._report_rows, self.count))
        results = np.empty((3, self.count))
        if self.count == 1:
            step = kernel.step_single
        else:
            step = kernel.step_parallel if self._parallel else kernel.step_serial
        step(
            self._blocks, self._clocks, actions, self._slots, self._samples, self._spans, self._horizons,
            self.task.substeps, self.task.time_step, observations, reports, results, self._casters, self._preview,
        )  # fmt: skip
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
        return from_lanes(self._blocks, 0, kernel.command_row(self._casters), self.count)

    @states.setter
    def states(self, value: NDArray[np.float64]) -> None:
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._blocks, 0)

    @property
    def paths(self) -> NDArray[np.int64]:
        """Which trajectory each robot follows (robots,), as a copy."""
        return self._clocks[1].copy()


def info_of(reports: NDArray[np.float64]) -> dict[str, Any]:
    """The report as named quantities: arrays (robots,) or (robots, width), reward terms in a dictionary."""
    first = kernel.FIRST_TERM
    pose = first + kernel.TERMS
    return {
        "position_error": reports[2],
        "heading_error": reports[kernel.HEADING_SIN],
        "reward_terms": {name: reports[first + i] for i, name in enumerate(Terms._fields)},
        "torque": reports[kernel.FIXED_REPORT_ROWS :].T,
        "power": reports[5],
        "traction_use": reports[6],
        "conditioning": reports[7],
        "pose": reports[pose : pose + 4].T,
        "reference_pose": reports[pose + 4 : pose + 8].T,
        "left_corridor": reports[0] > 0.0,
        "not_finite": reports[1] > 0.0,
    }
