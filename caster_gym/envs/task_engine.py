"""Every task for any number of robots, moved by compiled code; the environments are thin faces of this."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.compilation import compilations, included
from caster_gym.engines.held import Held
from caster_gym.engines.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.engines.memory import check_memory
from caster_gym.engines.recycling import Shelf
from caster_gym.engines.threads import over_blocks
from caster_gym.engines.time_step import check_rows, check_time_step
from caster_gym.envs import block_layout as layout
from caster_gym.envs import task_kernel as kernel
from caster_gym.envs.block_layout import (
    CONDITIONING,
    ENDINGS,
    FIRST_POSE,
    FIRST_RECORD,
    FIRST_SITUATION,
    FIRST_TERM,
    FIXED_REPORT_ROWS,
    HEADING_SIN,
    LEFT_CORRIDOR,
    NOT_FINITE,
    POSITION_ERROR,
    TOUCHED,
    TRACTION_USE,
)
from caster_gym.envs.guides import Courses, Timetable
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.scene import Scene
from caster_gym.mechanics import ground
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.mechanics.scalars import each, pairs
from caster_gym.mechanics.separation import Surroundings
from caster_gym.robot import Robot

DRAW_A_PATH = -1

_TERMS = slice(FIRST_TERM, FIRST_POSE)
_TORQUES = np.s_[..., FIXED_REPORT_ROWS:]
_POSE, _REFERENCE_POSE = np.s_[..., FIRST_POSE : FIRST_POSE + 4], np.s_[..., FIRST_POSE + 4 : FIRST_POSE + 8]
_IMPULSE = np.s_[..., FIRST_RECORD + 1 : FIRST_RECORD + 3]


class Outcome(NamedTuple):
    """What a step brought, one entry per robot along the axes named `robots`."""

    observations: NDArray[np.float32]  # (robots, size)
    rewards: NDArray[np.float64]  # (robots,)
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    reports: NDArray[np.float64]  # (quantities, robots)


class Plan(NamedTuple):
    """All paths of a task as the compiled step reads them, and what there is to say and to draw of them."""

    guide: Timetable | Courses
    names: tuple[str, ...]  # of the paths
    tables: tuple[NDArray[np.float64], ...]  # (K, 10) samples of each path, x and y first
    terms: tuple[str, ...]  # names of the reward's terms
    around: Surroundings
    arenas: NDArray[np.int64]  # (paths, 2) first and end of the obstacles beside each path
    descriptions: tuple[str, ...]  # what was made of each path


class Pace(NamedTuple):
    """What the engine needs to know of a task."""

    substeps: int
    time_step: float  # [s]
    corridor: float  # [m]
    start_offset: float  # [m]
    start_turn: float  # [rad]


class TaskEngine:
    """Robots of one kind, each on one of several paths.

    on_restart: functions that are called with the indices of robots that start a new episode, before they are placed.
    """

    def __init__(self, robot: Robot, plan: Plan, pace: Pace, observed: ObservationLayout, count: int) -> None:
        check_time_step(robot, pace.time_step, pace.substeps)
        self.robot, self.plan, self.layout, self.count = robot, plan, observed, count
        self.on_restart: list[Callable[[NDArray[np.int64]], None]] = []
        self._pace = pace
        self._sizes = layout.Sizes(
            tuple(range(robot.caster_count)), tuple(range(len(observed.preview))), tuple(range(observed.nearest))
        )
        check_memory(count, layout.desk_rows(self._sizes))
        self._spread = np.array([pace.start_offset, pace.start_turn])
        self._observation_size = observed.size
        self._report_rows = FIXED_REPORT_ROWS + 2 * robot.caster_count
        self._desk = np.zeros(layout.desk_rows(self._sizes) * LANES)
        kept, end = layout.parameter_row(self._sizes), layout.command_row(self._sizes)
        if count == 1:
            blocks, parameters = self._desk.reshape(1, -1), self._desk[kept * LANES : end * LANES].reshape(1, -1)
        else:
            blocks, parameters = np.zeros((block_count(count), kept * LANES)), np.zeros((1, (end - kept) * LANES))
        to_lanes(np.array([pack_parameters(robot_parameters(robot))]), parameters, 0)
        self._reports: NDArray[np.float64] = np.zeros((self._report_rows, count))  # the latest, for pictures
        self._shelves = (
            Shelf((count, observed.size), np.float32),
            Shelf((self._report_rows, count), np.float64),
            Shelf((3, count), np.float64),
        )
        among = len(plan.around.obstacles.radii) > 0
        self._world = layout.World(
            blocks=blocks,
            parameters=parameters,
            clocks=np.zeros((2, count), dtype=np.int64),
            seeds=np.zeros((2, count), dtype=np.uint64),
            slots=np.array([robot.driven.index(j) if j in robot.driven else -1 for j in robot.joints], dtype=np.int64),
            guide=plan.guide,
            hull=plan.around.hull if among else None,
            obstacles=plan.around.obstacles if among else None,
            arenas=plan.arenas if among else None,
            substeps=pace.substeps,
            time_step=pace.time_step,
        )
        self._results = np.zeros(3)  # of a robot alone
        self._held: Held | None = None  # made when it is needed, since that may have to compile

    def seed(self, robot: int, key: int) -> None:
        """Begin a robot's sequence of episodes anew from a key."""
        self._world.seeds[:, robot] = key, 0

    def episodes(self, selected: NDArray[np.int64]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Key, and number of the episode that is about to start, of some robots; random draws count from them."""
        return self._world.seeds[0, selected], self._world.seeds[1, selected]

    def restart(
        self, selected: NDArray[np.int64], into: Outcome | None = None, path: int | NDArray[np.int64] = DRAW_A_PATH
    ) -> Outcome:
        """Start new episodes of the selected robots; the others' entries are those of `into`, or zero.

        path: index of the path to follow, for all or for each of the selected; DRAW_A_PATH draws one.
        """
        for prepare in self.on_restart:
            prepare(selected)
        outcome = self._empty() if into is None else into
        views = layout.Views(outcome.observations, outcome.reports, np.zeros((3, 0)))
        paths = np.broadcast_to(np.asarray(path, dtype=np.int64), selected.shape).copy()
        before = compilations()
        kernel.restart(selected, paths, self._world, self._spread, views, self._desk, self._sizes)
        if compilations() > before:
            self._compile_step()
        if into is None:
            self._reports = self._reports.reshape(self._report_rows, -1).copy()
            self._reports[:, selected] = outcome.reports[:, selected]
        return outcome

    def checked_path(self, path: Any) -> NDArray[np.int64]:
        """Indices of paths, one a robot. Raises ValueError for one that is not there or no whole number."""
        wanted = np.asarray(path)
        if wanted.shape not in ((), (self.count,)):
            raise ValueError(f"path must be one number or an array of shape ({self.count},), got shape {wanted.shape}")
        if (
            wanted.dtype.kind not in "iu"
            or wanted.size == 0
            or wanted.min() < DRAW_A_PATH
            or wanted.max() >= len(self.plan.names)
        ):
            raise ValueError(f"path must be a whole number in 0 … {len(self.plan.names) - 1}, got {path!r}")
        return np.broadcast_to(wanted.astype(np.int64), (self.count,))

    def step(self, actions: NDArray[np.float32]) -> Outcome:
        """Move all robots for one control period under actions (robots, driven joints) in −1 … 1."""
        observations, reports, results = (shelf.take() for shelf in self._shelves)
        views = layout.Views(observations, reports, results)
        over_blocks(kernel.step_blocks, len(self._world.blocks), self._world, actions, views, self._sizes)
        self._reports = reports
        return Outcome(observations, results[0], results[1] > 0.0, results[2] > 0.0, reports)

    def step_alone(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, NDArray[np.float64]]:
        """Move the only robot there is for a control period: observation, reward, terminated, truncated, report.

        Faster than `step`, and the same to the last bit. Raises ValueError for an action (driven joints,) that is not a
        number.
        """
        observation = np.empty(self._observation_size, dtype=np.float32)
        report = np.empty(self._report_rows)
        held = self._held if self._held is not None else self._hold()
        if not kernel.step_single(held, action, observation, report):
            raise ValueError(f"action must hold numbers, got {action}")
        self._reports = report
        reward, failed, late = self._results.tolist()
        return observation, reward, failed > 0.0, late > 0.0, report

    def _hold(self) -> Held:
        self._held = Held((self._world, self._desk, self._results, self._sizes))
        return self._held

    def _compile_step(self) -> None:
        """Compile the step as well, by a call that does nothing, so that whoever waits does so once."""
        nothing, action = self._empty(), np.full(len(self.robot.driven), np.nan, dtype=np.float32)
        with included():
            if self.count == 1:
                kernel.step_single(self._hold(), action, nothing.observations[0], nothing.reports[:, 0].copy())
            else:
                views = layout.Views(nothing.observations, nothing.reports, np.zeros((3, self.count)))
                actions = np.zeros((self.count, len(action)), dtype=np.float32)
                kernel.step_blocks(0, 0, self._world, actions, views, self._sizes)

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
        return from_lanes(self._world.blocks, 0, layout.room_row(self._sizes), self.count)

    @states.setter
    def states(self, value: NDArray[np.float64]) -> None:
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, 0)
        if self._world.obstacles is not None:
            to_lanes(np.zeros((self.count, 1)), self._world.blocks, layout.room_row(self._sizes))

    @property
    def wrenches(self) -> NDArray[np.float64]:
        """External wrenches (robots, 3) at C, in B [N, N, N m], as a copy.

        They act until they are set again; an episode starts without any, whatever was set before its first step.
        """
        return from_lanes(self._world.blocks, layout.wrench_row(self._sizes), 3, self.count)

    @wrenches.setter
    def wrenches(self, value: NDArray[np.float64]) -> None:
        if np.shape(value) != (self.count, 3):
            raise ValueError(f"wrenches must have shape {(self.count, 3)}, got {np.shape(value)}")
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, layout.wrench_row(self._sizes))

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Every robot's numbers (robots, fields), in the order of `pack_parameters`, as a copy."""
        everybody = np.broadcast_to(self._world.parameters, (block_count(self.count), self._world.parameters.shape[1]))
        return from_lanes(everybody, 0, layout.parameter_rows(self._sizes), self.count)

    def check_parameters(self, rows: NDArray[np.float64], what: str | None = None) -> None:
        """Refuse robots of numbers (robots, fields) that the time step cannot follow; what: their name in the error."""
        called = f"robots like {self.robot.name!r} of other numbers" if what is None else what
        check_rows(called, rows, self._pace.time_step, self._pace.substeps)

    def set_parameters(self, selected: NDArray[np.int64], rows: NDArray[np.float64], *, checked: bool = False) -> None:
        """Give some robots other numbers than their robot file says; rows (selected, fields) as in `parameters`.

        Raises ValueError for robots that the time step cannot follow, unless they are `checked`.
        """
        changed = self.parameters
        if rows.shape != (len(selected), changed.shape[1]):
            raise ValueError(f"rows must have shape {(len(selected), changed.shape[1])}, got {rows.shape}")
        if not checked and len(selected):
            self.check_parameters(rows)
        changed[selected] = rows
        if len(self._world.parameters) < block_count(self.count):
            own = np.zeros((block_count(self.count), self._world.parameters.shape[1]))
            self._world = self._world._replace(parameters=own)
        to_lanes(changed, self._world.parameters, 0)

    @property
    def paths(self) -> NDArray[np.int64]:
        """Which path each robot follows (robots,), as a copy."""
        return np.array(self._world.clocks[1])

    def info(self, reports: NDArray[np.float64]) -> dict[str, Any]:
        """Named quantities of all robots, from reports (quantities, robots): arrays (robots,) or (robots, width).

        Of one robot, from its report (quantities,): numbers or arrays (width,). Reward terms are in a dictionary.
        """
        row: Any = reports if reports.ndim > 1 else reports.tolist()  # numbers of one robot are Python's own
        columns = reports.T
        return {
            "position_error": row[POSITION_ERROR],
            "heading_error": row[HEADING_SIN],
            "reward_terms": dict(zip(self.plan.terms, row[_TERMS], strict=False)),
            "torque": columns[_TORQUES],
            "power": row[FIRST_RECORD],
            "traction_use": row[TRACTION_USE],
            "conditioning": row[CONDITIONING],
            "pose": columns[_POSE],
            "reference_pose": columns[_REFERENCE_POSE],
            "progress": row[FIRST_SITUATION],
            "progress_share": row[FIRST_SITUATION + 1],
            "clearance": row[FIRST_SITUATION + 2],
            "impacts": row[FIRST_RECORD + 6],
            "impulse": columns[_IMPULSE],
            "normal_impulse": row[FIRST_RECORD + 3],
            "left_corridor": row[LEFT_CORRIDOR] > 0.0,
            "not_finite": row[NOT_FINITE] > 0.0,
            "touched": row[TOUCHED] > 0.0,
        }

    def scene(self, robot: int) -> Scene:
        """What there is to see of one robot."""
        state = self.states[robot]
        report = self._reports.reshape(self._report_rows, -1)[:, robot]
        path = int(self._world.clocks[1, robot])
        near, end = self.plan.arenas[path]
        record = report[FIRST_RECORD:]
        return Scene(
            robot=self.robot,
            time=float(self._world.clocks[0, robot]) * self._pace.substeps * self._pace.time_step,
            pose=state[:4],
            twist=state[4:7],
            directions=state[7:].reshape(-1, 2),
            torque=report[FIXED_REPORT_ROWS:].copy(),
            ground_forces=self._ground_forces(state, report[FIXED_REPORT_ROWS:]),
            path=self.plan.tables[path][:, :2],
            corridor=self._pace.corridor,
            reference=report[FIRST_POSE + 4 : FIRST_POSE + 8].copy(),
            obstacles=self.plan.around.obstacles._replace(
                radii=self.plan.around.obstacles.radii[near:end], spans=self.plan.around.obstacles.spans[near:end]
            ),
            impulse=record[1:3].copy(),
            impact_point=record[4:6].copy() if record[6] > 0.0 else np.full(2, np.nan),
            failed=bool(report[:ENDINGS].any()),
        )

    def _ground_forces(self, state: NDArray[np.float64], torque: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces (N, 2) of the floor on each wheel along its rolling direction and to its left. [N]"""
        parameters, now = robot_parameters(self.robot), unpack_state(tuple(state.tolist()))
        at_joints = each(joint_torques, (), pairs(tuple(torque.tolist())), parameters.casters)
        rate = forward_dynamics(now.twist, now.directions, at_joints, (0.0, 0.0, 0.0), parameters)
        shared = now.twist, rate, parameters.platform.coulomb_speed
        return np.array(each(ground.ground_force, shared, now.directions, parameters.casters, at_joints))


def joined(tables: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All tables of paths in one (rows, columns), with each one's first and last row (paths, 2)."""
    lengths = np.array([len(table) for table in tables])
    ends = np.cumsum(lengths)
    return np.ascontiguousarray(np.concatenate(tables)), np.stack([ends - lengths, ends - 1], axis=1).astype(np.int64)
