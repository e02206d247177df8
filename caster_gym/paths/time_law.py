"""The fastest way along a line, from rest to rest, within the limits of a robot's motors.

Casters trail: how they steer along a line depends on where they are, not on when. So at each point the motors' shares
of their greatest torques are linear in s̈ and ṡ², but for friction, and their limits make half-planes.

    q        twist at unit speed (tangent in B, bend): twist = q ṡ, twist rate = q s̈ + q′ ṡ²
    u, x     s̈ [m/s²] and ṡ² [m²/s²]
    a u + b x + c ṡ <= d        one limit at one point: two of each motor, two of force that no motor gives, one of ṡ

Every interval between rows has one u. Its limits are kept at _PARTS + 1 points, so that they hold at both of its rows.
A backward pass finds the greatest x from which the end can still be reached, a forward pass takes the greatest u that
stays below it: Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis",
IEEE Transactions on Robotics, 2018.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.mechanics.actuation import motor_wrenches
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import bias, inertia, resistance
from caster_gym.mechanics.linear import dot, multiply
from caster_gym.mechanics.motors import motor_speeds
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, add, each, flatten
from caster_gym.paths.arc_length import Line, between
from caster_gym.paths.feasibility import least_effort, trailing_directions
from caster_gym.paths.trajectory import Array
from caster_gym.robot import Robot

_PARTS = 4  # of an interval, at whose ends the limits are kept: dry friction turns round within a short way
_PASSES = 2  # each takes the tangents of c √x at the law before; a third would save 0.1 % of the time
_BLOCK = 128  # lines that are worked on at once
_SMALL_BLOCK = 16  # lines whose limits are worked out at once, so that their arrays stay in the processor's cache
_LEAST_LEFT = 0.01  # [-] of the margin that dry friction must leave
_SLOWEST = 1e-3  # [m/s] least speed of a tangent of c √x
_FLAT = 1e-9  # [1/(m/s²)] a limit that depends on u by less bounds x alone


class _Limits(NamedTuple):
    """Half-planes (F, C, P) at F points of P lines, and the greatest speed (F, P) there."""

    a: Array
    b: Array
    c: Array
    d: Array
    top: Array


def row_times(square_speed: Array, spacing: float) -> Array:
    """Time at each row of a law (K + 1,): s̈ is constant in between. [s]"""
    speed = np.sqrt(square_speed)
    return np.concatenate([[0.0], np.cumsum(2.0 * spacing / (speed[1:] + speed[:-1]))])


def fastest_laws(lines: Sequence[Line], robot: Robot, speed_limit: float, margin: float) -> list[Array]:
    """ṡ² (K + 1,) at the rows of each line [m²/s²], linear in s between them.

    speed_limit [m/s] bounds ṡ; margin is the share used of each motor's torque at its speed, and of its top speed.
    Raises ValueError where friction alone is more than that.
    """
    laws: dict[int, Array] = {}
    by_length = sorted(range(len(lines)), key=lambda i: len(lines[i].rows))
    for i in range(0, len(lines), _BLOCK):
        chosen = by_length[i : i + _BLOCK]
        block = [lines[i] for i in chosen]
        last = len(block[-1].rows) - 1
        parts = [
            _limits(block[j : j + _SMALL_BLOCK], last, robot, speed_limit, margin)
            for j in range(0, len(block), _SMALL_BLOCK)
        ]
        limits = _Limits(*(np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)))
        ends = np.array([len(line.rows) - 1 for line in block])
        square = _laws(limits, np.array([line.spacing for line in block]), ends)
        laws.update({i: square[: len(lines[i].rows), k] for k, i in enumerate(chosen)})
    return [laws[i] for i in range(len(lines))]


def _limits(lines: Sequence[Line], last: int, robot: Robot, speed_limit: float, margin: float) -> _Limits:
    """The limits along lines, at each row and between; lines with less than `last` intervals stay at their end."""
    points = np.stack([_points(line, last) for line in lines])
    psi = trailing_directions(points[..., [0, 1, 5, 6]], robot).T
    _, _, tx, ty, curvature, cos, sin, bend, bend_slope = np.ascontiguousarray(points.T)
    back = cos - 1j * sin
    tangent = (tx + 1j * ty) * back
    turning = 1j * (curvature - bend) * tangent  # derivative of the components of the tangent in B
    q, q_slope = (tangent.real, tangent.imag, bend), (turning.real, turning.imag, bend_slope)
    directions = tuple((f.real, f.imag) for f in psi * back)
    numbers = robot_parameters(robot)
    speeds = flatten(each(_turns, (q,), directions, numbers.casters))
    tops = flatten(each(_top_speeds, (), numbers.casters))
    top = np.full_like(bend, speed_limit)
    for w, fastest in zip(speeds, tops, strict=True):
        top = np.minimum(top, margin * fastest / np.maximum(np.abs(w), 1e-30))

    m = inertia(directions, numbers)
    smooth = numbers._replace(casters=tuple(c._replace(roll_coulomb=0.0, steer_coulomb=0.0) for c in numbers.casters))
    viscous = resistance(q, directions, smooth)
    whole = resistance(_times(top, q), directions, numbers)  # dry friction at the top is no less than below
    forces = (
        multiply(m, q),
        add(multiply(m, q_slope), bias(q, directions, numbers)),
        viscous,
        add(whole, _times(-top, viscous)),
    )
    shares = [_shares(force, directions, numbers) for force in forces]
    planes = []
    for joint, (a, b, c, dry) in enumerate(zip(*(motors for motors, _ in shares), strict=True)):
        falling = margin * speeds[joint] / tops[joint]
        for sign in (1.0, -1.0):  # friction that helps is not counted on: it need not be there
            left = margin - np.maximum(sign * dry, 0.0)
            planes.append((sign * a, sign * b, np.maximum(sign * c + np.maximum(sign * falling, 0.0), 0.0), left))
    a, b, c, dry = (lack for _, lack in shares)
    planes += [(sign * a, b, c, margin - dry) for sign in (1.0, -1.0)]
    planes.append((0.0 * top, 1.0 / top**2, 0.0 * top, 0.0 * top + 1.0))
    a, b, c, d = (np.stack(column, axis=1) for column in zip(*planes, strict=True))
    _refuse_stiction(d, lines, robot, margin)
    return _Limits(a, b, c, d, top)


def _points(line: Line, last: int) -> Array:
    """Rows of a line with _PARTS - 1 more between each two, the end repeated until it is row `last`."""
    points = np.repeat(line.rows, _PARTS, axis=0)[: _PARTS * (len(line.rows) - 1) + 1]
    for part in range(1, _PARTS):
        points[part::_PARTS] = between(line.rows, line.spacing, part / _PARTS, slice(0, -1))
    return np.pad(points, ((0, _PARTS * last + 1 - len(points)), (0, 0)), mode="edge")


def _turns(q: Vector, f: Direction, caster: CasterParameters) -> tuple[Array, Array]:
    """Turns of a caster's driven motors by way along the line. [rad/m]"""
    roll, steer = motor_speeds(joint_rates(q, f, caster), caster)
    return caster.roll_active * roll, caster.steer_active * steer


def _top_speeds(caster: CasterParameters) -> tuple[float, float]:
    return caster.roll_max_speed, caster.steer_max_speed


def _times(factor: Array, v: Vector) -> Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def _shares(force: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> tuple[list[Array], Array]:
    """Shares of the motors' greatest torques that make a force, and the use that the force lacking then counts as."""
    effort, lack = least_effort(force, directions, robot)
    wrenches = flatten(each(motor_wrenches, (), directions, robot.casters))
    return [dot(w, effort) for w in wrenches], lack[0]


def _refuse_stiction(left: Array, lines: Sequence[Line], robot: Robot, margin: float) -> None:
    """Refuse lines (F, C, P) along which dry friction leaves nothing of the motors' torque."""
    c, k = divmod(int(left.min(axis=0).argmin()), left.shape[2])
    f = int(left[:, c, k].argmin())
    if left[f, c, k] > _LEAST_LEFT * margin:
        return
    line, joint, share = lines[k], c // 2, margin - left[f, c, k]
    x, y = line.rows[f // _PARTS, 0:2]
    if joint < 2 * robot.caster_count:
        takes = f"takes {share:.2g} of the greatest torque of {robot.joints[joint]}"
    else:
        takes = f"pushes where the driven joints, {', '.join(robot.driven)}, cannot"
    raise ValueError(
        f"the robot cannot move along path {line.name!r} at s = {f * line.spacing / _PARTS:.3g} m, (x, y) = "
        f"({x:.3g}, {y:.3g}) m: dry friction {takes}, and the margin is {margin:g}; less friction would do, "
        f"or stronger motors"
    )


def _laws(limits: _Limits, spacing: Array, ends: NDArray[np.int64]) -> Array:
    """ṡ² (K + 1, P) of lines that end at the rows `ends`."""
    rows = limits.top[::_PARTS]
    cap = np.where((np.arange(len(rows))[:, None] >= ends) | (np.arange(len(rows)) == 0)[:, None], 0.0, rows**2)
    around = limits.top
    for _ in range(_PASSES):
        # c √x lies below each of its tangents; the one at rest's limit d / c at the latest leaves rest allowed
        tangent = np.minimum(around[:, None], limits.d / np.maximum(limits.c, 1e-300))
        planes = limits.a, limits.b + 0.5 * limits.c / tangent, limits.d - 0.5 * limits.c * tangent
        square = _forward(planes, _backward(planes, cap, spacing), spacing)
        around = np.sqrt(np.maximum(_refined(square), _SLOWEST**2))
    return square


def _refined(square: Array) -> Array:
    """Values (F, P) at all points of what is linear between rows (K + 1, P)."""
    fine = np.empty((_PARTS * (len(square) - 1) + 1, square.shape[1]))
    fine[::_PARTS] = square
    for part in range(1, _PARTS):
        fine[part::_PARTS] = square[:-1] + part / _PARTS * (square[1:] - square[:-1])
    return fine


class _Bounds(NamedTuple):
    """Bounds low + low_slope x <= u <= high + high_slope x (C, P) of one interval, and x <= most (P,)."""

    high: Array
    high_slope: Array
    low: Array
    low_slope: Array
    most: Array


def _bounds(planes: tuple[Array, Array, Array], k: int, end: Array, spacing: Array) -> _Bounds:
    """Bounds of u in interval k by x at its start, so that all limits are kept and x at its end lies in 0 … end."""
    points = slice(k * _PARTS, (k + 1) * _PARTS + 1)
    a, b, d = (plane[points] for plane in planes)
    ahead = 2.0 * spacing * np.linspace(0.0, 1.0, _PARTS + 1)[:, None, None]  # x there is x + ahead u
    a = (a + ahead * b).reshape(-1, len(spacing))
    b, d = b.reshape(a.shape), d.reshape(a.shape)
    bound = np.abs(a) > _FLAT
    slope = np.where(bound, a, 1.0)
    at, by = d / slope, -b / slope
    up, down = a > _FLAT, a < -_FLAT
    most = np.where(~bound & (b > 0.0), d / np.where(b > 0.0, b, 1.0), np.inf).min(axis=0)
    fall = np.broadcast_to(-0.5 / spacing, (1, len(spacing)))
    return _Bounds(
        np.concatenate([np.where(up, at, np.inf), 0.5 * end[None] / spacing]),
        np.concatenate([np.where(up, by, 0.0), fall]),
        np.concatenate([np.where(down, at, -np.inf), 0.0 * fall]),
        np.concatenate([np.where(down, by, 0.0), fall]),
        most,
    )


def _backward(planes: tuple[Array, Array, Array], cap: Array, spacing: Array) -> Array:
    """Greatest x (K + 1, P) at each row from which the end can be reached."""
    reach = cap.copy()
    for k in range(len(cap) - 2, -1, -1):
        bounds = _bounds(planes, k, reach[k + 1], spacing)
        reach[k] = _greatest(bounds, np.minimum(cap[k], bounds.most))
    return reach


def _greatest(bounds: _Bounds, x: Array) -> Array:
    """Greatest x (P,), at most the given one, that leaves u a choice.

    The room for u is concave in x and there is some at 0, so that Newton's steps from above end at the answer.
    """
    lines = np.arange(len(x))
    while True:
        high, low = bounds.high + bounds.high_slope * x, bounds.low + bounds.low_slope * x
        i, j = high.argmin(axis=0), low.argmax(axis=0)
        room = high[i, lines] - low[j, lines]
        slope = bounds.high_slope[i, lines] - bounds.low_slope[j, lines]
        short = (room < 0.0) & (slope < 0.0)
        lower = np.where(short, np.maximum(x - room / np.where(short, slope, -1.0), 0.0), x)
        if not (lower < x).any():
            return x
        x = np.minimum(lower, x)


def _forward(planes: tuple[Array, Array, Array], reach: Array, spacing: Array) -> Array:
    """x (K + 1, P) at the greatest u everywhere that stays within reach of the end."""
    square = np.zeros_like(reach)
    for k in range(len(reach) - 1):
        bounds = _bounds(planes, k, reach[k + 1], spacing)
        u = (bounds.high + bounds.high_slope * square[k]).min(axis=0)
        square[k + 1] = np.clip(square[k] + 2.0 * spacing * u, 0.0, reach[k + 1])
    return square
