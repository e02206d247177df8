"""The sections on isotropy: what the paper prints comes out, or the page says why not."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from papers.kim2001 import isotropy, redundancy
from papers.kim2001.isotropy_pictures import local_indices
from papers.kim2001.isotropy_search import FOUR, TYPES
from papers.page import Section, unexplained

BUILDERS = (isotropy.three_joints, redundancy.four_joints, redundancy.six_joints)


@cache
def section(number: int) -> Section:
    return BUILDERS[number]()


@pytest.mark.parametrize("number", range(3))
def test_every_check_agrees_or_names_an_erratum(number):
    assert unexplained([section(number)]) == ()


@pytest.mark.parametrize(("number", "failing"), [(0, {"E9": 6, "E24": 1, "E29": 1}), (1, {"E28": 1}), (2, {"E25": 1})])
def test_what_disagrees_is_listed_with_its_evidence(number, failing):
    checks = [check for check in section(number).checks if not check.agrees]
    tags = [check.remark.partition(":")[0] for check in checks]
    assert {tag: tags.count(tag) for tag in tags} == failing
    told = [difference.tag for difference in section(number).differences]
    assert set(tags) <= set(told)


def test_cells_that_disagree_still_have_the_printed_optimum():
    for check in section(0).checks:
        if check.remark.startswith("E9"):
            assert check.ours.rpartition(" ")[0] == check.printed.rpartition(" ")[0]


def test_only_one_grid_gives_all_optima():
    rows = next(table for table in section(0).tables if table.name == "grids").rows
    assert rows[0][2:] == (50, 44)
    assert all(float(row[2]) < 50 and float(row[3]) < 44 for row in rows[1:])


def test_six_joints_are_best_at_r_equal_d_but_for_slow_turning():
    ours = [check.agrees for check in section(2).checks]
    assert ours == [False, True, True, True, True]


@pytest.mark.parametrize("joints", [TYPES[4], FOUR])
def test_indices_of_the_figures_do_not_depend_on_the_third_wheel(joints):
    local = local_indices(joints)
    np.testing.assert_array_equal(local, local[..., :1] + np.zeros_like(local))


def test_figures_show_what_their_captions_say():
    three, four = local_indices(TYPES[4])[..., 0], local_indices(FOUR)[..., 0]
    # the valleys of Fig. 5: wheel 2's link points at wheel 1's centre, at pivot 1 − d (sin φ_1, cos φ_1)
    for phi in (0.0, 90.0, 200.0):
        row = three[round(phi / 2.5)]
        wheel = np.array([-np.sqrt(3.0), -1.0]) - 0.1 * np.array([np.sin(np.radians(phi)), np.cos(np.radians(phi))])
        along = np.array([np.sqrt(3.0), -1.0]) - wheel
        valley = np.degrees(np.arctan2(along[0], along[1]))  # φ = π/2 − δ
        lowest = 2.5 * float(row[:72].argmin())
        assert abs(lowest - valley) <= 1.25  # [°] half the distance of two angles of the figure
    # Fig. 6: about 1/√3 everywhere, more or less by what a trail of 0.1a changes: some 10 %
    assert_allclose(four, 1.0 / np.sqrt(3.0), rtol=0.1)


@pytest.mark.parametrize("number", range(3))
def test_tables_are_complete(number):
    optima = section(number).tables[-1]
    assert len(optima.rows) == (125, 25, 25)[number]
    assert all(len(row) == len(optima.columns) for row in optima.rows)
