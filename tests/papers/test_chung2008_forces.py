"""Forces along the circle of Fig. 5."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.driven_motion import lead
from papers.chung2008 import forces as paper
from papers.page import unexplained

ROBOT = load_robot("chung2008")


@pytest.fixture(scope="module")
def motion():
    return lead(paper.circle(1.0).trajectories(0.05)[0], ROBOT)


@pytest.fixture(scope="module")
def section():
    return paper.section()


def test_heading_follows_the_printed_quintic(motion):
    """(61) with a3 = 20 π / 60³, a4 = −30 π / 60⁴, a5 = 12 π / 60⁵, and the place on the circle with it."""
    beta = np.polynomial.Polynomial(paper.COEFFICIENTS)(motion.time)
    assert_allclose(motion.pose[:, 2], beta, atol=1e-12)  # round-off of 6
    assert_allclose(motion.pose[:, :2], np.stack((np.cos(beta), np.sin(beta)), axis=-1), atol=1e-12)


def test_configuration_is_kept_in_the_body_frame(motion):
    assert_allclose(np.degrees(np.pi - motion.steering[0]), [94.70, 93.95, 85.71], atol=0.005)  # to two decimals
    assert np.ptp(motion.steering, axis=0).max() < 1e-7  # the integration's tolerance is 1e-10 a step


def test_forces_without_wheels_by_hand(motion):
    """In the body frame: towards the centre m R ω², along the path m R dω/dt, and ½ m b² dω/dt."""
    force = paper.forces_along(motion, ROBOT).bare
    omega, alpha = motion.twist[:, 2], motion.twist_rate[:, 2]
    assert_allclose(force, np.stack((-5.0 * omega**2, 5.0 * alpha, 0.025 * alpha), axis=-1), atol=1e-12)


def test_missing_term_is_a_carried_mass_on_the_circle(motion):
    """(F5): 0.1 kg more run round the circle, as the casters' pivots have their mean at C."""
    forces = paper.forces_along(motion, ROBOT)
    centripetal = -0.1 * motion.twist[:, 2] ** 2
    expected = np.stack((centripetal, 0.0 * centripetal, 0.0 * centripetal), axis=-1)
    assert_allclose(forces.exact - forces.printed, expected, atol=1e-8)  # steering is integrated to 1e-8


def test_kinetic_energy_with_wheels_is_larger(motion):
    full, bare = (Model(r).kinetic_energy(motion.steering, motion.twist) for r in (ROBOT, ROBOT.without_wheels()))
    assert_allclose(full[1:-1] / bare[1:-1], (7.5379 + 2.0 * 0.0107 + 0.0397) / 5.025, rtol=1e-4)  # printed digits


def test_every_check_agrees_or_names_its_erratum(section):
    failed = [check for check in section.checks if not check.agrees]
    assert unexplained([section]) == ()
    assert sum("F_x" in check.what for check in failed) == 1
    assert len(failed) == 4  # two masses, (44), and F_x
    assert [difference.tag for difference in section.differences] == ["E1", "E13", "E14"]


def test_pictures_and_tables_are_named_apart(section):
    names = [part.name for part in (*section.pictures, *section.tables)]
    assert len(set(names)) == len(names) == 6
