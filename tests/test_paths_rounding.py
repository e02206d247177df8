"""caster_gym.paths.rounding: the steps of numbers that were rounded, and the size of noise."""

import numpy as np
import pytest

from caster_gym.paths.rounding import HEADING_UNITS, grid_step, rounding, zigzag


@pytest.mark.parametrize(("values", "units", "step"), [
    ([0.0, 0.3, 0.5], (1.0,), 0.1),
    ([0.002, 0.004, 0.01], (1.0,), 0.002),
    ([0.0254, 0.0508, 0.1016], (1.0,), 0.0254),
    ([1.0, 1.0], (1.0,), 0.0),
    ([0.1, np.pi, 0.77], (1.0,), 0.0),
    (np.radians([10.0, 11.5, 13.0]), HEADING_UNITS, np.radians(1.5)),
    (np.array([3, 7, 1003]) * np.pi / 2048.0, HEADING_UNITS, np.pi / 2048.0 * 4.0),
])  # fmt: skip
def test_a_grid_is_found_in_its_own_unit(values, units, step):
    assert grid_step(np.asarray(values, dtype=float), units) == pytest.approx(step, rel=1e-4)  # 1.5° are 0.02618 rad


def test_the_error_of_rounding_is_that_of_an_even_distribution():
    """A twelfth of the square of the step along each axis."""
    points = np.random.default_rng(6).uniform(-2.0, 2.0, (4000, 2))
    written = (points / 0.002).round() * 0.002
    error, step = rounding(written)
    assert step == pytest.approx(0.002)
    assert error == pytest.approx(np.sqrt(((written - points) ** 2).sum(axis=1).mean()), rel=0.03)  # 2 / √4000


@pytest.mark.parametrize(
    ("count", "step"),
    [
        (20, 0.001),  # few points are typed
        (400, 1e-9),  # fine enough
        (400, 0.05),  # coarse, and no point repeats the one before
    ],
)
def test_rounding_is_not_seen_where_it_does_not_matter_or_is_no_rounding(count, step):
    x = np.linspace(0.0, 2.0, count)
    zig = np.arange(count) % 2
    points = (np.column_stack([x, x**2 + 0.1 * zig]) / step).round() * step
    assert rounding(points) == (0.0, 0.0)


def test_white_noise_is_measured_and_a_curve_has_none():
    t = np.linspace(0.0, 2.0 * np.pi, 500)
    ring = np.column_stack([np.cos(t), np.sin(t)])
    assert zigzag(ring) == 0.0
    noisy = ring + np.random.default_rng(7).normal(0.0, 0.003, ring.shape)
    assert zigzag(noisy) == pytest.approx(0.003 * 2**0.5, rel=0.1)  # second differences of 500 points
