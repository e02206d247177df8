"""Quintic splines, four times continuously differentiable: neither acceleration nor the tangent's has a kink."""

from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from caster_gym.arrays import Array

_NATURAL = [(3, 0.0), (4, 0.0)]  # the ends that leave the least ∫ |p‴|²


def open_spline(at: Array, values: Array, u: Array) -> Array:
    """Value and first three derivatives (4, ...) at u of the spline through `values` at the places `at`.

    Two values give a straight line.
    """
    if len(at) == 2:
        return _derivatives(make_interp_spline(at, values, k=1), u)
    return _derivatives(make_interp_spline(at, values, k=5, bc_type=(_NATURAL, _NATURAL)), u)


def closed_spline(at: Array, values: Array, u: Array) -> Array:
    """As `open_spline`, periodic: the last value equals the first, and u is taken modulo the last `at`."""
    return _derivatives(make_interp_spline(at, values, k=5, bc_type="periodic"), np.mod(u, at[-1]))


def _derivatives(spline: Any, u: Array) -> Array:
    return np.stack([spline(u, order) for order in range(4)])
