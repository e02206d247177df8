"""The legs of a path through waypoints, as functions of progress 0 … 1."""

from typing import Any

import numpy as np

from caster_gym.arrays import Array
from caster_gym.paths.headings import Slopes
from caster_gym.paths.waypoints import Leg

_MEANS_ERR = 1.3  # [-] mean square error of a mean of n neighbours, as a multiple of 1 / n; found by trial
MOST_ROUNDED = 3.0  # [-] of the tolerance: rounded points lie nowhere farther from a curve than 1.4 steps


class Walk:
    """The curve and the headings of a leg, through its places or, if there is a tolerance, beside them.

    tolerance [m] and heading_tolerance [rad]: root mean square distance; most [m]: the greatest one.
    """

    def __init__(self, leg: Leg, tolerance: float, most: float, heading_tolerance: float) -> None:
        self._leg = leg
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(leg.points, axis=0).T))])
        angles = np.zeros(len(leg.points)) if leg.headings is None else leg.headings
        turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angles)))])
        self.way, self.turning = float(lengths[-1]), float(turned[-1])  # [m], [rad]
        # None: through the places, also where nothing smooth is as near to them as the tolerance
        # a turn on the spot has its stations by its angles
        self._smooth: Any = None
        self._smooth_headings: Any = None
        self._stations = lengths / self.way if self.way > 0.0 else turned / max(self.turning, 1e-300)
        if self.way > 0.0 and tolerance > 0.0 and len(leg.points) > 2:
            from caster_gym.paths.smoothing import fit_smoothing_curve  # SciPy takes a while to import

            # a mean of many waypoints errs less than each of them; not by the root of their number, as they are related
            error = tolerance * float(min(1.0, _MEANS_ERR * len(leg.weights) / leg.weights.sum())) ** 0.5
            self._smooth, self._stations = fit_smoothing_curve(leg.points, leg.weights, error, leg.closed, most)
        apart = np.concatenate([[True], np.diff(self._stations) > 0.0])
        self._at, self._angles = self._stations[apart], angles[apart]
        self._whole = self._angles[-1] - self._angles[0] if leg.closed else 0.0  # [rad] a lap, spread evenly
        self._rest = self._angles - self._whole * self._at  # periodic if the leg is closed
        if self.turning > 0.0 and heading_tolerance > 0.0 and len(self._at) > 2:
            from caster_gym.paths.smoothing import fit_smoothing_spline  # SciPy takes a while to import

            weights = leg.weights[apart]
            self._smooth_headings = fit_smoothing_spline(
                self._rest[:, None], self._at, weights, heading_tolerance, leg.closed
            )

    def curve(self, u: Array) -> Slopes:
        """p [m] and its first three derivatives at u; a closed leg goes on after 1."""
        if self.way == 0.0:
            still = np.zeros(len(u), dtype=np.complex128)
            return still + complex(*self._leg.points[0]), still, still, still
        if self._smooth is not None:
            x, y = _along(self._smooth, np.mod(u, 1.0) if self._leg.closed else u)
        else:
            x, y = (self._through(self._stations, column, u) for column in self._leg.points.T)
        a, b, c, d = (x[n] + 1j * y[n] for n in range(4))
        return a, b, c, d

    def turn(self, u: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """Heading [rad] and its first two derivatives by u."""
        if self.turning == 0.0:
            return np.full_like(u, self._angles[0]), np.zeros_like(u), np.zeros_like(u)
        if self._smooth_headings is not None:
            (turned,) = _along(self._smooth_headings, np.mod(u, 1.0) if self._leg.closed else u)
        else:
            turned = self._through(self._at, self._rest, u)
        return turned[0] + self._whole * u, turned[1] + self._whole, turned[2]

    def _through(self, at: Array, values: Array, u: Array) -> Array:
        from caster_gym.paths.interpolation import closed_spline, open_spline  # SciPy takes a while to import

        return (closed_spline if self._leg.closed else open_spline)(at, values, u)


def _along(spline: Any, u: Array) -> Array:
    """Values and first three derivatives (d, 4, K) of a spline with d components."""
    return np.stack([spline(u, order).T for order in range(4)], axis=1)
