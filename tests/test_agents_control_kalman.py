"""caster_gym.agents.control.kalman: gains that leave the least variance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_are

from caster_gym.agents.control.kalman import Axis, gains_of, steady_share

PERIOD = 0.02
NOISY = Axis(place=0.002, speed=0.01, unmodelled=0.5, drift=2.0, disturbance=2.0)


@pytest.mark.parametrize("axis", [NOISY, NOISY._replace(drift=0.0, disturbance=0.0), NOISY._replace(place=1e-6)])
def test_gains_settle_at_those_of_the_algebraic_riccati_equation(axis):
    """(X3), (X4), (X5), (X6), solved by scipy instead of by recursion; without drift the third number is not there."""
    size = 3 if axis.drift else 2
    t = PERIOD
    moves = np.array([[1.0, t, 0.5 * t**2], [0.0, 1.0, t], [0.0, 0.0, 1.0]])[:size, :size]
    pushed = np.array([0.5 * t**2, t, 0.0])[:size]
    added = axis.unmodelled**2 * np.outer(pushed, pushed) + np.diag([0.0, 0.0, axis.drift**2 * t])[:size, :size]
    measured, seen = np.diag([axis.place**2, axis.speed**2]), np.eye(2, size)
    before = solve_discrete_are(moves.T, seen.T, added, measured)
    expected = before @ seen.T @ np.linalg.inv(seen @ before @ seen.T + measured)
    found = gains_of(axis, PERIOD)
    assert_allclose(found.weights[-1, :size], expected, rtol=1e-5, atol=1e-9)  # the recursion stops at 1e-9 a period
    left = (np.eye(size) - expected @ seen) @ before
    assert found.speed == pytest.approx(np.sqrt(left[1, 1]), rel=1e-4)


def test_the_first_estimate_is_the_first_measurement_and_then_more_is_believed_of_the_model():
    weights = gains_of(NOISY, PERIOD).weights
    assert_allclose(weights[0], [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert (np.diff(weights[:5, 0, 0]) < 0.0).all()


def test_the_errors_of_a_simulated_filter_have_the_variance_that_it_expects():
    """4,000 double integrators, pushed and measured at random; the standard deviation of a sample of these is 1.1 %."""
    rng, t, count = np.random.default_rng(0), PERIOD, 4000
    found = gains_of(NOISY, PERIOD)
    true, belief = np.zeros((count, 3)), np.zeros((count, 3))
    true[:, 2] = NOISY.disturbance * rng.normal(size=count)
    for k in range(150):
        measured = true[:, :2] + rng.normal(size=(count, 2)) * [NOISY.place, NOISY.speed]
        weight = found.weights[min(k, len(found.weights) - 1)]
        belief += (measured - belief[:, :2]) @ weight.T
        if k == 149:
            break
        push = NOISY.unmodelled * rng.normal(size=count)
        for state, more in ((true, push), (belief, 0.0)):
            state[:, 0] += t * state[:, 1] + 0.5 * t**2 * (state[:, 2] + more)
            state[:, 1] += t * (state[:, 2] + more)
        true[:, 2] += NOISY.drift * np.sqrt(t) * rng.normal(size=count)
    assert np.std(true[:, 1] - belief[:, 1]) == pytest.approx(found.speed, rel=0.04)


@pytest.mark.parametrize("ratio", [1e-3, 0.3, 1.0, 30.0])
def test_the_share_of_a_measured_angle_leaves_the_variance_where_it_is(ratio):
    """(X7): p = l n² with p⁻ = p + w² and l = p⁻/(p⁻ + n²), for noise n and walk w."""
    share = steady_share(1.0, ratio)
    before = share + ratio**2
    assert share == pytest.approx(before / (before + 1.0), rel=1e-9)
