"""What a robot sees that misjudges its place, its heading and its twist.

A heading that is wrong by ε turns everything that is seen of the reference by −ε, and an error of the twist shows in
the twist and, the other way round, in its error. Parts that are measured from the robot itself, such as obstacles, stay
as they are.
"""

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.observation import ObservationLayout


class Misjudged:
    """The parts of an observation that follow from pose and twist."""

    def __init__(self, layout: ObservationLayout) -> None:
        parts = {part.name: part for part in layout.parts}
        self._twist, self._error = parts["twist"], parts["twist_error"]
        previews = [name for name in parts if name.startswith("preview_")]
        self._points = [(parts[name].place.start, parts[name].scale[:2]) for name in ("position_error", *previews)]
        starts = {name: part.place.start for name, part in parts.items()}
        pairs = [starts["position_error"], starts["heading_error"], starts["reference_acceleration"]]
        self._pairs = np.array(pairs + [starts[name] + first for name in previews for first in (0, 2, 4)])

    def misjudge(self, shown: Array, errors: Array, turned: bool) -> None:
        """Put errors into observations (robots, size), in place.

        errors: measured minus true place and twist in B, as (robots, 6): x, y [m], heading [rad], vx, vy [m/s],
        ω [rad/s]. turned: whether any heading is wrong.
        """
        twist, error = self._twist.place, self._error.place
        ratio = self._twist.scale / self._error.scale
        reference = shown[:, error] + ratio * shown[:, twist]  # velocity of the reference, in units of the error
        for start, scale in self._points:
            shown[:, start : start + 2] -= errors[:, :2] / scale
        if turned:
            cos, sin = np.cos(errors[:, 2:3]), -np.sin(errors[:, 2:3])
            turn(shown, self._pairs, cos, sin)
            turn(reference, np.zeros(1, dtype=np.int64), cos, sin)
        shown[:, twist] += errors[:, 3:6] / self._twist.scale
        shown[:, error] = reference - ratio * shown[:, twist]


def turn(rows: np.ndarray, first: np.ndarray, cos: Array, sin: Array) -> None:
    """Turn the pairs that begin in some columns, in place, counter-clockwise."""
    x, y = rows[:, first], rows[:, first + 1]
    rows[:, first], rows[:, first + 1] = cos * x - sin * y, sin * x + cos * y
