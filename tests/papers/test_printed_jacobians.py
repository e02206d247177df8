"""The printed matrices: right but for E2, E4, E5 and the rows of (37), each wrong by what its misprint says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from papers.jacobian_checks import check_matrix, compare
from papers.notation import CHUNG2008, KIM2001, kim2001_robot, lengths_of
from papers.printed_jacobians import (
    CHUNG2008_FORWARD,
    CHUNG2008_INVERSE,
    KIM2001_FORWARD,
    KIM2001_FOUR,
    KIM2001_GENERAL,
    KIM2001_INVERSE,
    KIM2001_THREE,
)
from tests.random_robots import random_robot

CHUNG = (*CHUNG2008_FORWARD, *CHUNG2008_INVERSE)
KIM = (*KIM2001_GENERAL, *KIM2001_FORWARD, *KIM2001_INVERSE, KIM2001_THREE, KIM2001_FOUR)
PHI = np.random.default_rng(3).uniform(-np.pi, np.pi, (100, 3))
ROUNDING = 1e-12  # [-] of the greatest entry

ROBOTS = {"chung2008": load_robot("chung2008"), "kim2001": kim2001_robot(0.3, 0.7)}


@pytest.mark.parametrize("matrix", [*CHUNG, *KIM], ids=lambda m: f"{m.notation.name} {m.equation}")
def test_printed_matrices_are_the_mechanics_once_corrected(matrix):
    robot = ROBOTS[matrix.notation.name]
    ours = matrix.from_mechanics(robot, PHI)
    corrected = matrix(PHI, lengths_of(robot), corrected=True)
    assert_allclose(corrected, ours, rtol=0.0, atol=ROUNDING * np.abs(ours).max())
    if not matrix.tag:
        assert_allclose(matrix(PHI, lengths_of(robot)), corrected, rtol=0.0, atol=0.0)


def test_only_four_matrices_are_misprinted_and_the_wrong_entries_are_found():
    wrong = {}
    for matrix in (*CHUNG, *KIM):
        found = compare(matrix, ROBOTS[matrix.notation.name], PHI)
        if found.wrong:
            wrong[matrix.notation.name, matrix.equation] = (matrix.tag, found.places)
    rows = "row 1; row 2; row 3; row 4"
    assert wrong.pop(("kim2001", "(37)"))[1] == rows
    assert wrong == {
        ("chung2008", "(16)"): ("E2", "row 1, column 3"),
        ("kim2001", "(22)"): ("E4", "row 1, column 3"),
        ("kim2001", "(24)"): ("E5", "row 3, column 3"),
    }


@pytest.mark.parametrize(
    ("matrix", "row", "size"),
    [
        (CHUNG2008_INVERSE[1], 0, lambda p: p.l / p.d * np.cos(PHI[:, 1])),  # E2: twice (l/2) r cos φ₂, over d r
        (KIM2001_INVERSE[2], 0, lambda p: -2.0 * p.b / p.d * np.cos(PHI[:, 2])),  # E4: twice b r cos φ₃, over d r
        (KIM2001_THREE, 2, lambda p: (p.b - p.d) / p.d * np.cos(PHI[:, 2])),  # E5: d in the place of b
    ],
)
def test_a_misprint_is_as_large_as_its_letters_say(matrix, row, size):
    robot = ROBOTS[matrix.notation.name]
    lengths = lengths_of(robot)
    off = matrix(PHI, lengths) - matrix.from_mechanics(robot, PHI)
    assert_allclose(off[:, row, 2], size(lengths), atol=1e-12)  # of entries of up to 40
    off[:, row, 2] = 0.0
    assert_allclose(off, 0.0, atol=1e-12)


def test_the_printed_rows_of_37_are_those_of_eta_and_theta():
    robot = ROBOTS["kim2001"]
    passive = KIM2001.inverse_jacobian(robot, PHI)[:, :2, :2].reshape(-1, 4, 3)  # η₁, θ₁, η₂, θ₂
    assert_allclose(KIM2001_FOUR(PHI, lengths_of(robot)), passive, atol=1e-12)


def test_forward_matrices_have_determinants_of_trail_times_radius():
    """−d r in kim2001, as it says; d r in chung2008, where the wheel rolls the other way."""
    for matrices, robot, sign in (
        (CHUNG2008_FORWARD, ROBOTS["chung2008"], 1.0),
        (KIM2001_FORWARD, ROBOTS["kim2001"], -1.0),
    ):
        p = lengths_of(robot)
        for matrix in matrices:
            assert_allclose(np.linalg.det(matrix(PHI, p)), sign * p.d * p.r, rtol=1e-12)


def test_complex_angles_give_derivatives():
    matrix, p = CHUNG2008_FORWARD[0], lengths_of(ROBOTS["chung2008"])
    change = matrix(PHI + 1e-30j, p).imag / 1e-30
    hessian = CHUNG2008.forward_hessian(ROBOTS["chung2008"], PHI)[:, 0]
    assert_allclose(change, hessian[..., 2], atol=1e-15)


def test_verdicts_name_entry_and_erratum():
    verdict = check_matrix(CHUNG2008_INVERSE[1], ROBOTS["chung2008"], PHI)
    assert not verdict.agrees
    assert "row 1, column 3" in verdict.ours
    assert verdict.remark.startswith("E2")
    assert check_matrix(CHUNG2008_INVERSE[0], ROBOTS["chung2008"], PHI).agrees


def test_what_is_wrong_with_angles_or_robot_is_said():
    with pytest.raises(ValueError, match=r"φ must have a last axis of 3, got shape \(2,\)"):
        CHUNG2008_FORWARD[0](np.zeros(2), lengths_of(ROBOTS["chung2008"]))
    with pytest.raises(ValueError, match="for 3 casters"):
        compare(CHUNG2008_FORWARD[0], random_robot(53, 4), PHI)
