"""caster_gym.paths.interpolation: quintic splines against what they must reproduce."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.paths.interpolation import closed_spline, open_spline


@pytest.mark.parametrize("count", [3, 4, 7])
def test_open_spline_reproduces_a_parabola_and_its_derivatives(count):
    """A natural quintic leaves the least ∫ |p‴|², which is zero for a parabola."""
    at, u = np.linspace(0.0, 2.0, count), np.linspace(0.0, 2.0, 50)
    got = open_spline(at, 3.0 * at**2 - at + 1.0, u)
    expected = np.stack([3.0 * u**2 - u + 1.0, 6.0 * u - 1.0, np.full_like(u, 6.0), np.zeros_like(u)])
    assert_allclose(got, expected, atol=1e-9)  # rounding, multiplied by knots' spacing to the power −3


def test_two_values_make_a_straight_line():
    got = open_spline(np.array([0.0, 1.0]), np.array([2.0, 5.0]), np.array([0.0, 0.5, 1.0]))
    assert_allclose(got, [[2.0, 3.5, 5.0], [3.0, 3.0, 3.0], [0.0] * 3, [0.0] * 3], atol=1e-14)


@pytest.mark.parametrize("count", [3, 4, 9])
def test_closed_spline_goes_on_smoothly_after_each_lap(count):
    at = np.linspace(0.0, 1.0, count + 1)
    values = np.random.default_rng(count).normal(size=count + 1)
    values[-1] = values[0]
    assert_allclose(closed_spline(at, values, at)[0], values, atol=1e-12)
    h = 1e-9
    before, after = closed_spline(at, values, np.array([1.0 - h, 1.0 + h])).T
    # All four derivatives change by less than 2h times the next, and those are below 1e6 for so many random values.
    assert_allclose(before, after, atol=2.0 * h * 1e6)
    assert_allclose(closed_spline(at, values, np.array([2.3])), closed_spline(at, values, np.array([0.3])), rtol=1e-9)
