"""Section 2 of chung2008, velocities."""

import pytest

from caster_gym.papers.chung2008.kinematics import section


@pytest.fixture(scope="module")
def page():
    return section()


def test_every_statement_agrees_or_names_its_erratum(page):
    disagreeing = {check.what: check.remark for check in page.checks if not check.agrees}
    assert set(disagreeing) == {"(16): matrix of (η_2, θ_2, φ_2)", "(16) is the inverse of (13)"}
    assert all(remark.startswith("E2") for remark in disagreeing.values())


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
    (difference,) = page.differences
    assert difference.tag == "E2"
    assert "6.92 rad/s" in difference.evidence
