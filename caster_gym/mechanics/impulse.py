"""Impulses of one contact, the wheels' inertia included. Derivation: docs/equations.md, section C.

The wheels keep rolling without slip through the impact, so the full M(δ) answers to the impulse and the robot is
heavier along its wheels than across them. What answers is an argument, though: any symmetric positive definite matrix.
Friction: W. J. Stronge, Impact Mechanics (Cambridge University Press, 2000); or A. Chatterjee and A. Ruina, J. Applied
Mechanics 65 (1998) 939.
"""

from typing import Literal, NamedTuple, TypeAlias

from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.scalars import Scalar, Symmetric, Vector, absolute, clip, maximum, sqrt, where

ImpactLaw: TypeAlias = Literal["stronge", "chatterjee_ruina"]

LAWS: dict[ImpactLaw, float] = {"stronge": 0.0, "chatterjee_ruina": 1.0}  # by which number the equations know them
_TINY = 1e-30  # far below every number that is divided by or whose root is taken, and not zero in single precision


class Mobility(NamedTuple):
    """W: velocities of a contact point along normal and tangent per unit of impulse. [1/kg]"""

    nn: Scalar
    nt: Scalar
    tt: Scalar


def contact_rows(point: tuple[Scalar, Scalar], normal: tuple[Scalar, Scalar]) -> tuple[Vector, Vector]:
    """N and T: velocities along normal and tangent, the normal turned by +90°, of a point in B from the twist."""
    px, py = point
    nx, ny = normal
    return (nx, ny, px * ny - py * nx), (-ny, nx, px * nx + py * ny)


def add_impulses(v: Vector, j_n: Scalar, m_n: Vector, j_t: Scalar, m_t: Vector) -> Vector:
    """Twist after impulses along normal and tangent; m_n, m_t: what a unit of each changes it by."""
    return (
        v[0] + m_n[0] * j_n + m_t[0] * j_t,
        v[1] + m_n[1] * j_n + m_t[1] * j_t,
        v[2] + m_n[2] * j_n + m_t[2] * j_t,
    )


def stronge(v_n: Scalar, v_t: Scalar, w: Mobility, restitution: Scalar, friction: Scalar) -> tuple[Scalar, Scalar]:
    """Normal and tangential impulse that end a contact which approaches at v_n < 0 and slides at v_t. [N s]

    Integrated along the normal impulse: sliding until v_t = 0 (the bend), then sticking or sliding the other way.
    """
    side = where(v_t < 0.0, -1.0 + 0.0 * v_t, 1.0 + 0.0 * v_t)
    sliding_n = w.nn - friction * side * w.nt  # (C3)
    braking = friction * w.tt - side * w.nt
    held = clip(-w.nt / w.tt, -friction, friction)  # (C4)
    held_n = w.nn + held * w.nt
    straight = (braking <= 0.0) | (friction <= 0.0)  # sliding never ends, or does not matter
    bend = where(straight, 0.0 * v_t, absolute(v_t) / where(straight, 1.0 + 0.0 * v_t, braking))
    at_bend = v_n + sliding_n * bend
    slides = straight | ((sliding_n > 0.0) & (-(1.0 + restitution) * v_n <= sliding_n * bend))
    after_compression = (at_bend >= 0.0) & (sliding_n > 0.0)  # whether the bend comes in restitution
    slope = where((slides & (sliding_n > 0.0)) | after_compression, sliding_n, held_n)
    left = at_bend * at_bend + held_n / slope * (restitution * restitution * v_n * v_n - at_bend * at_bend)  # (C5)
    work = at_bend * at_bend - held_n * (v_n + at_bend) * bend  # (C6)
    bounce = where(after_compression, sqrt(maximum(left, _TINY)), restitution * sqrt(maximum(work, _TINY)))
    rest = (bounce - at_bend) / held_n
    along = where(slides, -(1.0 + restitution) * v_n / slope, bend + rest)
    across = where(slides, -friction * side * along, held * rest - friction * side * bend)
    return along, across


def chatterjee_ruina(
    v_n: Scalar, v_t: Scalar, w: Mobility, restitution: Scalar, friction: Scalar
) -> tuple[Scalar, Scalar]:
    """The same by an algebraic law with Newton's restitution. [N s]"""
    frictionless = -v_n / w.nn  # (C1) with e = 0
    determinant = w.nn * w.tt - w.nt * w.nt
    stick_n = (w.nt * v_t - w.tt * v_n) / determinant  # (C7): the impulse that stops the contact point
    stick_t = (w.nt * v_n - w.nn * v_t) / determinant
    gain_n = stick_n - frictionless
    bounce = (1.0 + restitution) * frictionless
    sticks = absolute(stick_t) <= friction * (bounce + gain_n)
    room = where(sticks, 1.0 + 0.0 * stick_t, absolute(stick_t) - friction * gain_n)
    share = where(sticks, 1.0 + 0.0 * stick_t, friction * bounce / maximum(room, _TINY))  # (C8)
    return bounce + share * gain_n, share * stick_t


def impact(
    v_n: Scalar, v_t: Scalar, w: Mobility, restitution: Scalar, friction: Scalar, law: float
) -> tuple[Scalar, Scalar]:
    """Normal and tangential impulse of a contact [N s]; none where it does not approach. law: one of LAWS."""
    by_stronge = stronge(v_n, v_t, w, restitution, friction)
    algebraic = chatterjee_ruina(v_n, v_t, w, restitution, friction)
    hits = v_n < 0.0
    along = where(law > 0.5, algebraic[0], by_stronge[0])
    across = where(law > 0.5, algebraic[1], by_stronge[1])
    return where(hits, along, 0.0 * v_n), where(hits, across, 0.0 * v_n)


def collide(
    v: Vector,
    m: Symmetric,
    point: tuple[Scalar, Scalar],
    normal: tuple[Scalar, Scalar],
    restitution: Scalar,
    friction: Scalar,
    law: float,
) -> tuple[Scalar, Scalar, Vector]:
    """Normal and tangential impulse [N s] and the twist after an impact; nothing happens to a contact that separates.

    m: what answers to impulses at C, in B; the inertia M(δ) of a robot whose wheels roll without slip. point [m] and
    unit normal (from the obstacle into the robot) in B; the tangent is the normal turned by +90°.
    """
    n, t = contact_rows(point, normal)
    m_n, m_t = solve(m, n), solve(m, t)
    w = Mobility(dot(n, m_n), dot(n, m_t), dot(t, m_t))
    j_n, j_t = impact(dot(n, v), dot(t, v), w, restitution, friction, law)
    return j_n, j_t, add_impulses(v, j_n, m_n, j_t, m_t)
