"""The part of the world that a picture shows: metres to pixels and back.

Pixel coordinates are continuous, x to the right and y down: pixel (i, j) covers [i, i + 1) × [j, j + 1).
World coordinates are in W, y up.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.envs.scene import Scene

NEAR = 0.25  # of what is shown anyway: half-planes not farther off than that are shown too
BEHIND = 0.04  # how much of them is


class Area(NamedTuple):
    """A rectangle of a frame. [px]"""

    left: float
    top: float
    width: float
    height: float

    @property
    def centre(self) -> tuple[float, float]:
        """Its middle. [px]"""
        return self.left + 0.5 * self.width, self.top + 0.5 * self.height

    @property
    def corners(self) -> Array:
        """The four of them (4, 2), clockwise as one sees them. [px]"""
        right, bottom = self.left + self.width, self.top + self.height
        return np.array([(self.left, self.top), (right, self.top), (right, bottom), (self.left, bottom)])

    def inset(self, margin: float) -> "Area":
        """The same without a margin on each side, as long as something is left of it."""
        dx, dy = min(margin, 0.45 * self.width), min(margin, 0.45 * self.height)
        return Area(self.left + dx, self.top + dy, self.width - 2.0 * dx, self.height - 2.0 * dy)


@dataclass(frozen=True)
class View:
    """A part of the floor, shown in an area of a frame at one scale."""

    area: Area
    x: float  # [m] world point in the middle of the area
    y: float
    scale: float  # [px/m]

    def pixels(self, points: ArrayLike) -> Array:
        """Pixel coordinates (..., 2) of world points (..., 2)."""
        column, row = self.area.centre
        return (np.asarray(points, dtype=np.float64) - (self.x, self.y)) * (self.scale, -self.scale) + (column, row)

    def metres(self, pixels: ArrayLike) -> Array:
        """World points (..., 2) at pixel coordinates (..., 2)."""
        column, row = self.area.centre
        return (np.asarray(pixels, dtype=np.float64) - (column, row)) / (self.scale, -self.scale) + (self.x, self.y)

    def in_area(self, area: Area) -> "View":
        """The same place and scale in another area."""
        return View(area, self.x, self.y, self.scale)


def fit_view(low: ArrayLike, high: ArrayLike, area: Area) -> View:
    """The view that shows the world between two corners as large as the area allows."""
    first, last = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    size = np.maximum(last - first, 1e-6)
    scale = float(min(area.width / size[0], area.height / size[1]))
    x, y = 0.5 * (first + last)
    return View(area, float(x), float(y), scale)


def view_around(centre: ArrayLike, across: float, area: Area) -> View:
    """The view that shows `across` metres around a world point along the area's shorter side."""
    middle = np.asarray(centre, dtype=np.float64)
    return fit_view(middle - 0.5 * across, middle + 0.5 * across, area)


def extent(scene: Scene) -> tuple[Array, Array]:
    """Lower and upper corner of what a picture of the whole scene should show. [m]

    That is the path, as much of its corridor as helps to see it, all obstacles that end somewhere, and the edges of
    half-planes that are near to all this.
    """
    size = scene.robot.reach
    low, high = scene.path.min(axis=0), scene.path.max(axis=0)
    margin = max(1.2 * size, min(scene.corridor, 0.15 * float((high - low).max()) + 2.0 * size))
    low, high = low - margin, high + margin
    obstacles = scene.obstacles
    for radius, (_, _, first, end) in zip(obstacles.radii, obstacles.spans, strict=True):
        corners = obstacles.corners[first:end]
        if len(corners):
            low = np.minimum(low, corners.min(axis=0) - radius)
            high = np.maximum(high, corners.max(axis=0) + radius)
    across = float((high - low).max())
    for face, _, first, end in obstacles.spans:
        if first == end:
            normal, offset = obstacles.faces[face, :2], obstacles.faces[face, 2]
            nearest = np.where(normal > 0.0, low, high)
            gap = float(normal @ nearest - offset)
            if gap < NEAR * across:
                edge = nearest - max(gap + BEHIND * across, 0.0) * normal
                low, high = np.minimum(low, edge), np.maximum(high, edge)
    return low, high


def grid(count: int, area: Area) -> list[Area]:
    """Areas of equal size for `count` pictures, row by row, as large as they can be."""

    def shorter_side_and_waste(columns: int) -> tuple[float, int]:
        rows = -(-count // columns)
        return round(min(area.width / columns, area.height / rows), 6), -columns * rows

    columns = max(range(1, count + 1), key=shorter_side_and_waste)
    width, height = area.width / columns, area.height / -(-count // columns)
    return [
        Area(area.left + (i % columns) * width, area.top + (i // columns) * height, width, height) for i in range(count)
    ]


def round_length(longest: float) -> float:
    """The greatest of 1, 2, 5 times a power of ten that is not above the given one."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest * (1.0 + 1e-9))
