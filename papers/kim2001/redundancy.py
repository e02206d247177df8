"""kim2001, section V: how evenly four and six joints move the platform, Table 2 and Fig. 6."""

import numpy as np

from papers.analysis.isotropy import balanced_isotropy, isotropy
from papers.kim2001.isotropy_pictures import FIGURES, TWIST, best_quotient, contours, local_indices
from papers.kim2001.isotropy_search import (
    FOUR,
    GRID,
    RATIOS,
    SIX,
    TYPES,
    Cell,
    Optimum,
    cell_checks,
    indices,
    optima_table,
    optimum,
    printed_cells,
    searched,
)
from papers.notation import kim2001_robot
from papers.page import Check, Difference, Picture, Section, check_number

SHORT = 1e-9  # [a] steering links and wheels of next to no size; and numbers that differ by less are the same


def four_joints() -> Section:
    """Table 2, its text and Fig. 6."""
    cells = printed_cells(2)
    greatest = searched(FOUR).max(axis=(2, 3))
    three = np.max([searched(joints).max(axis=(2, 3)) for joints in TYPES.values()], axis=0)
    local = local_indices(FOUR)
    limit = float(balanced_isotropy(kim2001_robot(SHORT, SHORT), np.zeros(3), (1, 2), TWIST[0], TWIST[2]))
    meeting = [cell for cell in cells if cell.d > _half_distance()]
    zero = max(_index_where_wheels_meet(cell) for cell in meeting)
    improvement, over_third = greatest / three, float(np.ptp(local, axis=2).max())
    text = f"""
The same search for both joints of two wheels gives all optima and all indices of Table 2. Where r θ̇_max = d φ̇_max the
index depends on the places of the two wheels' centres alone (docs/analysis.md, (Q8)), and without trail not at all on
the steering: for ω_max/v_max = 0.5/a it is {limit:.6f} = 1/√3, to which the 0.577 of the paper tends. So Fig. 6 is
nearly flat, {local.min():.3f} to {local.max():.3f}. It does not depend on φ_3 (it changes by {over_third:.1g}).

Four joints are better than the best three for every demand, {improvement.min():.2f} to {improvement.max():.2f} times.
But {len(meeting)} optima, those with ω_max/v_max = 0.1/a and d = {" or ".join(sorted({f"{c.d:g}a" for c in meeting}))},
have steering links longer than half the distance of the pivots, {_half_distance():.2f}a. Their two wheels can meet in
one point, and there the set is singular (E10): the index is {zero:.0e} at most.
"""
    return Section(
        "Isotropy with four joints: Table 2 and Fig. 6",
        text,
        (
            *cell_checks(2, (FOUR,)),
            check_number(f"V: σ_GI of (θ_1, φ_1, θ_2, φ_2), {FIGURES}", "0.577", float(greatest[2, 1])),
            Check(
                "V: operation conditions of the 0.577",
                "φ̇_max/θ̇_max = a, ω_max/v_max = 0.5a",
                f"φ̇_max/θ̇_max = 1, ω_max/v_max = 0.5/a, where the index is {greatest[2, 1]:.4f}",
                False,
                "E28: a quotient of two rates has no unit, and ω/v is one over a length",
            ),
            Check(
                "V: four joints are better than three",
                "as expected",
                f"for {(improvement > 1.0).sum()} of 25 demands",
                bool((improvement > 1.0).all()),
            ),
            Check(
                "V: the index is independent of φ_3",
                "independent",
                f"changes by {over_third:.1g}",
                over_third < 1e-12,
            ),
        ),
        (optima_table("optima_four_joints", (FOUR,)),),
        (
            Picture(
                "figure_6",
                "Index of four joints over two steering angles, Fig. 6",
                f"Fig. 6: index of (θ_1, φ_1, θ_2, φ_2) at {FIGURES}: {local.min():.3f} to {local.max():.3f}, nowhere "
                "singular. The nearer to C the middle between the two wheels' centres is, the higher it is.",
                contours(FOUR, 0.005),
            ),
        ),
        (_conditions(),),
    )


def _conditions() -> Difference:
    """Which conditions give the 0.577 for every size a of the robot."""
    sizes = (1.0, 2.0)  # [m] of a
    right, printed = (
        ", ".join(f"{float(indices(FOUR, 0.1, 0.1, rate(a), twist(a))):.3f}" for a in sizes)
        for rate, twist in ((lambda a: 1.0, lambda a: 0.5), (lambda a: a, lambda a: 0.5 * a * a))
    )
    return Difference(
        "E28",
        "V, on Fig. 6",
        "φ̇_max/θ̇_max = a, ω_max/v_max = 0.5a",
        "φ̇_max/θ̇_max = 1, ω_max/v_max = 0.5/a",
        f"a is a length, and the index must not depend on its unit: for a = {' and '.join(f'{a:g} m' for a in sizes)} "
        f"it is {right} with the corrected conditions at r = d = 0.1a, and {printed} with the printed ones",
        nature="scan, probably",
    )


def six_joints() -> Section:
    """Section V's sentence on all six joints."""
    optima = {(x, y): optimum((i, j), (SIX,)) for i, x in enumerate(RATIOS) for j, y in enumerate(RATIOS)}
    of_one = {y: best for (x, y), best in optima.items() if x == 1.0}
    against = {y: _against_one(best, y) for y, best in of_one.items() if not _is_even(best, 1.0)}
    others = [
        f"[{best.r:g}, {best.d:g}] for ({x:g}, {y:g})" for (x, y), best in optima.items() if not _is_even(best, x)
    ]
    nearest = [_best_quotient(ratio) for ratio in RATIOS]
    text = f"""
With both joints of all three wheels, r θ̇_max = d φ̇_max makes a wheel equally fast along and across its rolling
direction. Then the index does not depend on how the wheels stand, only on where their centres are
(docs/analysis.md, (Q7), (Q8)).
It is at most min(v, ωR)/max(v, ωR) with R their root mean square distance from C, for short trails
{", ".join(f"{x:.3f}" for x in _without_trail())} for the five ω_max/v_max. Without trail a quarter turn of every wheel
exchanges rolling and steering, so that the mean is the same for r/d and d/r (Q9). As r and φ̇_max enter only through
r θ̇_max/φ̇_max (Q4), what is said of r/d = 1 holds for r/d = φ̇_max/θ̇_max at other rates.

With a trail this symmetry is lost, little for short ones: at d = 0.1a the best r/d is {min(nearest):.3f} to
{max(nearest):.3f} for the five ω_max/v_max. For long ones it matters. On the paper's grid r/d = 1 is the best for
{len(RATIOS) - len(against)} of the five; it is not where slow turning asks for wheels far from C, that is for long
steering links. Of all 25 demands (φ̇_max/θ̇_max, ω_max/v_max) the best r/d differs from φ̇_max/θ̇_max in {len(others)},
some of them at the ends of the grid: {"; ".join(others)}.
"""
    return Section(
        "Isotropy with six joints",
        text,
        tuple(
            Check(
                f"V: best r/d of six joints for φ̇_max/θ̇_max = 1, ω_max/v_max = {ratio:g}/a",
                "1",
                f"{best.r / best.d:.3g}, at [{best.r:g}, {best.d:g}]",
                ratio not in against,
                f"E25: {against[ratio]}" if ratio in against else "",
            )
            for ratio, best in of_one.items()
        ),
        (optima_table("optima_six_joints", (SIX,)),),
        (
            Picture(
                "six_joints",
                "Mean index of six joints by r/d",
                "Mean index of all six joints against r/d for φ̇_max = θ̇_max. Left: with short steering links it is "
                "greatest at 1 for every demand. Right: for ω_max/v_max = 0.1/a its maximum (dots) rises with d and "
                "moves below 1.",
                best_quotient(),
            ),
        ),
        (
            *(
                Difference(
                    "E25",
                    "V, on six joints",
                    "the index is greatest for r/d = 1 for every ω_max/v_max from 0.1 to 10",
                    f"for ω_max/v_max = {ratio:g}/a it is greatest at r/d = {of_one[ratio].r / of_one[ratio].d:.2g}",
                    evidence,
                )
                for ratio, evidence in against.items()
            ),
            Difference(
                "E26",
                "V, on six joints",
                '"4 redundant actuators"',
                "three: six driven joints, three degrees of freedom",
                '"the three wheels are driven by two actuators, respectively"',
            ),
        ),
    )


def _half_distance() -> float:
    """Half the distance of two pivots. [a]"""
    first, second, _ = kim2001_robot(1.0, 1.0).casters
    return 0.5 * float(np.hypot(second.x - first.x, second.y - first.y))


def _index_where_wheels_meet(cell: Cell) -> float:
    """Local index of a design of Table 2 with the centres of wheels 1 and 2 on one point."""
    angle = float(np.arccos(_half_distance() / cell.d))  # of the links to the line of the pivots
    steering = (np.pi + angle, -angle, 0.0)
    tops = [1.0, cell.rate_ratio, 1.0, cell.rate_ratio]
    twist = (1.0 / cell.twist_ratio, 1.0 / cell.twist_ratio, 1.0)
    return float(isotropy(kim2001_robot(cell.r, cell.d), steering, cell.joints, twist, tops))


def _without_trail() -> list[float]:
    """Index of six joints with r θ̇_max = d φ̇_max and next to no trail, for every ω_max/v_max."""
    robot = kim2001_robot(SHORT, SHORT)
    return [float(balanced_isotropy(robot, np.zeros(3), (1, 2, 3), 1.0 / ratio, 1.0)) for ratio in RATIOS]


def _best_quotient(twist_ratio: float) -> float:
    """The best r/d of six joints at d = 0.1a, to three digits."""
    quotients = np.linspace(0.97, 1.03, 61)
    return float(quotients[indices(SIX, 0.1 * quotients, 0.1, 1.0, twist_ratio).argmax()])


def _is_even(best: Optimum, rate_ratio: float) -> bool:
    """Does a design make rolling and steering equally fast?"""
    return abs(best.r / best.d / rate_ratio - 1.0) < SHORT


def _against_one(best: Optimum, twist_ratio: float) -> str:
    """The index of the best design of six joints beside the best with r = d."""
    even = indices(SIX, GRID, GRID, 1.0, twist_ratio)
    same = GRID[int(even.argmax())]
    return (
        f"[{best.r:g}, {best.d:g}] reaches {best.sigma:.4f}, and the best design with r/d = 1, [{same:g}, {same:g}], "
        f"{even.max():.4f}"
    )
