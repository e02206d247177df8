"""The search behind Tables 1 and 2, against the paper's own matrices, written down once more."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from papers.kim2001.isotropy_search import (
    FOUR,
    GRID,
    SIX,
    TYPES,
    at_printed,
    indices,
    is_printed,
    optimum,
    printed_cells,
)


def printed_row(letter: str, number: int, phi: np.ndarray, r: float, d: float) -> np.ndarray:
    """Row θ̇ or φ̇ of kim2001 (13), with a = 1, b = 2, l = 2√3."""
    x, y = ((-np.sqrt(3.0), -1.0), (np.sqrt(3.0), -1.0), (0.0, 2.0))[number - 1]
    s, c = np.sin(phi[..., number - 1]), np.cos(phi[..., number - 1])
    rows = {
        "θ": (d * s, d * c, d * x * c - d * y * s),
        "φ": (r * c, -r * s, d * r - r * x * s - r * y * c),
    }
    return np.stack(rows[letter], axis=-1) / (d * r)


def mean_of_printed(joints: str, r: float, d: float, rate_ratio: float, twist_ratio: float, count: int) -> float:
    """(35) over `count` angles of each wheel, by singular values of the rows divided by their greatest rates."""
    angles = 2.0 * np.pi / count * np.arange(count)
    phi = np.array(list(product(angles, repeat=3)))
    tops = {"θ": 1.0, "φ": rate_ratio}
    rows = [printed_row(j[0], int(j[2]), phi, r, d) / tops[j[0]] for j in joints.split()]
    twist = np.array([1.0 / twist_ratio, 1.0 / twist_ratio, 1.0])
    values = np.linalg.svd(np.stack(rows, axis=-2) * twist, compute_uv=False)
    return float((values[:, -1] / values[:, 0]).mean())


@pytest.mark.parametrize(
    ("joints", "letters"),
    [
        (TYPES[1], "θ_1 θ_2 θ_3"),
        (TYPES[2], "θ_1 θ_2 φ_3"),
        (TYPES[3], "θ_1 φ_2 φ_3"),
        (TYPES[4], "θ_1 φ_1 θ_2"),
        (TYPES[5], "θ_1 φ_1 φ_2"),
        (FOUR, "θ_1 φ_1 θ_2 φ_2"),
        (SIX, "θ_1 φ_1 θ_2 φ_2 θ_3 φ_3"),
    ],
    ids=["1", "2", "3", "4", "5", "four", "six"],
)
def test_index_is_that_of_the_papers_matrices(joints, letters):
    """(28), (31), (35)–(37): in the paper's letters and in ours."""
    demand = (0.7, 1.6, 0.5, 0.5)
    expected = mean_of_printed(letters, *demand, count=12)
    # singular steerings are on this grid; there the kernel's index is right to the root of rounding
    assert_allclose(indices(joints, *demand, interval=np.radians(30.0)), expected, atol=1e-8)


def test_index_has_the_shape_of_its_arguments():
    r, rate_ratio = np.array([[0.1], [1.0]]), np.array([0.1, 1.0, 10.0])
    values = indices(TYPES[4], r, 0.1, rate_ratio, 0.5)
    assert values.shape == (2, 3)
    assert_allclose(values[1, 2], float(indices(TYPES[4], 1.0, 0.1, 10.0, 0.5)))


def test_tables_have_a_cell_for_every_demand():
    for table in (1, 2):
        assert [cell.place for cell in printed_cells(table)] == list(product(range(5), repeat=2))
    assert {cell.joints for cell in printed_cells(1)} == {TYPES[4], TYPES[5]}
    assert {cell.joints for cell in printed_cells(2)} == {FOUR}


@pytest.mark.parametrize(("table", "sets"), [(1, (TYPES[1], TYPES[4], TYPES[5])), (2, (FOUR,))])
def test_search_finds_every_printed_optimum(table, sets):
    """On the grid of twenty values; types 2 and 3 are searched with the section."""
    for cell in printed_cells(table):
        best = optimum(cell.place, sets)
        assert is_printed(best, cell)
        assert (best.r, best.d) == (cell.r, cell.d)


def test_printed_indices_agree_but_for_the_erratum():
    """E9: 0.04 in the column 5, and 0.14 in row 5, column 0.1."""
    for table, half_unit in ((1, 0.005), (2, 0.0005)):
        cells = printed_cells(table)
        off = np.abs(at_printed(cells) - [float(cell.sigma) for cell in cells])
        wrong = [(c.rate_ratio, c.twist_ratio) for c, o in zip(cells, off, strict=True) if o > half_unit + 1e-9]
        column = [(ratio, 5.0) for ratio in (0.1, 0.5, 1.0, 5.0, 10.0)]
        assert sorted(wrong) == (sorted([*column, (5.0, 0.1)]) if table == 1 else [])


def test_the_grid_needs_its_odd_value():
    """Both printed indices of [3.9, 10] exclude 10^0.6 = 3.98."""
    three, four = (float(indices(joints, 3.9, 10.0, 0.5, 0.1)) for joints in (TYPES[5], FOUR))
    other_three, other_four = (float(indices(joints, 10.0**0.6, 10.0, 0.5, 0.1)) for joints in (TYPES[5], FOUR))
    assert (round(three, 2), round(four, 3)) == (0.33, 0.452)
    assert (round(other_three, 2), round(other_four, 3)) == (0.32, 0.453)
    assert len(GRID) == 20


def test_six_joints_do_better_off_r_equal_d_when_turning_is_slow():
    """ω_max/v_max = 0.1/a: by the paper's matrices, [7.9, 10] beats [10, 10], the best with r = d."""
    letters = "θ_1 φ_1 θ_2 φ_2 θ_3 φ_3"
    assert mean_of_printed(letters, 7.9, 10.0, 1.0, 0.1, 24) > mean_of_printed(letters, 10.0, 10.0, 1.0, 0.1, 24) + 0.01
    even = indices(SIX, GRID, GRID, 1.0, 0.1)
    assert int(even.argmax()) == GRID.index(10.0)
