"""A floor that wheels slip on, here and in MuJoCo: python -m scripts.slip_peer --out docs/truth

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
    "drift": "way [mm]",
    "spin-up of a wheel": "its rate at the end [rad/s]",
    "regrip": "last slip above 20 mm/s [ms]",
    "braking": "way [mm]",
}


def comparison_table(comparisons: list[Comparison]) -> str:
    """What both say, scenario by scenario, as Markdown."""
    heads = ("scenario", "measured", "robot", "ours", "MuJoCo", "ends apart [mm]", "at 5 ms ours is off [mm]")
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
    heads = ("robot", "side", "step [ms]", "drift off by [mm]", "simulated s per s of a core", "ours is faster by")
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
        "# A floor that wheels slip on",
        paragraph(
            f"""On a floor of finite friction (`floor: {{friction: 0.7}}`, section S of
            [equations.md](../equations.md#s-a-floor-with-finite-friction)) wheels may slip. MuJoCo's elliptic cone has
            the same law of friction; its contacts are springs and dampers, so that loads build up in some milliseconds
            and wheels creep a little before they slip. Here the time constant of its contacts is {1e3 * SOFTNESS:g} ms,
            and the platform may tip, with its mass centre at {HEIGHT:g} m. A contact that slides hops in MuJoCo: its
            load comes in beats (`findings/mujoco_sliding_contact_hops.sh`), the teeth in the picture, and on four stiff
            legs they set the robot rocking. So all robots stand on three of their casters here, where mean loads follow
            from balance alone, and what their wheels do is compared in the mean. Ours is compared at a step of
            {1e3 * OUR_STEPS[-1]:g} ms, MuJoCo at {1e3 * STEPS[-1]:g} ms."""
        ),
        paragraph(
            """Each robot is driven ever harder until its wheels slip; driven on all joints beyond what the floor holds,
            with wheels askew; driven by one wheel that spins; set on the floor moving otherwise than its wheels roll,
            until they grip; and braked by wheels that hardly turn. An end counts an angle as the way at 0.2 m."""
        ),
        comparison_table(comparisons),
        "Medians, least and greatest in brackets; [all of them](slip.csv).",
        "![Slip over time, ours and MuJoCo's, in five scenarios](slip.png)",
        "*The wheel of tidybot2 that slips most, in the first draw.*",
        "## Speed at an error",
        paragraph(
            """Robots that drift, on one core, in turns; the error is the distance of the ends of the drifts above from
            ours at the shortest step, which for MuJoCo contains what its softer contacts do otherwise."""
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
