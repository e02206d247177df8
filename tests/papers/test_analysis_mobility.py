"""(J1), (J3), (J4): freedoms that are counted, and motions that exist."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model
from papers.analysis.mobility import counted_mobility, grubler_mobility, loop_closure, mobility
from papers.notation import kim2001_robot
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

SET = ("roll_1", "roll_2", "steer_3")


@pytest.mark.parametrize(
    ("space", "links", "freedoms", "count"),
    [
        (3, 4, [1] * 4, 1),  # four-bar linkage
        (3, 5, [1] * 5, 2),  # five-bar linkage
        (3, 3, [1] * 3, 0),  # a triangle of bars is stiff
        (3, 8, [1] * 9, 3),  # platform on three legs, each of two revolute joints and a slider
        (6, 14, [2, 1, 3] * 6, 6),  # Stewart platform: universal joint, slider, ball
        (6, 2, [1], 1),  # a door
    ],
)
def test_grubler_counts_the_freedoms_of_known_linkages(space, links, freedoms, count):
    """(J1): textbook mechanisms."""
    assert grubler_mobility(space, links, freedoms) == count


def test_a_platform_on_casters_is_counted_three_freedoms():
    """(J1): for every number of casters."""
    assert [counted_mobility(count) for count in (1, 2, 3, 4, 12)] == [3] * 5


@pytest.mark.parametrize("count", CASTER_COUNTS)
def test_the_count_is_true_at_every_configuration(count):
    """(J4): at random, with all wheels parallel, all leading, all lines through C; whatever the geometry."""
    robot = random_robot(41, count)
    random, _, _, _ = random_motion(1, robot, 200)
    radial = np.array([np.arctan2(caster.y, caster.x) for caster in robot.casters])
    special = [np.zeros(count), np.full(count, 0.5 * np.pi), radial, radial + np.pi, radial + 0.5 * np.pi]
    assert (mobility(robot, np.concatenate((random, special))) == counted_mobility(count)).all()


@pytest.mark.parametrize("count", CASTER_COUNTS)
def test_true_motions_close_all_loops(count):
    """(J3): joint rates that the mechanics give for a twist, and only those, are in the null space."""
    robot = random_robot(42, count)
    steering, twist, _, _ = random_motion(2, robot, 30)
    closure = loop_closure(robot, steering)
    assert closure.shape == (30, 3 * (count - 1), 3 * count)
    rates = np.stack(Model(robot).rates(steering, twist), -1).reshape(30, -1)
    assert_allclose(np.einsum("...ij,...j->...i", closure, rates), 0.0, atol=1e-12)  # lengths of 0.3 m times 30 rad/s
    one_slips = rates + 0.1 * np.eye(3 * count)[1]
    assert (np.abs(np.einsum("...ij,...j->...i", closure, one_slips)).max(axis=-1) > 1e-3).all()


def test_holding_three_joints_holds_the_robot():
    """(J4): almost everywhere; with two of them one freedom is left, with one two."""
    robot = random_robot(43, 3)
    steering, _, _, _ = random_motion(3, robot, 200)
    assert (mobility(robot, steering, SET) == 0).all()
    assert (mobility(robot, steering, SET[:2]) == 1).all()
    assert (mobility(robot, steering, "roll_1") == 2).all()
    assert (mobility(robot, steering, robot.joints) == 0).all()


def test_three_lines_through_a_point_leave_a_freedom():
    """(J4): links 1 and 2 and axle 3 through one point, about which the robot then turns with its motors at rest."""
    robot = kim2001_robot(radius=0.3, trail=0.7)
    point = np.array([0.3, 0.5])
    first, second, third = (np.array([caster.x, caster.y]) for caster in robot.casters)
    towards = [np.arctan2(*(point - pivot)[::-1]) for pivot in (first, second)]
    leg = third - point  # the wheel's centre A − d f lies on the axle through the point: f · leg = d
    across = np.arctan2(leg[1], leg[0]) + np.arccos(0.7 / np.hypot(*leg))
    steering = np.array([*towards, across])
    assert mobility(robot, steering, SET) == 1
    assert mobility(robot, steering + np.array([0.01, 0.0, 0.0]), SET) == 0
    eta, theta, delta = Model(robot).rates(steering, [point[1], -point[0], 1.0])  # a turn about the point
    assert_allclose([theta[0], theta[1], delta[2]], 0.0, atol=1e-12)
    assert np.abs(eta).max() > 0.1


def test_parallel_lines_leave_a_freedom():
    """(J4): links 1 and 2 along x and axle 3 along x; the robot moves across with its motors at rest."""
    assert mobility(kim2001_robot(radius=0.3, trail=0.7), [0.0, np.pi, 0.5 * np.pi], SET) == 1


def test_two_wheels_in_one_place_leave_a_freedom():
    """(J4), E10: both joints of two casters held, and long links whose wheels meet."""
    robot = kim2001_robot(radius=0.3, trail=2.5)
    half = robot.casters[1].x
    towards = np.arccos(half / 2.5)  # both wheels stand above the middle of the side between their pivots
    steering = np.array([towards + np.pi, -towards, 0.3])
    both = ("roll_1", "steer_1", "roll_2", "steer_2")
    assert mobility(robot, steering, both) == 1
    assert mobility(robot, steering + np.array([0.1, 0.0, 0.0]), both) == 0


def test_what_is_wrong_with_a_count_is_said():
    with pytest.raises(ValueError, match=r"space must be 3 .* or 6, got 4"):
        grubler_mobility(4, 2, [1])
    with pytest.raises(ValueError, match="links must be 1 or more, the ground included, got 0"):
        grubler_mobility(3, 0, [1])
    with pytest.raises(ValueError, match="a joint must have 1 to 2 freedoms, got 3"):
        grubler_mobility(3, 4, [1, 3])
    with pytest.raises(ValueError, match=r"links must be a whole number, got 2\.5"):
        grubler_mobility(3, 2.5, [1])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"the freedom of a joint must be a whole number, got 1\.5"):
        grubler_mobility(3, 2, [1.5])  # type: ignore[list-item]
    with pytest.raises(ValueError, match=r"the number of casters must be a whole number, got 3\.5"):
        counted_mobility(3.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="number of casters must be 1 or more, got 0"):
        counted_mobility(0)


def test_what_is_wrong_with_a_configuration_is_said():
    robot = random_robot(44, 3)
    with pytest.raises(ValueError, match="unknown joint 'roll_4'"):
        mobility(robot, np.zeros(3), ("roll_4",))
    with pytest.raises(ValueError, match="a joint is named twice"):
        mobility(robot, np.zeros(3), ("roll_1", "roll_1"))
    with pytest.raises(ValueError, match=r"last axis of 3, got shape \(2,\)"):
        mobility(robot, np.zeros(2))
    with pytest.raises(ValueError, match="steering must be finite, got inf"):
        loop_closure(robot, [0.0, np.inf, 0.0])
