"""caster_gym.control.wrench_limits: how much of a wrench the motors can give, against a linear programme."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linprog

from caster_gym.control.wrench_limits import reach_of

COUNT = 40


def problems(seed, motors, size):
    """B with singular values of 5 to 10 N, wrenches of that size, and limits around zero."""
    rng = np.random.default_rng(seed)
    left, _, right = np.linalg.svd(rng.normal(size=(COUNT, 3, motors)), full_matrices=False)
    b, way = (left * rng.uniform(5.0, 10.0, (COUNT, 1, 3))) @ right, size * rng.normal(size=(COUNT, 3))
    return b, way, -rng.uniform(0.0, 1.0, (COUNT, motors)), rng.uniform(0.0, 1.0, (COUNT, motors))


def by_linear_programme(b, start, way, low, high):
    """Greatest t in 0 … 1 with B u = start + t · way; None where there is none."""
    matrix = np.column_stack([b, -way])
    bounds = [*zip(low, high, strict=True), (0.0, 1.0)]
    found = linprog([*np.zeros(len(low)), -1.0], A_eq=matrix, b_eq=start, bounds=bounds, method="highs")
    return -found.fun if found.status == 0 else None


@pytest.mark.parametrize("motors", [4, 6, 8])
def test_the_greatest_share_is_that_of_a_linear_programme(motors):
    """Damping of 1e-5 σ_max takes up to 1e-10 σ_max² / σ_min² of a wrench, far below the tolerance; so does HiGHS."""
    b, way, low, high = problems(0, motors, 30.0)
    start = problems(1, motors, 1.5)[1]
    found = reach_of(b).greatest_share(start, way, low, high)
    expected = [by_linear_programme(*one) for one in zip(b, start, way, low, high, strict=True)]
    possible = np.array([one is not None for one in expected])
    assert possible.mean() > 0.2 and np.median(found[possible]) < 0.9
    assert_allclose(found[possible], np.array(expected)[possible].astype(float), atol=1e-5)
    assert (found[~possible] == 1.0).all()


@pytest.mark.parametrize("motors", [3, 6])
def test_lack_tells_whether_the_motors_can_give_a_wrench(motors):
    b, wrench, low, high = problems(2, motors, 2.0)
    lack = reach_of(b).lack(wrench, low, high)
    nothing = np.zeros(3)
    possible = np.array(
        [by_linear_programme(one, w, nothing, *u) is not None for one, w, *u in zip(b, wrench, low, high, strict=True)]
    )
    assert 0.1 < possible.mean() < 0.9
    sure = np.abs(lack) > 1e-4  # [N] damping and HiGHS's own tolerance
    assert_array_equal(lack[sure] < 0.0, possible[sure])


def test_a_robot_alone_and_in_a_batch_gets_the_same_shares():
    b, way, low, high = problems(3, 6, 30.0)
    start = np.zeros((COUNT, 3))
    together = reach_of(b).greatest_share(start, way, low, high)
    alone = [
        reach_of(b[i : i + 1]).greatest_share(*(x[i : i + 1] for x in (start, way, low, high)))[0] for i in range(COUNT)
    ]
    assert_array_equal(together, alone)


def test_what_motors_cannot_push_at_all_does_not_count():
    """Columns in a plane: the part of a wrench across the plane is left out, as damping leaves it out of torques."""
    b, way, low, high = problems(4, 4, 1.0)
    b[:, 2] = 0.0
    reach = reach_of(b)
    tilted = way + np.array([0.0, 0.0, 1e3])
    still = np.zeros((COUNT, 3))
    assert_allclose(
        reach.greatest_share(still, tilted, low, high), reach.greatest_share(still, way, low, high), atol=1e-9
    )
