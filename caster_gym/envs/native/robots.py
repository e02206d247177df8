"""What a task stores of its robots between steps: states, parameters, clocks and seeds, in blocks."""

import copy
from collections.abc import Callable
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.free_wheels import check_free_wheels
from caster_gym.engines.memory import check_memory
from caster_gym.engines.native.buffer_pool import BufferPool
from caster_gym.engines.native.held import Held
from caster_gym.engines.native.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.engines.time_step import check_rows, check_time_step
from caster_gym.envs.native import layout
from caster_gym.envs.observation import ObservationLayout
from caster_gym.envs.plan import Pace, Plan
from caster_gym.envs.report import RESULT
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import FloorTable, PatchRow, floor_table
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.robot import Robot
from caster_gym.states import AnyState, State, check_state, fingerprint


class Robots:
    """Robots of one kind, each on one of several paths; what moves them is in `TaskEngine`."""

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
            np.zeros((len(layout.CLOCKS), count), dtype=np.int64),
            np.zeros((len(layout.SEEDS), count), dtype=np.uint64),
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
            source=plan.source,
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
        world = self._world
        return tuple(np.array(part) for part in (world.blocks, world.parameters, world.clocks, world.seeds))

    @changing.setter
    def changing(self, parts: tuple[NDArray[Any], ...]) -> None:
        self._build(*(np.array(part) for part in parts))

    def get_state(self) -> State:
        """Copies of all that changes from step to step, by name; what there is not at the moment is an empty array."""
        blocks, parameters, clocks, seeds = self.changing
        return {
            "blocks": blocks,
            "parameters": parameters if len(parameters) == block_count(self.count) else parameters[:0],
            "clocks": clocks,
            "seeds": seeds,
            "late": np.zeros(0, dtype=np.int64) if self._late is None else self._late.copy(),
            "reports": np.zeros((self.report_rows, 0)) if self._kept_reports is None else self._kept_reports.copy(),
        }

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless a state is one of so many robots of this kind on these paths."""
        world = self._world
        expected = {
            "blocks": world.blocks,
            "parameters": np.broadcast_to(0.0, (block_count(self.count), world.parameters.shape[1])),
            "clocks": world.clocks,
            "seeds": world.seeds,
            "late": np.broadcast_to(np.int64(0), self.count),
            "reports": np.broadcast_to(0.0, (self.report_rows, self.count)),
        }
        check_state("the robots", state, expected, ("parameters", "late", "reports"))
        self.plan.check_clocks(*state["clocks"])

    def set_state(self, state: AnyState) -> None:
        """Go on from a state that `get_state` gave and `check_state` has seen. Arrays are copied."""
        nominal = np.zeros((1, self._world.parameters.shape[1]))
        to_lanes(np.array([pack_parameters(robot_parameters(self.robot))]), nominal, 0)
        parameters = state["parameters"] if state["parameters"].size else nominal
        self.changing = state["blocks"], parameters, state["clocks"], state["seeds"]
        self._late = state["late"].copy() if state["late"].size else None
        drawn = self._kept_reports is not None and state["reports"].size
        self._kept_reports = state["reports"].copy() if drawn else None

    @cached_property
    def plan_fingerprint(self) -> str:
        """What tells the paths, obstacles and reward weights of the plan from others."""
        return fingerprint(self.plan)

    def seed(self, robot: int, key: int) -> None:
        """Begin a robot's sequence of episodes anew from a key."""
        self._world.seeds[:, robot] = layout.Seeds(key=key, episode=0)

    def episodes(self, selected: NDArray[np.int64]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Key, and number of the episode that is about to start, of some robots; random draws count from them."""
        return self._world.seeds[layout.SEEDS.key, selected], self._world.seeds[layout.SEEDS.episode, selected]

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
            rows[block, self._rows.state : self._rows.room, lane] = states
            rows[block, self._rows.room, lane] = 0.0
        if progress is not None:
            rows[block, self._rows.progress, lane] = progress
        if clocks is not None:
            self._world.clocks[layout.CLOCKS.done, selected] = clocks
            self._late = np.zeros(self.count, dtype=np.int64) if self._late is None else self._late
            self._late[selected] = clocks

    @property
    def states(self) -> NDArray[np.float64]:
        """A copy of all states (robots, 7 + 2 N), laid out as in `caster_gym.engines.native.fleet.Fleet`.

        Where wheels may slip, the rates of all casters and the tilt follow (robots, 9 + 4 N), as in `pack_state`.
        """
        return from_lanes(self._world.blocks, self._rows.state, self._rows.room, self.count)

    @states.setter
    def states(self, value: NDArray[np.float64]) -> None:
        to_lanes(np.ascontiguousarray(value, dtype=np.float64), self._world.blocks, self._rows.state)
        if self._world.obstacles is not None:
            to_lanes(np.zeros((self.count, 1)), self._world.blocks, self._rows.room)

    @property
    def wrenches(self) -> NDArray[np.float64]:
        """External wrenches (robots, 3) at C, in B [N, N, N m], as a copy.

        They act until they are set again; an episode starts without any, whatever was set before its first step.
        """
        return from_lanes(self._world.blocks, self._rows.wrench, len(layout.NO_WRENCH), self.count)

    @wrenches.setter
    def wrenches(self, value: NDArray[np.float64]) -> None:
        shape = self.count, len(layout.NO_WRENCH)
        if np.shape(value) != shape:
            raise ValueError(f"wrenches must have shape {shape}, got {np.shape(value)}")
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
        return np.array(self._world.clocks[layout.CLOCKS.path])


def _table(floor: Floor) -> FloorTable:
    """The numbers of a floor, of one type whether there are patches or not: so that one compilation does for all."""
    table = floor_table(floor)
    return table._replace(patches=np.zeros((0, len(PatchRow._fields))) if table.patches is None else table.patches)
