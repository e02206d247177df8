"""caster_gym.paths.timed_motion: motions through samples, and what counts as their noise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import make_interp_spline

from caster_gym.paths.timed_motion import motion_through, noise_of, smooth_motion

TIMES = np.arange(0.0, 12.0, 0.02)


def loop(t):
    """A loop of 1.5 by 0.5 m in 12 s with its velocity and acceleration (3, K, 2)."""
    w, x, y = 2.0 * np.pi / 12.0, 1.5 * np.exp(1j * 2.0 * np.pi / 12.0 * t), 0.5 * np.exp(2j * np.pi / 12.0 * t)
    return np.stack([np.stack([((1j * w) ** n * x).real, ((1j * w) ** n * y).imag], axis=1) for n in range(3)])


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
@pytest.mark.parametrize("unit", [1e-2, 1e-3, 1e-4])
def test_rounding_makes_no_accelerations(rate, unit):
    """Through the rounded samples themselves, a spline has accelerations of about 4 unit / √12 · rate²."""
    at = np.arange(0.0, 12.0, 1.0 / rate)
    rounded = np.round(loop(at)[0] / unit) * unit
    noise = noise_of(at, rounded)
    assert noise == pytest.approx(unit / 12.0**0.5, rel=0.3)  # neighbours say much the same as the digits
    found = smooth_motion(at, rounded, noise, at)
    assert np.abs(found[0] - loop(at)[0]).max() < 2.0 * unit
    # true accelerations reach 0.41 m/s²; the bound is what is left at the free ends of the coarsest table, which
    # has 240 samples of 2.9 mm
    assert np.abs(found[2] - loop(at)[2]).max() < (0.12 if unit == 1e-2 else 0.05)


def test_noise_is_estimated_from_samples_with_all_their_digits():
    errors = 5e-4 * np.random.default_rng(0).standard_normal((len(TIMES), 2))
    assert noise_of(TIMES, loop(TIMES)[0] + errors) == pytest.approx(5e-4, rel=0.15)  # a median of 600: 4 % deviation


@pytest.mark.parametrize(
    ("at", "values"),
    [
        (TIMES, loop(TIMES)[0]),  # exact
        (TIMES[:15], np.round(loop(TIMES[:15])[0], 3)),  # few
        (TIMES, np.column_stack([0.5 * TIMES, 0.01 * np.round(100.0 * TIMES)])),  # round numbers of an even motion
        (10.0 * TIMES, np.round(loop(TIMES)[0], 4)),  # rounding that is of no account
        (TIMES, np.zeros((len(TIMES), 2))),
    ],
)
def test_where_there_is_no_noise_none_is_found(at, values):
    assert noise_of(at, values) == 0.0


def test_times_that_jitter_are_no_noise_of_places():
    at = TIMES + np.random.default_rng(1).uniform(-0.006, 0.006, len(TIMES))
    assert noise_of(at, loop(at)[0]) == 0.0


def test_residuals_have_the_size_of_the_noise():
    samples = loop(TIMES)[0] + 1e-3 * np.random.default_rng(2).standard_normal((len(TIMES), 2))
    for noise in (0.5e-3, 1e-3, 3e-3):
        residual = smooth_motion(TIMES, samples, noise, TIMES)[0] - samples
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(noise, rel=0.01)  # halvings of λ


def test_without_noise_it_is_the_natural_quintic_spline():
    """Reinsch: as λ falls to zero the smoothing spline becomes the natural interpolating one."""
    at, values = TIMES[::40], loop(TIMES[::40])[0]
    natural = [(3, np.zeros(2)), (4, np.zeros(2))]
    expected = make_interp_spline(at, values, k=5, bc_type=(natural, natural))
    found = smooth_motion(at, values, 1e-12, TIMES[:-40])
    assert_allclose(found[0], expected(TIMES[:-40]), atol=1e-6)  # the lightest λ, 1e-6
    assert_allclose(motion_through(at, values, False, TIMES[:-40])[0], expected(TIMES[:-40]), atol=1e-12)


def test_a_constant_acceleration_is_not_smoothed_away():
    """∫ |x‴|² of a parabola is zero, whatever λ."""
    parabola = (0.3 - 0.2 * TIMES + 0.05 * TIMES**2)[:, None]
    found = smooth_motion(TIMES, parabola, 0.1, TIMES)
    assert_allclose(found[2], 0.1, atol=1e-5)  # of the heaviest λ's equations six digits are left
    assert_allclose(found[0], parabola, atol=1e-5)


def test_derivatives_are_those_of_the_value():
    samples = np.round(loop(TIMES)[0], 3)
    h = 1e-4
    inside = TIMES[5:-5]
    before, here, after = (smooth_motion(TIMES, samples, 3e-4, inside + k * h) for k in (-1, 0, 1))
    assert_allclose((after[0] - before[0]) / (2.0 * h), here[1], atol=1e-6)  # h² times a third derivative
    assert_allclose((after[1] - before[1]) / (2.0 * h), here[2], atol=1e-6)


@pytest.mark.parametrize("rests", [True, False])
def test_between_equal_samples_it_rests_and_starts_without_a_jolt(rests):
    at = np.array([0.0, 4.0, 8.0, 12.0])
    values = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.5]])
    t = np.linspace(0.0, 12.0, 601)
    value, first, second = motion_through(at, values, rests, t)
    still = (t >= 4.0) & (t <= 8.0)
    assert_allclose(value[still], [[1.0, 0.0]] * still.sum(), atol=1e-12)
    assert np.abs(first[still]).max() < 1e-12
    assert np.abs(second[still]).max() < 1e-12
    assert np.abs(np.diff(second, axis=0)).max() < 0.05  # no jump: accelerations reach 0.4 m/s² within 2 s
    assert_allclose(value[[0, 200, -1]], values[[0, 1, 3]], atol=1e-12)
    ends = np.abs(first[[0, -1]]).max()
    assert ends < 1e-12 if rests else ends > 0.1


def test_two_samples_at_rest_make_the_quintic():
    t = np.linspace(0.0, 5.0, 101)
    value = motion_through(np.array([0.0, 5.0]), np.array([[0.0], [3.0]]), True, t)[0][:, 0]
    tau = t / 5.0
    assert_allclose(value, 3.0 * tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2), atol=1e-12)
