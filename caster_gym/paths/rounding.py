"""Estimates how finely numbers were written down, from their digits and steps."""

from collections.abc import Sequence

import numpy as np

from caster_gym.arrays import Array

_FEWEST = 30  # fewer waypoints do not show that they were rounded: people type round numbers
_FINE = 0.01  # [-] of the extent: a coarser grid is not taken for rounding, unless neighbours fall together on it
_COARSE = 0.1  # [-] of the extent: nothing is told of a coarser grid
_TOGETHER = 0.1  # [-] share of rows that repeat the row before them, by which a coarse grid shows itself
_MATTERS = 0.1  # [-] of the extent: step · n² beyond, rounding changes the second derivative by about 2 %
_GRID_SLACK = 0.02  # [-] of a grid's step: numbers that miss it by more do not lie on it
_ALTERNATING = 0.6  # [-] share of turns that go to and fro, from which on they are noise
_FINEST_DIGIT = 9
_FINER = 0.3  # [-] of the median step by significant digits: a grid that is coarser explains the values as well
_FEWEST_DIGITS, _MOST_DIGITS = 3, 7  # significant ones of a number that was rounded to so many
_ROUNDED = 1.0 / 12.0**0.5  # root mean square error of numbers that were rounded to a step of 1
HEADING_UNITS = (1.0, np.pi / 180.0, np.pi / 32768.0)  # [rad] radians, degrees, ticks of encoders


def grid_step(values: Array, units: Sequence[float] = (1.0,)) -> float:
    """Step of the coarsest grid, decimal in one of the units, on which values (n,) lie from the first; 0 if on none."""
    away = values - values[0]
    if not away.any():
        return 0.0
    for unit in units:
        for digits in range(_FINEST_DIGIT + 1):
            scaled = away / unit * 10.0**digits
            whole = np.rint(scaled)
            if whole.any() and np.abs(scaled - whole).max() <= _GRID_SLACK and np.abs(whole).max() < 2**52:
                return float(np.gcd.reduce(whole.astype(np.int64))) / 10.0**digits * unit
    if np.array_equal(values, values.astype(np.float32)):
        return float(np.spacing(np.float32(np.abs(values).max())))
    return 0.0


def _digit_step(values: Array, grid: float) -> float:
    """Step of the grid on which values (n,) lie; of so many significant digits, if small values have finer ones.

    As those of "%.5g" do, which MATLAB and streams of C++ write unless told otherwise: then the root mean square.
    """
    size = np.abs(values[values != 0.0])
    if not len(size):
        return grid
    power = np.floor(np.log10(size) + 1e-12)
    for digits in range(_FEWEST_DIGITS, _MOST_DIGITS + 1):
        step = 10.0 ** (power - digits + 1.0)
        scaled = size / step
        if (np.abs(scaled - np.rint(scaled)) <= 1e-6).all():
            finer = grid < _FINER * float(np.median(step))
            return float(np.sqrt(np.mean(step**2))) if finer else grid
    return grid


def rounding(columns: Array, units: Sequence[float] = (1.0,)) -> tuple[float, float]:
    """Root mean square error of rows (n, d) that were rounded, and the step; zeros where it would not bend a curve."""
    steps = np.array([_digit_step(column, grid_step(column, units)) for column in columns.T])
    step, extent = float(steps.max()), float(np.ptp(columns, axis=0).max())
    if not _matters(step, len(columns), extent) or (step > _FINE * extent and not _falls_together(columns)):
        return 0.0, 0.0
    return _ROUNDED * float(np.hypot.reduce(steps)), step


def headings_note(tolerance: float, step: float | None) -> str:
    """What to tell of headings that are smoothed within a tolerance [rad]; step [rad]: because of their rounding."""
    why = "as their tolerance allows" if step is None else f"as they are rounded to {step:.3g} rad"
    return f"headings smoothed, at {tolerance:.2g} rad from those given (root mean square), {why}"


def _matters(step: float, count: int, extent: float) -> bool:
    """Does rounding to a step bend a curve through so many points of such an extent, and are they not typed?"""
    return count >= _FEWEST and step <= _COARSE * extent and step * count**2 > _MATTERS * extent


def _falls_together(columns: Array) -> bool:
    """Do many rows (n, d) repeat the row before them?"""
    return float((np.diff(columns, axis=0) == 0.0).all(axis=1).mean()) >= _TOGETHER


def zigzag(points: Array) -> float:
    """Root mean square noise of points (n, 2) [m], if it makes most of their turns go to and fro; else 0.

    Of white noise 3 of 4 second differences turn against the one before, and their mean square is 6 times its own.
    """
    bends = np.diff(points[:, 0] + 1j * points[:, 1], 2)
    if len(bends) < _FEWEST:
        return 0.0
    noise = float(np.sqrt((np.abs(bends) ** 2).mean() / 6.0))
    alternating = float(((bends[1:] * bends[:-1].conj()).real < 0.0).mean())
    matters = noise * len(points) ** 2 > _MATTERS * float(np.ptp(points, axis=0).max())
    return noise if alternating > _ALTERNATING and matters else 0.0


def is_coarse(points: Array) -> bool:
    """Do points (n, 2) lie on a grid whose step would bend a curve through them, rounded or not?"""
    step = max(grid_step(column) for column in points.T)
    return _matters(step, len(points), float(np.ptp(points, axis=0).max()))
