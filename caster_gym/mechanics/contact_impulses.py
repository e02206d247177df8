"""Impulses at all contacts of a pose: of impacts, and of contacts that last. docs/equations.md, section O."""

from typing import Any, NamedTuple

from caster_gym.mechanics.dynamics import inertia
from caster_gym.mechanics.impulse import collide
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Vector,
    absolute,
    anywhere,
    clip,
    each,
    maximum,
    memory,
    where,
)
from caster_gym.mechanics.separation import TOUCH, Hull, Obstacles, contact_points, separation

RESTING = 0.01  # [m/s] slower contacts do not bounce
STILL = 1e-6  # [m/s] slower contacts do not approach
SWEEPS = 60  # over all contacts, at one moment


class Pressure(NamedTuple):
    """Impulses of obstacles on the robot."""

    wrench: Vector  # [N s, N s, N m s] in B
    normal: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in B, of the last impact
    impacts: Scalar  # 1 if any contact approached faster than RESTING, else 0


def press(
    state: State, restitution: Scalar, robot: RobotParameters, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[Vector, Pressure]:
    """Twist after impulses at all contacts in turn, until none approaches; and these impulses.

    Contacts that approach slower than RESTING do not bounce.
    """
    v, (c, s) = state.twist, state.heading
    nothing = 0.0 * v[0]
    wrench, normal, at, struck = (nothing, nothing, nothing), nothing, (nothing, nothing), nothing
    for _ in range(SWEEPS):
        approaching = nothing > 1.0
        for k in range(first, end):
            apart = separation(state.position, state.heading, hull, obstacles, k)
            touching = apart.gap < TOUCH
            if not anywhere(touching):
                continue
            nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
            points = contact_points(state.position, state.heading, apart, hull, obstacles, k)
            for i in range(2):
                px, py = points[i]
                now = nx * (v[0] - v[2] * py) + ny * (v[1] + v[2] * px)
                bounce = where(now < -RESTING, restitution, nothing)
                j_n, j_t, after = collide(v, state.directions, points[i], (nx, ny), bounce, obstacles.friction, robot)
                acts = touching & (now < -STILL)
                strikes = touching & (now < -RESTING)
                v = each(where, (acts,), after, v)
                j_n, j_t = where(acts, j_n, nothing), where(acts, j_t, nothing)
                jx, jy = nx * j_n - ny * j_t, ny * j_n + nx * j_t
                wrench = (wrench[0] + jx, wrench[1] + jy, wrench[2] + px * jy - py * jx)
                normal, struck = normal + j_n, where(strikes, 1.0 + nothing, struck)
                at = (where(strikes, px, at[0]), where(strikes, py, at[1]))
                approaching = approaching | acts
        if not anywhere(approaching):
            break
    return v, Pressure(wrench, normal, at, struck)


def hold(
    v: Vector,
    state: State,
    heading: Direction,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
) -> tuple[Vector, Scalar]:
    """Impulses of lasting contacts on a robot that would else reach the twist v: wrench in B, and their normal sum.

    v and the impulses are taken in the directions of `heading`. No contact approaches any more, none pulls, one that
    recedes does not press, and friction holds or acts against sliding: projected Gauss–Seidel over all contacts, each
    of which keeps the sum of its impulses. Contacts that approach faster than RESTING in `state` are left alone. (O7)
    """
    nothing = 0.0 * v[0]
    wrench, normal = (nothing, nothing, nothing), nothing
    sums = memory(nothing, 4 * (end - first))  # normal and tangential impulse of both points of each obstacle
    m = inertia(state.directions, robot)
    c, s = heading
    for _ in range(SWEEPS):
        changing = nothing > 1.0
        for k in range(first, end):
            apart = separation(state.position, state.heading, hull, obstacles, k)
            touching = apart.gap < TOUCH
            if not anywhere(touching):
                continue
            nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
            points = contact_points(state.position, heading, apart, hull, obstacles, k)
            for i in range(2):
                px, py = points[i]
                n, t = (nx, ny, px * ny - py * nx), (-ny, nx, px * nx + py * ny)
                acts = touching & (dot(n, state.twist) > -RESTING)
                at = 4 * (k - first) + 2 * i
                m_n, m_t = solve(m, n), solve(m, t)
                j_n = maximum(sums[at] - dot(n, v) / dot(n, m_n), 0.0)
                d_n = where(acts, j_n - sums[at], nothing)
                v = (v[0] + m_n[0] * d_n, v[1] + m_n[1] * d_n, v[2] + m_n[2] * d_n)
                sums[at] = sums[at] + d_n
                limit = obstacles.friction * sums[at]
                j_t = clip(sums[at + 1] - dot(t, v) / dot(t, m_t), -limit, limit)
                d_t = where(acts, j_t - sums[at + 1], nothing)
                v = (v[0] + m_t[0] * d_t, v[1] + m_t[1] * d_t, v[2] + m_t[2] * d_t)
                sums[at + 1] = sums[at + 1] + d_t
                jx, jy = nx * d_n - ny * d_t, ny * d_n + nx * d_t
                wrench = (wrench[0] + jx, wrench[1] + jy, wrench[2] + px * jy - py * jx)
                normal = normal + d_n
                change = maximum(absolute(d_n) * dot(n, m_n), absolute(d_t) * dot(t, m_t))
                changing = changing | (change > STILL)
        if not anywhere(changing):
            break
    return wrench, normal
