"""(N9): changing the independent joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.coordinate_switching import (
    all_complements,
    choose_along,
    forward_dynamics,
    simulate,
    singular_steering,
)
from papers.analysis.orthogonal_complement import OrthogonalComplement
from tests.random_robots import random_motion, random_robot

CHUNG = load_robot("chung2008")
SETS = all_complements(CHUNG)
LIMIT = 100.0


def turning_casters(steps):
    """Steering angles of casters that turn around together, by way of many singular configurations."""
    return np.linspace(0.1, 2.0 * np.pi, steps)[:, None] + [0.0, 0.3, -0.4]


def test_there_is_a_complement_for_every_three_joints():
    assert len({one.independent for one in SETS}) == 20


def test_the_set_in_use_stays_below_the_limit_and_is_kept_as_long():
    """(N9)."""
    chosen, numbers = choose_along(turning_casters(400), SETS, LIMIT)
    used = numbers[np.arange(len(chosen)), chosen]
    assert used.max() < LIMIT
    assert (numbers.max(axis=0) > LIMIT).all()  # no set could have been used all the way
    changes = np.flatnonzero(np.diff(chosen))
    assert 0 < len(changes) < 20
    for step in changes:
        assert numbers[step + 1, chosen[step]] > LIMIT  # what was left had to be
        assert numbers[step + 1].argmin() == chosen[step + 1]


def test_each_twist_rate_is_that_of_the_operational_space():
    steering = turning_casters(200)
    _, twist, torque, _ = random_motion(51, CHUNG, 200)
    chosen, _ = choose_along(steering, SETS, LIMIT)
    ours = forward_dynamics(steering, twist, torque, SETS, chosen)
    expected = Model(CHUNG).forward_dynamics(steering, twist, torque)
    assert_allclose(ours, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())  # LIMIT² times rounding, with room


@pytest.mark.parametrize("caster_count", [2, 3, 4])
def test_singular_steering_is_singular(caster_count):
    """(N2): the rows of the three joints, from the operational-space model, have no inverse there."""
    robot = random_robot(52, caster_count)
    found = 0
    for one in all_complements(robot)[::3]:
        steering = singular_steering(one, np.linspace(-1.0, 2.0, caster_count))
        if steering is not None:
            values = np.linalg.svd(Model(robot).jacobian(steering, one.independent), compute_uv=False)
            assert values[-1] < 1e-12 * values[0]  # a root to rounding
            found += 1
    assert found > 0


def test_none_where_turning_one_caster_makes_nothing_singular():
    """Both joints of caster 1 and steering 2: the axle of wheel 2 would have to pass through the centre of wheel 1.

    With both casters along the line of their pivots, A1 − A2 = e f, and e < 2 d it cannot, whichever is turned alone.
    """
    casters = tuple(caster.model_copy(update={"trail": 0.1}) for caster in CHUNG.casters)
    robot = CHUNG.model_copy(update={"casters": casters})
    one = OrthogonalComplement(robot, ("roll_1", "steer_1", "steer_2"))
    assert singular_steering(one, np.array([np.pi, np.pi, 0.7])) is None
    assert singular_steering(one, np.array([0.0, np.pi, 0.7])) is not None


def test_changing_joints_leave_the_motion_unchanged():
    """(N9), (N7): under the same torques as the operational-space model."""
    model, dt, steps = Model(CHUNG), 0.01, 150
    state = np.array([0.0, 0.0, 0.0, 0.2, 0.1, 0.3, 2.5, 2.2, 1.8])  # casters that flip
    torque = np.tile([-0.004, 0.0, 0.004, 0.0, 0.003, 0.001], (steps, 1))
    walk = simulate(SETS, state, torque, dt, LIMIT)
    apart = np.abs(walk.states - model.simulate(state, torque, dt, steps)).max()
    fine = simulate(SETS, state, np.repeat(torque, 2, axis=0), 0.5 * dt, LIMIT)
    apart_fine = np.abs(fine.states - model.simulate(state, torque[0], 0.5 * dt, 2 * steps)).max()
    # the steps are of fifth order here and of fourth there: half a step, a sixteenth of it, while casters flip
    assert apart < 1e-3
    assert apart_fine < apart / 10.0
    changes = np.count_nonzero(np.diff(walk.chosen))
    assert changes > 0
    assert walk.condition_numbers.max() < LIMIT
    assert walk.examined == steps + (changes + 1) * len(SETS)


def test_a_walk_ends_where_its_only_set_is_singular():
    """Straight ahead, with pivots at round numbers: J_p of the paper's set is singular to the last digit."""
    places = ((-0.25, 0.0), (0.25, 0.0), (0.0, 0.5))
    casters = tuple(c.model_copy(update={"x": x, "y": y}) for c, (x, y) in zip(CHUNG.casters, places, strict=True))
    one = OrthogonalComplement(CHUNG.model_copy(update={"casters": casters}), ("roll_1", "roll_2", "steer_3"))
    walk = simulate([one], np.array([0.0, 0.0, 0.0, 0.1, *np.zeros(5)]), np.zeros((3, 6)), 0.01)
    assert np.isfinite(walk.states[0]).all()
    assert np.isnan(walk.states[1:]).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], np.zeros(9), np.zeros((2, 6)), 0.01), "candidates must hold at least one set"),
        (
            (SETS, np.zeros(9), np.zeros((2, 6)), 0.01, 0.5),
            "limit must be 1 or more, as condition numbers are, got 0.5",
        ),
        ((SETS, np.zeros(9), np.zeros((2, 6)), 0.01, np.nan), "limit must be 1 or more"),
        ((SETS, np.zeros(9), np.zeros((2, 6)), 1.0), "a time step of 1 s cannot follow the casters"),
        ((SETS, np.zeros(8), np.zeros((2, 6)), 0.01), r"state must have a last axis of 9, got shape \(8,\)"),
        ((SETS, np.zeros(9), np.zeros(6), 0.01), "torque must have two axes and state one"),
        ((SETS, np.zeros(9), np.full((2, 6), np.inf), 0.01), "torque must be finite, got inf"),
    ],
)
def test_what_cannot_be_simulated_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        simulate(*arguments)


def test_a_path_needs_a_limit_and_candidates():
    with pytest.raises(ValueError, match="limit must be 1 or more, as condition numbers are, got 0"):
        choose_along(turning_casters(3), SETS, 0.0)
    with pytest.raises(ValueError, match="candidates must hold at least one set"):
        choose_along(turning_casters(3), (), LIMIT)
