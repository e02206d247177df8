"""caster_gym.paths.smoothing: curves beside noisy points, against curves known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.paths.smoothing import fit_smoothing_curve, fit_smoothing_spline

AT = np.linspace(0.0, 1.0, 201)


def rms(values):
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def test_a_cubic_is_not_bent_however_large_the_tolerance():
    """The penalty on the fourth derivative of a cubic is zero."""
    cubic = 2.0 * AT**3 - AT**2 + 0.5
    spline = fit_smoothing_spline(cubic[:, None], AT, np.ones(201), 10.0, False)
    u = np.linspace(0.0, 1.0, 33)
    assert_allclose(spline(u, 2)[:, 0], 12.0 * u - 2.0, atol=1e-5)  # rounding, times the weight of the penalty


@pytest.mark.parametrize("closed", [False, True])
def test_the_distance_from_noisy_values_is_the_tolerance(closed):
    """The smoothest spline within a tolerance uses all of it; the bisection leaves 2e-4 of a power of 10."""
    noise = np.random.default_rng(1).normal(0.0, 0.01, 201)
    values = np.sin(2.0 * np.pi * AT) + noise
    values[-1] = values[0] if closed else values[-1]
    spline = fit_smoothing_spline(values[:, None], AT, np.ones(201), 0.01, closed)
    kept = slice(0, 200) if closed else slice(0, 201)
    assert rms(spline(AT)[kept, 0] - values[kept]) == pytest.approx(0.01, rel=5e-3)
    assert rms(spline(AT)[:, 0] - np.sin(2.0 * np.pi * AT)) < 0.004  # a third of the noise


def test_no_value_is_farther_away_than_the_greatest_distance_allowed():
    values = np.where(np.arange(201) == 100, 0.5, 0.0)[:, None]
    far = fit_smoothing_spline(values, AT, np.ones(201), 0.1, False)
    near = fit_smoothing_spline(values, AT, np.ones(201), 0.1, False, most=0.05)
    assert abs(far(0.5)[0] - 0.5) > 0.3
    assert abs(near(AT) - values).max() < 0.05 * (1.0 + 1e-9)


def test_a_small_tolerance_is_kept_as_well():
    values = np.random.default_rng(2).normal(size=(12, 2))
    at = np.linspace(0.0, 1.0, 12)
    spline = fit_smoothing_spline(values, at, np.ones(12), 1e-4, False)
    assert rms(np.hypot(*(spline(at) - values).T)) <= 1e-4 * (1.0 + 1e-9)
    assert abs(spline(np.linspace(0.0, 1.0, 500))).max() < 3.0 * abs(values).max()  # it does not swing in between


def test_a_closed_spline_goes_on_smoothly():
    ring = np.exp(2.0j * np.pi * np.linspace(0.0, 1.0, 61))
    points = np.column_stack([ring.real, ring.imag]).round(2)
    points[-1] = points[0]
    spline, _ = fit_smoothing_curve(points, np.ones(61), 0.004, True, np.inf)
    for order in range(5):
        assert_allclose(spline(0.0, order), spline(1.0, order), rtol=1e-6, atol=1e-6 * (2.0 * np.pi) ** order)


def test_the_curve_is_walked_at_an_even_pace_over_points_that_are_not():
    """Chords between points 1 mm apart with errors of 1 mm are twice as long as the way."""
    t = np.concatenate([np.linspace(0.0, 0.3, 900), np.linspace(0.31, 1.0, 60)])
    way = np.column_stack([3.0 * t, np.sin(3.0 * t)])
    points = way + np.random.default_rng(3).normal(0.0, 0.001, way.shape)
    spline, at = fit_smoothing_curve(points, np.ones(len(t)), 0.0014, False, np.inf)
    pace = np.hypot(*spline(np.linspace(0.0, 1.0, 200), 1).T)
    assert pace.max() / pace.min() < 1.05
    assert (np.diff(at) >= 0.0).all() and (at[0], at[-1]) == (0.0, 1.0)


def test_a_long_gap_between_dense_points_is_bridged():
    """Where there are no points there are no knots, so that nothing can swing."""
    t = np.concatenate([np.linspace(0.0, 0.2, 500), np.linspace(0.8, 1.0, 500)])
    points = np.column_stack([t, 0.1 * t**2]).round(4)
    spline, _ = fit_smoothing_curve(points, np.ones(1000), 5e-5, False, np.inf)
    x, y = spline(np.linspace(0.0, 1.0, 300)).T
    assert abs(y - 0.1 * x**2).max() < 5e-3  # the tangents at both sides are known to about 1 %


@pytest.mark.parametrize("tolerance", [0.0005, 0.001, 0.01])
def test_no_curve_swings_out_between_points_whose_noise_is_larger_than_the_tolerance(tolerance):
    """Such a curve was 10,000 km long, or none at all, as its coefficients were undetermined."""
    t = np.linspace(0.0, 2.0 * np.pi, 500)
    points = np.column_stack([1.5 * np.sin(t), 0.8 * np.sin(2.0 * t)])
    points += np.random.default_rng(1).normal(0.0, 0.02, points.shape)
    chords = np.hypot(*np.diff(points, axis=0).T).sum()
    spline, at = fit_smoothing_curve(points, np.ones(500), tolerance, False, np.inf)
    if spline is not None:
        assert np.hypot(*np.diff(spline(np.linspace(0.0, 1.0, 20001)), axis=0).T).sum() < 1.5 * chords
    assert (np.diff(at) > 0.0).all()


@pytest.mark.parametrize("step", [0.002, 0.1, 1.0])
@pytest.mark.parametrize("tolerance", [0.001, 0.05])
def test_sparse_points_that_zigzag_do_not_swing_out_from_pass_to_pass(step, tolerance):
    """A curve near twelve corners is about as long as the way between them: half as long again leaves room to round."""
    points = np.array([(step * k, k % 2) for k in range(12)], dtype=np.float64)
    spline, at = fit_smoothing_curve(points, np.ones(12), tolerance, False, np.inf)
    assert rms(np.hypot(*(spline(at) - points).T)) == pytest.approx(tolerance, rel=5e-3)  # as the bisection leaves
    along = spline(np.linspace(0.0, 1.0, 2001))
    chords = np.hypot(*np.diff(points, axis=0).T).sum()
    assert np.hypot(*np.diff(along, axis=0).T).sum() < 1.5 * chords
