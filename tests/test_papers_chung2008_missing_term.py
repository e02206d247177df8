"""How large the missing term is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.papers.chung2008 import missing_term as paper


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
    assert failed[0].remark.startswith("E3")


def test_exact_model_is_closer_to_the_momenta_on_every_motion(section):
    """(F6): by a factor of a thousand at least."""
    table = next(table for table in section.tables if table.name == "missing_residuals")
    assert len(table.rows) == 12
    for _, _, force, exact, printed in table.rows:
        assert exact < 1e-3 * printed < 1e-3 * force
