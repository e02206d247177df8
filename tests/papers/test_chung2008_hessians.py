"""Section 2 of chung2008, accelerations."""

import pytest

from papers.chung2008.hessians import section
from papers.page import unexplained


@pytest.fixture(scope="module")
def page():
    return section()


def test_every_statement_agrees_or_names_its_erratum(page):
    disagreeing = {check.what: check.remark for check in page.checks if not check.agrees}
    assert set(disagreeing) == {"(18): ü = G φ̇ + φ̇ᵀ H φ̇", 'A.1: "Position Hessian matrix is symmetric"'}
    assert unexplained([page]) == ()
    assert len(page.differences) == 2


def test_the_skew_part_over_ground_is_half_the_radius(page):
    """0.0125 m of 0.025 m, for rolling and yaw; (J7) is tested with the Hessian itself."""
    (symmetry,) = [check for check in page.checks if "Position" in check.what]
    assert "over ground 0.0125 m (r/2) of θ and η, " in symmetry.ours


def test_the_hessian_stands_in_a_table_as_its_closed_form(page):
    """Of the first caster at φ = 30°: ∂/∂φ of (12), its columns of η (−d sin φ, −d cos φ) and θ (r cos φ, −r sin φ)."""
    (table,) = page.tables
    body = {tuple(row[:3]): row[3] for row in table.rows if row[3] != 0.0}
    d = r = 0.025
    expected = {
        ("v_x", "η", "φ"): -d * 3.0**0.5 / 2.0,
        ("v_y", "η", "φ"): d / 2.0,
        ("v_x", "θ", "φ"): -r / 2.0,
        ("v_y", "θ", "φ"): -r * 3.0**0.5 / 2.0,
    }
    assert body == pytest.approx(expected, rel=1e-12)


def test_the_loop_of_the_picture_stays_open_by_about_r(page):
    """2 r ε sin(ε/2) of ε = 0.8 rad, in mm: the wheel's centre leaves along f and returns along f turned by ε."""
    (picture,) = page.pictures
    assert "C is 15.6 mm off" in picture.caption
    assert len(picture.figure.axes) == 2
