"""Collision impulses, the wheels' inertia included. Derivation: docs/equations.md, section C.

The wheels keep rolling without slip through the impact, so the full M(δ) answers to the impulse and the robot is
heavier along its wheels than across them. Friction: Chatterjee and Ruina, J. Applied Mechanics 65 (1998) 939.
"""

from caster_gym.mechanics.dynamics import inertia
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector, absolute, maximum, where


def collide(
    v: Vector,
    directions: tuple[Direction, ...],
    point: tuple[Scalar, Scalar],
    normal: tuple[Scalar, Scalar],
    restitution: Scalar,
    friction: Scalar,
    robot: RobotParameters,
) -> tuple[Scalar, Scalar, Vector]:
    """Normal and tangential impulse [N s] and the twist after an impact; nothing happens to a contact that separates.

    point [m] and unit normal (from the obstacle into the robot) in B; the tangent is the normal turned by +90°.
    """
    px, py = point
    nx, ny = normal
    n = (nx, ny, px * ny - py * nx)
    t = (-ny, nx, px * nx + py * ny)
    m = inertia(directions, robot)
    m_n, m_t = solve(m, n), solve(m, t)
    w_nn, w_nt, w_tt = dot(n, m_n), dot(n, m_t), dot(t, m_t)
    v_n, v_t = dot(n, v), dot(t, v)
    frictionless = -v_n / w_nn  # (C1) with e = 0
    determinant = w_nn * w_tt - w_nt * w_nt
    stick_n = (w_nt * v_t - w_tt * v_n) / determinant  # (C3): the impulse that stops the contact point
    stick_t = (w_nt * v_n - w_nn * v_t) / determinant
    gain_n = stick_n - frictionless
    bounce = (1.0 + restitution) * frictionless
    sticks = absolute(stick_t) <= friction * (bounce + gain_n)
    room = where(sticks, 1.0 + 0.0 * stick_t, absolute(stick_t) - friction * gain_n)
    share = where(sticks, 1.0 + 0.0 * stick_t, friction * bounce / maximum(room, 1e-300))  # (C4)
    hits = v_n < 0.0
    j_n = where(hits, bounce + share * gain_n, 0.0 * v_n)
    j_t = where(hits, share * stick_t, 0.0 * v_n)
    after = (
        v[0] + m_n[0] * j_n + m_t[0] * j_t,
        v[1] + m_n[1] * j_n + m_t[1] * j_t,
        v[2] + m_n[2] * j_n + m_t[2] * j_t,
    )
    return j_n, j_t, after
