"""A path that is followed at the robot's own pace, on generic scalars: its points, its nearest point, its reference.

Between two rows of a course, see `caster_gym.paths.course`, the point is Hermite's cubic, everything else is linear.
"""

from typing import Any, NamedTuple, TypeAlias

from caster_gym.envs.rows import numbered
from caster_gym.envs.tracking import Reference, kernel
from caster_gym.mechanics.scalars import Scalar, clip, maximum, minimum, sqrt, where


class Row(NamedTuple):
    """A row of a course, at an arc length."""

    x: Scalar  # [m]
    y: Scalar
    tx: Scalar  # unit tangent
    ty: Scalar
    curvature: Scalar  # [1/m] positive to the left
    cos: Scalar  # heading
    sin: Scalar
    bend: Scalar  # [rad/m] dψ/ds of the heading
    bend_slope: Scalar  # [rad/m²] d²ψ/ds²
    square_speed: Scalar  # [m²/s²] ṡ² of the time law


ROW = numbered(Row)

Point: TypeAlias = tuple[Scalar, Scalar]

NEWTON_STEPS = 3  # of the projection, from the nearest chord


def blend(share: Scalar, a: Scalar, b: Scalar) -> Scalar:
    """a + share · (b − a)."""
    return a + share * (b - a)


def point_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Point of the path between two rows. [m]"""
    u, w = share, 1.0 - share
    first, last = w * w * (1.0 + 2.0 * u), u * u * (1.0 + 2.0 * w)
    along, back = spacing * u * w * w, -spacing * u * u * w
    return (
        first * a.x + last * b.x + along * a.tx + back * b.tx,
        first * a.y + last * b.y + along * a.ty + back * b.ty,
    )


def slope_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Derivative of that point by the share. [m]"""
    u, w = share, 1.0 - share
    along, back = spacing * w * (1.0 - 3.0 * u), spacing * u * (3.0 * u - 2.0)
    return (
        6.0 * u * w * (b.x - a.x) + along * a.tx + back * b.tx,
        6.0 * u * w * (b.y - a.y) + along * a.ty + back * b.ty,
    )


def bend_between(a: Row, b: Row, share: Scalar, spacing: Scalar) -> tuple[Scalar, Scalar]:
    """Second derivative of that point by the share. [m]"""
    u = share
    along, back = spacing * (6.0 * u - 4.0), spacing * (6.0 * u - 2.0)
    return (
        (6.0 - 12.0 * u) * (b.x - a.x) + along * a.tx + back * b.tx,
        (6.0 - 12.0 * u) * (b.y - a.y) + along * a.ty + back * b.ty,
    )


def chord_share(a: Point, b: Point, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    """Share 0 … 1 of the chord from a to b at which it is nearest to (x, y), and the squared distance there. [m²]"""
    (ax, ay), (bx, by) = a, b
    bx, by, dx, dy = bx - ax, by - ay, x - ax, y - ay
    share = clip((dx * bx + dy * by) / (bx * bx + by * by), 0.0, 1.0)
    dx, dy = dx - share * bx, dy - share * by
    return share, dx * dx + dy * dy


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
    c, s = blend(share, a.cos, b.cos), blend(share, a.sin, b.sin)
    bend, bend_slope = blend(share, a.bend, b.bend), blend(share, a.bend_slope, b.bend_slope)
    length, turned = sqrt(tx * tx + ty * ty), sqrt(c * c + s * s)
    tx, ty, c, s = tx / length, ty / length, c / turned, s / turned
    v = law_speed(blend(share, a.square_speed, b.square_speed))
    along = 0.5 * (b.square_speed - a.square_speed) / spacing
    across = blend(share, a.curvature, b.curvature) * v * v
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


def arrived_share(x: Scalar, y: Scalar, last: Row, scale: Scalar) -> Scalar:
    """What counts as progress at the end of the path: 1 on its last point."""
    ahead, left = last.x - x, last.y - y
    return kernel(ahead * ahead + left * left, scale)


def progress_share(progress: Scalar, before: Scalar, length: Scalar, position: Point, last: Row, source: Any) -> Scalar:
    """Progress over that which a period allows; near the end of the path no less than what counts for staying there."""
    share = minimum((progress - maximum(before, 0.0)) / source.stride, 1.0)
    there = arrived_share(position[0], position[1], last, source.arrival_scale)
    return where(progress >= length - source.arrival, maximum(share, there), share)
