"""Slip on a floor of finite friction, compared with MuJoCo: python -m scripts.slip_peer --out docs/truth

The same robots on the same floor: driven until their wheels slip, driven beyond what the floor holds, with one wheel
that spins, with wheels that slide and find their grip again, and braked by wheels that hardly turn. MuJoCo's elliptic
cone is the other side.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from caster_gym import load_robot
from caster_gym.report.figures import COLOURS, legend_below, new_figure
from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table, write_csv
from scripts.mujoco_peer import spread
from scripts.slip_runs import (
    DRAWS,
    HEIGHT,
    OUR_STEPS,
    ROBOTS,
    SOFTNESS,
    STEPS,
    Comparison,
    Rate,
    compare,
    measure,
    rates,
    scenarios,
)


def write_table(file: Path, comparisons: list[Comparison]) -> None:
    """A line for each robot, draw, scenario and time step."""
    rows: list[tuple[object, ...]] = []
    for one in comparisons:
        head = one.scene.robot.name, one.scene.draw, one.scene.name
        for step, error in zip(OUR_STEPS[:-1], one.our_errors, strict=True):
            rows.append((*head, "caster_gym", step, f"{error:.3g}", ""))
        rows.append((*head, "caster_gym", OUR_STEPS[-1], 0, f"{measure(one.scene, one.ours):.4g}"))
        for step, error in zip(STEPS, one.their_errors, strict=True):
            last = f"{measure(one.scene, one.theirs):.4g}" if step == STEPS[-1] else ""
            rows.append((*head, "mujoco", step, f"{error:.3g}", last))
    write_csv(file, ("robot", "draw", "scenario", "side", "step_s", "from_exact_m", "measure"), rows)


def draw_courses(file: Path, comparisons: list[Comparison]) -> None:
    """Slip of the wheel that slips most over time, a panel for each scenario."""
    figure = new_figure(1, len(comparisons), (2.9, 3.0))
    for axis, one in zip(figure.axes, comparisons, strict=True):
        wheel = int(one.ours.slip.max(axis=0).argmax())
        axis.plot(1e3 * one.theirs.time, one.theirs.slip[:, wheel], color=COLOURS[3], linewidth=2.4, label="MuJoCo")
        axis.plot(1e3 * one.ours.time, one.ours.slip[:, wheel], color=COLOURS[0], linewidth=1.1, label="caster_gym")
        axis.set_title(one.scene.name)
        axis.set_xlabel("time [ms]")
    figure.axes[0].set_ylabel("slip of the wheel that slips most [m/s]")
    legend_below(figure, figure.axes[0], 2, frameon=False)
    figure.savefig(file)


UNITS = {
    "onset of slip": "first slip above 20 mm/s [ms]",
    "drift": "distance from the start [mm]",
    "spin-up of a wheel": "rate of that wheel at the end [rad/s]",
    "regrip": "last slip above 20 mm/s [ms]",
    "braking": "distance from the start [mm]",
}


def comparison_table(comparisons: list[Comparison]) -> str:
    """What both say, scenario by scenario, as Markdown."""
    heads = ("scenario", "measured", "robot", "ours", "MuJoCo", "distance of the ends [mm]", "our error at 5 ms [mm]")
    rows = []
    for name, unit in UNITS.items():
        for robot in dict.fromkeys(one.scene.robot.name for one in comparisons):
            mine = [one for one in comparisons if (one.scene.robot.name, one.scene.name) == (robot, name)]
            factor = 1.0 if "rad/s" in unit else 1e3
            cells = (
                name,
                unit,
                robot,
                spread([factor * measure(one.scene, one.ours) for one in mine]),
                spread([factor * measure(one.scene, one.theirs) for one in mine]),
                spread([1e3 * one.their_errors[-1] for one in mine]),
                spread([1e3 * one.our_errors[0] for one in mine]),
            )
            rows.append(cells)
    return markdown_table(heads, rows)


def rate_table(found: list[Rate], comparisons: list[Comparison]) -> str:
    """Errors of drifts beside simulated time, as Markdown."""
    heads = (
        "robot",
        "side",
        "step [ms]",
        "error of the drift [mm]",
        "simulated s per s of core",
        "ours is faster by",
    )
    rows = []
    for rate in found:
        mine = [one for one in comparisons if (one.scene.robot.name, one.scene.name) == (rate.robot, "drift")]
        error = np.median([one.our_errors[0] for one in mine])
        for side, speed in (("ours, batch", rate.batch), ("ours, one robot", rate.single)):
            rows.append((rate.robot, side, f"{1e3 * OUR_STEPS[0]:g}", f"{1e3 * error:.2g}", f"{speed:,.0f}", ""))
        for step, speed, errors in zip(STEPS, rate.peer, np.array([one.their_errors for one in mine]).T, strict=True):
            faster = f"{rate.batch / speed:,.0f} (batch), {rate.single / speed:,.0f} (one)"
            error = np.median(errors)
            rows.append((rate.robot, "MuJoCo", f"{1e3 * step:g}", f"{1e3 * error:.2g}", f"{speed:,.0f}", faster))
    return markdown_table(heads, rows)


def page(comparisons: list[Comparison], found: list[Rate], command: str) -> str:
    """The comparison as Markdown; picture and table lie beside it."""
    parts = [
        "# Slip compared with MuJoCo's",
        paragraph(
            f"""This page compares robots whose wheels may slip with MuJoCo's, on a floor of finite friction (`floor:
            {{friction: 0.7}}`, section S of [equations.md](../equations.md#s-a-floor-with-finite-friction)). MuJoCo's
            elliptic cone has the same law of friction. Its contacts are springs and dampers, so that loads build up
            within some milliseconds and wheels creep a little before they slip. Here the time constant of its contacts
            is {1e3 * SOFTNESS:g} ms, and the platform may tip, with its mass centre at {HEIGHT:g} m. A sliding contact
            hops in MuJoCo, so that its load pulsates (`findings/mujoco_sliding_contact_hops.sh`). These are the teeth
            in the picture; on four stiff legs they make the robot rock. So all robots stand on three of their casters
            here, where balance alone determines the mean loads, and the comparison is of mean motions. Our time step is
            {1e3 * OUR_STEPS[-1]:g} ms, MuJoCo's {1e3 * STEPS[-1]:g} ms."""
        ),
        paragraph(
            """There are five scenarios. In the first, the torques grow until the wheels slip. In the second, all joints
            push harder than the floor can hold, with random steering angles. In the third, one driven wheel spins. In
            the fourth, the robot starts with a motion that does not match the rates of its wheels, and slides until
            they grip. In the fifth, wheels that hardly turn brake the robot. In distances between ends, an angle counts
            as the arc at 0.2 m."""
        ),
        comparison_table(comparisons),
        "Medians, with minimum and maximum in brackets; [all runs](slip.csv).",
        "![Slip over time, ours and MuJoCo's, in five scenarios](slip.png)",
        "*The wheel of tidybot2 that slips most, in the first draw.*",
        "## Speed and error",
        paragraph(
            """The table compares robots that drift, simulated in turns on one core. The error is the distance between
            the ends of the drifts above and our ends at the shortest step. For MuJoCo, it includes the effect of its
            softer contacts."""
        ),
        rate_table(found, comparisons),
        f"- Command: `{command}`\n- Versions: {versions_in_words('caster_gym', 'mujoco', 'numpy')}",
    ]
    return join_parts(parts)


def main(arguments: list[str] | None = None) -> None:
    """Compare, and write a page, a table and a figure into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), help="names or files")
    parser.add_argument("--draws", type=int, default=DRAWS, help="of each scenario of each robot")
    parser.add_argument("--out", type=Path, default=Path("docs/truth"), metavar="DIR")
    chosen = parser.parse_args(arguments)
    robots = [load_robot(name) for name in chosen.robots]
    scenes = [scene for robot in robots for draw in range(chosen.draws) for scene in scenarios(robot, draw)]
    comparisons = [compare(scene) for scene in tqdm(scenes, disable=None)]
    found = [rates(robot) for robot in robots]
    chosen.out.mkdir(parents=True, exist_ok=True)
    write_table(chosen.out / "slip.csv", comparisons)
    last = robots[-1].name
    shown = [one for one in comparisons if (one.scene.robot.name, one.scene.draw) == (last, 0)]
    draw_courses(chosen.out / "slip.png", shown)
    command = command_line("scripts.slip_peer", arguments)
    (chosen.out / "slip.md").write_text(page(comparisons, found, command), encoding="utf-8")


if __name__ == "__main__":
    main()
