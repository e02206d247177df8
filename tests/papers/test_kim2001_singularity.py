"""kim2001, (24) to (27) and Figs. 2 to 4: what is printed, corrected, and drawn."""

import numpy as np
import pytest

from caster_gym import Model
from papers.analysis.action_lines import smallest_singular_value
from papers.kim2001.singularity import (
    FOUR_JOINTS,
    JOINTS_2,
    determinant_27,
    section,
)
from papers.notation import KIM2001, in_words, kim2001_robot, lengths_of

ROBOT = kim2001_robot(radius=0.3, trail=0.4, a=0.7)
LENGTHS = lengths_of(ROBOT)
PHI = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, 3))
ROUNDING = 1e-11  # of determinants of the order of 100


@pytest.fixture(scope="module")
def made():
    return section()


def test_the_corrected_determinant_is_that_of_the_mechanics():
    """E6."""
    rows = Model(ROBOT).jacobian(KIM2001.steering(PHI), JOINTS_2) * [[1.0], [1.0], [-1.0]]  # φ̇ = −δ̇
    np.testing.assert_allclose(determinant_27(LENGTHS, PHI, corrected=True), np.linalg.det(rows), atol=ROUNDING)


def test_the_first_term_alone_is_printed_wrong():
    """E6: its sign is turned."""
    p1, p2, p3 = PHI.T
    first = np.sin(p1 - p2) * (0.4 - 3.0 * 0.7 * np.cos(p3)) / (0.4 * 0.3**2)
    difference = determinant_27(LENGTHS, PHI, corrected=True) - determinant_27(LENGTHS, PHI)
    np.testing.assert_allclose(difference, 2.0 * first, atol=ROUNDING)


@pytest.mark.parametrize("phi", [(0.0, 0.0, 90.0), (30.0, 30.0, 120.0), (90.0, 90.0, 0.0)])
def test_the_determinant_vanishes_at_parallel_lines_worked_out_by_hand(phi):
    """In the paper's angles: links 1 and 2 alike, axle 3 at right angles to link 3, so φ_3 = φ_1 + 90° (or − 90°)."""
    assert determinant_27(LENGTHS, np.radians(phi), corrected=True) == pytest.approx(0.0, abs=ROUNDING)


def test_the_determinant_vanishes_where_links_point_at_c_and_the_axle_passes_through_it():
    """By symmetry φ_1 = −φ_2 = −60° points both links along lines through C; f·(C − A) = −d turns axle 3 through it."""
    upwards = np.arccos(0.4 / 1.4)  # caster 3 at (0, b): −b sin δ = −d with sin δ = cos φ
    phi = (np.pi / 3.0, -np.pi / 3.0, upwards)
    assert determinant_27(LENGTHS, phi, corrected=True) == pytest.approx(0.0, abs=ROUNDING)


@pytest.mark.parametrize("letters", [*FOUR_JOINTS, "θ_1 θ_2 φ_3", "θ_1 φ_2 θ_3"])
def test_sets_of_the_figures_push_everywhere_at_other_angles(letters):
    """They are singular somewhere, not always."""
    assert smallest_singular_value(ROBOT, KIM2001.steering(PHI), in_words(letters)).max() > 0.3


def test_every_statement_agrees_or_names_its_erratum(made):
    assert len(made.checks) == 11
    assert [check.remark for check in made.checks if not check.agrees] == ["E6"]


def test_the_figures_are_drawn(made):
    """Smoke test: Figs. 2, 3 with two panels, Fig. 4 with four."""
    assert [len(picture.figure.axes) for picture in made.pictures] == [2, 2, 4]
    titles = [axis.get_title() for picture in made.pictures for axis in picture.figure.axes]
    assert all("σ = " in title and float(title.split("σ = ")[1].split("\n")[0]) < 1e-12 for title in titles)
