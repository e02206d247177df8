"""Outlines of convex shapes, by faces and corners, and checks that a shape is convex."""

from cmath import isfinite
from itertools import combinations
from math import atan2, hypot, pi
from typing import NamedTuple, TypeAlias

import numpy as np

Corners: TypeAlias = tuple[tuple[float, float], ...]

LEAST_EDGE = 1e-6  # [m] of corners that count as different
_LEAST_TURN = 1e-9  # [rad] at a corner
_SLACK = 1e-9  # [-] of unit normals, and of corners on faces as a share of their coordinates: rounding and more


class OutlineError(ValueError):
    """Corners that are no convex shape; the message goes on after "its outline"."""


class Outline(NamedTuple):
    """One shape, as `caster_gym.mechanics.separation` measures gaps to it."""

    faces: tuple[tuple[float, float, float], ...]  # outward normal n_x, n_y and its offset: n · p = offset on the face
    corners: Corners  # [m]
    radius: float  # [m]

    @property
    def reach(self) -> float:
        """Distance of the farthest point from the origin. [m]"""
        return float(np.hypot(*np.asarray(self.corners).T).max()) + self.radius


def convex(corners: Corners) -> Outline:
    """A convex polygon listed counter-clockwise, or a line of two corners, which has a face on either side.

    Raises OutlineError that says which corner is wrong, and how. Anything rounder is a polygon with a radius:
    `convex(corners)._replace(radius=0.1)`.
    """
    if len(corners) < 2:
        raise OutlineError(f"must have two corners or more, got {len(corners)}")
    if fault := polygon_fault(corners):
        raise OutlineError(f"has corners that {fault}")
    faces = []
    for (x, y), (next_x, next_y) in zip(corners, corners[1:] + corners[:1], strict=True):
        length = hypot(next_x - x, next_y - y)
        nx, ny = (next_y - y) / length, (x - next_x) / length
        faces.append((nx, ny, nx * x + ny * y))
    return Outline(tuple(faces), corners, 0.0)


def outline_fault(outline: object) -> str | None:
    """Why this is not the outline of a convex shape, as far as it can be seen; None if it is."""
    if not isinstance(outline, Outline):
        return f"must be an Outline, as convex((corner, corner, …)) gives, got {outline!r}"
    try:
        faces = np.array(outline.faces, dtype=np.float64).reshape(len(outline.faces), 3)
        corners = np.array(outline.corners, dtype=np.float64).reshape(len(outline.corners), 2)
        radius = float(outline.radius)
    except (TypeError, ValueError):
        return f"must have faces (n_x, n_y, offset), corners (x, y) and a radius, got {outline!r}"
    if not (np.isfinite(faces).all() and np.isfinite(corners).all() and 0.0 <= radius < np.inf):
        return f"must have finite numbers and no negative radius, got {outline!r}"
    if not len(faces) + len(corners):
        return "must have a face or a corner, got neither"
    if (abs(np.hypot(*faces[:, :2].T) - 1.0) > _SLACK).any():
        return f"must have normals of unit length, got the faces {outline.faces}"
    ahead = corners @ faces[:, :2].T - faces[:, 2]  # [m] (corner, face)
    if (ahead > LEAST_EDGE + _SLACK * abs(corners).max(initial=0.0)).any():
        corner, face = np.unravel_index(ahead.argmax(), ahead.shape)
        return (
            f"must have all corners behind all faces, but corner {corner + 1} lies {ahead.max():.4g} m in front of "
            f"face {face + 1}"
        )
    return None


def polygon_fault(corners: Corners) -> str | None:
    """Why these are not the corners of a convex polygon in counter-clockwise order, and where; None if they are.

    Two corners are a polygon with two edges on the same line.
    """
    points = [complex(*corner) for corner in corners]
    if not all(map(isfinite, points)):
        i = next(i for i, point in enumerate(points) if not isfinite(point))
        return f"must be finite numbers, got {_corner(i, points)}"
    count = len(points)
    edges = [points[(i + 1) % count] - points[i] for i in range(count)]
    for i, edge in enumerate(edges):
        if abs(edge) < LEAST_EDGE:
            return f"must all differ, but {_corner(i, points)} is the same as corner {(i + 1) % count + 1}"
    if count == 2:
        return None
    turns = [_angle(edges[i - 1], edges[i]) for i in range(count)]
    if min(turns) > _LEAST_TURN and abs(sum(turns) - 2.0 * pi) < 1e-6:
        return None
    for i, j in combinations(range(count), 2):
        if (crossing := _crossing(points[i], edges[i], points[j], edges[j])) is not None:
            return (
                f"must not cross itself, but its edges from corner {i + 1} and from corner {j + 1} "
                f"cross at ({crossing.real:.4g}, {crossing.imag:.4g}) m"
            )
    if sum(turns) < 0.0:
        return "must be listed counter-clockwise, these run clockwise"
    i = min(range(count), key=lambda k: turns[k])
    if turns[i] < -_LEAST_TURN:
        return f"must be convex, but it bends inwards at {_corner(i, points)}; make two polygons of it"
    return f"must turn at every corner, but it runs straight on at {_corner(i, points)}; leave that one out"


def _angle(a: complex, b: complex) -> float:
    """Angle from a to b. [rad]"""
    turned = a.conjugate() * b
    return atan2(turned.imag, turned.real)


def _crossing(p: complex, along_p: complex, q: complex, along_q: complex) -> complex | None:
    """Where the segments p + t along_p and q + u along_q cross between their ends, if they do."""
    across = (along_p.conjugate() * along_q).imag
    if across == 0.0:
        return None
    t = ((q - p).conjugate() * along_q).imag / across
    u = ((q - p).conjugate() * along_p).imag / across
    inside = all(1e-9 < share < 1.0 - 1e-9 for share in (t, u))
    return p + t * along_p if inside else None


def _corner(i: int, points: list[complex]) -> str:
    return f"corner {i + 1} at ({points[i].real:.4g}, {points[i].imag:.4g}) m"
