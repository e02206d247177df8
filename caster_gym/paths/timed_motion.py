"""Smooth motions through timed samples, without the accelerations that rounding and noise would cause.

The quintic smoothing spline: of all curves that are as near to the samples as their noise is large, the one with the
least ∫ |x‴|². Reinsch, "Smoothing by spline functions", Numerische Mathematik, 1967.

    σ      standard deviation of the samples' errors         [m] or [rad]
    h      median time between samples, the unit of time within this module
    λ      weight of ∫ |x‴|², found so that the residuals have the size σ
"""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array, diags_array

from caster_gym.arrays import Array

DENSE = 20  # samples, from which on a table is a record of a motion rather than a list of places
_MEDIAN = 0.6745  # [-] half of normal errors are below that share of σ
_SEEN = 0.2  # [-] of the rounding that the digits tell: what neighbours must miss each other by, if it is rounding
_SURER = 3.0  # [-] of σ by neighbours over that by digits, below which the digits are believed
_WHITE = 1.5  # [-] errors are noise if a cubic through neighbours misses by hardly more than a quintic
_GAIN = 4.0  # [-] of an interpolating spline: standard deviation of its acceleration over σ / h²
_LEAST = 0.02  # [m/s²] or [rad/s²] from noise that is left alone
_LIGHTEST, _HEAVIEST = -6.0, 7.0  # log10 λ: beyond, the equations lose their digits
_HALVINGS = 16
_FEWEST_SITES = 4
_DEGREE = 5


def noise_of(at: Array, values: Array) -> float:
    """σ of samples (K, M) at times (K,) [s], from the unit of their last digit and from what neighbours predict.

    0 where it does not matter: for few samples, and where it makes no accelerations worth speaking of.
    """
    if len(at) < DENSE:
        return 0.0
    near, far = _misses(at, values, 2), _misses(at, values, 3)
    typical = [float(np.median(miss, axis=0).max()) / _MEDIAN for miss in (near, far)]
    noise = typical[1] if typical[0] < _WHITE * typical[1] else 0.0
    rounding, seen = _rounding(values), far[far > 1e-9]
    if not len(seen) or float(np.sqrt(np.mean(seen**2))) < _SEEN * rounding:
        rounding = 0.0  # a smooth motion whose numbers happen to be round
    size = rounding if noise < _SURER * rounding else noise  # errors of rounding are no normal ones
    return size if _GAIN * size > _LEAST * float(np.median(np.diff(at))) ** 2 else 0.0


def _rounding(values: Array) -> float:
    """σ of numbers with few digits, in SI units or, of angles, in degrees."""
    for unit in (1e-2, np.radians(1.0), 1e-3, np.radians(0.1), np.radians(0.01), 1e-4, 1e-5, 1e-6):
        if np.allclose(values, np.round(values / unit) * unit, rtol=0.0, atol=1e-6 * unit):
            return float(unit / 12.0**0.5)
    return 0.0


def _misses(at: Array, values: Array, reach: int) -> Array:
    """How far samples are from the polynomials through as many neighbours on either side, over what σ = 1 gives."""
    around = [k for k in range(-reach, reach + 1) if k]
    times = [at[reach + k : len(at) - reach + k] for k in around]
    here = at[reach : len(at) - reach]
    weights = [
        np.prod([(here - other) / (own - other) for other in times if other is not own], axis=0) for own in times
    ]
    guessed = sum(
        weight[:, None] * values[reach + k : len(at) - reach + k] for weight, k in zip(weights, around, strict=True)
    )
    size = np.sqrt(1.0 + np.square(weights).sum(axis=0))
    return np.asarray(np.abs(values[reach : len(at) - reach] - guessed) / size[:, None], dtype=np.float64)


def smooth_motion(at: Array, values: Array, noise: float, times: Array) -> Array:
    """Value and first two derivatives (3, T, M) at times [s] of the curve that leaves residuals of σ = noise.

    Its knots are the samples, or every tenth or hundredth of them where the curve is to be much smoother.
    """
    thin = 1
    while True:
        unit = thin * float(np.median(np.diff(at)))
        u = (at - at[0]) / unit
        sites = np.append(u[:-1:thin], u[-1])
        knots = np.concatenate([np.full(_DEGREE, u[0]), sites, np.full(_DEGREE, u[-1])])
        basis = csr_array(BSpline.design_matrix(u, knots, _DEGREE))
        square, rough, right = _banded(basis.T @ basis), _banded(_roughness(knots, sites)), basis.T @ values
        low, high = _LIGHTEST, _HEAVIEST
        smoothest = solveh_banded(square + 10.0**high * rough, right)
        if _miss(basis @ smoothest, values) >= noise or len(sites) < 10 * _FEWEST_SITES:
            break
        thin *= 10
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        fitted = solveh_banded(square + 10.0**middle * rough, right)
        low, high = (middle, high) if _miss(basis @ fitted, values) < noise else (low, middle)
    spline = BSpline(knots, solveh_banded(square + 10.0**low * rough, right), _DEGREE)
    return np.stack([spline((times - at[0]) / unit, order) / unit**order for order in range(3)])


def _miss(fitted: Array, values: Array) -> float:
    return float(np.sqrt(np.mean((fitted - values) ** 2)))


def _roughness(knots: Array, u: Array) -> Any:
    """∫ B‴ B‴ of all pairs of splines: B‴ is a quadratic, so that three points of Gauss's rule are exact."""
    count, bend = len(knots) - _DEGREE - 1, None
    for degree in (5, 4, 3):
        ends = knots[5 - degree : len(knots) - (5 - degree)]
        scale = degree / (ends[degree + 1 : -1] - ends[1 : -degree - 1])
        step = diags_array([-scale, scale], offsets=[0, 1], shape=(count - 1, count))
        bend = step if bend is None else step @ bend
        count -= 1
    nodes, weights = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff(u)
    points = (u[:-1, None] + half[:, None] * (1.0 + nodes)).ravel()
    values = csr_array(BSpline.design_matrix(points, knots[3:-3], 2)) @ bend
    return values.T @ diags_array((half[:, None] * weights).ravel()) @ values


def _banded(matrix: Any) -> Array:
    """Upper diagonals of a symmetric matrix, as solveh_banded takes them."""
    rows = np.zeros((_DEGREE + 1, matrix.shape[0]))
    for k in range(_DEGREE + 1):
        diagonal = matrix.diagonal(k)
        rows[_DEGREE - k, k : k + len(diagonal)] = diagonal
    return rows


def motion_through(at: Array, values: Array, rests: bool, times: Array) -> Array:
    """Value and first two derivatives (3, T, M) at times of quintic splines through samples (K, M) at times `at`.

    Between equal samples it rests, and begins and ends to move there without a jolt. rests: so do both ends.
    """
    result = np.zeros((3, len(times), values.shape[1]))
    still = (np.diff(values, axis=0) == 0.0).all(axis=1)
    edges = [0, *(np.flatnonzero(np.diff(still)) + 1).tolist(), len(still)]
    for start, end in pairwise(edges):
        inside = (times >= at[start]) & ((times < at[end]) if end < len(still) else True)
        if still[start]:
            result[0, inside] = values[start]
            continue
        clamped = [(1, np.zeros(values.shape[1])), (2, np.zeros(values.shape[1]))]
        free = [(3, np.zeros(values.shape[1])), (4, np.zeros(values.shape[1]))]
        first = clamped if start > 0 or rests else free
        last = clamped if end < len(still) or rests else free
        if end - start == 1 and first is free and last is free:
            spline = make_interp_spline(at[[start, end]], values[[start, end]], k=1)
            parts = [spline(times[inside]), spline(times[inside], 1), 0.0]
        else:
            spline = make_interp_spline(at[start : end + 1], values[start : end + 1], k=5, bc_type=(first, last))
            parts = [spline(times[inside], order) for order in range(3)]
        for order, part in enumerate(parts):
            result[order, inside] = part
    return result
