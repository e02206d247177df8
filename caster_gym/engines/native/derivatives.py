"""Derivatives of a control period of the bare mechanics by state, torques and robot parameters, compiled.

The mechanics run on dual numbers, see `caster_gym.engines.native.dual_numbers`: no formula is written a second time.
"""

import math
import operator
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.configuration import did_you_mean
from caster_gym.engines.model_inputs import listed_robots
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import INLINE, borrowed, compiled
from caster_gym.engines.native.dual_numbers import WIDTH, join, split, take
from caster_gym.engines.native.lanes import LANES, block_count, counting, read_robot, to_lanes
from caster_gym.engines.native.threads import over_blocks
from caster_gym.engines.time_step import check_fleet, check_rows
from caster_gym.mechanics.integration import BODY_ROWS, pack_state, rk4_step, state_rows, unpack_state
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    CasterParameters,
    Dynamics,
    PlatformParameters,
    RobotParameters,
    pack_parameters,
    robot_parameters,
)
from caster_gym.mechanics.scalars import each, either, flatten, pairs
from caster_gym.robot import Robot

TOGETHER = 16  # robots of a block: differentiating them takes about as long as stepping a block of a fleet
UNIT_TOLERANCE = 1e-6  # [-] of the lengths of directions, as `Fleet` has it

_BODY = (0.0,) * BODY_ROWS
_PLATFORM, _CASTER = PlatformParameters._fields, CasterParameters._fields
_OF_MOTORS = _CASTER[_CASTER.index("roll_max_torque") :]  # and which joints they drive, which equations hold
_WITHOUT_EFFECT = {"height", "floor_friction", *_OF_MOTORS}  # on wheels that roll without slip under joint torques
DIFFERENTIABLE = tuple(name for name in _PLATFORM + _CASTER if name not in _WITHOUT_EFFECT)


@register_jitable(**INLINE)
def _plain_robot(robot: Any, _first: Any) -> Any:
    return robot


@register_jitable(**INLINE)
def _dual_caster(tangents: Any, first: Any, index: Any, caster: Any) -> Any:
    return CasterParameters(*join(caster[:], tangents, PLATFORM_FIELDS + CASTER_FIELDS * index, first))


@register_jitable(**INLINE)
def _dual_robot(tangents: Any, robot: Any, first: Any) -> Any:
    return RobotParameters(
        PlatformParameters(*join(robot.platform[:], tangents, 0, first)),
        each(_dual_caster, (tangents, first), counting(robot.casters), robot.casters),
    )


@register_jitable(**INLINE)
def _two(_caster: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _differentiate(
    first: int,
    end: int,
    states: Any,
    torques: Any,
    tangents: Any,
    blocks: Any,
    robots: int,
    by_state: Any,
    by_torque: Any,
    by_parameters: Any,
    steps: int,
    h: float,
    casters: tuple[int, ...],
) -> None:
    """Move the states (count, rows) of robots in blocks first … end − 1, with their tangents (count, rows, K).

    by_state (rows, K), by_torque (2 N, K), by_parameters (fields, K) or None: what the tangents are at the start. Robot
    i has the parameters of number i % robots.
    """
    torque_like = flatten(each(_two, (), casters))
    state_like = _BODY + torque_like  # two numbers for each caster there, too
    for i in range(first * TOGETHER, min(end * TOGETHER, len(states))):
        values, slopes, number = borrowed(states[i]), borrowed(tangents[i]), i % robots
        slopes[:] = by_state
        robot = read_robot(blocks[number // LANES], number % LANES, 0, casters)
        given = take(torques[i], 0, torque_like)
        for _ in range(steps):
            start = take(values, 0, state_like)
            for column in range(0, slopes.shape[1], WIDTH):  # where all values are the same, and worked out once
                state = unpack_state(join(start, slopes, 0, column))
                pushes = pairs(join(given, by_torque, 0, column))
                mine = either(by_parameters, _plain_robot, _dual_robot, (robot, column))
                moved = rk4_step(state, pushes, (0.0, 0.0, 0.0), h, mine)
                split(pack_state(moved), values, slopes, 0, column)


def _described(kinds: tuple[Any, ...]) -> Work:
    *_, by_parameters, _, _, casters = kinds
    whose = " by the robot's numbers" if isinstance(by_parameters, types.Array) else ""
    return Work(f"derivatives of {len(casters)} casters' motion{whose}", 2.0 * (1.0 + len(casters)))


def _first_wrong(states: Any, torques: Any) -> int:
    """The first robot whose numbers are not finite or whose directions are no unit vectors; −1 if there is none."""
    for i in range(len(states)):
        for number in states[i]:
            if not math.isfinite(number):
                return i
        for number in torques[i]:
            if not math.isfinite(number):
                return i
        for first in range(BODY_ROWS - 2, states.shape[1], 2):
            c, s = (states[i, 2], states[i, 3]) if first < BODY_ROWS else (states[i, first], states[i, first + 1])
            if not abs(math.hypot(c, s) - 1.0) <= UNIT_TOLERANCE:
                return i
    return -1


_compiled_differentiate = compiled(_differentiate, _described)
_compiled_first_wrong = compiled(_first_wrong, lambda _: Work("checks of states and torques", 1.0))


class Period(NamedTuple):
    """Where robots are after a control period, and its derivatives, which share one array."""

    state: Array  # (..., 7 + 2 N)
    by_state: Array  # (..., 7 + 2 N, 7 + 2 N)
    by_torque: Array  # (..., 7 + 2 N, 2 N) [per N m]
    by_parameters: Array  # (..., 7 + 2 N, P) [per unit of each parameter]


class PeriodDerivatives:
    """A control period of the bare mechanics, as `Fleet.step` moves robots, with its exact derivatives.

    robots: one Robot for all, or one for each. A period is `substeps` RK4 steps of `time_step` [s] under constant joint
    torques. by: the parameters to differentiate by, in this order: `mass`, `inertia`, `com_x`, `com_y` and
    `coulomb_speed` of the platform, and the numbers of the casters by their names in
    `caster_gym.mechanics.parameters.CasterParameters`, such as `radius` for one that all casters share or `radius_2`
    for that of the second caster. parameters: numbers in place of the one robot's own, as `Model` takes them. checked:
    the caller has made sure that the time step can follow these.

    Torques act at the joints, so that neither motors nor their limits play a part; wheels roll without slip, and
    there are no obstacles. A state is x, y [m], cos β, sin β in the world, twist vx, vy, ω in B [m/s, rad/s], then
    cos δ, sin δ of each caster; derivatives take all its numbers as free. By an angle it is −sin times the derivative
    by its cosine, plus cos times that by its sine. Source: docs/equations.md, by dual numbers.

    >>> import caster_gym, numpy as np
    >>> robot = caster_gym.load_robot("chung2008")
    >>> derivatives = caster_gym.PeriodDerivatives(robot, time_step=0.005, substeps=4, by=["mass"])
    >>> state = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, *[1.0, 0.0] * 3])  # straight ahead at 0.5 m/s
    >>> end = derivatives.at(state, [0.1, 0.0] * 3)
    >>> end.by_torque.shape, end.by_torque[4, ::2].round(3)  # of vx by the rolling torques [m/s per N m]
    ((13, 6), array([0.106, 0.106, 0.106]))
    >>> end.by_parameters[4].round(4)  # and by the platform's mass [m/s per kg]
    array([-0.0042])
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        time_step: float,
        substeps: int = 1,
        by: Sequence[str] = (),
        dynamics: Dynamics = "exact",
        parameters: RobotParameters | None = None,
        *,
        checked: bool = False,
    ) -> None:
        self.robots = tuple(listed_robots(robots, None))
        self.by = (by,) if isinstance(by, str) else tuple(map(str, by))
        self.time_step, self.substeps = float(time_step), operator.index(substeps)
        if self.substeps < 1:
            raise ValueError(f"substeps must be 1 or more, got {self.substeps}")
        if parameters is None:
            check_fleet(self.robots, self.time_step)
            rows = np.array([pack_parameters(robot_parameters(robot, dynamics)) for robot in self.robots])
        else:
            if not isinstance(robots, Robot):
                raise ValueError(f"parameters replace the numbers of one robot, got a list of {len(self.robots)}")
            if len(parameters.casters) != robots.caster_count:
                raise ValueError(f"parameters must be of {robots.caster_count} casters, got {len(parameters.casters)}")
            rows = np.stack([np.ravel(one) for one in np.broadcast_arrays(*pack_parameters(parameters))], axis=1)
            if not checked:
                check_rows(f"robots like {robots.name!r} whose numbers were replaced", rows, self.time_step)
        n = self.robots[0].caster_count
        self._count = len(rows)
        self._rows, self._joints = state_rows(n, False), 2 * n
        blocks: Array = np.zeros((block_count(len(rows)), rows.shape[1] * LANES))
        to_lanes(rows, blocks, 0)
        free = self._rows + self._joints
        self._directions = -(-(free + len(self.by)) // WIDTH) * WIDTH
        ours: Array = np.eye(free, self._directions)
        numbers: Array = np.zeros((rows.shape[1], self._directions))
        for column, name in enumerate(self.by, free):
            numbers[_places(name, n), column] = 1.0
        tangents = ours[: self._rows], ours[self._rows :], numbers if self.by else None
        period = self.substeps, self.time_step, tuple(range(n))
        self._constants = blocks, self._count, *tangents, *period

    def at(self, state: ArrayLike, torque: ArrayLike) -> Period:
        """The period from states (..., 7 + 2 N) under joint torques (..., 2 N): roll_1, steer_1, roll_2, … [N m]

        Leading axes are a batch; of several robots, the last of them holds one state for each.
        """
        states, torques = np.array(state, np.float64, order="C"), np.array(torque, np.float64, order="C")
        batch = states.shape[:-1]
        if states.shape != (*batch, self._rows) or torques.shape != (*batch, self._joints):
            raise ValueError(self._wrong_shapes(states, torques))
        if self._count > 1 and batch[-1:] != (self._count,):
            raise ValueError(
                f"state must hold {self._count} robots along its last axis but one, got shape {states.shape}"
            )
        rows, free = self._rows, self._rows + self._joints
        count = states.size // rows
        now, given = states.reshape(count, rows), torques.reshape(count, self._joints)
        if (wrong := _compiled_first_wrong(now, given)) >= 0:
            raise ValueError(_what_is_wrong(now[wrong], given[wrong]))
        tangents = np.empty((*states.shape, self._directions))
        flat = tangents.reshape(count, rows, self._directions)
        over_blocks(_compiled_differentiate, -(-count // TOGETHER), now, given, flat, *self._constants)
        by_parameters = tangents[..., free : free + len(self.by)]
        return Period(states, tangents[..., :rows], tangents[..., rows:free], by_parameters)

    def _wrong_shapes(self, states: Array, torques: Array) -> str:
        last = f"state must have a last axis of {self._rows} and torque one of {self._joints}, their other axes alike"
        return f"{last}, got shapes {states.shape} and {torques.shape}"


def _what_is_wrong(state: Array, torque: Array) -> str:
    """Of one robot that `_first_wrong` has found."""
    for name, values in (("state", state), ("torque", torque)):
        if not np.isfinite(values).all():
            return f"{name} must be finite, got {values[~np.isfinite(values)][0]}"
    lengths = np.hypot(*np.concatenate([state[2:4], state[BODY_ROWS:]]).reshape(-1, 2).T)
    return f"directions must be unit vectors, got a length of {lengths[np.abs(lengths - 1.0).argmax()]:g}"


def _places(name: str, casters: int) -> list[int]:
    """Where a parameter stands in the row of a robot's numbers: once, or once for each caster."""
    if name in _PLATFORM and name in DIFFERENTIABLE:
        return [_PLATFORM.index(name)]
    field, _, number = name.rpartition("_") if name not in DIFFERENTIABLE else (name, "", "")
    if field not in DIFFERENTIABLE or field in _PLATFORM:
        raise ValueError(_unknown(name))
    if number and not (number.isdecimal() and 1 <= int(number) <= casters):
        raise ValueError(f"parameter {name!r} must end in a caster's number, 1 … {casters}")
    chosen = [int(number) - 1] if number else range(casters)
    return [PLATFORM_FIELDS + CASTER_FIELDS * k + _CASTER.index(field) for k in chosen]


def _unknown(name: str) -> str:
    if name.rpartition("_")[0] in _WITHOUT_EFFECT or name in _WITHOUT_EFFECT:
        return (
            f"parameter {name!r} has no effect on wheels that roll without slip under joint torques; known are "
            f"{', '.join(DIFFERENTIABLE)}"
        )
    return f"there is no parameter {name!r} to differentiate by: {did_you_mean(name, DIFFERENTIABLE)}"
