"""Bounds of the least singular value hold, and sets that symmetry maps into each other are counted once."""

import numpy as np
import pytest
from scipy.optimize import minimize

from caster_gym import load_robot
from caster_gym.design.joint_sets import turned_parallel
from papers.analysis.action_lines import smallest_singular_value
from papers.analysis.joint_sets import (
    classify_all,
    least_singular_value,
    proved_brackets,
    rounded_down,
    set_types,
    steepest,
)
from tests.random_robots import random_robot
from tests.test_design_joint_sets import BOTH_OF_TWO, CHUNG, SINGULAR, long_legged, searched


@pytest.mark.parametrize(
    "joints", [BOTH_OF_TWO, ("roll_1", "steer_1", "steer_2"), ("roll_1", "steer_1", "roll_2", "steer_3")]
)
def test_brackets_hold_the_least_singular_value(joints):
    """(L7): no sample is below, one is found above, and they are as near as asked."""
    robot = long_legged(7)
    bracket = least_singular_value(robot, joints, precision=0.05)
    assert bracket.lower <= bracket.upper <= bracket.lower + 0.05
    assert smallest_singular_value(robot, bracket.steering, joints) == pytest.approx(bracket.upper, rel=1e-9)
    assert bracket.lower <= searched(robot, joints, seed=1) + SINGULAR


def test_no_turn_changes_the_singular_value_faster_than_the_bound():
    """(L7): at random, and towards singular configurations, where singular values fall fastest."""
    rng = np.random.default_rng(3)
    fastest = 0.0
    for seed in range(30):
        robot = long_legged(seed)
        joints = ("roll_1", "steer_2", "roll_3")
        start = np.concatenate([rng.uniform(-np.pi, np.pi, (200, 3)), [turned_parallel(robot, joints, 0.3)] * 200])
        turn = 1e-3 * rng.choice((-1.0, 1.0), start.shape)
        change = smallest_singular_value(robot, start + turn, joints) - smallest_singular_value(robot, start, joints)
        fastest = max(fastest, np.abs(change).max() / (1e-3 * steepest(robot, joints)))
    assert 0.4 < fastest <= 1.0  # and the bound is of the right size


def test_brackets_hold_for_all_sets_and_are_attained():
    """(L7), whether a set was searched itself or a smaller set lent its bound."""
    robot = load_robot("chung2008")
    sets = classify_all(robot)
    brackets = proved_brackets(robot, sets)
    assert set(brackets) == {one.joints for one in sets if one.singular == "never"}
    steering = np.random.default_rng(2).uniform(-np.pi, np.pi, (5000, 3))
    for joints, bracket in brackets.items():
        assert 0.5 < bracket.lower <= smallest_singular_value(robot, steering, joints).min()
        assert smallest_singular_value(robot, bracket.steering, joints) == pytest.approx(bracket.upper, abs=1e-12)
        assert bracket.upper - bracket.lower <= 0.02 + 1e-12  # the precision asked for


def test_all_six_joints_have_a_bound_of_their_own():
    """Four of them lend 0.715 at most, while the least that any search finds for all six is 1.2988."""
    robot = load_robot("chung2008")
    six = [one for one in classify_all(robot) if len(one.joints) in (4, 6)]
    bracket = proved_brackets(robot, six)[robot.joints]
    found = least_by_scipy(robot, robot.joints)
    assert bracket.lower <= found <= bracket.upper + 1e-6
    assert bracket.lower > 1.27


def least_by_scipy(robot, joints):
    """The least smallest singular value from local searches by another method, from many places."""
    starts = np.random.default_rng(3).uniform(-np.pi, np.pi, (30, robot.caster_count))
    return min(
        minimize(lambda x: float(smallest_singular_value(robot, x, joints)), start, method="Nelder-Mead").fun
        for start in starts
    )


def test_a_search_that_stops_early_still_proves_its_bound():
    whole, early = (least_singular_value(CHUNG, CHUNG.joints, most_cells=most) for most in (None, 20_000))
    assert 0.0 < early.lower < whole.lower <= whole.upper <= early.upper


@pytest.mark.parametrize(
    ("bound", "words"), [(0.71526, "0.715"), (0.71499, "0.714"), (1.0, "1.000"), (0.9999, "0.999")]
)
def test_a_bound_is_never_rounded_up(bound, words):
    assert rounded_down(bound) == words


@pytest.mark.parametrize(
    ("name", "cycles"),
    [
        ("chung2008", [3, 2, 2, 2, 1, 1]),  # of a triangle: nothing, three mirrors, two turns
        ("xr4000", [4, 3, 3, 2, 2, 2, 1, 1]),  # of a square: nothing, mirrors through corners and sides, three turns
        ("tidybot2", [4, 2, 2, 2]),  # of a rectangle
    ],
)
def test_as_many_types_as_burnside_counts(name, cycles):
    """Each caster has four states. A symmetry that moves them in k cycles keeps 4^k of all sets; types are the mean."""
    robot = load_robot(name)
    sets = classify_all(robot)
    found = set_types(robot, sets)
    assert len(found) == sum(4**k for k in cycles) / len(cycles) - 1
    assert sorted(one.joints for kind in found for one in kind) == sorted(one.joints for one in sets)
    assert all(len({(one.singular, len(one.joints)) for one in kind}) == 1 for kind in found)


def test_a_robot_without_symmetry_has_a_type_for_each_set():
    robot = random_robot(1, 3)
    assert all(len(kind) == 1 for kind in set_types(robot, classify_all(robot)))


def test_a_precision_must_be_positive():
    with pytest.raises(ValueError, match="precision must be positive, got 0"):
        least_singular_value(CHUNG, BOTH_OF_TWO, precision=0.0)
