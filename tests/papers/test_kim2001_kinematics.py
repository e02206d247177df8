"""Section II of kim2001."""

import pytest

from papers.kim2001.kinematics import CELLS, global_index, section
from papers.page import unexplained


@pytest.fixture(scope="module")
def page():
    return section()


def test_every_statement_agrees_or_names_its_erratum(page):
    disagreeing = {check.what: check.remark for check in page.checks if not check.agrees}
    assert {what.split(":")[0].split(" is the")[0] for what in disagreeing} == {"(22)", "(24)", "(37)"}
    assert unexplained([page]) == ()


def test_all_printed_matrices_have_a_verdict(page):
    said = [check.what for check in page.checks]
    for equation in ("(11)", "(13)", "(15)", "(16)", "(17)", "(20)", "(21)", "(22)", "(24)", "(37)"):
        assert any(what.startswith(equation) for what in said), equation


def test_determinants_are_as_printed(page):
    (determinants,) = [check for check in page.checks if check.what.startswith("determinants")]
    assert determinants.agrees
    assert determinants.printed == "−d r"


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.printed)
def test_table_2_was_computed_with_the_joints_of_the_text(cell):
    """Driven φ gives the printed digits, the rows of (37) as printed do not."""
    assert global_index(cell, corrected=True) == pytest.approx(float(cell.printed), abs=0.5e-3)
    assert abs(global_index(cell, corrected=False) - float(cell.printed)) > 1e-3


def test_differences_are_measured(page):
    """E4: 2 b / d = 4 / 0.7 at cos φ₃ = ±1, which random angles nearly reach."""
    sign, entry, rows = page.differences
    assert (sign.tag, entry.tag, rows.tag) == ("E4", "E5", "E18")
    assert "off by up to 5.71" in sign.evidence
    assert "0.453 printed, 0.4525 by φ, 0.1581 by η" in rows.evidence


def test_the_picture_shows_three_conventions(page):
    (picture,) = page.pictures
    assert [axis.get_title() for axis in picture.figure.axes] == ["here: δ", "chung2008", "kim2001"]
