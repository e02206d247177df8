"""The natural orthogonal complement of chung2008, (20) to (30) and (A3) to (A10): right, singular, and mended."""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.robot import load_robot
from papers.analysis.coordinate_switching import (
    all_complements,
    choose_along,
    forward_dynamics,
    simulate,
)
from papers.analysis.orthogonal_complement import OrthogonalComplement
from papers.chung2008.complement_checks import (
    LIMIT,
    PAPER_SET,
    agreement,
    constraints,
    frequency,
    singularities,
)
from papers.chung2008.complement_pictures import picture_of_path, picture_of_singularity
from papers.chung2008.complement_runs import (
    DECADES,
    DISTANCES,
    PERIOD,
    RADIUS,
    STEP,
    Drive,
    approach,
    drive,
    power,
    relative,
)
from papers.notation import in_letters
from papers.page import Section, Table

LIMITS = (LIMIT, 1000.0)
PAPER_ALONE, CHANGED = f"{in_letters(PAPER_SET)} alone", "changed above {:g}"
LOST = 1.0  # [m] from the place, or no number at all: a simulation is lost
BATCH, REPEATS = 1000, 9  # robots at a time, and how often the time is taken


def section() -> Section:
    """The algorithm reproduced, what it confirms, where it fails, and what its remedy costs."""
    robot = load_robot("chung2008")
    complements = all_complements(robot)
    paper = next(one for one in complements if one.independent == PAPER_SET)
    near, driven = approach(complements), drive(robot)
    switching, cost = _switching(complements, paper, driven), _cost(complements, paper, driven)
    agreeing, difference = agreement(complements)
    gaps = switching.gaps[PAPER_ALONE], switching.gaps[CHANGED.format(LIMIT)]
    steering, twist, torque = driven.states[:-1, 6:], driven.states[:-1, 3:6], driven.torques
    chosen, numbers = choose_along(steering, complements, LIMIT)
    right = paper.model.forward_dynamics(steering, twist, torque)
    errors = (
        relative(paper.forward_dynamics(steering, twist, torque), right),
        relative(forward_dynamics(steering, twist, torque, complements, chosen), right),
    )
    checks = (
        *constraints(complements, paper),
        *singularities(complements, near),
        *agreeing,
        frequency(numbers, chosen),
    )
    straight = float(paper.condition_number(np.zeros(3)))
    kappas, printed_errors, errors_near = (
        values[:, DECADES] for values in (near.condition_numbers, near.printed_errors, near.errors)
    )
    powers = [power(values) for values in (kappas, near.coriolis, printed_errors, errors_near)]
    useless = [DISTANCES[np.median(v, axis=0) > 0.01][0] for v in (near.printed_errors, near.errors)]
    changes = int(np.count_nonzero(np.diff(chosen)))
    text = f"""
The paper's first algorithm writes the dynamics in three independent joint rates. Its equations (20) to (30) and (A3) to
(A10) stand, sign by sign, and for any three joints they give the twist rate of the operational-space model to rounding,
as long as J_p is well conditioned. Its dynamics were derived in another way, so each confirms the other; both contain
the term that (49) lacks (E3). The "joint torque vector" of (27) is τ = Gᵀ wᴱ: torques at the dependent joints enter it
through (21), τ = τ_a + (J_p⁻¹ J_a)ᵀ τ_p. The term GᵀWMG of (30) is zero for every such robot, as the gyroscopic moment
of a wheel points along its rolling direction, where the floor takes it.

J_p is singular exactly where the lines of the three joints meet in a point or are parallel. The paper's own example
{in_letters(PAPER_SET)} is singular whenever the robot drives straight along its x-axis with its casters trailing
(condition number {straight:.0e}): both wheels then roll on one line, and nothing tells how the robot turns. Near such a
configuration the condition number of J_p grows as 1/distance to the power {powers[0]:.1f}. C of (30) contains J_p⁻¹
once in Gᵀ and twice in Ġ, so its entries grow to the power {powers[1]:.1f}, and their rounding errors carry the error
of the twist rate to the power {powers[2]:.1f}: nearer than {useless[0]:.0e} rad it is more than 1 % in half of the
cases. Multiplied from the right, vector by vector, C is never formed and the power is {powers[3]:.1f}, the 1 % at
{useless[1]:.0e} rad; this better way is used below. The operational-space model needs no J_p and has no such place.

Changing the independent joints mends it. Along {PERIOD:g} s of driving, a circle of {RADIUS:g} m while the heading
swings, every one of the {len(complements)} sets passes a condition number of {numbers.max(axis=0).min():.0f} somewhere;
a change whenever {LIMIT:g} is passed takes {changes} changes. Simulated under the same torques, the set of (A9) alone
{_ending(gaps[0])} of the operational-space model, a simulation with changing sets
{_ending(gaps[1])}. At each change the condition numbers of all sets
are needed, and the rates, which are the state, have to be computed anew from the twist.
"""
    return Section(
        "Natural orthogonal complement: (20) to (30), (A3) to (A10)",
        text,
        checks,
        (switching.table, cost),
        (
            picture_of_singularity(paper, DISTANCES, near),
            picture_of_path(
                np.linspace(0.0, PERIOD, len(torque), endpoint=False),
                numbers,
                complements.index(paper),
                chosen,
                LIMIT,
                errors,
                gaps,
            ),
        ),
        (difference,),
    )


class _Switching(NamedTuple):
    table: Table
    gaps: dict[str, Array]  # [m] of the simulated place over time, by the rows of the table


def _switching(complements: tuple[OrthogonalComplement, ...], paper: OrthogonalComplement, driven: Drive) -> _Switching:
    """The path with one set of independent joints, and with changing ones."""
    steering, twist, torque = driven.states[:-1, 6:], driven.states[:-1, 3:6], driven.torques
    right = paper.model.forward_dynamics(steering, twist, torque)
    _, numbers = choose_along(steering, complements, LIMIT)
    best = complements[int(numbers.max(axis=0).argmin())]
    ways: dict[str, tuple[tuple[OrthogonalComplement, ...], float]] = {
        PAPER_ALONE: ((paper,), np.inf),
        f"{in_letters(best.independent)} alone, the best condition number": ((best,), np.inf),
    }
    ways |= {CHANGED.format(limit): (complements, limit) for limit in LIMITS}
    rows: list[tuple[str | float, ...]] = []
    gaps = {}
    for name, (sets, limit) in ways.items():
        chosen, numbers = choose_along(steering, sets, limit)
        error = relative(forward_dynamics(steering, twist, torque, sets, chosen), right).max()
        walk = simulate(sets, driven.states[0], torque, STEP, limit)
        gaps[name] = np.hypot(*(walk.states - driven.states)[:, :2].T)
        rows.append(
            (
                name,
                str(np.count_nonzero(np.diff(chosen))),
                str(len(np.unique(chosen))),
                str(walk.examined if len(sets) > 1 else 0),
                float(numbers[np.arange(len(chosen)), chosen].max()),
                float(error),
                1000.0 * lost if (lost := float(gaps[name].max())) < LOST else _ending(gaps[name]),
            )
        )
    table = Table(
        "complement_switching",
        f"Independent joints along the path of {len(steering)} steps: changes, each of which computes the independent "
        f"rates anew; sets in use; condition numbers that the simulation had to compute to watch over "
        f"{len(complements)} sets; greatest condition number of J_p; greatest relative error of the twist rate at the "
        f"configurations of the path; greatest error of the place in a simulation.",
        ("independent joints", "changes", "sets", "examined", "condition number", "error of ν̇", "of the place [mm]"),
        rows,
    )
    return _Switching(table, gaps)


def _ending(gap: Array) -> str:
    """Where a simulation ends beside the place that it should have reached; distances over time [m]."""
    if gap.max() < LOST:
        return f"ends {1000.0 * gap[-1]:.2g} mm beside the place"
    return f"is lost after {STEP * int(np.argmin(gap < LOST)):.2f} s"


def _cost(complements: tuple[OrthogonalComplement, ...], paper: OrthogonalComplement, driven: Drive) -> Table:
    """Time per twist rate, the ways taken in turn so that all meet the same disturbances."""
    printed = OrthogonalComplement(paper.robot, paper.independent, as_printed=True)
    states, torques = driven.states[:-1][:BATCH], driven.torques[:BATCH]
    rows: list[tuple[str | float, ...]] = []
    for count, calls in ((len(states), 1), (BATCH // 10, 5), (1, 20)):
        steering, twist, torque = states[:count, 6:], states[:count, 3:6], torques[:count]
        chosen, _ = choose_along(steering, complements, LIMIT)
        changing = steering[1:][np.diff(chosen) != 0]

        def switching(
            steering: Array = steering,
            twist: Array = twist,
            torque: Array = torque,
            chosen: NDArray[np.int64] = chosen,
            changing: Array = changing,
        ) -> None:
            paper.condition_number(steering)  # of the set in use, whichever it is
            if len(changing):
                for one in complements:
                    one.condition_number(changing)
            forward_dynamics(steering, twist, torque, complements, chosen)

        ways: dict[str, Callable[..., object]] = {
            "operational space, (D5)": paper.model.forward_dynamics,
            "complement, as printed": printed.forward_dynamics,
            "complement, vector by vector": paper.forward_dynamics,
            "the same, changing sets": lambda *_, run=switching: run(),
        }
        taken = np.array(
            [[_seconds(way, (steering, twist, torque), calls) for way in ways.values()] for _ in range(REPEATS)]
        )
        for name, seconds in zip(ways, taken.T, strict=True):
            low, middle, high = np.quantile(seconds / taken[:, 0], (0.25, 0.5, 0.75))
            ratio = f"{middle:.1f} ({low:.1f} to {high:.1f})"
            rows.append((name, str(count), float(1e6 * np.median(seconds) / count), ratio))
    return Table(
        "complement_cost",
        f"Time of a twist rate in NumPy, all robots of a batch in one call, on the machine that made this page: "
        f"median of {REPEATS} rounds, and median and quartiles of the ratios to the first way in the same round. "
        f"One robot at a time costs little but the overhead of Python.",
        ("way", "robots at a time", "µs per robot", "ratio"),
        rows,
    )


def _seconds(way: Callable[..., object], arguments: tuple[Array, ...], calls: int) -> float:
    start = perf_counter()
    for _ in range(calls):
        way(*arguments)
    return (perf_counter() - start) / calls
