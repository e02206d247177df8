"""kim2001, Tables 1 and 2: the printed cells, and the search over wheels and steering links that made them."""

import csv
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.design.isotropy import INTERVAL, global_isotropies
from papers.notation import in_letters, in_words, kim2001_robot
from papers.page import Check, Table, check_number

RATIOS = (0.1, 0.5, 1.0, 5.0, 10.0)  # of the top rates of steering and rolling, and of ω_max and v_max [1/a]
GRID = (*(k / 10.0 for k in range(1, 10)), 1.0, 1.3, 1.6, 2.0, 2.5, 3.2, 3.9, 5.0, 6.3, 7.9, 10.0)  # of r and d [a]
EXACT_TENTHS = tuple(10.0 ** (k / 10.0) for k in range(11))
OTHER_GRIDS = {
    "tenths of a to 1, then 10^(k/10) unrounded": (*GRID[:9], *EXACT_TENTHS),
    "10^(k/10) from 0.1 on": (*(0.1 * x for x in EXACT_TENTHS[:-1]), *EXACT_TENTHS),
    "tenths of a to 1, then whole a": (*GRID[:9], *map(float, range(1, 11))),
}
TYPES = {
    1: in_words("θ_1 θ_2 θ_3"),
    2: in_words("θ_1 θ_2 φ_3"),
    3: in_words("θ_1 φ_2 φ_3"),
    4: in_words("θ_1 φ_1 θ_2"),
    5: in_words("θ_1 φ_1 φ_2"),
}
FOUR = in_words("θ_1 φ_1 θ_2 φ_2")
SIX = in_words("θ_1 φ_1 θ_2 φ_2 θ_3 φ_3")
ROBOT = kim2001_robot(0.1, 0.1)


class Cell(NamedTuple):
    """A cell of Table 1 or 2: the demand, the best design found and its index, as printed."""

    rate_ratio: float
    twist_ratio: float
    joints: tuple[str, ...]
    r: float
    d: float
    sigma: str

    @property
    def place(self) -> tuple[int, int]:
        """Its row and column."""
        return RATIOS.index(self.rate_ratio), RATIOS.index(self.twist_ratio)


class Optimum(NamedTuple):
    """The best design of a search."""

    joints: tuple[str, ...]
    r: float
    d: float
    sigma: float


@cache
def printed_cells(table: int) -> tuple[Cell, ...]:
    """The cells of Table 1 or 2, row by row."""
    text = (files("papers.kim2001") / f"table{table}.csv").read_text(encoding="utf-8")
    cells = []
    for row in csv.DictReader(text.splitlines()):
        rates, twists, r, d = (float(row[name]) for name in ("rate_ratio", "twist_ratio", "r", "d"))
        joints = TYPES[int(row["type"])] if "type" in row else FOUR
        cells.append(Cell(rates, twists, joints, r, d, row["sigma"]))
    return tuple(cells)


def indices(
    joints: Sequence[str],
    r: ArrayLike,
    d: ArrayLike,
    rate_ratio: ArrayLike,
    twist_ratio: ArrayLike,
    interval: float = INTERVAL,
) -> Array:
    """σ_GI, (35), for arrays of designs and demands that go together by NumPy's rules."""
    parts = np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in (r, d, rate_ratio, twist_ratio)))
    radius, trail, rate, twist = (part.ravel() for part in parts)
    one = np.ones_like(rate)
    tops = np.stack([one if joint.startswith("roll") else rate for joint in joints], axis=1)
    twists = np.stack([1.0 / twist, 1.0 / twist, one], axis=1)
    return global_isotropies(ROBOT, joints, twists, tops, radius, trail, interval).reshape(parts[0].shape)


@cache
def searched(joints: tuple[str, ...], grid: tuple[float, ...] = GRID) -> Array:
    """σ_GI (5, 5, n, n) for every demand and every r and d of a grid."""
    g, x = np.array(grid), np.array(RATIOS)
    return indices(joints, g[:, None], g, x[:, None, None, None], x[:, None, None])


def optimum(place: tuple[int, int], sets: Sequence[tuple[str, ...]], grid: tuple[float, ...] = GRID) -> Optimum:
    """The best of some joint sets on a grid, for a demand."""
    found = []
    for joints in sets:
        values = searched(joints, grid)[place]
        i, j = np.unravel_index(int(values.argmax()), values.shape)
        found.append(Optimum(joints, grid[i], grid[j], float(values[i, j])))
    return max(found, key=lambda one: one.sigma)


def is_printed(best: Optimum, cell: Cell) -> bool:
    """Is it the optimum that a cell lists, with one digit after the point, rounded or cut off?"""
    off = max(abs(best.r - cell.r), abs(best.d - cell.d))
    return best.joints == cell.joints and off < 0.1 - 1e-9


def at_printed(cells: Sequence[Cell], inverted: bool = False, interval: float = INTERVAL) -> Array:
    """Our index at each cell's design; inverted: with the columns read as they are headed, v_max/ω_max."""
    power = -1.0 if inverted else 1.0
    return np.array([float(indices(c.joints, c.r, c.d, c.rate_ratio, c.twist_ratio**power, interval)) for c in cells])


def agrees(cell: Cell, ours: float) -> bool:
    """Does an index agree with a cell's printed digits?"""
    return check_number("", cell.sigma, ours).agrees


def design(joints: Sequence[str], r: float, d: float) -> str:
    """A joint set and its [r, d] as the tables print them."""
    return f"{in_letters(joints)} [{r:g}, {d:g}]"


def cell_checks(table: int, sets: Sequence[tuple[str, ...]]) -> list[Check]:
    """For every cell: is its design the best, and does its index agree?"""
    checks, cells = [], printed_cells(table)
    for cell, ours in zip(cells, at_printed(cells), strict=True):
        best, number = optimum(cell.place, sets), check_number("", cell.sigma, float(ours))
        found = is_printed(best, cell)
        what = f"Table {table}, φ̇_max/θ̇_max = {cell.rate_ratio:g}, ω_max/v_max = {cell.twist_ratio:g}/a"
        checks.append(
            Check(
                f"{what}: best set and [r, d] / a, index",
                f"{design(cell.joints, cell.r, cell.d)} {cell.sigma}",
                f"{design(best.joints, best.r, best.d)} {number.ours}",
                found and number.agrees,
                "E9: the best design agrees, its index does not" if found and not number.agrees else "",
            )
        )
    return checks


def optima_table(name: str, sets: Sequence[tuple[str, ...]]) -> Table:
    """The best design of each joint set for every demand."""
    rows = [
        (x, y, in_letters(joints), *optimum((i, j), (joints,))[1:])
        for i, x in enumerate(RATIOS)
        for j, y in enumerate(RATIOS)
        for joints in sets
    ]
    columns = ("φ̇_max/θ̇_max", "ω_max/v_max [1/a]", "joints", "r [a]", "d [a]", "σ_GI")
    return Table(name, "The best design on the paper's grid for every demand.", columns, rows)
