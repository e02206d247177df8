"""Every task for any number of robots, moved by compiled code; the environments are thin faces of this."""

import copy
from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.free_wheels import check_free_wheels
from caster_gym.engines.memory import check_memory
from caster_gym.engines.native.buffer_pool import BufferPool
from caster_gym.engines.native.compilation import compilations, included
from caster_gym.engines.native.held import Held
from caster_gym.engines.native.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.engines.native.threads import over_blocks
from caster_gym.engines.time_step import check_rows, check_time_step
from caster_gym.envs.native import layout
from caster_gym.envs.native import step as kernel
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.plan import Pace, Plan
from caster_gym.envs.report import RESULT, named
from caster_gym.envs.rows import span
from caster_gym.envs.scene import Scene, draw_scene
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import FloorTable, floor_table
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.mechanics.separation import Obstacles
from caster_gym.robot import Robot

DRAW_A_PATH = -1
_ENDED = span((RESULT.failed, RESULT.late))


class Outcome(NamedTuple):
    """What a step brought, one entry per robot along the axes named `robots`."""

    observations: NDArray[np.float32]  # (robots, size)
    rewards: NDArray[np.float64]  # (robots,)
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    reports: NDArray[np.float64]  # (quantities, robots)


class TaskEngine:
    """Robots of one kind, each on one of several paths.

    on_restart: functions that are called with the indices of robots that start a new episode, before they are placed.
    """

    def __init__(self, robot: Robot, plan: Plan, pace: Pace, observed: ObservationLayout, count: int) -> None:
        check_time_step(robot, pace.time_step, pace.substeps)
        if pace.floor is not None:
            numbers = np.array([pack_parameters(robot_parameters(robot))])
            check_free_wheels(f"robot {robot.name!r}", numbers, pace.time_step, pace.substeps)
        self.robot, self.plan, self.layout, self.count = robot, plan, observed, count
        self.on_restart: list[Callable[[NDArray[np.int64]], None]] = []
        self._pace = pace
        self._sizes = layout.Sizes(
            tuple(range(robot.caster_count)),
            tuple(range(len(observed.preview))),
            tuple(range(observed.nearest)),
            tuple(range(robot.caster_count if pace.floor is not None else 0)),
            tuple(range(len(plan.terms))),
        )
        self._rows = layout.rows_of(self._sizes)
        self.slipping = len(self._sizes.slipping)  # wheels that may slip: none, or all
        check_memory(count, self._rows.end)
        self.spread = np.array([pace.start_offset, pace.start_turn])  # [m], [rad] greatest displacements of a start
        self.corridor, self.control_period = pace.corridor, pace.substeps * pace.time_step  # [m], [s]
        self.report_rows = self._rows.end - self._rows.report
        self._kept_reports: NDArray[np.float64] | None = None  # latest of a batch that is drawn, copied for pictures
        self._late: NDArray[np.int64] | None = None  # (robots,) clocks at which episodes began, unless all were 0
        kept, end = self._rows.parameters, self._rows.commands
        self._build(
            np.zeros((1, self._rows.end * LANES) if count == 1 else (block_count(count), kept * LANES)),
            np.zeros((1, (end - kept) * LANES)),
            np.zeros((2, count), dtype=np.int64),
            np.zeros((2, count), dtype=np.uint64),
        )
        to_lanes(np.array([pack_parameters(robot_parameters(robot))]), self._world.parameters, 0)

    def _build(
        self,
        blocks: NDArray[np.float64],
        parameters: NDArray[np.float64],
        clocks: NDArray[np.int64],
        seeds: NDArray[np.uint64],
    ) -> None:
        """Join what changes from step to step with what stays. A robot alone lives in its workspace, `blocks`."""
        plan, robot, count, floor = self.plan, self.robot, self.count, self._pace.floor
        among = len(plan.around.obstacles.radii) > 0
        self._workspace = blocks.reshape(-1) if count == 1 else np.zeros(self._rows.end * LANES)
        self._world = layout.World(
            blocks=blocks,
            parameters=self._workspace_parameters(self._workspace) if count == 1 else parameters,
            clocks=clocks,
            seeds=seeds,
            slots=np.array([robot.driven.index(j) if j in robot.driven else -1 for j in robot.joints], dtype=np.int64),
            guide=plan.guide,
            hull=plan.around.hull if among else None,
            obstacles=plan.around.obstacles if among else None,
            arenas=plan.arenas if among else None,
            floor=None if floor is None else _table(floor),
            substeps=self._pace.substeps,
            time_step=self._pace.time_step,
        )
        self._pools = (
            BufferPool((count, self.layout.size), np.float32),
            BufferPool((self.report_rows, count), np.float64),
            BufferPool((len(RESULT), count), np.float64),
        )
        self._observation_size = self.layout.size
        self._results = np.zeros(len(RESULT))  # of a robot alone
        self._held: Held | None = None  # made when it is needed, since that may have to compile

    def _workspace_parameters(self, workspace: NDArray[np.float64]) -> NDArray[np.float64]:
        kept, end = self._rows.parameters, self._rows.commands
        return workspace[kept * LANES : end * LANES].reshape(1, -1)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy needs. All that compiled code refers to is put together anew around its arrays."""
        rebuilt = ("_workspace", "_world", "_pools", "_observation_size", "_results", "_held")
        state = {name: value for name, value in vars(self).items() if name not in rebuilt}
        return state | {"changing": self.changing}

    def __setstate__(self, state: dict[str, Any]) -> None:
        changing = state.pop("changing")
        vars(self).update(state)
        self._build(*changing)

    def __copy__(self) -> Self:
        """As independent as a deep copy: two engines that share arrays would move the same robots."""
        return copy.deepcopy(self)

    @property
    def changing(self) -> tuple[NDArray[Any], ...]:
        """Copies of all that changes from step to step: blocks, parameters, clocks, seeds."""
        return tuple(np.array(part) for part in self._world[:4])

    @changing.setter
    def changing(self, parts: tuple[NDArray[Any], ...]) -> None:
        self._build(*(np.array(part) for part in parts))

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
        views = layout.Views(outcome.observations, outcome.reports, np.zeros((len(RESULT), 0)))
        paths = np.broadcast_to(np.asarray(path, dtype=np.int64), selected.shape).copy()
        before = compilations()
        kernel.restart(selected, paths, self._world, self.spread, views, self._workspace, self._sizes)
        if compilations() > before:
            self._compile_step()
        if self._kept_reports is not None:
            self._kept_reports[:, selected] = outcome.reports[:, selected]
        if self._late is not None:
            self._late[selected] = 0
            self._late = self._late if self._late.any() else None
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
        observations, reports, results = (pool.take() for pool in self._pools)
        views = layout.Views(observations, reports, results)
        over_blocks(kernel.step_blocks, len(self._world.blocks), self._world, actions, views, self._sizes)
        if self._kept_reports is not None:
            self._kept_reports = reports.copy()
        if self.count == 1:
            self._workspace_report[:] = reports[:, 0]
        terminated, truncated = results[_ENDED] > 0.0
        if self._late is not None:
            truncated = self._over(self._late)
        return Outcome(observations, results[RESULT.reward], terminated, truncated, reports)

    def step_alone(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, NDArray[np.float64]]:
        """Move the only robot there is for a control period: observation, reward, terminated, truncated, report.

        Faster than `step`, and the same to the last bit. Raises ValueError for an action (driven joints,) that is not a
        number.
        """
        observation = np.empty(self._observation_size, dtype=np.float32)
        report = np.empty(self.report_rows)
        held = self._held if self._held is not None else self._hold()
        if not kernel.step_single(held, action, observation, report):
            raise ValueError(f"action must hold numbers, got {action}")
        reward, failed, late = self._results.tolist()
        return observation, reward, failed > 0.0, late > 0.0, report

    def _hold(self) -> Held:
        self._held = Held((self._world, self._workspace, self._results, self._sizes))
        return self._held

    def _compile_step(self) -> None:
        """Compile the step as well, by a call that does nothing, so that whoever waits does so once."""
        nothing, action = self._empty(), np.full(len(self.robot.driven), np.nan, dtype=np.float32)
        with included():
            if self.count == 1:
                kernel.step_single(self._hold(), action, nothing.observations[0], nothing.reports[:, 0].copy())
            else:
                views = layout.Views(nothing.observations, nothing.reports, np.zeros((len(RESULT), self.count)))
                actions = np.zeros((self.count, len(action)), dtype=np.float32)
                kernel.step_blocks(0, 0, self._world, actions, views, self._sizes)

    def look(self, progress_stays: bool = True) -> Outcome:
        """What all robots see and report where they are now, as at a start: after no time, without torques.

        Everything comes from what the engine alone holds; arrays that it gave away may have been written into since.
        Unless their progress stays, the robots seek the point of a path that is nearest to them.
        """
        world = self._world
        blocks, parameters, clocks, _ = self.changing
        guide: Any = world.guide.still() if progress_stays else world.guide
        clocks[0] -= 1
        still = world._replace(blocks=blocks, parameters=parameters, clocks=clocks, guide=guide, substeps=0)
        outcome = self._empty()
        still_actions = np.zeros((self.count, len(self.robot.driven)), dtype=np.float32)
        if self.count > 1:
            views = layout.Views(outcome.observations, outcome.reports, np.zeros((len(RESULT), self.count)))
            kernel.step_blocks(0, len(blocks), still, still_actions, views, self._sizes)
            return outcome
        workspace = blocks.reshape(-1)
        still = still._replace(parameters=self._workspace_parameters(workspace))
        held = Held((still, workspace, np.zeros(len(RESULT)), self._sizes))
        report = np.zeros(self.report_rows)
        kernel.step_single(held, still_actions[0], outcome.observations[0], report)
        outcome.reports[:, 0] = report
        return outcome

    def put(
        self,
        selected: NDArray[np.int64],
        states: NDArray[np.float64] | None = None,
        clocks: NDArray[np.int64] | None = None,
        progress: NDArray[np.float64] | None = None,
    ) -> None:
        """Give some robots other states (selected, numbers), clocks [control periods] and progress [m] (selected,)."""
        rows = self._world.blocks.reshape(len(self._world.blocks), -1, LANES)
        block, lane = selected // LANES, selected % LANES
        if states is not None:
            rows[block, : self._rows.room, lane] = states
            rows[block, self._rows.room, lane] = 0.0
        if progress is not None:
            rows[block, self._rows.progress, lane] = progress
        if clocks is not None:
            self._world.clocks[0, selected] = clocks
            self._late = np.zeros(self.count, dtype=np.int64) if self._late is None else self._late
            self._late[selected] = clocks

    def _over(self, late: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whose time is over; an episode that began late may take as long as any, but not past the trajectory's end."""
        first, last, longest = self.plan.guide.spans[self._world.clocks[1]].T
        over: NDArray[np.bool_] = self._world.clocks[0] >= np.minimum(last - first, late + longest)
        return over

    def _empty(self) -> Outcome:
        size, count = self.layout.size, self.count
        nothing = np.zeros(count, dtype=np.bool_)
        return Outcome(
            np.zeros((count, size), dtype=np.float32),
            np.zeros(count),
            nothing,
            nothing.copy(),
            np.zeros((self.report_rows, count)),
        )

    @property
    def states(self) -> NDArray[np.float64]:
        """A copy of all states (robots, 7 + 2 N), laid out as in `caster_gym.engines.native.fleet.Fleet`.

        Where wheels may slip, the rates of all casters and the tilt follow (robots, 9 + 4 N), as in `pack_state`.
        """
        return from_lanes(self._world.blocks, 0, self._rows.room, self.count)

    @states.setter
    def states(self, value: NDArray[np.float64]) -> None:
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, 0)
        if self._world.obstacles is not None:
            to_lanes(np.zeros((self.count, 1)), self._world.blocks, self._rows.room)

    @property
    def wrenches(self) -> NDArray[np.float64]:
        """External wrenches (robots, 3) at C, in B [N, N, N m], as a copy.

        They act until they are set again; an episode starts without any, whatever was set before its first step.
        """
        return from_lanes(self._world.blocks, self._rows.wrench, 3, self.count)

    @wrenches.setter
    def wrenches(self, value: NDArray[np.float64]) -> None:
        if np.shape(value) != (self.count, 3):
            raise ValueError(f"wrenches must have shape {(self.count, 3)}, got {np.shape(value)}")
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, self._rows.wrench)

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Every robot's numbers (robots, fields), in the order of `pack_parameters`, as a copy."""
        everybody = np.broadcast_to(self._world.parameters, (block_count(self.count), self._world.parameters.shape[1]))
        return from_lanes(everybody, 0, self._rows.commands - self._rows.parameters, self.count)

    def check_parameters(self, rows: NDArray[np.float64], what: str | None = None) -> None:
        """Refuse robots of numbers (robots, fields) that the time step cannot follow; what: their name in the error."""
        called = f"robots like {self.robot.name!r} of other numbers" if what is None else what
        check_rows(called, rows, self._pace.time_step, self._pace.substeps)
        if self._pace.floor is not None:
            check_free_wheels(called, rows, self._pace.time_step, self._pace.substeps)

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
        """Named quantities of all robots, or one; see `caster_gym.envs.report.named`."""
        return named(reports, self.plan.terms, self.slipping)

    def scene(self, robot: int) -> Scene:
        """What there is to see of one robot."""
        if self.count > 1 and self._kept_reports is None:
            self.keep_reports()
        path = int(self._world.clocks[1, robot])
        return draw_scene(
            self.robot,
            float(self._world.clocks[0, robot]) * self._pace.substeps * self._pace.time_step,
            self.states[robot],
            self._report_of(robot),
            len(self.plan.terms),
            self.wrenches[robot],
            self.plan.tables[path][:, :2],
            self._pace.corridor,
            self._obstacles_beside(path),
            self._pace.floor,
            self._pace.time_step,
        )

    def keep_reports(self) -> None:
        """Keep a copy of every report from now on, which pictures of a batch need."""
        if self._kept_reports is None and self.count > 1:
            self._kept_reports = self.look().reports

    def _report_of(self, robot: int) -> NDArray[np.float64]:
        """The latest report of a robot, from where nobody else can have changed it."""
        if self._kept_reports is not None:
            return self._kept_reports[:, robot].copy()
        return self._workspace_report.copy()

    @property
    def _workspace_report(self) -> NDArray[np.float64]:
        """Where the latest report of a robot alone stands."""
        row = self._rows.report
        return self._workspace.reshape(-1, LANES)[row : row + self.report_rows, 0]

    def _obstacles_beside(self, path: int) -> Obstacles:
        around, (near, end) = self.plan.around.obstacles, self.plan.arenas[path]
        return around._replace(radii=around.radii[near:end], spans=around.spans[near:end])


def _table(floor: Floor) -> FloorTable:
    """The numbers of a floor, of one type whether there are patches or not: so that one compilation does for all."""
    table = floor_table(floor)
    return table._replace(patches=np.zeros((0, 4)) if table.patches is None else table.patches)
