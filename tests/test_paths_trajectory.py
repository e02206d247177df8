"""caster_gym.paths.trajectory: the table, the time law of chung2008 (61), and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.paths.trajectory import COLUMNS, Trajectory, place, rest_to_rest, tabulate, whole_steps


def at_rest(count=11):
    samples = np.zeros((count, len(COLUMNS)))
    samples[:, COLUMNS.index("cos")] = 1.0
    return samples


def test_progress_over_sixty_seconds_has_the_coefficients_of_the_paper():
    """β = 2π · progress; chung2008 (61) prints a3 = 20π/60³, a4 = −30π/60⁴, a5 = 12π/60⁵."""
    progress, rate, acceleration = rest_to_rest(3000, 0.02)
    t = 0.02 * np.arange(3001)
    beta = np.polynomial.Polynomial([0, 0, 0, 20 * np.pi / 60**3, -30 * np.pi / 60**4, 12 * np.pi / 60**5])
    # Rounding of numbers up to 2π.
    assert_allclose(2 * np.pi * progress, beta(t), atol=1e-13)
    assert_allclose(2 * np.pi * rate, beta.deriv()(t), atol=1e-13)
    assert_allclose(2 * np.pi * acceleration, beta.deriv(2)(t), atol=1e-13)


def test_progress_starts_and_ends_at_rest():
    for part, first, last in zip(rest_to_rest(37, 0.1), (0, 0, 0), (1, 0, 0), strict=True):
        assert (part[0], part[-1]) == (first, last)


def test_duration_is_rounded_to_the_nearest_whole_number_of_steps():
    assert [whole_steps(d, 0.02) for d in (1.0, 1.009, 1.011, 0.3)] == [50, 50, 51, 15]


def test_trajectory_lasts_one_step_less_than_it_has_samples():
    assert Trajectory("still", 0.02, at_rest(501)).duration == pytest.approx(10.0)


def test_samples_cannot_be_changed_and_do_not_follow_the_array_they_came_from():
    samples = at_rest()
    trajectory = Trajectory("still", 0.02, samples)
    samples[0, 0] = 5.0
    assert trajectory.samples[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.samples[0, 0] = 1.0


def test_columns_hold_what_their_names_say():
    names = ("x", "vx", "ax")
    x, v, a = (np.full(4, 10 * i + 1 + 1j * (10 * i + 2)) for i in range(3))
    table = tabulate((x, v, a), (np.full(4, 0.6 + 0.8j), np.full(4, 7.0), np.full(4, 8.0)))
    for i, name in enumerate(names):
        column = COLUMNS.index(name)
        assert_allclose(table[:, column : column + 2], [[10 * i + 1, 10 * i + 2]] * 4)
    rest = [COLUMNS.index(name) for name in ("cos", "sin", "omega", "alpha")]
    assert_allclose(table[:, rest], [[0.6, 0.8, 7.0, 8.0]] * 4)


def test_placing_turns_about_the_origin_and_then_moves():
    motion = (np.array([1.0 + 0j]), np.array([2.0 + 0j]), np.array([3.0 + 0j]))
    (p, v, a), heading = place(motion, np.array([1j]), (5.0, 6.0), np.pi / 2)
    assert_allclose([p[0], v[0], a[0], heading[0]], [5 + 7j, 2j, 3j, -1], atol=1e-15)  # rounding of π/2


@pytest.mark.parametrize("time_step", [0.0, -0.02, np.nan, np.inf])
def test_time_step_must_be_positive(time_step):
    with pytest.raises(ValueError, match="time step of a path must be positive, got"):
        Trajectory("still", time_step, at_rest())
    with pytest.raises(ValueError, match="time step of a path must be positive, got"):
        whole_steps(10.0, time_step)


def test_too_short_a_duration_is_refused_with_the_shortest_that_would_do():
    with pytest.raises(
        ValueError, match=r"0\.1 s is 5 time steps of 0\.02 s; a path needs at least 10, that is 0\.2 s"
    ):
        whole_steps(0.1, 0.02)
    assert whole_steps(0.2, 0.02) == 10


def test_samples_that_are_not_finite_are_named_by_column_and_row():
    samples = at_rest()
    samples[3, COLUMNS.index("ax")] = np.nan
    with pytest.raises(ValueError, match="ax of path 'bad' is nan in sample 3"):
        Trajectory("bad", 0.02, samples)


@pytest.mark.parametrize("shape", [(10,), (5, 9), (1, 10)])
def test_samples_of_another_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"must have shape \(K \+ 1, 10\)"):
        Trajectory("bad", 0.02, np.ones(shape))


def test_a_heading_that_turns_back_within_a_step_is_refused():
    samples = at_rest()
    samples[5:, COLUMNS.index("cos")] = -1.0
    with pytest.raises(ValueError, match=r"heading of path 'bad' turns by 3\.1 rad in the time step after 0\.08 s"):
        Trajectory("bad", 0.02, samples)
