"""The history of one robot that a viewer keeps: its trace, its errors, and its impacts."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.scene import Scene

IMPACT_LIFE = 0.6  # [s] for which an impact is shown


class Impact(NamedTuple):
    """An impact on the robot."""

    time: float  # [s]
    point: Array  # (2,) in W [m]
    impulse: Array  # (2,) in W [N s]


class History:
    """The past of one episode. It begins anew when time falls back or the path is another."""

    def __init__(self) -> None:
        self._rows = np.empty((256, 4))
        self._count = 0
        self._path: Array | None = None
        self.impacts: list[Impact] = []

    def add(self, scene: Scene) -> None:
        """Take in a scene; one at the same time as the last takes its place."""
        if self._count and (scene.time < self._rows[self._count - 1, 0] or not self._same_path(scene.path)):
            self._count = 0
            self.impacts = []
        self._path = scene.path
        if self._count and scene.time == self._rows[self._count - 1, 0]:
            self._count -= 1
            self.impacts = [impact for impact in self.impacts if impact.time < scene.time]
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        error = float(np.hypot(*(scene.reference[:2] - scene.pose[:2])))
        self._rows[self._count] = scene.time, *scene.pose[:2], error
        self._count += 1
        self.impacts = [impact for impact in self.impacts if scene.time - impact.time < IMPACT_LIFE]
        if np.isfinite(scene.impact_point).all() and scene.impulse.any():
            self.impacts.append(Impact(scene.time, scene.impact_point.copy(), scene.impulse.copy()))

    def _same_path(self, path: Array) -> bool:
        return self._path is path or (self._path is not None and np.array_equal(self._path, path))

    @property
    def times(self) -> Array:
        """Times of the scenes so far (n,). [s]"""
        return self._rows[: self._count, 0]

    @property
    def positions(self) -> Array:
        """Where C was (n, 2), in W. [m]"""
        return self._rows[: self._count, 1:3]

    @property
    def errors(self) -> Array:
        """Distances from the reference (n,). [m]"""
        return self._rows[: self._count, 3]
