"""Section 2 of chung2008, velocities."""

import pytest

from papers.chung2008.kinematics import section
from papers.page import unexplained


@pytest.fixture(scope="module")
def page():
    return section()


def test_every_statement_agrees_or_names_its_erratum(page):
    disagreeing = {check.what: check.remark for check in page.checks if not check.agrees}
    assert set(disagreeing) == {
        "introduction, on Campion et al.: motors that three casters need to avoid singularity",
        "(16): matrix of (η_2, θ_2, φ_2)",
        "(16) is the inverse of (13)",
    }
    assert unexplained([page]) == ()


def test_mobility_is_three_as_printed(page):
    """(1): counted, and found as motions at every sampled configuration."""
    mobility = [check for check in page.checks if "obility" in check.what]
    assert [check.printed[0] for check in mobility] == ["3", "3"]
    assert all(check.ours.startswith("3") and "…" not in check.ours for check in mobility)


def test_all_printed_equations_have_a_verdict(page):
    said = " ".join(check.what for check in page.checks)
    for equation in ("(1)", "(3)–(11)", "(12)", "(13)", "(14)", "(15)", "(16)", "(17)", "(35)", "(36)", "(37)", "(38)"):
        assert equation in said


def test_the_difference_is_measured(page):
    """E2: l / d = 0.173 / 0.025 at cos φ₂ = ±1, which random angles nearly reach."""
    difference, _ = page.differences
    assert difference.tag == "E2"
    assert "6.92 rad/s" in difference.evidence


def test_four_motors_are_enough(page):
    """E27: against "more than four", from all sets of joints; kim2001 names the same three."""
    check, difference = page.checks[0], page.differences[1]
    assert not check.agrees and check.ours.startswith("4: (θ_1, φ_1, θ_2, φ_2), (θ_1, φ_1, θ_3, φ_3), ")
    assert difference.tag == "E27"
    assert "of all 63 sets of joints the smallest without singularity have 4" in difference.evidence
    assert "6 of 6 sets of five have none either" in difference.evidence
