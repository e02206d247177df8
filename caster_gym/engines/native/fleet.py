"""The bare mechanics of many robots at once, compiled."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.memory import check_memory
from caster_gym.engines.model_inputs import listed_robots
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import INLINE, compiled
from caster_gym.engines.native.fleet_rows import (
    find_frictions,
    friction_row,
    parameter_row,
    room_row,
    state_of,
    surface_of,
    torque_row,
)
from caster_gym.engines.native.guarding import borrowed_floor, borrowed_hull, borrowed_obstacles, reach_of
from caster_gym.engines.native.lanes import (
    LANES,
    block_count,
    from_lanes,
    read_pairs,
    read_robot,
    read_state,
    to_lanes,
    write,
)
from caster_gym.engines.native.threads import over_blocks
from caster_gym.engines.time_step import check_fleet, follows, longest_of_robots
from caster_gym.floor import FloorLike, load_floor
from caster_gym.mechanics.contact import guarded_step
from caster_gym.mechanics.floor import floor_table, parameters_on, wrong_state
from caster_gym.mechanics.grip_or_slip import free_step
from caster_gym.mechanics.integration import pack_state, state_at_rest, state_rows, unpack_state
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    Dynamics,
    PlatformParameters,
    RobotParameters,
    pack_parameters,
    unpack_parameters,
)
from caster_gym.mechanics.room import should_measure, step_within_room
from caster_gym.mechanics.separation import Hull, Obstacles, Surroundings, clearance
from caster_gym.mechanics.slip_state import rolling_state, slips_of, unpack_slip_state
from caster_gym.robot import Robot


@register_jitable(**INLINE)
def _measure(block: Any, lanes: Any, h: Any, hull: Any, obstacles: Any, casters: Any, floor: Any) -> None:
    """Measure the room of robots that may soon need to know it."""
    if obstacles is None:
        return
    row = room_row(casters, floor)
    for lane in range(lanes):
        state = read_state(block, lane, 0, casters)
        if should_measure(block[row * LANES + lane], state.twist, h, hull.reach):
            gap = clearance(state.position, state.heading, hull, obstacles, 0, len(obstacles.radii))
            block[row * LANES + lane] = gap


@register_jitable(**INLINE)
def _take_care(block: Any, lanes: Any, h: Any, hull: Any, obstacles: Any, casters: Any, floor: Any) -> None:
    """Step the robots that may touch something."""
    if obstacles is None:
        return
    for lane in range(lanes):
        if block[room_row(casters, floor) * LANES + lane] < 0.0:
            _compiled_careful_step(block, lane, h, hull, obstacles, casters, floor)


@register_jitable(**INLINE)
def _step_lanes(
    block: Any, lanes: int, here: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...], floor: Any
) -> None:
    """One step of the first lanes of one block, of which the first `here` hold robots and the rest are spare."""
    row, reach = room_row(casters, floor), reach_of(hull)
    _measure(block, here, h, hull, obstacles, casters, floor)
    find_frictions(block, lanes, casters, floor)
    for lane in range(lanes):
        state = state_of(block, lane, casters, floor)
        torques = read_pairs(block, lane, torque_row(casters, floor), casters)
        robot = read_robot(block, lane, parameter_row(casters, floor), casters)
        target = free_step(state, torques, (0.0, 0.0, 0.0), h, robot, surface_of(block, lane, casters, floor))
        end, room, _ = step_within_room(obstacles, block[row * LANES + lane], state, target, h, reach)
        write(block, lane, 0, end)
        block[row * LANES + lane] = room
    _take_care(block, here, h, hull, obstacles, casters, floor)


def _careful_step(
    block: Any, lane: int, h: float, hull: Hull, obstacles: Obstacles, casters: tuple[int, ...], floor: Any
) -> None:
    """One step of a robot that may touch something."""
    hull, obstacles = borrowed_hull(hull), borrowed_obstacles(obstacles)
    row, count = room_row(casters, floor), len(obstacles.radii)
    state = state_of(block, lane, casters, floor)
    torques = read_pairs(block, lane, torque_row(casters, floor), casters)
    robot = read_robot(block, lane, parameter_row(casters, floor), casters)
    surface = surface_of(block, lane, casters, floor)
    state, _ = guarded_step(state, torques, (0.0, 0.0, 0.0), h, robot, hull, obstacles, 0, count, surface)
    write(block, lane, 0, pack_state(state))
    block[row * LANES + lane] = clearance(state.position, state.heading, hull, obstacles, 0, count)


def _step_one(
    blocks: Any, steps: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...], floor: Any
) -> None:
    near, around, below = borrowed_hull(hull), borrowed_obstacles(obstacles), borrowed_floor(floor)
    for _ in range(steps):
        _step_lanes(blocks[0], 1, 1, h, near, around, casters, below)


def _step_block(
    block: Any, here: int, steps: int, h: float, hull: Any, obstacles: Any, casters: tuple[int, ...], floor: Any
) -> None:
    near, around, below = borrowed_hull(hull), borrowed_obstacles(obstacles), borrowed_floor(floor)
    for _ in range(steps):
        _step_lanes(block, LANES, here, h, near, around, casters, below)


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
    floor: Any,
) -> None:
    for i in range(first, end):
        here = min(LANES, count - i * LANES)
        _compiled_step_block(blocks[i], here, steps, h, hull, obstacles, casters, floor)


def _described(types: tuple[Any, ...]) -> Work:
    *_, hull, _, casters, floor = types
    among, slippery = hasattr(hull, "types"), hasattr(floor, "types")  # else they are None
    around = (" among obstacles" if among else "") + (" on a floor of finite friction" if slippery else "")
    work = (2.0 if among else 1.0) * (4.0 if slippery else 1.0) * (2.0 + len(casters))
    return Work(f"{len(casters)} casters (mechanics{around})", work)


_compiled_careful_step = compiled(_careful_step)
_compiled_step_block = compiled(_step_block)
_compiled_step_one = compiled(_step_one, _described)
_compiled_step_blocks = compiled(_step_blocks, _described)


class Fleet:
    """Robots with the same number of casters, each with its own parameters and state, moved together.

    robots: one Robot for all, or one for each. state (count, 7 + 2 N): x, y [m], cos β, sin β in the world,
    twist vx, vy, ω in B [m/s, rad/s], then cos δ, sin δ of each caster. around: obstacles, from
    `caster_gym.arena.packing.surroundings`.

    floor: one of finite friction, on which wheels may slip, as the environments take it: a `caster_gym.floor.Floor` or
    a mapping. Then state (count, 9 + 4 N) goes on with η̇, θ̇ of each caster [rad/s] and the tilt that
    shifts loads [N m]; set to (count, 7 + 2 N), wheels start rolling without slip.

    >>> import caster_gym, numpy as np
    >>> fleet = caster_gym.Fleet(caster_gym.load_robot("chung2008"), count=1000)
    >>> fleet.step(np.tile([0.1, 0.0], (1000, 3)), dt=0.005, steps=200)  # 0.1 N m at every rolling joint
    >>> fleet.state.shape, fleet.state[0, :2].round(3)  # after 1 s: x, y [m]
    ((1000, 13), array([0.795, 0.   ]))
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        count: int | None = None,
        dynamics: Dynamics = "exact",
        around: Surroundings | None = None,
        floor: FloorLike = None,
    ) -> None:
        if isinstance(robots, Robot):
            n = robots.caster_count
            check_memory(count or 1, state_rows(n, False) + 2 * n + PLATFORM_FIELDS + CASTER_FIELDS * n)
        self.robots = tuple(listed_robots(robots, count))
        self.count = len(self.robots)
        self._casters = tuple(range(self.robots[0].caster_count))
        below = load_floor(floor)
        self._floor = None if below is None else floor_table(below)
        self._torque_row, self._room_row = torque_row(self._casters, self._floor), room_row(self._casters, self._floor)
        among = around is not None and len(around.obstacles.radii) > 0
        self._hull: Hull | None = around.hull if around is not None and among else None
        self._obstacles: Obstacles | None = around.obstacles if around is not None and among else None
        self._distinct = list({id(robot): robot for robot in self.robots}.values())
        numbers = [parameters_on(robot, dynamics, below) for robot in self._distinct]
        packed = {id(robot): pack_parameters(one) for robot, one in zip(self._distinct, numbers, strict=True)}
        parameters = np.array([packed[id(robot)] for robot in self.robots])
        self._longest = float(longest_of_robots(self._distinct).min())
        first = parameter_row(self._casters, self._floor)
        self._blocks: Array = np.zeros((block_count(self.count), (first + parameters.shape[1]) * LANES))
        to_lanes(parameters, self._blocks, first)
        if self._floor is not None:
            friction = parameters[:, PlatformParameters._fields.index("floor_friction"), None]
            frictions = np.repeat(friction, len(self._casters), axis=1)
            to_lanes(frictions, self._blocks, friction_row(self._casters, self._floor))
        self.state = np.tile(pack_state(state_at_rest(len(self._casters))), (self.count, 1))

    @property
    def state(self) -> Array:
        """A copy of all states (count, 7 + 2 N), on a floor of finite friction (count, 9 + 4 N)."""
        return from_lanes(self._blocks, 0, self._torque_row, self.count)

    @state.setter
    def state(self, value: ArrayLike) -> None:
        state, rolling = np.asarray(value, dtype=np.float64), state_rows(len(self._casters), False)
        if self._floor is not None and state.shape == (self.count, rolling):
            state = self._rolling(self._checked("state", state, rolling))
        if state.shape != (self.count, self._torque_row):
            raise ValueError(wrong_state(state.shape, self.count, len(self._casters), self._floor is not None))
        state = self._checked("state", state, self._torque_row)
        now = unpack_state(tuple(state[:, :rolling].T))
        length = np.stack([np.hypot(c, s) for c, s in (now.heading, *now.directions)], axis=1)
        if np.abs(length - 1.0).max() > 1e-6:
            raise ValueError(
                f"directions must be unit vectors, got a length of {length.flat[np.abs(length - 1).argmax()]:g}"
            )
        to_lanes(state, self._blocks, 0)
        to_lanes(np.zeros((self.count, 1)), self._blocks, self._room_row)

    @property
    def slip(self) -> Array:
        """Velocities (count, N, 2) of the wheels' material points over the floor along f and f⊥. [m/s]"""
        if self._floor is None:
            return np.zeros((self.count, len(self._casters), 2))
        now = unpack_slip_state(tuple(self.state.T))
        slips = slips_of(now, self._numbers())
        return np.moveaxis(np.array(slips), -1, 0)

    def _numbers(self) -> RobotParameters:
        """Parameters whose fields hold a number a robot."""
        first = parameter_row(self._casters, self._floor)
        width = self._blocks.shape[1] // LANES - first
        return unpack_parameters(tuple(from_lanes(self._blocks, first, width, self.count).T))

    def _rolling(self, state: Array) -> Array:
        """States (count, 7 + 2 N) as those of wheels that may slip, but do not yet."""
        return np.array(pack_state(rolling_state(unpack_state(tuple(state.T)), self._numbers()))).T

    def step(self, torque: ArrayLike, dt: float, steps: int = 1) -> None:
        """Steps of dt seconds under joint torques (count, 2 N) [N m]: roll_1, steer_1, roll_2, …"""
        steps = operator.index(steps)
        if steps < 0:
            raise ValueError(f"steps must be 0 or more, got {steps}")
        if not follows(dt, self._longest):
            check_fleet(self._distinct, dt)
        to_lanes(self._checked("torque", torque, 2 * len(self._casters)), self._blocks, self._torque_row)
        arguments = (steps, dt, self._hull, self._obstacles, self._casters, self._floor)
        if self.count == 1:
            _compiled_step_one(self._blocks, *arguments)
        else:
            over_blocks(_compiled_step_blocks, len(self._blocks), self._blocks, self.count, *arguments)

    def _checked(self, name: str, value: ArrayLike, width: int) -> Array:
        array = np.asarray(value, dtype=np.float64)
        if array.shape != (self.count, width):
            raise ValueError(f"{name} must have shape {(self.count, width)}, got {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
        return array
