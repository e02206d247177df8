"""The page on the natural orthogonal complement: what is printed, and what is claimed there."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.orthogonal_complement import OrthogonalComplement
from papers.chung2008.complement import section
from papers.chung2008.complement_checks import LIMIT, PAPER_SET, printed_loops
from papers.chung2008.complement_runs import DECADES, DISTANCES, STEP, drive, power
from papers.notation import CHUNG2008, lengths_of
from papers.page import unexplained

CHUNG = load_robot("chung2008")


@pytest.fixture(scope="module")
def page():
    return section()


def test_every_check_agrees_or_names_an_erratum(page):
    assert len(page.checks) == 9
    assert unexplained([page]) == ()
    assert [check.agrees for check in page.checks].count(False) == 1  # (27) against the printed (47)


def test_the_printed_loops_are_ours_but_for_the_signs_of_the_letters():
    """(A7), (A9): θ̇ and φ̇ of the paper count against θ̇ and δ̇."""
    steering = np.array([0.3, -1.1, 2.0])
    ours = OrthogonalComplement(CHUNG, PAPER_SET).loops(steering)
    printed = printed_loops(CHUNG2008.steering(steering), lengths_of(CHUNG))
    assert_allclose(ours[0] * [1.0, -1.0, 1.0, -1.0, 1.0, -1.0], printed[0], atol=1e-12)  # rounding
    assert_allclose(ours[1] * [-1.0, -1.0, -1.0], printed[1], atol=1e-12)


def test_the_drive_follows_its_circle():
    driven = drive(CHUNG)
    reach = np.hypot(*(driven.states[:, :2] - [0.0, 0.5]).T)
    assert_allclose(reach, 0.5, atol=0.01)  # torques are held over a step of 10 ms, without feedback on the place
    assert_allclose(driven.states[-1], Model(CHUNG).simulate(driven.states[-2], driven.torques[-1], STEP, 1)[-1])


def test_a_power_is_found():
    assert power(np.array([7.0 * DISTANCES[DECADES] ** -3])) == pytest.approx(3.0)


def test_changing_the_set_keeps_what_the_papers_set_loses(page):
    table = page.tables[0]
    alone, best, *changed = (dict(zip(table.columns, row, strict=True)) for row in table.rows)
    for single in (alone, best):
        assert single["condition number"] > 1e3
        place = single["of the place [mm]"]
        assert place > 1.0 if isinstance(place, float) else "lost after" in place
    for row, limit in zip(changed, (LIMIT, 1000.0), strict=True):
        assert row["condition number"] <= limit
        assert 0 < int(row["changes"]) < 20
        assert row["error of ν̇"] < 1e-9  # see ROUNDING
    assert changed[0]["of the place [mm]"] < 1e-3


def test_the_page_is_complete(page):
    """Smoke test: two tables, two pictures, the evidence for (E3)."""
    assert [table.name for table in page.tables] == ["complement_switching", "complement_cost"]
    assert [p.name for p in page.pictures] == ["complement_singularity", "complement_path"]
    assert [difference.tag for difference in page.differences] == ["E3"]
    assert all(len(row) == len(table.columns) for table in page.tables for row in table.rows)
