"""How far the robot is from an obstacle, in which direction, and where they touch. Derivation: docs/equations.md, O.

The gap between two convex shapes is their greatest separation along an axis that is a face normal of either, or, where
one of them is round, the line from a corner of one to a corner of the other; a disc is one corner with a radius. It is
their distance, except for two sharp corners before each other: then it is less, but of the same sign. Axes n are unit
vectors from the obstacle to the robot, in W.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics.scalars import Direction, Scalar, entry, maximum, minimum, sqrt, where

TOUCH = 2e-5  # [m] nearer than this counts as touching
_FAR = 1e9  # [m] beyond everything
_NOWHERE = 1e-12  # [m] two points that are nearer have no direction from one to the other


class Hull(NamedTuple):
    """The robot's outline in B: a convex polygon, or a disc about C, which is one corner with a radius."""

    faces: Any  # (E, 3) outward normal n_x, n_y and its offset: n · p = offset on the face
    corners: Any  # (M, 2) [m]
    radius: Any  # [m]
    reach: Any  # [m] greatest distance of its points from C


class Obstacles(NamedTuple):
    """Convex obstacles in W. Half-planes have a face and no corner, pillars a corner and no face."""

    faces: Any  # (F, 3) outward normal n_x, n_y and its offset: n · p = offset on the face
    corners: Any  # (V, 2) [m]
    radii: Any  # (K,) [m]
    spans: Any  # int64 (K, 4): first face and the end of the faces, first corner and the end of the corners
    restitution: Any  # [-] 0 … 1
    friction: Any  # [-] between robot and obstacles
    law: Any = 0.0  # of the impulse of a single contact, one of `impulse.LAWS`


class Surroundings(NamedTuple):
    """A robot's outline and what is in its way."""

    hull: Hull
    obstacles: Obstacles


class Separation(NamedTuple):
    """Gap between robot and obstacle, negative where they overlap, and the axis along which it is measured."""

    gap: Scalar  # [m]
    nx: Scalar  # of the unit axis, in W
    ny: Scalar


def lowest(nx_B: Scalar, ny_B: Scalar, hull: Hull) -> Scalar:
    """Least n · p of the hull's corners, n and p in B. [m]"""
    corners = hull.corners
    low = nx_B * entry(corners, 0, 0) + ny_B * entry(corners, 0, 1)
    for i in range(1, len(corners)):
        low = minimum(nx_B * entry(corners, i, 0) + ny_B * entry(corners, i, 1), low)
    return low


def highest(nx: Scalar, ny: Scalar, obstacles: Obstacles, k: Any) -> Scalar:
    """Greatest n · p of an obstacle's corners. [m]"""
    corners, first = obstacles.corners, entry(obstacles.spans, k, 2)
    high = nx * entry(corners, first, 0) + ny * entry(corners, first, 1)
    for j in range(first + 1, entry(obstacles.spans, k, 3)):
        high = maximum(nx * entry(corners, j, 0) + ny * entry(corners, j, 1), high)
    return high


def separation(
    position: tuple[Scalar, Scalar], heading: Direction, hull: Hull, obstacles: Obstacles, k: Any
) -> Separation:
    """Gap and axis between the robot and obstacle k."""
    x, y = position
    c, s = heading
    faces, corners, spans = obstacles.faces, obstacles.corners, obstacles.spans
    rounding = hull.radius + obstacles.radii[k]
    gap, nx, ny = 0.0 * x - _FAR, 0.0 * x + 1.0, 0.0 * x
    for i in range(entry(spans, k, 0), entry(spans, k, 1)):
        ax, ay = entry(faces, i, 0), entry(faces, i, 1)
        along = ax * x + ay * y + lowest(c * ax + s * ay, c * ay - s * ax, hull) - entry(faces, i, 2) - rounding  # (O1)
        wider = along > gap
        gap, nx, ny = where(wider, along, gap), where(wider, ax + 0.0 * x, nx), where(wider, ay + 0.0 * x, ny)
    if entry(spans, k, 3) > entry(spans, k, 2):
        for i in range(len(hull.faces)):
            ax, ay = (
                s * entry(hull.faces, i, 1) - c * entry(hull.faces, i, 0),
                -s * entry(hull.faces, i, 0) - c * entry(hull.faces, i, 1),
            )
            along = ax * x + ay * y - entry(hull.faces, i, 2) - highest(ax, ay, obstacles, k) - rounding  # (O2)
            wider = along > gap
            gap, nx, ny = where(wider, along, gap), where(wider, ax, nx), where(wider, ay, ny)
        if rounding > 0.0:
            for j in range(entry(spans, k, 2), entry(spans, k, 3)):
                for i in range(len(hull.corners)):
                    px, py = entry(hull.corners, i, 0), entry(hull.corners, i, 1)
                    wx, wy = x + c * px - s * py - entry(corners, j, 0), y + s * px + c * py - entry(corners, j, 1)
                    length = maximum(sqrt(wx * wx + wy * wy), _NOWHERE)
                    somewhere = length > _NOWHERE
                    ax, ay = where(somewhere, wx / length, 1.0 + 0.0 * wx), where(somewhere, wy / length, 0.0 * wy)
                    low = ax * x + ay * y + lowest(c * ax + s * ay, c * ay - s * ax, hull)
                    along = low - highest(ax, ay, obstacles, k) - rounding  # (O3)
                    wider = along > gap
                    gap, nx, ny = where(wider, along, gap), where(wider, ax, nx), where(wider, ay, ny)
    return Separation(gap, nx, ny)


def clearance(
    position: tuple[Scalar, Scalar], heading: Direction, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> Scalar:
    """Gap to the nearest of the obstacles first … end − 1. [m]"""
    nearest = 0.0 * position[0] + _FAR
    for k in range(first, end):
        nearest = minimum(separation(position, heading, hull, obstacles, k).gap, nearest)
    return nearest


def contact_points(
    position: tuple[Scalar, Scalar], heading: Direction, apart: Separation, hull: Hull, obstacles: Obstacles, k: Any
) -> tuple[tuple[Scalar, Scalar], tuple[Scalar, Scalar]]:
    """Both ends, in B, of the line along which robot and obstacle k touch; twice the same where it is a point.

    Each shape's corners that lie foremost along the axis span an interval across it; they touch where both overlap.
    """
    x, y = position
    c, s = heading
    nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
    low = lowest(nx, ny, hull)
    left, right = _FAR + 0.0 * x, -_FAR + 0.0 * x
    for i in range(len(hull.corners)):
        px, py = entry(hull.corners, i, 0), entry(hull.corners, i, 1)
        across = nx * py - ny * px
        foremost = nx * px + ny * py <= low + TOUCH
        left = where(foremost, minimum(across, left), left)
        right = where(foremost, maximum(across, right), right)
    first, end = entry(obstacles.spans, k, 2), entry(obstacles.spans, k, 3)
    if end > first:
        high = highest(apart.nx, apart.ny, obstacles, k)
        least, most = _FAR + 0.0 * x, -_FAR + 0.0 * x
        for j in range(first, end):
            qx, qy = entry(obstacles.corners, j, 0), entry(obstacles.corners, j, 1)
            across = apart.nx * (qy - y) - apart.ny * (qx - x)
            foremost = apart.nx * qx + apart.ny * qy >= high - TOUCH
            least = where(foremost, minimum(across, least), least)
            most = where(foremost, maximum(across, most), most)
        left, right = maximum(left, least), minimum(right, most)
    apart_across = left > right
    middle = 0.5 * (left + right)
    left, right = where(apart_across, middle, left), where(apart_across, middle, right)
    depth = low - hull.radius - 0.5 * apart.gap  # halfway between the surfaces
    return (depth * nx - left * ny, depth * ny + left * nx), (depth * nx - right * ny, depth * ny + right * nx)  # (O4)
