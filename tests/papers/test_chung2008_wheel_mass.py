"""What heavier wheels do along the circle and the ellipse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from papers.chung2008 import wheel_mass as paper
from papers.page import unexplained

ROBOT = load_robot("chung2008")


@pytest.fixture(scope="module")
def section():
    return paper.section()


def test_wheels_of_the_printed_mass_are_the_printed_wheels():
    """Three wheels of 0.5 kg and a platform of 5 kg are the robot itself, to the digits of Table 2."""
    robot = paper.with_masses(ROBOT, 5.0, 1.5)
    for ours, printed in zip(robot.casters, ROBOT.casters, strict=True):
        assert_allclose(ours.wheel.spin_inertia, printed.wheel.spin_inertia, rtol=1e-4)
        assert_allclose(ours.wheel.yaw_inertia, printed.wheel.yaw_inertia, rtol=1e-4)
    assert_allclose((robot.platform.mass, robot.platform.inertia), (5.0, 0.025), rtol=1e-15)


def test_force_grows_in_proportion_to_the_wheels():
    """Masses enter the equations linearly."""
    case = paper.Case("circle", paper.circle(), 5.0, 3.0)
    force = paper.compute(case, ROBOT).force
    assert_allclose(force[6], 0.5 * (force[0] + force[-1]), rtol=0.0, atol=1e-13)  # round-off of 1 N


def test_force_along_the_circle_by_hand():
    """A wheel rolling along the path adds 3/2 of its mass, a solid disc's, but for the casters' lag of d / R."""
    result = paper.compute(paper.Case("circle", paper.circle(), 5.0, 3.0), ROBOT)
    alpha = 2.0 * np.pi * 10.0 / np.sqrt(3.0) / 60.0**2  # greatest of the quintic
    assert_allclose(result.change[1], 4.5 * 5.0 * alpha, rtol=2e-3)


def test_bad_masses_are_named():
    with pytest.raises(ValueError, match="platform_mass must be positive, got 0 kg"):
        paper.with_masses(ROBOT, 0.0, 1.0)
    with pytest.raises(ValueError, match="wheels_mass must not be negative, got -1 kg"):
        paper.with_masses(ROBOT, 5.0, -1.0)
    with pytest.raises(ValueError, match="wheels_mass must not be negative, got nan kg"):
        paper.with_masses(ROBOT, 5.0, float("nan"))


def test_every_check_agrees_or_names_its_erratum(section):
    failed = [check for check in section.checks if not check.agrees]
    assert [check.what for check in failed] == [
        "Figs. 13–15: the same in y, relative to the greatest force without wheels"
    ]
    assert unexplained([section]) == ()
    assert len(section.differences) == 1


def test_statements_on_the_circle_hold(section):
    """y and θ_z largely, x not that much; four times the force in half the time."""
    verdicts = {check.what: check.agrees for check in section.checks}
    names = (
        "Figs. 10–12: the force in y",
        "Figs. 10–12: the force in θ_z",
        "Fig. 10: the force in x",
        "the speed of the",
    )
    for name in names:
        assert [agrees for what, agrees in verdicts.items() if what.startswith(name)] == [True], name
