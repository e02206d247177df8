"""caster_gym.engines.native.dual_numbers: the rules of differentiation, against steps along the imaginary axis."""

import math

import numpy as np
import pytest
from numba import TypingError, njit
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.engines.native.dual_numbers import WIDTH, join, split, take

TINY = 1e-30  # its square is nothing beside 1: derivatives by imaginary steps are exact to rounding


def mixture(x, y, root):
    """All operations, with dual numbers on both sides and with plain ones on either."""
    a = (x + y) * (x - y) / (2.0 + x * y)
    b = 3.0 * (1.5 - a) * y * 0.5 + 4.0 / (x + 2.0) - x / 3.0
    return a - 1.0, -b, root(b * b + 0.25)


compiled_mixture = njit(error_model="numpy", forceinline=True)(mixture)


@njit(error_model="numpy")
def mixture_of_duals(start, tangents, values, slopes):
    for column in range(0, slopes.shape[1], WIDTH):
        x, y = join(take(start, 0, (0.0, 0.0)), tangents, 0, column)
        split(compiled_mixture(x, y, math.sqrt), values, slopes, 0, column)


@njit(error_model="numpy")
def larger(start, tangents, values, slopes):
    x, y = join(take(start, 0, (0.0, 0.0)), tangents, 0, 0)
    split((x if x > y else y,), values, slopes, 0, 0)


def test_values_are_those_of_plain_numbers_and_tangents_obey_the_rules():
    """To rounding: each tangent is a sum of some twenty products of order 1."""
    rng = np.random.default_rng(0)
    start, tangents = rng.uniform(0.5, 2.0, 2), rng.normal(size=(2, 3 * WIDTH))
    values, slopes = np.zeros(3), np.zeros((3, 3 * WIDTH))
    mixture_of_duals(start, tangents, values, slopes)
    x, y = start
    assert_array_equal(values, mixture(x, y, math.sqrt))
    for (dx, dy), slope in zip(tangents.T, slopes.T, strict=True):
        expected = np.array(mixture(x + 1j * TINY * dx, y + 1j * TINY * dy, np.sqrt)).imag / TINY
        assert_allclose(slope, expected, rtol=1e-13, atol=1e-13)


def test_dual_numbers_are_not_compared():
    """A choice between them would hide where a derivative ends to exist."""
    with pytest.raises(TypingError, match=r"Dual"):
        larger(np.ones(2), np.ones((2, WIDTH)), np.zeros(1), np.zeros((1, WIDTH)))


def test_there_are_no_dual_numbers_outside_compiled_code():
    with pytest.raises(NotImplementedError, match="in compiled code alone"):
        join((1.0,), np.ones((1, WIDTH)), 0, 0)
    with pytest.raises(NotImplementedError, match="in compiled code alone"):
        split((1.0,), np.zeros(1), np.ones((1, WIDTH)), 0, 0)
