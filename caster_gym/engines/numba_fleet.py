"""The bare mechanics of many robots at once, compiled."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike, NDArray

from caster_gym.engines.compilation import Work
from caster_gym.engines.guarding import borrowed_hull, borrowed_obstacles, reach_of, settled, worth_measuring
from caster_gym.engines.lanes import (
    BODY_ROWS,
    LANES,
    block_count,
    from_lanes,
    read_pairs,
    read_robot,
    read_state,
    to_lanes,
    write,
)
from caster_gym.engines.memory import check_memory
from caster_gym.engines.numba_compiler import INLINE, compiled
from caster_gym.engines.threads import over_blocks
from caster_gym.engines.time_step import check_fleet, follows, longest_of_robots
from caster_gym.mechanics.contact import guarded_step
from caster_gym.mechanics.integration import pack_state, rk4_step
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    Dynamics,
    pack_parameters,
    robot_parameters,
)
from caster_gym.mechanics.separation import Hull, Obstacles, Surroundings, clearance
from caster_gym.robot import Robot


@register_jitable(**INLINE)
def torque_row(casters: Any, floor: Any) -> int:
    """First row of the joint torques, behind the state."""
    if floor is None:
        return BODY_ROWS + 2 * len(casters)
    return BODY_ROWS + 4 * len(casters) + 2


@register_jitable(**INLINE)
def room_row(casters: Any, floor: Any) -> int:
    """Row of the room; negative while the coming step is to be taken with care."""
    return torque_row(casters, floor) + 2 * len(casters)


@register_jitable(**INLINE)
def friction_row(casters: Any, floor: Any) -> int:
    """First row of the floor's friction under each wheel, if wheels may slip. Parameters follow."""
    return room_row(casters, floor) + 1


@register_jitable(**INLINE)
def parameter_row(casters: Any, floor: Any) -> int:
    """First row of the robot's parameters."""
    if floor is None:
        return friction_row(casters, floor)
    return friction_row(casters, floor) + len(casters)


@register_jitable(**INLINE)
def _state_of(block: Any, lane: Any, casters: Any, floor: Any) -> Any:
    """State of one robot."""
    if floor is None:
        return read_state(block, lane, 0, casters)
    return read_slip_state(block, lane, 0, casters)


@register_jitable(**INLINE)
def _target(state: Any, torques: Any, h: Any, robot: Any, frictions: Any, floor: Any) -> Any:
    """The state after one step in the open."""
    if floor is None:
        return rk4_step(state, torques, (0.0, 0.0, 0.0), h, robot)
    end, _ = slip_step(state, torques, (0.0, 0.0, 0.0), h, frictions, robot)
    return end


@register_jitable(**INLINE)
def _frictions(block: Any, lane: Any, casters: Any, floor: Any) -> Any:
    """Friction under each wheel of one robot."""
    if floor is None:
        return None
    return read(block, lane, friction_row(casters, floor), counting(casters))


@register_jitable(**INLINE)
def _find_frictions(block: Any, lanes: Any, casters: Any, floor: Any) -> None:
    """Find the friction under the wheels of all robots."""
    if floor is None:
        return
    _look_at_patches(block, lanes, casters, floor, floor.patches)


@register_jitable(**INLINE)
def _look_at_patches(block: Any, lanes: Any, casters: Any, floor: Any, patches: Any) -> None:
    """Where there are patches; else every wheel keeps its friction."""
    if patches is None:
        return
    row, parameters = friction_row(casters, floor), parameter_row(casters, floor)
    for lane in range(lanes):
        robot = read_robot(block, lane, parameters, casters)
        write(block, lane, row, each(own_friction, (robot.platform.floor_friction,), robot.casters))
    for k in range(len(patches)):
        patch = (patches[k, 0], patches[k, 1], patches[k, 2], patches[k, 3])
        for lane in range(lanes):  # neighbours side by side, a patch at a time
            state = read_slip_state(block, lane, 0, casters)
            robot = read_robot(block, lane, parameters, casters)
            before = read(block, lane, row, counting(casters))
            shared = state.position, state.heading, patch
            write(block, lane, row, each(patch_friction, shared, before, state.directions, robot.casters))


@register_jitable(**INLINE)
def _measure(block: Any, lanes: Any, h: Any, hull: Any, obstacles: Any, casters: Any) -> None:
    """Measure the room of robots that may soon need to know it."""
    if obstacles is None:
        return
    row = room_row(casters)
    for lane in range(lanes):
        state = read_state(block, lane, 0, casters)
        if worth_measuring(block[row * LANES + lane], state.twist, h, hull.reach):
            gap = clearance(state.position, state.heading, hull, obstacles, 0, len(obstacles.radii))
            block[row * LANES + lane] = gap


@register_jitable(**INLINE)
def _take_care(block: Any, lanes: Any, h: Any, hull: Any, obstacles: Any, casters: Any) -> None:
    """Step the robots that may touch something."""
    if obstacles is None:
        return
    for lane in range(lanes):
        if block[room_row(casters) * LANES + lane] < 0.0:
            _compiled_careful_step(block, lane, h, hull, obstacles, casters)


@register_jitable(**INLINE)
def _step_lanes(
    block: Any, lanes: int, here: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...], floor: Any
) -> None:
    """One step of the first lanes of one block, of which the first `here` hold robots and the rest are spare."""
    row, reach = room_row(casters, floor), reach_of(hull)
    _measure(block, here, h, hull, obstacles, casters)
    _find_frictions(block, lanes, casters, floor)
    for lane in range(lanes):
        state = _state_of(block, lane, casters, floor)
        torques = read_pairs(block, lane, torque_row(casters, floor), casters)
        robot = read_robot(block, lane, parameter_row(casters, floor), casters)
        target = _target(state, torques, h, robot, _frictions(block, lane, casters, floor), floor)
        end, room, _ = settled(obstacles, block[row * LANES + lane], state, target, h, reach)
        write(block, lane, 0, end)
        block[row * LANES + lane] = room
    _take_care(block, here, h, hull, obstacles, casters)


def _careful_step(block: Any, lane: int, h: float, hull: Hull, obstacles: Obstacles, casters: tuple[int, ...]) -> None:
    """One step of a robot that may touch something."""
    hull, obstacles = borrowed_hull(hull), borrowed_obstacles(obstacles)
    row, count = room_row(casters), len(obstacles.radii)
    state = read_state(block, lane, 0, casters)
    torques = read_pairs(block, lane, torque_row(casters), casters)
    robot = read_robot(block, lane, row + 1, casters)
    state, _ = guarded_step(state, torques, (0.0, 0.0, 0.0), h, robot, hull, obstacles, 0, count)
    write(block, lane, 0, pack_state(state))
    block[row * LANES + lane] = clearance(state.position, state.heading, hull, obstacles, 0, count)


def _step_one(blocks: Any, steps: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...]) -> None:
    near, around = borrowed_hull(hull), borrowed_obstacles(obstacles)
    for _ in range(steps):
        _step_lanes(blocks[0], 1, 1, h, near, around, casters)


def _step_block(
    block: Any, here: int, steps: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...]
) -> None:
    near, around = borrowed_hull(hull), borrowed_obstacles(obstacles)
    for _ in range(steps):
        _step_lanes(block, LANES, here, h, near, around, casters)


def _step_blocks(
    first: int,
    end: int,
    blocks: Any,
    count: int,
    steps: int,
    h: float,
    hull: Any,
    obstacles: Any,
    casters: tuple[int, ...],
) -> None:
    for i in range(first, end):
        here = min(LANES, count - i * LANES)
        _compiled_step_block(blocks[i], here, steps, h, hull, obstacles, casters)


def _described(types: tuple[Any, ...]) -> Work:
    *_, hull, _, casters = types
    among = hasattr(hull, "types")  # else it is None
    around = " among obstacles" if among else ""
    return Work(f"{len(casters)} casters (mechanics{around})", (2.0 if among else 1.0) * (2.0 + len(casters)))


_compiled_careful_step = compiled(_careful_step)
_compiled_step_block = compiled(_step_block)
_compiled_step_one = compiled(_step_one, _described)
_compiled_step_blocks = compiled(_step_blocks, _described)


class Fleet:
    """Robots with the same number of casters, each with its own parameters and state, moved together.

    robots: one Robot for all, or one for each. state (count, 7 + 2 N): x, y [m], cos β, sin β in the world,
    twist vx, vy, ω in B [m/s, rad/s], then cos δ, sin δ of each caster. around: obstacles, from
    `caster_gym.arena.packing.surroundings`.
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        count: int | None = None,
        dynamics: Dynamics = "exact",
        around: Surroundings | None = None,
    ) -> None:
        if isinstance(robots, Robot):
            check_memory(count or 1, BODY_ROWS + PLATFORM_FIELDS + (4 + CASTER_FIELDS) * robots.caster_count)
        listed = [robots] * (1 if count is None else count) if isinstance(robots, Robot) else list(robots)
        if not listed or (count is not None and len(listed) != count):
            raise ValueError(f"a fleet needs one robot for all or {count or 'at least 1'} of them, got {len(listed)}")
        sizes = {robot.caster_count for robot in listed}
        if len(sizes) > 1:
            raise ValueError(f"all robots of a fleet must have the same number of casters, got {sorted(sizes)}")
        self.robots = tuple(listed)
        self.count = len(listed)
        self._casters = tuple(range(sizes.pop()))
        self._torque_row, self._room_row = torque_row(self._casters), room_row(self._casters)
        among = around is not None and len(around.obstacles.radii) > 0
        self._hull: Hull | None = around.hull if around is not None and among else None
        self._obstacles: Obstacles | None = around.obstacles if around is not None and among else None
        self._distinct = list({id(robot): robot for robot in listed}.values())
        packed = {id(robot): pack_parameters(robot_parameters(robot, dynamics)) for robot in self._distinct}
        parameters = np.array([packed[id(robot)] for robot in listed])
        self._longest = float(longest_of_robots(self._distinct).min())
        rows = self._room_row + 1 + parameters.shape[1]
        self._blocks: NDArray[np.float64] = np.zeros((block_count(self.count), rows * LANES))
        to_lanes(parameters, self._blocks, self._room_row + 1)
        at_rest = np.zeros((self.count, self._torque_row))
        at_rest[:, 2] = 1.0
        at_rest[:, BODY_ROWS::2] = 1.0
        self.state = at_rest

    @property
    def state(self) -> NDArray[np.float64]:
        """A copy of all states (count, 7 + 2 N)."""
        return from_lanes(self._blocks, 0, self._torque_row, self.count)

    @state.setter
    def state(self, value: ArrayLike) -> None:
        state = self._checked("state", value, self._torque_row)
        pairs = state[:, [2, 3, *range(BODY_ROWS, self._torque_row)]].reshape(self.count, -1, 2)
        length = np.hypot(pairs[..., 0], pairs[..., 1])
        if np.abs(length - 1.0).max() > 1e-6:
            raise ValueError(
                f"directions must be unit vectors, got a length of {length.flat[np.abs(length - 1).argmax()]:g}"
            )
        to_lanes(state, self._blocks, 0)
        to_lanes(np.zeros((self.count, 1)), self._blocks, self._room_row)

    def step(self, torque: ArrayLike, dt: float, steps: int = 1) -> None:
        """RK4 steps of dt seconds under joint torques (count, 2 N) [N m]: roll_1, steer_1, roll_2, …"""
        steps = operator.index(steps)
        if steps < 0:
            raise ValueError(f"steps must be 0 or more, got {steps}")
        if not follows(dt, self._longest):
            check_fleet(self._distinct, dt)
        to_lanes(self._checked("torque", torque, 2 * len(self._casters)), self._blocks, self._torque_row)
        arguments = (steps, dt, self._hull, self._obstacles, self._casters)
        if self.count == 1:
            _compiled_step_one(self._blocks, *arguments)
        else:
            over_blocks(_compiled_step_blocks, len(self._blocks), self._blocks, self.count, *arguments)

    def _checked(self, name: str, value: ArrayLike, width: int) -> NDArray[np.float64]:
        array = np.asarray(value, dtype=np.float64)
        if array.shape != (self.count, width):
            raise ValueError(f"{name} must have shape {(self.count, width)}, got {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
        return array
