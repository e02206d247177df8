"""Following a path at one's own pace, on generic scalars: where the robot is on it, and what its progress is worth.

A row of a course, see `caster_gym.paths.course`, is (x, y, t_x, t_y, κ, cos ψ, sin ψ, ψ′, ψ″, ṡ²) at an arc length;
between two rows the point is Hermite's cubic, everything else is linear.
"""

from typing import NamedTuple, TypeAlias

from caster_gym.envs.tracking import (
    Errors,
    Record,
    Reference,
    both_kernels,
    distance_square,
    impact_share,
    kernel,
    turn_square,
)
from caster_gym.mechanics.scalars import Scalar, clip, each, maximum, sqrt, where

Row: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]

NEWTON_STEPS = 3  # of the projection, from the nearest chord


class FollowWeights(NamedTuple):
    """What following is worth, and when it has failed."""

    progress: Scalar  # [1] reward for going as fast as allowed, wherever
    cross_track: Scalar  # for doing so on the path
    heading: Scalar  # and turned as the path asks
    effort: Scalar
    impact: Scalar
    cross_track_scale: Scalar  # ℓ [m] the error at which half of the fine kernel is left
    heading_scale: Scalar  # [rad]
    impact_scale: Scalar  # [N s] normal impulse in a control period that costs half of the weight
    coarse: Scalar  # ratio of the wide kernel's length to the fine one's
    corridor: Scalar  # [m] position error that ends the episode
    touching_ends: Scalar  # 1 if touching an obstacle ends the episode, else 0


class FollowTerms(NamedTuple):
    """Reward terms; the reward is their sum."""

    progress: Scalar
    cross_track: Scalar
    heading: Scalar
    effort: Scalar
    impact: Scalar
    alive: Scalar


def blend(share: Scalar, a: Scalar, b: Scalar) -> tuple[Scalar]:
    """a + share · (b − a)."""
    return (a + share * (b - a),)


def point_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Point of the path between two rows. [m]"""
    u, w = share, 1.0 - share
    first, last = w * w * (1.0 + 2.0 * u), u * u * (1.0 + 2.0 * w)
    along, back = spacing * u * w * w, -spacing * u * u * w
    return (
        first * a[0] + last * b[0] + along * a[2] + back * b[2],
        first * a[1] + last * b[1] + along * a[3] + back * b[3],
    )


def slope_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Derivative of that point by the share. [m]"""
    u, w = share, 1.0 - share
    along, back = spacing * w * (1.0 - 3.0 * u), spacing * u * (3.0 * u - 2.0)
    return (
        6.0 * u * w * (b[0] - a[0]) + along * a[2] + back * b[2],
        6.0 * u * w * (b[1] - a[1]) + along * a[3] + back * b[3],
    )


def bend_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Second derivative of that point by the share. [m]"""
    u = share
    along, back = spacing * (6.0 * u - 4.0), spacing * (6.0 * u - 2.0)
    return (
        (6.0 - 12.0 * u) * (b[0] - a[0]) + along * a[2] + back * b[2],
        (6.0 - 12.0 * u) * (b[1] - a[1]) + along * a[3] + back * b[3],
    )


def nearest_share(a: Row, b: Row, share: Scalar, spacing: Scalar, x: Scalar, y: Scalar) -> Scalar:
    """Share of the way from row a to row b where the path is nearest to (x, y), from a first guess; 0 … 1."""
    for _ in range(NEWTON_STEPS):
        px, py = point_between(a, b, share, spacing)
        tx, ty = slope_between(a, b, share, spacing)
        bx, by = bend_between(a, b, share, spacing)
        off = (px - x) * tx + (py - y) * ty
        square = tx * tx + ty * ty
        rise = maximum(square + (px - x) * bx + (py - y) * by, 0.1 * square)
        share = clip(share - off / rise, 0.0, 1.0)
    return share


def law_speed(square: Scalar) -> Scalar:
    """Speed of the time law. [m/s]"""
    return sqrt(maximum(square, 0.0))


def course_reference(a: Row, b: Row, share: Scalar, spacing: Scalar) -> Reference:
    """What a course asks between two rows, at its time law, whose acceleration along the path is constant there."""
    x, y = point_between(a, b, share, spacing)
    tx, ty = slope_between(a, b, share, spacing)
    (curvature,), (c,), (s,), (bend,), (bend_slope,), (square,) = each(blend, (share,), a[4:], b[4:])
    length, turned = sqrt(tx * tx + ty * ty), sqrt(c * c + s * s)
    tx, ty, c, s = tx / length, ty / length, c / turned, s / turned
    v = law_speed(square)
    along = 0.5 * (b[9] - a[9]) / spacing
    across = curvature * v * v
    return Reference(
        x,
        y,
        c,
        s,
        v * tx,
        v * ty,
        v * bend,
        along * tx - across * ty,
        along * ty + across * tx,
        along * bend + v * v * bend_slope,
    )


def at_rest(reference: Reference) -> Reference:
    """The same place without motion."""
    none = 0.0 * reference.x
    return Reference(reference.x, reference.y, reference.cos, reference.sin, none, none, none, none, none, none)


def follow_terms(
    errors: Errors, share: Scalar, effort: Scalar, record: Record, failed: Scalar, weights: FollowWeights
) -> FollowTerms:
    """Progress times quality minus effort and impacts, never negative in sum: staying in the task beats leaving it.

    Quality counts only as far as there is progress, so that resting on the path earns nothing but `alive`, which equals
    the greatest cost.
    """
    wide = weights.coarse
    near = both_kernels(distance_square(errors), weights.cross_track_scale, wide)
    turned = both_kernels(turn_square(errors), weights.heading_scale, wide)
    alive = where(failed > 0.5, 0.0, 1.0)
    return FollowTerms(
        where(failed > 0.5, 0.0, weights.progress * share),
        where(failed > 0.5, 0.0, weights.cross_track * share * near),
        where(failed > 0.5, 0.0, weights.heading * share * turned),
        where(failed > 0.5, 0.0, -weights.effort * effort),
        where(failed > 0.5, 0.0, -weights.impact * impact_share(record.pressing, weights.impact_scale)),
        (weights.effort + weights.impact) * alive,
    )


def arrived_share(x: Scalar, y: Scalar, last: Row, scale: Scalar) -> Scalar:
    """What counts as progress at the end of the path: 1 on its last point."""
    ahead, left = last[0] - x, last[1] - y
    return kernel(ahead * ahead + left * left, scale)
