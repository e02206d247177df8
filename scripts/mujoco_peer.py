"""Motions compared with MuJoCo's: python -m scripts.mujoco_peer --out docs/truth

The same torques drive the same robots here and, with ever smaller time steps, in MuJoCo. The command writes a page, a
table and a figure.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from caster_gym import Robot, load_robot
from caster_gym.report.figures import COLOURS, legend_below, new_figure
from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table, write_csv
from scripts.dry_friction import LOAD, PERIOD, SECONDS, SPEEDS, Creep, creep, creep_table
from scripts.mujoco_robot import (
    DURATION,
    OUR_STEP,
    STRONG,
    Drive,
    driven,
    joint_indices,
    path_length,
    placed,
    slip,
    strong_drives,
    without_dry_friction,
)

ROBOTS = ("chung2008", "xr4000", "tidybot2")
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)  # [s] MuJoCo's
DRAWS = 6


class Comparison(NamedTuple):
    """One drive of one robot: ours, and where MuJoCo ends with each of its time steps."""

    robot: str
    draw: int
    path: float  # [m] way of C
    slip: float  # [-] of MuJoCo's wheels at its coarsest step
    from_exact: NDArray[np.float64]  # (steps,) [m] distance of the ends
    from_incomplete: NDArray[np.float64]  # (steps,) [m] the same, from the model without (D1)
    limit: float  # [m] from ours to the end that MuJoCo's two finest steps extrapolate to


def compare(robot: Robot, drive: Drive, timesteps: tuple[float, ...] = STEPS) -> Comparison:
    """Drive a robot, here and in MuJoCo."""
    draw, state, torque = drive
    ours, incomplete = driven(robot, [drive], OUR_STEP)[:, 0], driven(robot, [drive], OUR_STEP, "chung2008")[:, 0]
    ends = np.array([end(robot, state, torque, step) for step in timesteps])
    return Comparison(
        robot.name,
        draw,
        path_length(ours),
        slip(robot, state, torque, timesteps[0], DURATION),
        distance(ends, ours[-1, :2]),
        distance(ends, incomplete[-1, :2]),
        float(distance(2.0 * ends[-1] - ends[-2], ours[-1, :2])),
    )


def end(robot: Robot, state: NDArray[np.float64], torque: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Where MuJoCo has C at the end of a drive: x, y [m]."""
    model, data = placed(robot, state, torque, timestep)
    mujoco.mj_step(model, data, round(DURATION / timestep))
    (x, y, _), _ = joint_indices(robot, model)
    return np.array(data.qpos[[x, y]])


def distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (...) between points (..., 2). [m]"""
    return np.asarray(np.hypot(*np.moveaxis(a - b, -1, 0)))


def write_table(file: Path, comparisons: list[Comparison]) -> None:
    """A line for each robot, draw and time step."""
    rows = [
        (one.robot, one.draw, f"{one.path:.6g}", step, f"{exact:.6g}", f"{incomplete:.6g}")
        for one in comparisons
        for step, exact, incomplete in zip(STEPS, one.from_exact, one.from_incomplete, strict=True)
    ]
    write_csv(file, ("robot", "draw", "path_m", "mujoco_step_s", "from_exact_m", "from_without_D1_m"), rows)


def draw_convergence(file: Path, comparisons: list[Comparison]) -> None:
    """Distance of the ends over MuJoCo's step, a panel for each robot."""
    names = list(dict.fromkeys(one.robot for one in comparisons))
    figure = new_figure(1, len(names), (3.4, 3.6), sharey=True)
    steps = 1e3 * np.array(STEPS)
    sides = (
        ("from_incomplete", COLOURS[3], "s", "from the model without (D1)"),
        ("from_exact", COLOURS[0], "o", "from the exact model"),
    )
    for axis, name in zip(figure.axes, names, strict=True):
        mine = [one for one in comparisons if one.robot == name]
        for field, colour, marker, label in sides:
            errors = 1e3 * np.array([getattr(one, field) for one in mine])
            axis.loglog(steps, errors.T, color=colour, alpha=0.25, linewidth=0.9)
            axis.loglog(steps, np.median(errors, axis=0), color=colour, marker=marker, markersize=4, label=label)
        middle = 1e3 * np.median([one.from_exact for one in mine], axis=0)
        axis.loglog(steps, 0.6 * middle[-1] * steps / steps[-1], ":", color="black", linewidth=1.2, label="∝ step")
        axis.set_title(name)
        axis.set_xlabel("time step of MuJoCo [ms]")
        axis.set_xticks(steps, [f"{step:g}" for step in steps])
        axis.minorticks_off()
    figure.axes[0].set_ylabel(f"distance of the ends after {DURATION:g} s [mm]")
    legend_below(figure, figure.axes[0], 3, frameon=False)
    figure.savefig(file)


def page(comparisons: list[Comparison], creeps: list[Creep], command: str) -> str:
    """The comparison as Markdown; pictures and tables lie beside it."""
    coarse, fine = 1e3 * STEPS[0], 1e3 * STEPS[-1]
    heads = (
        "robot",
        "length of C's path [m]",
        f"slip at {coarse:g} ms",
        f"distance from the exact model at {coarse:g} ms [mm]",
        f"at {fine:g} ms [mm]",
        "extrapolated to a step of zero [mm]",
        "ratio after halving the step",
        f"distance from the model without (D1) at {fine:g} ms [mm]",
    )
    rows = []
    for name in dict.fromkeys(one.robot for one in comparisons):
        mine = [one for one in comparisons if one.robot == name]
        exact = 1e3 * np.array([one.from_exact for one in mine])
        cells = (
            name,
            spread([one.path for one in mine]),
            f"{100.0 * float(np.median([one.slip for one in mine])):.2f} %",
            spread(exact[:, 0]),
            spread(exact[:, -1]),
            spread([1e3 * one.limit for one in mine]),
            f"{np.median(exact[:, -1] / exact[:, -2]):.3f}",
            spread([1e3 * one.from_incomplete[-1] for one in mine]),
        )
        rows.append(cells)
    closer = sum(one.from_exact[-1] < 0.5 * one.from_incomplete[-1] for one in comparisons)
    draws = max(Counter(one.robot for one in comparisons).values())
    parts = [
        "# Motions compared with MuJoCo's",
        paragraph(
            """This page compares the motions of caster_gym with MuJoCo's. MuJoCo simulates the same robots as rigid
            bodies: a platform that slides and turns in the plane, steering links, and wheels, which are spheres on a
            plane. The friction of its contact solver keeps them from sliding
            ([mjcf.py](../../caster_gym/export/mjcf.py)). It knows joints, masses and contacts, but none of the
            equations in [equations.md](../equations.md). Its contacts are soft over a few time steps, so its wheels
            creep a little, and less with every smaller step."""
        ),
        paragraph(
            f"""Each robot is driven {draws} times from rest for {DURATION:g} s, with random steering angles and
            constant torques. The torques are drawn so that each joint pushes the floor with up to {100.0 * STRONG:.0f}
            % of the weight on its wheel and no motor exceeds its top speed. The table compares where the platform ends.
            Dry friction of the joints is left out, because MuJoCo's jumps at rest, whereas ours passes smoothly through
            zero; see below."""
        ),
        markdown_table(heads, rows),
        "Medians over the drives, with minimum and maximum in brackets; [all drives](convergence.csv).",
        paragraph(
            f"""As its step goes to zero, MuJoCo ends where the exact model ends: halving the step halves the distance,
            and what is left after extrapolation to a step of zero is an error of second order. MuJoCo's distance from
            the model without (D1), the term that chung2008 lacks, stays as large as the difference between the two
            models. In {closer} of {len(comparisons)} drives, MuJoCo with its finest step ends at least twice as close
            to the exact model as to the one without (D1)."""
        ),
        "![Distance of MuJoCo's end from both models' ends, over MuJoCo's time step](convergence.png)",
        paragraph(
            """*Thin lines are single drives, thick lines their medians. Blue is proportional to MuJoCo's step, like the
            dotted line, so the exact model is the limit. Orange levels off, because the equations without (D1) describe
            another robot.*"""
        ),
        *dry_friction(creeps),
        f"- Command: `{command}`\n- Ours: RK4 at {1e3 * OUR_STEP:g} ms\n"
        f"- Versions: {versions_in_words('caster_gym', 'mujoco', 'numpy')}",
    ]
    return join_parts(parts)


def dry_friction(creeps: list[Creep]) -> list[str]:
    """What a load does that dry friction ought to hold, as paragraphs; none for robots without dry friction."""
    if not creeps:
        return []
    return [
        "## Dry friction does not hold",
        paragraph(
            f"""The dry friction of a joint is `coulomb` · rate / √(rate² + `coulomb_speed`²). It passes smoothly
            through zero, so that time steps can follow it. A joint below its breakaway torque therefore creeps instead
            of standing still: under a share s of that torque, it turns at s / √(1 − s²) of `coulomb_speed`. Below, all
            casters trail and each rolling joint is driven by {100.0 * LOAD:g} % of its `coulomb` for {SECONDS:g} s.
            MuJoCo holds its joints by a constraint, and creeps because its contacts and constraints are soft."""
        ),
        creep_table(creeps),
        paragraph(
            f"""The brackets contain the smallest number of `substeps`, for a control period of {1e3 * PERIOD:g} ms,
            with which time steps follow the robot. `coulomb_speed` is a field of the robot's file, {SPEEDS[0]:g} rad/s
            by default. A smaller value makes the law sharper and needs shorter time steps; steps that are too long are
            refused, with the number of substeps that suffices. Use a small value to find out whether a robot stands
            still under a load. For driving, the default suffices."""
        ),
    ]


def spread(values: Any) -> str:
    """Median, least and greatest."""
    low, middle, high = (
        np.format_float_positional(v, 2, fractional=False, trim="-") for v in np.quantile(values, (0.0, 0.5, 1.0))
    )
    return f"{middle} ({low} – {high})"


def main(arguments: list[str] | None = None) -> None:
    """Compare, and write a page with what belongs to it into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), help="names or files")
    parser.add_argument("--draws", type=int, default=DRAWS, help="drives of each robot")
    parser.add_argument("--out", type=Path, default=Path("docs/truth"), metavar="DIR")
    chosen = parser.parse_args(arguments)
    robots = [without_dry_friction(load_robot(name)) for name in chosen.robots]
    pairs = [(robot, drive) for robot in robots for drive in strong_drives(robot, chosen.draws)]
    comparisons = [compare(robot, drive) for robot, drive in tqdm(pairs, file=sys.stderr, disable=None)]
    creeps = [creep(robot) for robot in map(load_robot, chosen.robots) if robot.casters[0].roll.coulomb > 0.0]
    chosen.out.mkdir(parents=True, exist_ok=True)
    write_table(chosen.out / "convergence.csv", comparisons)
    draw_convergence(chosen.out / "convergence.png", comparisons)
    command = command_line("scripts.mujoco_peer", arguments)
    (chosen.out / "mujoco.md").write_text(page(comparisons, creeps, command), encoding="utf-8")


if __name__ == "__main__":
    main()
