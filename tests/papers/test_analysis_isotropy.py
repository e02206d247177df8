"""How evenly a set of joints moves the platform at given steering angles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.isotropy import balanced_isotropy, isotropy
from papers.notation import kim2001_robot
from tests.random_robots import random_robot

KIM = kim2001_robot(0.1, 0.1)
ROUNDING = 1e-12  # of some thousand operations on numbers of about one


def test_twist_from_rates_has_the_same_index():
    """(Q1), (Q2): of three joints the inverse, normalised as kim2001 does in (31); of five the pseudo-inverse."""
    robot = random_robot(1, 3)
    steering, twist, rates = [0.3, 2.0, -1.0], np.array([2.0, 0.7, 3.0]), np.array([5.0, 3.0, 8.0, 2.0, 6.0])
    rows = Model(robot).jacobian(steering, robot.joints[:5])
    three = np.diag(1.0 / twist) @ np.linalg.inv(rows[:3]) @ np.diag(rates[:3])
    five = np.linalg.pinv(np.diag(1.0 / rates) @ rows @ np.diag(twist))
    for matrix, count in ((three, 3), (five, 5)):
        values = np.linalg.svd(matrix, compute_uv=False)
        index = isotropy(robot, steering, robot.joints[:count], twist, rates[:count])
        assert_allclose(index, values[-1] / values[0], rtol=1e-10)  # a condition of some ten costs a digit or two


def test_an_index_of_one_moves_equally_well_everywhere():
    """All wheels point outwards and their centres lie at v/ω from C: then the farthest and the nearest twist agree."""
    centre = 2.0 + 0.5  # [m] pivots at 2a, trail 0.5 inwards along the rolling direction
    robot = kim2001_robot(0.5, 0.5)
    inwards = [np.arctan2(-caster.y, -caster.x) for caster in robot.casters]
    index = isotropy(robot, inwards, robot.joints, (centre, centre, 1.0), np.ones(6))
    assert_allclose(index, 1.0, atol=ROUNDING)


def test_index_is_zero_where_three_lines_meet():
    """Steering links in line with C: all three wheels roll past C, and nothing tells its yaw rate."""
    outwards = [np.arctan2(caster.y, caster.x) for caster in KIM.casters]
    assert isotropy(KIM, outwards, ("roll_1", "roll_2", "roll_3"), (1.0, 1.0, 1.0), np.ones(3)) < ROUNDING


def test_common_factors_of_twists_and_of_rates_drop_out():
    steering, joints = np.array([0.3, 2.0, -1.0]), KIM.joints[:3]
    one = isotropy(KIM, steering, joints, (2.0, 2.0, 1.0), (1.0, 5.0, 1.0))
    assert_allclose(isotropy(KIM, steering, joints, (6.0, 6.0, 3.0), (0.1, 0.5, 0.1)), one, rtol=1e-10)


@pytest.mark.parametrize("name", ["chung2008", "xr4000"])
def test_balanced_casters_have_the_closed_form(name):
    """(Q7), (Q8): with r θ̇_max = d δ̇_max the index depends on the wheels' centres alone."""
    robot = load_robot(name)
    steering = np.random.default_rng(1).uniform(-np.pi, np.pi, (50, robot.caster_count))
    for casters in ((1, 2), (1, 2, 3)):
        joints = [f"{kind}_{i}" for i in casters for kind in ("roll", "steer")]
        tops = [top for i in casters for top in (1.0, robot.casters[i - 1].radius / robot.casters[i - 1].trail)]
        expected = isotropy(robot, steering, joints, (0.3, 0.3, 2.0), tops)
        assert_allclose(balanced_isotropy(robot, steering, casters, 0.3, 2.0), expected, atol=1e-9)  # of a difference


def test_rates_are_those_of_the_wheels_centre():
    """(Q7): d δ̇ and r θ̇ + s δ̇ are the velocity, across and along, of the platform's point above the contact."""
    robot = random_robot(2, 4)
    rng = np.random.default_rng(3)
    steering, twist = rng.uniform(-np.pi, np.pi, 4), rng.uniform(-1.0, 1.0, 3)
    _, theta, delta = Model(robot).rates(steering, twist)
    for caster, angle, roll, steer in zip(robot.casters, steering, theta, delta, strict=True):
        f = np.array([np.cos(angle), np.sin(angle)])
        n = np.array([-f[1], f[0]])
        centre = np.array([caster.x, caster.y]) - caster.trail * f + caster.offset * n
        velocity = twist[:2] + twist[2] * np.array([-centre[1], centre[0]])
        assert_allclose(caster.trail * steer, n @ velocity, atol=ROUNDING)
        assert_allclose(caster.radius * roll + caster.offset * steer, f @ velocity, atol=ROUNDING)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"joints": ("roll_1", "roll_2", "spin_3")}, r"unknown joint 'spin_3'; the joints are roll_1, .*steer_3"),
        ({"joints": ("roll_1", "steer_1")}, "three degrees of freedom: name three joints or more, got roll_1, steer_1"),
        ({"top_twist": (1.0, 0.0, 1.0)}, "top_twist must be positive and finite, got 0"),
        ({"top_twist": (1.0, 1.0)}, r"top_twist must have 3 numbers, vx, vy and ω, got shape \(2,\)"),
        ({"top_twist": [(1.0, 1.0, 1.0)] * 2}, r"top_twist must have 3 numbers, vx, vy and ω, got shape \(2, 3\)"),
        ({"top_rates": (1.0, -2.0, 1.0)}, "top_rates must be positive and finite, got -2"),
        ({"top_rates": (1.0, float("nan"), 1.0)}, "top_rates must be positive and finite, got nan"),
        ({"top_rates": (1.0, 1.0)}, r"top_rates must have 3 numbers, one for each joint, got shape \(2,\)"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_bad_input_is_named(changed, message):
    good = {"joints": KIM.joints[:3], "top_twist": (1.0, 1.0, 1.0), "top_rates": np.ones(3)}
    with pytest.raises(ValueError, match=message):
        isotropy(KIM, np.zeros(3), **{**good, **changed})


def test_balanced_casters_are_two_or_more_known_ones_without_offset():
    for casters in ((1,), (1, 1), (1, 4), (0, 1)):
        with pytest.raises(ValueError, match=r"name two or more different casters from 1 to 3, got \["):
            balanced_isotropy(KIM, np.zeros(3), casters, 1.0, 1.0)
    tidybot = load_robot("tidybot2")
    with pytest.raises(ValueError, match="robot 'tidybot2' has wheels with a lateral offset"):
        balanced_isotropy(tidybot, np.zeros(4), (1, 2), 1.0, 1.0)
    with pytest.raises(ValueError, match="top_speed must be positive and finite, got 0"):
        balanced_isotropy(KIM, np.zeros(3), (1, 2), 0.0, 1.0)
    with pytest.raises(ValueError, match=r"steering must have a last axis of 3, got shape \(2,\)"):
        balanced_isotropy(KIM, np.zeros(2), (1, 2), 1.0, 1.0)
    with pytest.raises(ValueError, match="steering must be finite, got nan"):
        balanced_isotropy(KIM, [0.0, np.nan, 0.0], (1, 2), 1.0, 1.0)
