"""Coulomb friction of the floor on all wheels at once, as impulses over a step. docs/equations.md, section S.

A wheel is held as long as its impulse stays within the limit that its load allows; else it slides against that limit.
Of all impulses within their limits these have the least ½ Pᵀ W P + uᵀ P: velocities are unique and no energy is gained.
A wheel answers to its own impulse by a 2×2 matrix and to the others through three numbers, the change of the twist. So
Newton's method is needed for those three alone, in a fixed number of rounds without branches.

    P        impulse of the floor on a wheel along f and f⊥                              [N s]
    rho      slip velocity for each unit of P of a wheel that slides; 0 if it is held    [1/kg]
"""

from typing import NamedTuple

from caster_gym.mechanics.linear import dot, factors, length, multiply, scale, scale_pair, shift, substitute, subtract
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Symmetric,
    Vector,
    add,
    clip,
    each,
    maximum,
    sqrt,
    total,
    where,
)

LEAST_FORCE = 1e-6  # [N] that holds a wheel without load: as good as nothing, and the inverse is still a number
NO_TIME = 1e-9  # [s] robots of a batch that have nothing left of their step stay where they are, with finite limits
TINY = 1e-30  # keeps a quotient of two numbers that vanish together a number


class Footing(NamedTuple):
    """How one wheel meets the floor: u = free + rows · change of the twist + mobility · P."""

    free: Direction  # [m/s] u without the floor while the twist stays
    rows: tuple[Vector, Vector]
    mobility: tuple[Scalar, Scalar, Scalar]  # K at (f, f), (f, f⊥), (f⊥, f⊥) [1/kg]


class Limit(NamedTuple):
    """How great a wheel's impulse may be."""

    most: Scalar  # [N s]
    inverse: Scalar


Problem = tuple[Symmetric, Vector, tuple[Footing, ...], tuple[Limit, ...]]
# inertia of the platform with casters that answer freely, its known impulse, and how all wheels meet the floor


class Grip(NamedTuple):
    """One wheel in a round of Newton's method."""

    impulse: Direction
    slide: Scalar  # rho
    stiffness: tuple[Scalar, Scalar, Scalar]  # −dP/du, in the order of K [kg]


def impulse_limit(time: Scalar, force: Scalar) -> Limit:
    """The limit as the solve takes it, for a force that the floor can hold over some seconds."""
    some = maximum(time, NO_TIME) * maximum(force, LEAST_FORCE + 0.0 * force)
    return Limit(some, 1.0 / some)


def slide_ratio(u: Direction, limit: Limit) -> Scalar:
    """rho of a wheel that slides on as it does."""
    return length(u) * limit.inverse


def unheld_velocity(change: Vector, footing: Footing) -> Direction:
    """u at a change of the twist, without an impulse of the floor on this wheel."""
    return footing.free[0] + dot(footing.rows[0], change), footing.free[1] + dot(footing.rows[1], change)


def grip(change: Vector, caution: Scalar, footing: Footing, limit: Limit, slide: Scalar) -> Grip:
    """Impulse of one wheel at a change of the twist, and how it answers to another one.

    caution: share of the stiffness at a fixed rho in that answer: 1 never overshoots, 0 is Newton's method.
    """
    wx, wy = unheld_velocity(change, footing)
    ff, fp, pp = footing.mobility
    a, c = ff + slide, pp + slide
    px, py = fp * wy - c * wx, fp * wx - a * wy  # P times the determinant: fewer quotients
    square = px * px + py * py
    answer = maximum(px * (c * px - fp * py) + py * (a * py - fp * px), TINY)
    rho = slide + square * (sqrt(square) * limit.inverse - (a * c - fp * fp)) / answer  # (S13)
    rho = maximum(rho, 0.0 * rho)
    a, c = ff + rho, pp + rho
    px, py = fp * wy - c * wx, fp * wx - a * wy
    scale = 1.0 / maximum(a * c - fp * fp, sqrt(px * px + py * py) * limit.inverse)  # (S12)
    across = (1.0 - caution) / maximum(a * py * py - 2.0 * fp * px * py + c * px * px, TINY)
    kept = caution * scale
    slides = rho > 0.0
    stiffness = (  # (S14)
        where(slides, py * py * across + c * kept, c * scale),
        where(slides, -px * py * across - fp * kept, -fp * scale),
        where(slides, px * px * across + a * kept, a * scale),
    )
    return Grip((px * scale, py * scale), rho, stiffness)


def floor_wrench(footing: Footing, wheel: Grip) -> Vector:
    """Impulse that the platform feels of one wheel's. [N s, N s, N m s]"""
    a, b = footing.rows
    p, q = wheel.impulse
    return a[0] * p + b[0] * q, a[1] * p + b[1] * q, a[2] * p + b[2] * q


def floor_stiffness(footing: Footing, wheel: Grip) -> Symmetric:
    """How the floor holds the platform by one wheel. [kg, kg m, kg m²]"""
    a, b = footing.rows
    xx, xy, yy = wheel.stiffness
    p = shift(xy, scale(xx, a), b)
    q = shift(yy, scale(xy, a), b)
    return (
        a[0] * p[0] + b[0] * q[0],
        a[0] * p[1] + b[0] * q[1],
        a[0] * p[2] + b[0] * q[2],
        a[1] * p[1] + b[1] * q[1],
        a[1] * p[2] + b[1] * q[2],
        a[2] * p[2] + b[2] * q[2],
    )


def slide_of(wheel: Grip) -> Scalar:
    """rho."""
    return wheel.slide


def used_share(wheel: Grip, limit: Limit) -> Scalar:
    """Share of the greatest impulse that a wheel takes. [-]"""
    p, q = wheel.impulse
    use = sqrt(p * p + q * q) * limit.inverse
    return clip(use, 0.0 * use, 1.0 + 0.0 * use)  # rounding may leave a little more than 1


def newton_round(
    change: Vector, caution: Scalar, problem: Problem, slides: tuple[Scalar, ...]
) -> tuple[Vector, tuple[Scalar, ...]]:
    """A better change of the twist, and rho of all wheels."""
    inertia, force, footings, limits = problem
    grips = each(grip, (change, caution), footings, limits, slides)
    pushed = add(force, total(each(floor_wrench, (), footings, grips)))
    held = add(inertia, total(each(floor_stiffness, (), footings, grips)))
    taken = multiply(inertia, change)
    left = subtract(pushed, taken)
    step = substitute(factors(held), left)
    return add(change, step), each(slide_of, (), grips)


def floor_answer(change: Vector, footing: Footing, wheel: Grip) -> Direction:
    """How u answers to all impulses: to a wheel's own, and to the change of the twist that all make. [m/s]"""
    ff, fp, pp = footing.mobility
    p, q = wheel.impulse
    return (
        dot(footing.rows[0], change) + ff * p + fp * q,
        dot(footing.rows[1], change) + fp * p + pp * q,
    )


def work_parts(wheel: Grip, before: Direction, answer: Direction) -> tuple[Scalar, Scalar]:
    """P · u without the impulses, and P · what they change it by. [J]"""
    p, q = wheel.impulse
    return p * before[0] + q * before[1], p * answer[0] + q * answer[1]


def lessen(share: Scalar, wheel: Grip) -> Grip:
    """A wheel with a share of its impulse."""
    return Grip(scale_pair(share, wheel.impulse), wheel.slide, wheel.stiffness)


def cut_impulses(change: Vector, problem: Problem, slides: tuple[Scalar, ...]) -> tuple[Vector, tuple[Grip, ...]]:
    """Impulses within their limits at a change of the twist that was found, and the change that they do make."""
    _, _, footings, limits = problem
    grips = each(grip, (change, 0.0), footings, limits, slides)
    return impulses_change(problem, grips), grips


def impulses_change(problem: Problem, grips: tuple[Grip, ...]) -> Vector:
    """Change of the twist that impulses make."""
    inertia, force, footings, _ = problem
    return substitute(factors(inertia), add(force, total(each(floor_wrench, (), footings, grips))))


def final_impulses(change: Vector, problem: Problem, slides: tuple[Scalar, ...]) -> tuple[Vector, tuple[Grip, ...]]:
    """The same; should the rounds not have sufficed, impulses are lessened until they add no energy."""
    inertia, force, footings, limits = problem
    grips = each(grip, (change, 0.0), footings, limits, slides)
    found = factors(inertia)
    alone = substitute(found, force)
    by_floor = substitute(found, total(each(floor_wrench, (), footings, grips)))
    before = each(unheld_velocity, (alone,), footings)
    gained, resisted = total(each(work_parts, (), grips, before, each(floor_answer, (by_floor,), footings, grips)))
    nothing = 0.0 * resisted
    share = clip(-gained / maximum(resisted, TINY + nothing), nothing, 1.0 + nothing)  # (S14)
    step = scale(share, by_floor)
    return add(alone, step), each(lessen, (share,), grips)
