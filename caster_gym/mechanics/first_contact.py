"""When a robot first touches something during a segment of a time step. docs/equations.md, section O."""

from typing import Any, NamedTuple

from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import Scalar, anywhere, entry, maximum, minimum, sqrt, where
from caster_gym.mechanics.separation import Hull, Obstacles, Separation, lowest, separation

SLOP = 2e-5  # [m] depth that a segment may add where the robot touches already
ADVANCES = 40  # of a search for the first contact
FOUND = 1e-6  # [m] accuracy of that search


class Sweep(NamedTuple):
    """Pose during a segment: cubic polynomials of time, in W, with the values and rates of both its ends."""

    x: tuple[Scalar, Scalar, Scalar, Scalar]
    y: tuple[Scalar, Scalar, Scalar, Scalar]
    c: tuple[Scalar, Scalar, Scalar, Scalar]
    s: tuple[Scalar, Scalar, Scalar, Scalar]
    acceleration: Scalar  # [m/s²] bound for every point of the robot


def cubic(
    h: Scalar, start: Scalar, rate: Scalar, end: Scalar, end_rate: Scalar
) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Coefficients of Hermite's cubic over h seconds, lowest first."""
    mean = (end - start) / h
    return start, rate, (3.0 * mean - 2.0 * rate - end_rate) / h, (rate + end_rate - 2.0 * mean) / (h * h)


def value(p: tuple[Scalar, Scalar, Scalar, Scalar], t: Scalar) -> Scalar:
    """The polynomial at t."""
    return p[0] + t * (p[1] + t * (p[2] + t * p[3]))


def slope(p: tuple[Scalar, Scalar, Scalar, Scalar], t: Scalar) -> Scalar:
    """Its derivative at t."""
    return p[1] + t * (2.0 * p[2] + t * 3.0 * p[3])


def greatest_bend(
    p: tuple[Scalar, Scalar, Scalar, Scalar], q: tuple[Scalar, Scalar, Scalar, Scalar], h: Scalar
) -> Scalar:
    """Greatest length of the second derivative of (p, q), which is linear in time: that at either end."""
    first = 4.0 * (p[2] * p[2] + q[2] * q[2])
    px, qx = p[2] + 3.0 * h * p[3], q[2] + 3.0 * h * q[3]
    return sqrt(maximum(first, 4.0 * (px * px + qx * qx)))


def sweep_between(start: State, end: State, h: Scalar, reach: Scalar) -> Sweep:
    """The pose between two states that are h seconds apart. (O5)"""
    h = maximum(h, 1e-9)
    (c0, s0), (c1, s1) = start.heading, end.heading
    (u0, v0, w0), (u1, v1, w1) = start.twist, end.twist
    x = cubic(h, start.position[0], c0 * u0 - s0 * v0, end.position[0], c1 * u1 - s1 * v1)
    y = cubic(h, start.position[1], s0 * u0 + c0 * v0, end.position[1], s1 * u1 + c1 * v1)
    c, s = cubic(h, c0, -s0 * w0, c1, -s1 * w1), cubic(h, s0, c0 * w0, s1, c1 * w1)
    return Sweep(x, y, c, s, greatest_bend(x, y, h) + reach * greatest_bend(c, s, h))


def free_time(sweep: Sweep, t: Scalar, apart: Separation, threshold: Scalar, hull: Hull) -> Scalar:
    """Time from t during which no corner gets nearer than the threshold along the present axis. [s]

    A corner i recedes at u_i and accelerates towards the obstacle by at most A: its gap stays above
    g_i + u_i τ − ½ A τ².
    """
    c, s = value(sweep.c, t), value(sweep.s, t)
    c_rate, s_rate = slope(sweep.c, t), slope(sweep.s, t)
    away = apart.nx * slope(sweep.x, t) + apart.ny * slope(sweep.y, t)
    nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
    low = lowest(nx, ny, hull)
    least = 1e9 + 0.0 * t
    for i in range(len(hull.corners)):
        px, py = entry(hull.corners, i, 0), entry(hull.corners, i, 1)
        room = maximum(apart.gap - threshold + (nx * px + ny * py - low), 0.0)
        u = away + apart.nx * (c_rate * px - s_rate * py) + apart.ny * (s_rate * px + c_rate * py)
        root = sqrt(u * u + 2.0 * sweep.acceleration * room)
        least = minimum(2.0 * room / maximum(root - u, 1e-300), least)  # (O6)
    return least


def first_contact(sweep: Sweep, h: Scalar, hull: Hull, obstacles: Obstacles, first: Any, end: Any) -> Scalar:
    """Time of the first contact during a segment of h seconds; h or more if there is none. [s]

    The search never steps over a contact. Where the robot touches already, it may sink by another SLOP.
    """
    earliest = h
    for k in range(first, end):
        t, threshold = 0.0 * h, 0.0 * h
        for i in range(ADVANCES):
            position, heading = (value(sweep.x, t), value(sweep.y, t)), (value(sweep.c, t), value(sweep.s, t))
            apart = separation(position, heading, hull, obstacles, k)
            if i == 0:
                threshold = minimum(0.0, apart.gap - SLOP)
            moving = (t < earliest) & (apart.gap > threshold + FOUND)
            if not anywhere(moving):
                break
            free = free_time(sweep, t, apart, threshold, hull)
            t = where(moving, minimum(t + free, earliest), t)
        earliest = minimum(t, earliest)
    return earliest
