"""Limits of a robot's motors at each place along a line, as half-planes, and how far a time law exceeds them.

Casters trail: how they steer along a line depends on where they are, not on when. So at each point the motors' shares
of their greatest torques are linear in s̈ and ṡ², but for friction, and their limits make half-planes.

    q        twist at unit speed (tangent in B, bend): twist = q ṡ, twist rate = q s̈ + q′ ṡ²
    u, x     s̈ [m/s²] and ṡ² [m²/s²]
    a u + b x + c ṡ <= d        one limit at one point: two of each motor, two of force that no motor gives, one of ṡ

Half-planes stand at PARTS + 1 points of each interval between rows. Casters that flip and dry friction that changes its
sign ask for more in between. `excess` therefore looks at points that lie close together compared with the trails.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from caster_gym.arrays import Array, Flags, Indices, Plane
from caster_gym.mechanics.actuation import motor_wrenches
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import bias, caster_drive, inertia, inverse_dynamics, resistance
from caster_gym.mechanics.linear import dot, multiply, scale
from caster_gym.mechanics.motors import motor_speeds, torque_range
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, add, each, flatten
from caster_gym.paths.arc_length import Line, between
from caster_gym.paths.feasibility import least_effort
from caster_gym.paths.moments import FRICTION_TURN, dry_friction, greatest_torques
from caster_gym.paths.trailing import directions_at_rows
from caster_gym.robot import Robot

PARTS = 4  # of an interval, at whose ends half-planes stand
_STEP = 1.0 / 24.0  # [-] of the shortest trail between the points of `excess`: a flip errs by 0.1 % of a torque then
_SWIFT = 0.03  # [rad] of steering between two of PARTS points, from which on `excess` looks closer
_SAME = 1e-9  # [-] friction that differs by no more than rounding: the first place is told
LEAST_LEFT = 0.01  # [-] of the margin that dry friction must leave


class Limits(NamedTuple):
    """Half-planes (F, C, P) at F points of P lines, and the greatest speed (F, P) there."""

    a: Array
    b: Array
    c: Array
    d: Array
    top: Array

    def of(self, lines: Flags) -> "Limits":
        """Those of some lines."""
        return Limits(*(part[..., lines] for part in self))

    def drawn_in(self, beyond: Array, least: float) -> "Limits":
        """Limits less by `beyond` (K, C, P) at all points of each interval, down to the least d."""
        less = np.zeros_like(self.d)
        for part in range(PARTS + 1):
            points = less[part : part + PARTS * len(beyond) : PARTS]
            np.maximum(points, beyond, out=points)
        return self._replace(d=np.maximum(self.d - less, np.minimum(self.d, least)))


class Ways(NamedTuple):
    """Lines at `steps` + 1 points of each of K intervals; lines with fewer intervals stay at their end."""

    points: Array  # (9, steps + 1, K, P) with the columns of lines
    psi: Plane  # (N, steps + 1, K, P) rolling directions in W

    def of(self, lines: Indices) -> "Ways":
        """Those of some lines."""
        return Ways(self.points[..., lines], self.psi[..., lines])

    def at(self, intervals: Flags, stride: int) -> "Ways":
        """M intervals (K, P) at every so many of their points: (9, S, M) and (N, S, M)."""
        return Ways(self.points[:, ::stride, intervals], self.psi[:, ::stride, intervals])


class _Motion(NamedTuple):
    """q, q′ and the rolling directions in B at some points."""

    q: Vector
    q_slope: Vector
    directions: tuple[Direction, ...]


def steps_between(line: Line, robot: Robot) -> int:
    """Into how many steps `excess` divides an interval of a line, so that it sees casters flip: a multiple of PARTS."""
    step = _STEP * min(caster.trail for caster in robot.casters)
    return PARTS * int(np.ceil(line.spacing / (PARTS * step) - 1e-9))


def ways_along(lines: Sequence[Line], last: int, steps: int, robot: Robot) -> Ways:
    """Lines of at most `last` intervals at `steps` + 1 points of each."""
    spacing = np.array([line.spacing for line in lines])
    rows = np.stack([np.pad(line.rows, ((0, last + 1 - len(line.rows)), (0, 0)), mode="edge") for line in lines])
    points = np.empty((steps + 1, *rows[:, 1:].shape))
    points[0], points[-1] = rows[:, :-1], rows[:, 1:]
    for part in range(1, steps):
        points[part] = between(rows, spacing[:, None], part / steps, slice(0, -1))
    for k, line in enumerate(lines):
        points[:, k, len(line.rows) - 1 :] = line.rows[-1]
    columns = np.ascontiguousarray(points.transpose(3, 0, 2, 1))
    x, y, cos, sin = columns[[0, 1, 5, 6]]
    return Ways(columns, directions_at_rows(x + 1j * y, cos + 1j * sin, robot))


def limits_along(ways: Ways, lines: Sequence[Line], robot: Robot, speed_limit: float, margin: float) -> Limits:
    """The limits at PARTS points of each interval, and at the end.

    Raises ValueError where dry friction leaves nothing of the margin.
    """
    stride = (len(ways.points[0]) - 1) // PARTS
    q, q_slope, directions = _motion(_in_a_row(ways.points, stride), _in_a_row(ways.psi, stride))
    numbers = robot_parameters(robot)
    speeds = flatten(each(_turns, (q,), directions, numbers.casters))
    tops = flatten(each(_top_speeds, (), numbers.casters))
    top = np.full_like(q[2], speed_limit)
    for w, fastest in zip(speeds, tops, strict=True):
        top = np.minimum(top, margin * fastest / np.maximum(np.abs(w), 1e-30))

    m = inertia(directions, numbers)
    smooth = numbers._replace(casters=tuple(c._replace(roll_coulomb=0.0, steer_coulomb=0.0) for c in numbers.casters))
    viscous = resistance(q, directions, smooth)
    whole = resistance(scale(top, q), directions, numbers)
    forces = (
        multiply(m, q),
        add(multiply(m, q_slope), bias(q, directions, numbers)),
        viscous,
        add(whole, scale(-top, viscous)),
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
    return Limits(a, b, c, d, top)


def excess(ways: Ways, square: Array, spacing: Array, robot: Robot, most: float) -> Array:
    """By how much (K, C, P) the law ṡ² (K + 1, P) exceeds each kind of limit in each interval; below 0 it keeps it.

    most: the share of the motors that may be used, like the margin of the limits.
    Friction is that of the robot at the speed of the law. Where it changes between two points, the worst counts.
    """
    numbers = robot_parameters(robot)
    stride = (len(ways.points[0]) - 1) // PARTS
    driven = np.broadcast_to(np.maximum(square[:-1], square[1:]) > 0.0, ways.points.shape[2:])
    found = np.full((*driven.shape, 4 * robot.caster_count + 3), -np.inf)
    looked, swift = _broken(ways.at(driven, stride), _Law.of(square, spacing, driven), numbers, most)
    found[driven] = looked.T
    closer = driven.copy()
    closer[driven] = swift
    if closer.any():
        found[closer] = _broken(ways.at(closer, 1), _Law.of(square, spacing, closer), numbers, most)[0].T
    return found.swapaxes(1, 2)


class _Law(NamedTuple):
    """The law in M intervals: ṡ² at both ends [m²/s²] and s̈ [m/s²], each (M,)."""

    start: Array
    end: Array
    u: Array

    @classmethod
    def of(cls, square: Array, spacing: Array, chosen: Flags) -> "_Law":
        """That of chosen intervals (K, P) of a law (K + 1, P)."""
        start, end = square[:-1][chosen], square[1:][chosen]
        return cls(start, end, (end - start) / (2.0 * np.broadcast_to(spacing, chosen.shape)[chosen]))


def _broken(ways: Ways, law: _Law, robot: RobotParameters, most: float) -> tuple[Array, Flags]:
    """`excess` (C, M) at the points (S, M) of ways, and in which intervals (M,) only closer points can tell."""
    q, q_slope, directions = _motion(ways.points, ways.psi)
    share = np.linspace(0.0, 1.0, len(q[2]))[:, None]
    x = law.start + share * (law.end - law.start)
    v = scale(np.sqrt(np.maximum(x, 0.0)), q)
    force = inverse_dynamics(v, directions, add(scale(law.u, q), scale(x, q_slope)), robot)
    shares, lack = _shares(force, directions, robot)
    speeds = flatten(each(_turns, (v,), directions, robot.casters))
    tops = flatten(each(_top_speeds, (), robot.casters))
    over, fastest = [], np.zeros_like(x)
    for given, speed, top in zip(shares, speeds, tops, strict=True):
        low, high = torque_range(speed, most, top)
        over += [given - high, low - given]
        fastest = np.maximum(fastest, np.abs(speed) / top)
    over += [lack - most, lack - most, np.square(fastest / most) - 1.0]
    found = np.stack([_peak(one) for one in over])
    here, more = _friction_between(v, directions, robot)
    for limit, added in enumerate(more):
        np.maximum.at(found[limit], here[1], over[limit][here] + added)
    swift = np.zeros(x.shape[1], dtype=np.bool_)
    swift[here[1]] = True
    swift |= (found > 0.0).any(axis=0)
    for cos, sin in directions:
        swift |= (np.abs(cos[1:] * sin[:-1] - sin[1:] * cos[:-1]) > _SWIFT).any(axis=0)
    return found, swift


def _peak(values: Array) -> Array:
    """Bound of what values (S, M) reach between their points too.

    A parabola through neighbours rises by at most 1/8 of their second difference b between two points; twice that
    leaves room for b to grow.
    """
    bent = np.maximum(2.0 * values[1:-1] - values[:-2] - values[2:], 0.0)
    inside: Array = (values[1:-1] + 0.25 * bent).max(axis=0)
    ends: Array = np.maximum(values[0] + 0.25 * bent[0], values[-1] + 0.25 * bent[-1])
    return np.maximum(ends, inside)


def _in_a_row(values: Any, stride: int) -> Any:
    """Every so many of values (..., steps + 1, K, P) as points (..., F, P) of whole lines."""
    inner = values[..., :-1:stride, :, :].swapaxes(-3, -2)
    flat = inner.reshape(*values.shape[:-3], -1, values.shape[-1])
    return np.concatenate([flat, values[..., -1, -1:, :]], axis=-2)


def _friction_between(
    v: Vector, directions: tuple[Direction, ...], robot: RobotParameters
) -> tuple[tuple[Indices, ...], list[Array]]:
    """Places in (S, M) where dry friction changes fast, and what its worst adds to each limit of the motors there.

    Joints may change one after the other: each counts with the worst of its friction at the point and its neighbours.
    """
    dry = flatten(each(dry_friction, (v, robot.platform.coulomb_speed), directions, robot.casters))
    sizes = flatten(each(greatest_torques, (), robot.casters))
    jumping = np.zeros(v[2].shape, dtype=np.bool_)
    for torque, size in zip(dry, sizes, strict=True):
        jumps = np.abs(np.diff(torque, axis=0)) > FRICTION_TURN * size
        jumping[1:] |= jumps
        jumping[:-1] |= jumps
    here = np.nonzero(jumping)
    before, after = np.maximum(here[0] - 1, 0), np.minimum(here[0] + 1, len(jumping) - 1)
    at = tuple((f[0][here], f[1][here]) for f in directions)
    more = [np.zeros(len(here[0])) for _ in range(2 * len(dry))]
    for joint, torque in enumerate(dry):
        changes = [torque[place, here[1]] - torque[here] for place in (before, after)]
        least, most = np.minimum(np.minimum(*changes), 0.0), np.maximum(np.maximum(*changes), 0.0)
        caster, kind = divmod(joint, 2)
        one = caster_drive(at[caster], robot.casters[caster], (1.0 - kind, 1.0 * kind))
        for motor, share in enumerate(_shares(one, at, robot)[0]):
            more[2 * motor] += np.maximum(share * least, share * most)
            more[2 * motor + 1] += np.maximum(-share * least, -share * most)
    return here, more


def _motion(points: Array, psi: Plane) -> _Motion:
    _, _, tx, ty, curvature, cos, sin, bend, bend_slope = points
    back = cos - 1j * sin
    tangent = (tx + 1j * ty) * back
    turning = 1j * (curvature - bend) * tangent  # derivative of the components of the tangent in B
    directions = tuple((f.real.copy(), f.imag.copy()) for f in psi * back)
    q = tangent.real.copy(), tangent.imag.copy(), bend
    return _Motion(q, (turning.real.copy(), turning.imag.copy(), bend_slope), directions)


def _turns(q: Vector, f: Direction, caster: CasterParameters) -> tuple[Array, Array]:
    """Turns of a caster's driven motors by way along the line, or by time. [rad/m] or [rad/s]"""
    roll, steer = motor_speeds(joint_rates(q, f, caster), caster)
    return caster.roll_active * roll, caster.steer_active * steer


def _top_speeds(caster: CasterParameters) -> tuple[float, float]:
    return caster.roll_max_speed, caster.steer_max_speed


def _shares(force: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> tuple[list[Array], Array]:
    """Shares of the motors' greatest torques that make a force, and the use that the force lacking then counts as."""
    effort, lack = least_effort(force, directions, robot)
    wrenches = flatten(each(motor_wrenches, (), directions, robot.casters))
    return [dot(w, effort) for w in wrenches], lack[0]


def _refuse_stiction(left: Array, lines: Sequence[Line], robot: Robot, margin: float) -> None:
    """Refuse lines (F, C, P) along which dry friction leaves nothing of the motors' torque."""
    c, k = divmod(int(left.min(axis=0).argmin()), left.shape[2])
    f = int((left[:, c, k] <= left[:, c, k].min() + _SAME).argmax())
    if left[f, c, k] > LEAST_LEFT * margin:
        return
    line, joint, share = lines[k], c // 2, margin - left[f, c, k]
    x, y = line.rows[f // PARTS, 0:2]
    if joint < 2 * robot.caster_count:
        takes, else_ = f"takes {share:.2g} of the greatest torque of {robot.joints[joint]}", ", or stronger motors"
    else:
        takes, else_ = f"pushes where the driven joints, {', '.join(robot.driven)}, cannot", ""
    raise ValueError(
        f"the robot cannot move along path {line.name!r} at s = {f * line.spacing / PARTS:.3g} m, (x, y) = "
        f"({x:.3g}, {y:.3g}) m: dry friction {takes}, and the margin is {margin:g}; less friction would suffice{else_}"
    )
