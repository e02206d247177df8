"""Smoothing splines, which pass values within a tolerance.

Penalised splines: Eilers and Marx, "Flexible smoothing with B-splines and penalties", Statistical Science, 1996. Of all
quintic splines with knots at the values' places whose root mean square distance from the values is at most the
tolerance, the one with the least ∫ |p⁗|².
"""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.sparse.linalg import splu

from caster_gym.arrays import Array

_DEGREE = 5
_ORDER = 4  # of the derivative that the penalty is on
_FEWEST_PIECES, _MOST_PIECES = 12, 1500  # between knots: finer features than a path of so many has are noise
_LEAST_PIECE = 0.1  # [-] of the median distance between places: knots are no nearer to each other
# powers of 10: weights of the penalty beside that of the values. The curve is stiff over as many pieces as the eighth
# root of its weight. More than from _STIFF on is left to fewer pieces, as large weights drown in rounding
_WEAKEST, _STIFF, _STRONGEST = -9.0, 4.0, 9.0
_BISECTIONS = 16  # to 2e-4 of a power
_PASSES = 3  # of fits at the arc lengths of the fit before: chords between noisy points are too long, and unequal
_LONGEST = 1.5  # [-] of the way from point to point: a longer curve swings out between its knots, and is none
_LONGER = 1.02  # [-] of that way: a curve as long as that swings out between sparse points, with each pass farther
_FINE = 8  # samples for each piece, from which an arc length is summed


def fit_smoothing_spline(
    values: Array, at: Array, weights: Array, tolerance: float, closed: bool, most: float = np.inf
) -> Any:
    """The spline beside values (n, d) at ascending places (n,) 0 … 1 with weights (n,), in the units of the tolerance.

    most: greatest distance from any value. closed: periodic, the last value being the first again.
    """
    pieces = _FEWEST_PIECES
    while True:
        knots = _knots(at, pieces, closed)
        fit = _Fit(values, at, weights, knots, closed)
        if fit.is_near(fit.coefficients(_STIFF), tolerance, most):
            low, high = _STIFF, _STRONGEST
            break
        if pieces >= min(len(at), _MOST_PIECES):
            low, high = _WEAKEST, _STIFF
            break
        pieces *= 2
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        near = fit.is_near(fit.coefficients(middle), tolerance, most)
        low, high = (middle, high) if near else (low, middle)
    return BSpline(knots, fit.unwrapped @ fit.coefficients(low), _DEGREE)


class _Fit:
    """Least squares with a penalty, on given knots."""

    def __init__(self, values: Array, at: Array, weights: Array, knots: Array, closed: bool) -> None:
        inner = slice(0, -1) if closed else slice(None)
        self._values, self._weights = values[inner], weights[inner] / weights[inner].sum()
        basis = BSpline.design_matrix(np.clip(at[inner], 0.0, 1.0 - 1e-12), knots, _DEGREE)
        slope = _derivative(knots)
        count = len(knots) - _DEGREE - 1
        self.unwrapped = sparse.identity(count, format="csr")
        if closed:
            around = np.arange(count) % (count - _DEGREE)
            self.unwrapped = sparse.csr_matrix((np.ones(count), (np.arange(count), around)))
            slope = slope[:-1]  # the last one is the first again
        self._basis, slope = basis @ self.unwrapped, slope @ self.unwrapped
        self._normal = self._basis.T @ sparse.diags(self._weights) @ self._basis
        penalty = slope.T @ slope
        self._penalty = penalty * (self._normal.diagonal().mean() / np.median(penalty.diagonal()))
        self._right = self._basis.T @ (self._weights[:, None] * self._values)

    def coefficients(self, power: float) -> Array:
        """The best ones at a weight of the penalty, as a power of 10."""
        matrix = sparse.csc_matrix(self._normal + 10.0**power * self._penalty)
        return np.asarray(splu(matrix).solve(self._right), dtype=np.float64)

    def is_near(self, coefficients: Array, tolerance: float, most: float) -> bool:
        """Is the root mean square distance within a tolerance, and every distance at most another?"""
        square = ((self._values - self._basis @ coefficients) ** 2).sum(axis=1)
        return bool(self._weights @ square <= tolerance**2 and square.max() <= most**2)


def _knots(at: Array, pieces: int, closed: bool) -> Array:
    """Knots at some of the places (n,) 0 … 1, for so many pieces at most, and beyond both ends as a quintic needs."""
    least = max(_LEAST_PIECE * float(np.median(np.diff(at))), 1.0 / pieces)
    chosen = [0.0]
    for place in at[1:-1].tolist():
        if place - chosen[-1] >= least and 1.0 - place >= least:
            chosen.append(place)
    inner = np.array([*chosen, 1.0])
    while len(inner) <= _DEGREE:  # a closed spline needs as many pieces as its degree
        inner = np.sort(np.concatenate([inner, 0.5 * (inner[1:] + inner[:-1])]))
    if closed:
        return np.concatenate([inner[-_DEGREE - 1 : -1] - 1.0, inner, inner[1 : _DEGREE + 1] + 1.0])
    ahead = np.arange(1, _DEGREE + 1)
    return np.concatenate([-ahead[::-1] * inner[1], inner, 1.0 + ahead * (1.0 - inner[-2])])


def _derivative(knots: Array) -> Any:
    """Matrix from coefficients to those of the penalised derivative, times roots of the way that each stands for."""
    count = len(knots) - _DEGREE - 1
    matrix = sparse.identity(count, format="csr")
    for degree in range(_DEGREE, _DEGREE - _ORDER, -1):
        order = _DEGREE - degree + 1
        span = knots[order + degree : order + degree + count - order] - knots[order:count]
        matrix = sparse.diags(degree / span) @ (matrix[1:] - matrix[:-1])
    left = _DEGREE - _ORDER
    ways = knots[_ORDER + left + 1 : _ORDER + left + 1 + matrix.shape[0]] - knots[_ORDER : _ORDER + matrix.shape[0]]
    return sparse.csr_matrix(sparse.diags(np.sqrt(ways / (left + 1))) @ matrix)


def fit_smoothing_curve(
    points: Array, weights: Array, tolerance: float, closed: bool, most: float
) -> tuple[Any, Array]:
    """The spline beside points (n, 2), walked at an even pace over 0 … 1, and the places (n,) of the points on it.

    None instead of the spline where there is none so near to the points: noise that is larger than the tolerance leaves
    the coefficients undetermined, and the curve swings out between its knots.
    """
    chords = np.hypot(*np.diff(points, axis=0).T)
    by_chords = at = np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum()
    for fits in range(_PASSES + 1):
        spline = fit_smoothing_spline(points, at, weights, tolerance, closed, most)
        fine = np.linspace(0.0, 1.0, _FINE * len(spline.c) + 1)
        pace = np.hypot(*spline(fine, 1).T)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(fine))])
        if way[-1] > _LONGEST * chords.sum():
            return None, by_chords
        if fits == _PASSES or way[-1] > _LONGER * chords.sum():
            break
        at = np.interp(at, fine, way / way[-1])
    return spline, at
