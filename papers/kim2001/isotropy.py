"""kim2001, section IV: how evenly three joints move the platform, Table 1 and Fig. 5."""

from collections.abc import Sequence

import numpy as np

from caster_gym.arrays import Array
from caster_gym.design.isotropy import INTERVAL
from papers.kim2001.isotropy_pictures import FIGURES, contours, local_indices
from papers.kim2001.isotropy_search import (
    FOUR,
    GRID,
    OTHER_GRIDS,
    RATIOS,
    TYPES,
    Cell,
    agrees,
    at_printed,
    cell_checks,
    design,
    indices,
    is_printed,
    optima_table,
    optimum,
    printed_cells,
    searched,
)
from papers.kim2001.steering_only import text as text_on_steering
from papers.kim2001.steering_only import workspace_check
from papers.notation import in_letters
from papers.page import Check, Difference, Picture, Section, Table, check_number

LAST_DIGIT = 5e-4  # half a unit of it in Table 2


def three_joints() -> Section:
    """Table 1, its text and Fig. 5."""
    cells, sets = printed_cells(1), tuple(TYPES.values())
    every_cell = (*cells, *printed_cells(2))
    right, as_headed = (_agreeing(every_cell, inverted) for inverted in (False, True))
    tables = ((sets, cells), ((FOUR,), printed_cells(2)))
    found = sum(is_printed(optimum(cell.place, of), cell) for of, some in tables for cell in some)
    wrong = [(cell, ours) for cell, ours in zip(cells, at_printed(cells), strict=True) if not agrees(cell, ours)]
    kept = sum(is_printed(optimum(cell.place, sets), cell) for cell, _ in wrong)
    greatest = np.array([[[searched(joints)[i, j].max() for joints in sets] for j in range(5)] for i in range(5)])
    either = int((greatest.argmax(axis=2) >= 3).sum())
    both = greatest[..., 3:].min(axis=2) > greatest[..., :3].max(axis=2)
    finer = np.abs(at_printed(every_cell, interval=INTERVAL / 2.0) - at_printed(every_cell)).max()
    example, headed_example = (float(indices(TYPES[4], 0.1, 0.1, 1.0, ratio)) for ratio in (0.5, 2.0))
    best = optimum((RATIOS.index(1.0), RATIOS.index(0.5)), sets)
    over_third = np.ptp(local_indices(TYPES[4]), axis=2).max()
    beaten = "ω_max/v_max = " + ", ".join(f"{RATIOS[j]:g}/a" for j in np.unique(np.nonzero(~both)[1]))
    checks = (
        *cell_checks(1, sets),
        check_number(f"IV: σ_GI of (θ_1, φ_1, θ_2), {FIGURES}", "0.369", example),
        Check(
            "IV: the best set and design for that demand",
            f"{in_letters(TYPES[4])} [0.1, 0.1]",
            design(best.joints, best.r, best.d),
            (best.joints, best.r, best.d) == (TYPES[4], 0.1, 0.1),
        ),
        Check("IV: the best set is of type 4 or 5", "for every demand", f"for {either} of 25", either == both.size),
        Check(
            "IV: types 4 and 5 are both better than the others",
            "for every demand",
            f"for {both.sum()} of 25",
            bool(both.all()),
            "" if both.all() else f"E24: Table 1 lists winners; another type is better than one of them where {beaten}",
        ),
        _rolling_joints_check(),
        workspace_check(),
        Check(
            "IV: a finer interval than 5° does not improve the accuracy much",
            "not much",
            f"2.5° changes the index of the {len(every_cell)} cells of both tables by {finer:.1g} at most",
            bool(finer < LAST_DIGIT),
        ),
    )
    text = f"""
The index (28) is the ratio of least to greatest singular value of the normalised Jacobian (31). Its mean (35) over a 5°
grid of the steering angles that enter is searched over the paper's grid of r and d, for every joint set and demand.

The sentence that describes this grid cannot be read as it stands. {len(GRID)} values give {found} of the
{len(every_cell)} optima of both tables, types included:
{", ".join(f"{x:g}" for x in GRID)}, times a. These are the tenths of a, then 10^(k/10) in two digits, with 3.9
instead of 4. The 3.9 is no misprint: {_why_not_398()}.

The columns of Table 1 are headed v_max/ω_max, those of Table 2 σ_min/σ_max in the scanned text; both hold ω_max/v_max
in units of 1/a (E8). So read, {right} of the {len(every_cell)}
printed indices agree to their last digit; as headed, {as_headed} would. (The same numbers come out if the heads are
right and the first matrix of (31) was inverted; the text of section V speaks for the heads being wrong.) The
{len(wrong)} others are in Table 1 (E9): {kept} of their designs are the optima, but the index there is another.

The best set is of type 4 or 5 for {either} of 25 demands. That both are better than the three others holds for
{both.sum()} of them. Type 1 has rolling joints only, so that neither r nor d changes its index. Fig. 5 averages over
φ_3, on which the index of (θ_1, φ_1, θ_2) does not depend (it changes by {over_third:.1g}).
{text_on_steering()}"""
    place = "at (φ̇_max/θ̇_max, ω_max/v_max) = "
    return Section(
        "Isotropy with three joints: Table 1 and Fig. 5",
        text,
        checks,
        (_grids(), optima_table("optima_three_joints", sets)),
        (
            Picture(
                "figure_5",
                "Index of three joints over two steering angles, Fig. 5",
                f"Fig. 5: index of (θ_1, φ_1, θ_2) at {FIGURES}. In the dark valleys it falls "
                "to zero: there the steering link of wheel 2 points at the centre of wheel 1, through "
                "which the lines of θ_1 and φ_1 go.",
                contours(TYPES[4], 0.05),
            ),
        ),
        (
            Difference(
                "E7",
                "(31)",
                "matrices that cannot be read",
                "G* = diag(1/vx_max, 1/vy_max, 1/ω_max) G diag(φ̇_1max, φ̇_2max, φ̇_3max)",
                f"so read, {right} of {len(every_cell)} printed indices agree to their last digit",
                nature="scan, probably",
            ),
            Difference(
                "E8",
                "head of Table 1; IV, text",
                "v_max/ω_max",
                "ω_max/v_max, in 1/a, as section V says; the head of Table 2, σ_min/σ_max in the scan, means the same",
                f"{right} of {len(every_cell)} printed indices agree, {as_headed} with the columns as headed; the "
                f"0.369 of the text is {example:.4f}, and would be {headed_example:.4f} for v_max/ω_max = 0.5a",
            ),
            Difference(
                "E9",
                "Table 1",
                place + "; ".join(f"({c.rate_ratio:g}, {c.twist_ratio:g}): {c.sigma}" for c, _ in wrong),
                "; ".join(f"{ours:.4f}" for _, ours in wrong),
                f"the indices of all other cells of both tables agree, and {found} of the {len(every_cell)} optima",
            ),
            Difference(
                "E24",
                "IV, on Table 1",
                "types 5 and 4 have better global isotropic performance than the other sets",
                f"true of the winners, which are all that Table 1 lists: one of the two is the best for {either} of 25 "
                f"demands. That both beat all others holds for {both.sum()}",
                _who_is_beaten(greatest, both),
                nature="reading",
            ),
            Difference(
                "E29",
                "IV, before 1.",
                "the five sets contain more than one rolling joint",
                "one or more: types 3 and 5 of Table 1 have one",
                "rolling joints of types 1 to 5: " + ", ".join(map(str, _rolling_joints())),
            ),
        ),
    )


def _rolling_joints() -> list[int]:
    """Number of rolling joints in each type of Table 1."""
    return [sum(joint.startswith("roll") for joint in joints) for joints in TYPES.values()]


def _rolling_joints_check() -> Check:
    counts = _rolling_joints()
    return Check(
        "IV: rolling joints in the five sets that are compared",
        "more than one",
        ", ".join(f"{count} in type {kind}" for kind, count in zip(TYPES, counts, strict=True)),
        min(counts) > 1,
        "E29: at least one is meant, since only (φ_1, φ_2, φ_3) is left out",
    )


def _grids() -> Table:
    """How many cells each reading of the paper's grid gives."""
    rows = []
    for name, grid in {"the values above": GRID, **OTHER_GRIDS}.items():
        found = [
            (cell, optimum(cell.place, sets, grid))
            for table, sets in ((1, (TYPES[4], TYPES[5])), (2, (FOUR,)))
            for cell in printed_cells(table)
        ]
        designs = sum(is_printed(best, cell) for cell, best in found)
        numbers = sum(agrees(cell, best.sigma) for cell, best in found)
        rows.append((name, len(grid), designs, numbers))
    caption = (
        "Readings of the paper's grid, and how many of the 50 cells of both tables come out of a search over each."
    )
    return Table("grids", caption, ("r and d", "values", "[r, d], rounded or cut off", "index"), rows)


def _why_not_398() -> str:
    """What both tables say about the cell whose r is 3.9."""
    parts = []
    for table in (1, 2):
        cell = next(c for c in printed_cells(table) if c.r == 3.9)
        exact = 10.0**0.6
        ours, other = (float(indices(cell.joints, r, cell.d, cell.rate_ratio, cell.twist_ratio)) for r in (3.9, exact))
        parts.append(
            f"Table {table} prints {cell.sigma} there, which is {ours:.4f} at 3.9a and {other:.4f} at {exact:.2f}a"
        )
    return "; ".join(parts)


def _who_is_beaten(greatest: Array, both: Array) -> str:
    """The demands where type 4 or 5 is worse than another."""
    words = []
    for i, j in np.argwhere(np.logical_not(both)):
        values = greatest[i, j]
        worse, better = 3 + int(values[3:].argmin()), int(values[:3].argmax())
        words.append(
            f"({RATIOS[i]:g}, {RATIOS[j]:g}): type {better + 1} reaches {values[better]:.3f}, "
            f"type {worse + 1} {values[worse]:.3f}"
        )
    return "at (φ̇_max/θ̇_max, ω_max/v_max) = " + "; ".join(words)


def _agreeing(cells: Sequence[Cell], inverted: bool) -> int:
    """How many printed indices ours agree with; inverted: with the columns read as they are headed."""
    return sum(agrees(cell, ours) for cell, ours in zip(cells, at_printed(cells, inverted), strict=True))
