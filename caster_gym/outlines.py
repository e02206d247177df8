"""Outlines of convex shapes: their faces and corners, and what is wrong with one that is not convex."""

from itertools import combinations
from math import atan2, hypot, pi
from typing import NamedTuple, TypeAlias

import numpy as np

Corners: TypeAlias = tuple[tuple[float, float], ...]

_LEAST_TURN = 1e-9  # [rad] at a corner


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
    """A convex polygon listed counter-clockwise, or a line of two corners, which has a face on either side."""
    faces = []
    for (x, y), (next_x, next_y) in zip(corners, corners[1:] + corners[:1], strict=True):
        length = hypot(next_x - x, next_y - y)
        nx, ny = (next_y - y) / length, (x - next_x) / length
        faces.append((nx, ny, nx * x + ny * y))
    return Outline(tuple(faces), corners, 0.0)


def polygon_fault(corners: Corners) -> str | None:
    """Why these are not the corners of a convex polygon in counter-clockwise order, and where; None if they are."""
    points = [complex(*corner) for corner in corners]
    count = len(points)
    edges = [points[(i + 1) % count] - points[i] for i in range(count)]
    for i, edge in enumerate(edges):
        if abs(edge) < 1e-6:
            return f"must all differ, but {_corner(i, points)} is the same as corner {(i + 1) % count + 1}"
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
