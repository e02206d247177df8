"""Which time steps can follow a robot, and what to change if one cannot. Every engine checks its time step."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.time_scales import STEPS_TO_TOP, Limits, greatest_part, limits
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters, unpack_parameters
from caster_gym.robot import Robot

MOST_SUBSTEPS = 1000  # of a control period
SHORTEST_PERIOD = 1e-5  # [s]
_TOGETHER = 256  # robots that are worked out at once
_ROUNDING = 1e-9  # [-] relative; a step of trail / speed is written with rounding
_UNITS = {"viscous": "N m s/rad", "coulomb": "N m", "scrub": "N m s/rad", "max_torque": "N m"}


def check_time_step(robot: Robot, time_step: float, substeps: int | None = None) -> None:
    """Refuse a time step [s] that cannot follow a robot, and say which would.

    substeps: in how many such steps a control period is cut, if it is; then the number is told that would suffice.
    """
    if not follows(time_step, longest_time_step(robot)):
        raise ValueError(_refusal(f"robot {robot.name!r}", _row(robot), time_step, substeps))


def check_fleet(robots: Sequence[Robot], time_step: float) -> None:
    """The same for several robots."""
    longest = longest_of_robots(robots)
    if not follows(time_step, float(longest.min())):
        check_time_step(robots[int(longest.argmin())], time_step)


def check_rows(what: str, rows: Array, time_step: float, substeps: int | None = None) -> None:
    """The same for robots of given numbers (R, fields), in the order of `pack_parameters`."""
    longest = longest_of_rows(rows)
    worst = int(longest.argmin())
    if not follows(time_step, float(longest[worst])):
        raise ValueError(_refusal(what, rows[worst : worst + 1], time_step, substeps))


def follows(time_step: float, longest: float) -> bool:
    """Whether a time step is one, and no longer than the longest. [s]"""
    return 0.0 < time_step <= longest * (1.0 + _ROUNDING)


def substeps_for(period: float, longest: float) -> int:
    """Fewest equal time steps of a period [s] that are no longer than the longest. [s]"""
    return max(1, math.ceil(period / longest * (1.0 - _ROUNDING)))


@lru_cache(maxsize=256)
def longest_time_step(robot: Robot) -> float:
    """Longest time step that follows a robot. [s]"""
    return float(longest_of_rows(_row(robot))[0])


def longest_of_robots(robots: Sequence[Robot]) -> Array:
    """Longest time steps (R,) that follow robots with the same number of casters. [s]"""
    if len(robots) == 1:
        return np.array([longest_time_step(robots[0])])
    return longest_of_rows(np.concatenate([_row(robot) for robot in robots]))


def longest_of_rows(rows: Array) -> Array:
    """Longest time steps (R,) that follow robots of given numbers (R, fields). [s]

    Raises ValueError for numbers that are not finite, and for inertias so small that rounding hides them.
    """
    if not np.isfinite(rows).all():
        row, field = np.argwhere(~np.isfinite(rows))[0]
        raise ValueError(f"a robot's numbers must be finite, got {rows[row, field]} as number {field + 1}")
    distinct, back = np.unique(rows, axis=0, return_inverse=True)
    try:
        parts = [limits(distinct[i : i + _TOGETHER]).longest for i in range(0, len(distinct), _TOGETHER)]
    except np.linalg.LinAlgError:
        raise ValueError(
            "a robot needs positive masses and inertias: its inertia matrix is not positive definite"
        ) from None
    return np.concatenate(parts)[back.reshape(-1)]


def _row(robot: Robot) -> Array:
    return np.array([pack_parameters(robot_parameters(robot))])


def _refusal(what: str, row: Array, time_step: float, substeps: int | None) -> str:
    """Why a time step cannot follow a robot of given numbers (1, fields), and what would."""
    rates = limits(row)
    longest, needed = float(rates.longest[0]), rates.needed[:, 0]
    binding = Limits._fields[int(needed.argmax())]
    reason, field = _reason(row, binding, float(needed.max()))
    whom = f"the casters of {what}" if binding == "turning" else what
    said = f"a time step of {time_step:g} s cannot follow {whom}: {reason}; it must be positive and at most "
    said += f"{rounded_down(longest)} s"
    if substeps is None or not time_step > 0.0:
        return said
    count = substeps_for(time_step * substeps, longest)
    if count <= MOST_SUBSTEPS:
        return f"{said}: 'substeps' of {count} would suffice, in place of {substeps}"
    return f"{said}: {count:,} 'substeps', more than a task may have{_remedies(row, field, time_step, longest)}"


def _remedies(row: Array, field: str | None, time_step: float, longest: float) -> str:
    """What suffices instead of a shorter time step."""
    ways = []
    if field is not None and (enough := _enough(row, field, time_step)) is not None:
        ways.append(f"a {_key(field)!r} of at most {enough} {_unit(field)} in every caster")
    if MOST_SUBSTEPS * longest >= SHORTEST_PERIOD:
        ways.append(f"a 'control_period' of {_round(MOST_SUBSTEPS * longest)} s in {MOST_SUBSTEPS} 'substeps'")
    return f"; {' or '.join(ways)} would suffice" if ways else ""


def _enough(row: Array, field: str, time_step: float) -> str | None:
    """A bound of a number of every caster with which a time step follows the robot; None if others stand against it."""
    robot = unpack_parameters(tuple(row[0].tolist()))
    most = max(getattr(caster, field) for caster in robot.casters)
    for power in range(1, 17):
        bound = rounded_down(most * 10.0 ** (-0.5 * power))
        less = tuple(caster._replace(**{field: min(getattr(caster, field), float(bound))}) for caster in robot.casters)
        if follows(time_step, float(longest_of_rows(np.array([pack_parameters(robot._replace(casters=less))]))[0])):
            return bound
    return None


def _reason(row: Array, binding: str, rate: float) -> tuple[str, str | None]:
    """What is too fast, at which rate [1/s], and the field of the number that makes it so most of all."""
    casters = unpack_parameters(tuple(row[0].tolist())).casters
    if binding == "turning":
        trail = min(caster.trail for caster in casters)
        return f"with a trail of {trail:g} m they turn at up to {rate:.4g} rad/s", None
    number, field = greatest_part(row, "motors" if binding == "motors" else "friction")
    cause = f"{_key(field)!r} of {getattr(casters[number - 1], field):g} {_unit(field)} at caster {number}"
    if binding == "motors":
        speed = getattr(casters[number - 1], field.replace("torque", "speed"))
        return (
            f"full torque reaches the motors' top speed in {STEPS_TO_TOP / rate:.2g} s, most of all by {cause} with "
            f"a 'max_speed' of {speed:g} rad/s"
        ), field
    dry = " over the robot's 'coulomb_speed'" if field.endswith("coulomb") else ""
    when = " at top speed" if binding == "driving" else ""
    return f"friction brakes it too fast{when}, most of all by {cause}{dry}", field


def _key(field: str) -> str:
    """The key in a robot's file: roll_viscous as roll.viscous."""
    return field.replace("_", ".", 1)


def _unit(field: str) -> str:
    return _UNITS[field.partition("_")[2] or field]


def _round(value: float) -> str:
    """1, 2 or 5 in the first digit of a positive number that is no more than it: other times are multiples of that."""
    unit = 10.0 ** math.floor(math.log10(value))
    digit = max(digit for digit in (1, 2, 5) if digit * unit <= value * (1.0 + _ROUNDING))
    return f"{digit * unit:g}"


def rounded_down(value: float) -> str:
    """Three digits of a positive number that are no more than it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.floor(value / unit * (1.0 + _ROUNDING)) * unit:.3g}"
