"""How large the missing term is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from papers.analysis.model_comparison import carried_mass
from papers.chung2008 import missing_term as paper
from papers.page import unexplained


@pytest.fixture(scope="module")
def section():
    return paper.section()


def test_share_at_random_is_three_to_six_percent():
    """Half of all states of the paper's robot; 10,000 draws leave less than a tenth of a percent."""
    of_bias, _ = paper.random_shares(load_robot("chung2008"))
    assert_allclose(np.percentile(of_bias, (25.0, 75.0)), (0.03, 0.06), atol=0.005)  # the statement's last digit


def test_steady_share_by_hand():
    """(F5): 0.1 kg on 5 kg."""
    assert_allclose(paper.steady_share(load_robot("chung2008")), 0.1 / 5.1, rtol=1e-9)  # the file rounds p = d / 3


def test_every_check_agrees_or_names_its_erratum(section):
    failed = [check for check in section.checks if not check.agrees]
    assert [check.printed for check in failed] == ["P*_φφφ becomes a zero array"]
    assert unexplained([section]) == ()


def test_exact_model_is_closer_to_the_momenta_on_every_motion(section):
    """(F6): by a factor of a thousand at least."""
    table = next(table for table in section.tables if table.name == "missing_residuals")
    assert len(table.rows) == 12
    for _, _, force, exact, printed in table.rows:
        assert exact < 1e-3 * printed < 1e-3 * force


def test_the_circle_is_driven_at_the_speed_that_is_named():
    """(61) reaches 15/8 of its mean speed; scaled motions reach theirs, with forces that go with its square."""
    for radius, speed in ((1.0, 1.0), (0.5, 0.3)):
        (one,) = paper.circle(radius, speed).trajectories(0.01)
        assert_allclose(np.hypot(*one.samples[:, 4:6].T).max(), speed, rtol=1e-3)  # whole time steps
        slow = paper.at_speed(one, 0.5 * speed)
        assert_allclose(np.hypot(*slow.samples[:, 4:6].T).max(), 0.5 * speed, rtol=1e-14)
        assert_allclose(slow.duration, 2.0 * one.duration, rtol=2e-3)  # twice as above
        rates = np.gradient(slow.samples[:, 4], slow.time_step)[1:-1]
        assert_allclose(slow.samples[1:-1, 7], rates, atol=1e-4 * speed)  # differences of second order


def test_what_is_missing_on_the_circle_by_hand(section):
    """(F5): the carried mass m_l p / d of all casters, 0.1 kg of chung2008's robot, at v²/R."""
    table = next(table for table in section.tables if table.name == "missing_circle")
    missing = {row[0]: row[4:] for row in table.rows if row[1] == "what is missing"}
    assert set(missing) == {"chung2008", "xr4000"}
    assert_allclose(missing["chung2008"][0], 0.1, rtol=1e-3)  # the file rounds p = d / 3
    for name, peaks in missing.items():
        assert_allclose(peaks[0], carried_mass(load_robot(name)), rtol=1e-6)
        assert_allclose(peaks[1:], 0.0, atol=1e-6 * peaks[0])  # steering is integrated to 1e-10 a step
    assert {row[2] for row in table.rows} == {1.0}
