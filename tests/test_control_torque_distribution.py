"""caster_gym.control.torque_distribution: least squares within limits, damped where the casters cannot push."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import lsq_linear

from caster_gym.control.torque_distribution import (
    REGULARISATION,
    STRONGEST_DAMPING,
    WELL_CONDITIONED,
    damping_of,
    distribute,
)

COUNT = 60
WIDE = 1e6  # a limit that nothing reaches


def problems(seed, motors, conditioning=1.0, size=1.0):
    """B with the singular values 10, about 5 and 10 · conditioning, wrenches of that size, and limits around zero."""
    rng = np.random.default_rng(seed)
    left = np.linalg.qr(rng.normal(size=(COUNT, 3, 3)))[0]
    right = np.linalg.qr(rng.normal(size=(COUNT, motors, motors)))[0][:, :3]
    values = np.stack([np.full(COUNT, 10.0), rng.uniform(4.0, 6.0, COUNT), np.full(COUNT, 10.0 * conditioning)], axis=1)
    b = left @ (values[:, :, None] * right)
    wrench = size * rng.normal(size=(COUNT, 3))
    return b, wrench, -rng.uniform(0.2, 1.0, (COUNT, motors)), rng.uniform(0.2, 1.0, (COUNT, motors))


def by_scipy(b, wrench, low, high):
    """Bounded least squares with the damping as rows of its own."""
    solutions = []
    for matrix, force, below, above, damping in zip(b, wrench, low, high, damping_of(b), strict=True):
        rows = np.concatenate([matrix, np.sqrt(damping) * np.eye(len(below))])
        wanted = np.concatenate([force, np.zeros(len(below))])
        solutions.append(lsq_linear(rows, wanted, (below, above), method="bvls", tol=1e-14).x)
    return np.array(solutions)


@pytest.mark.parametrize("motors", [3, 4, 6, 8])
@pytest.mark.parametrize("conditioning", [0.3, 0.01, 1e-6])
def test_distribution_is_bounded_least_squares(motors, conditioning):
    """The residual of the damped problem is the least one, whatever limits are active."""
    b, wrench, low, high = problems(1, motors, conditioning, size=10.0)
    shares, expected = distribute(b, wrench, low, high), by_scipy(b, wrench, low, high)
    active = np.any((shares == low) | (shares == high), axis=1)
    assert 0.2 < active.mean() <= 1.0

    def cost(u):
        residual = np.einsum("rij,rj->ri", b, u) - wrench
        return np.sum(residual**2, axis=1) + damping_of(b) * np.sum(u**2, axis=1)

    # with fewer than three free motors the damping of 1e-10 |B|² leaves torques an error of 1e-16 · 1e10; costs are
    # flat there, so that they differ by its square times |B|² = 100
    assert_allclose(cost(shares), cost(expected), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("motors", [3, 4, 6, 8])
def test_torques_are_those_of_bounded_least_squares(motors):
    """Far from singular with three motors, torques themselves are unique. With more, only the damping picks them."""
    b, wrench, low, high = problems(2, motors, 0.01, size=10.0)
    # damping of 2.6e-4 |B|² makes the normal equations a condition number of 4e3, over round-off
    assert_allclose(distribute(b, wrench, low, high), by_scipy(b, wrench, low, high), atol=1e-9)


@pytest.mark.parametrize("conditioning", [0.3, 0.01, 0.0])
def test_without_active_limits_it_is_the_damped_pseudo_inverse(conditioning):
    b, wrench, _, _ = problems(3, 6, conditioning)
    limit = np.full((COUNT, 6), WIDE)
    damping = damping_of(b)[:, None, None]
    expected = np.linalg.solve(b.mT @ b + damping * np.eye(6), b.mT @ wrench[..., None])[..., 0]
    # the 6 × 6 system has a condition number of 1e10 where damping is 1e-10 σ²: 1e-16 · 1e10
    assert_allclose(distribute(b, wrench, -limit, limit), expected, atol=1e-5)


def test_far_from_singular_the_wrench_is_supplied():
    b, wrench, _, _ = problems(4, 6, 0.3)
    limit = np.full((COUNT, 6), WIDE)
    supplied = np.einsum("rij,rj->ri", b, distribute(b, wrench, -limit, limit))
    # the regularisation takes (1e-5 / 0.3)² = 1e-9 of a wrench of about 1
    assert_allclose(supplied, wrench, atol=1e-8)


@pytest.mark.parametrize("conditioning", [1.0, 0.01, 0.0])
@pytest.mark.parametrize("size", [1.0, 1e2, 1e6])
def test_limits_are_always_kept(conditioning, size):
    b, wrench, low, high = problems(5, 6, conditioning, size)
    low[::4, 0] = 0.0  # a motor beyond its top speed gives nothing in one direction
    high[::4, 1] = 0.0
    low[::4, 2], high[::4, 2] = 0.0, 0.0
    shares = distribute(b, wrench, low, high)
    assert np.all((shares >= low) & (shares <= high))


def test_a_robot_alone_and_in_a_batch_gets_the_same_torques():
    b, wrench, low, high = problems(6, 6, 0.2, size=5.0)
    together = distribute(b, wrench, low, high)
    alone = [distribute(*(x[i : i + 1] for x in (b, wrench, low, high)))[0] for i in range(COUNT)]
    assert_array_equal(together, alone)


def test_the_order_in_memory_plays_no_part():
    arrays = problems(8, 6, 0.2, size=5.0)
    turned = [np.asfortranarray(array) for array in arrays]
    assert not turned[2][0].flags.c_contiguous
    assert_array_equal(distribute(*turned), distribute(*arrays))


def test_motors_that_cannot_push_are_not_asked():
    nothing = np.zeros((1, 3, 6))
    ones = np.ones((1, 6))
    assert np.all(distribute(nothing, np.ones((1, 3)), -ones, ones) == 0.0)


def test_damping_grows_smoothly_towards_a_singular_configuration():
    """It sets in with zero slope at WELL_CONDITIONED and reaches STRONGEST_DAMPING, and never jumps."""
    sizes = np.linspace(0.0, 2.0 * WELL_CONDITIONED, 2001)
    b = np.zeros((len(sizes), 3, 3))
    b[:, 0, 0], b[:, 1, 1], b[:, 2, 2] = 4.0, 2.0, 4.0 * sizes
    damping = damping_of(b) / 4.0**2
    least = REGULARISATION**2
    assert_allclose(damping[sizes >= WELL_CONDITIONED * (1 + 1e-9)], least, rtol=1e-12)
    assert damping[0] == pytest.approx(STRONGEST_DAMPING**2 + least, rel=1e-12)
    assert np.all(np.diff(damping) <= 1e-18)
    slope = np.diff(damping) / np.diff(sizes)
    steepest = 2.0 * STRONGEST_DAMPING**2 / WELL_CONDITIONED  # of (S (1 − x/W))² at x = 0
    assert np.abs(slope).max() <= steepest
    assert np.abs(np.diff(slope)).max() <= 1.01 * steepest * (sizes[1] / WELL_CONDITIONED)  # and that of its slope


def test_damping_bounds_torques_near_a_singular_configuration():
    """σ / (σ² + λ) is at most 1 / (2 √λ), and 1 / σ where damping has not set in, for every nearness."""
    limit = np.full((COUNT, 6), WIDE)
    for conditioning in (0.05, 0.02, 5e-3, 1e-3, 1e-5, 1e-9, 0.0):
        b, wrench, _, _ = problems(7, 6, conditioning)
        gain = np.linalg.norm(distribute(b, wrench, -limit, limit), axis=1) / np.linalg.norm(wrench, axis=1)
        # the worst is where half of the damping has set in; with σ_max = 10: max of x / (x² + (S (1 − x/W))²) / 10
        x = np.linspace(0.0, WELL_CONDITIONED, 1001)
        bound = (x / (x**2 + (STRONGEST_DAMPING * (1.0 - x / WELL_CONDITIONED)) ** 2)).max() / 10.0
        assert gain.max() <= bound < 4.0


def test_directions_that_can_be_pushed_are_pushed_at_a_singular_configuration():
    b = np.zeros((1, 3, 3))
    b[0, 0, 0], b[0, 1, 1] = 10.0, 5.0
    one = np.ones((1, 3))
    shares = distribute(b, np.array([[1.0, 1.0, 1.0]]), -one, one)[0]
    # damping takes λ / (σ² + λ) of it: 4e-4 · 100 / (25 + 4e-4 · 100) = 0.16 %
    assert_allclose(shares, [0.1, 0.2, 0.0], rtol=2e-3)
