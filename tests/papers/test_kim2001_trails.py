"""The section on long and on unequal trails: E10, and three motors that are enough."""

import numpy as np
import pytest

from caster_gym.design.joint_sets import classify
from papers.analysis.action_lines import smallest_singular_value
from papers.kim2001.trails import THREE_MOTORS, section, unequal_robot
from papers.page import unexplained


@pytest.fixture(scope="module")
def made():
    return section()


def test_only_the_long_trails_of_table_2_disagree(made):
    """E10: l/2 = √3 a lies between 1 a and 6.3 a."""
    assert len(made.checks) == 6
    failed = [check for check in made.checks if not check.agrees]
    assert [check.what.split("d = ")[1].split(" a")[0] for check in failed] == ["6.3", "10"]
    assert unexplained([made]) == ()
    assert {difference.tag for difference in made.differences} == {"E10"}


def test_the_least_singular_value_falls_with_the_trail(made):
    (table,) = made.tables
    lower, upper = np.array([row[3:5] for row in table.rows], dtype=float).T
    assert (np.diff(upper[:4]) < 0.0).all() and (lower[:4] > 0.4).all()
    assert (upper[4:] < 1e-12).all()  # rounding


def test_three_motors_are_enough_on_the_robot_drawn():
    robot = unequal_robot()
    assert classify(robot, THREE_MOTORS).singular == "never"
    steering = np.random.default_rng(0).uniform(-np.pi, np.pi, (20000, 3))
    assert smallest_singular_value(robot, steering, THREE_MOTORS).min() > 0.1


def test_the_pictures_are_drawn(made):
    """Smoke test."""
    assert [len(picture.figure.axes) for picture in made.pictures] == [2, 1]
