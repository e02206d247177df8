"""Speed of the robots, beside MuJoCo and Gymnasium: python -m scripts.measure_speed --out docs/speed.md

About ten minutes, and more where nothing has been compiled yet; with --quick about one, then without Torch, memory and
compiling from nothing.
"""

import argparse
import os
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from caster_gym import Robot, load_robot
from caster_gym.engines.native.threads import get_threads
from caster_gym.report.provenance import command_line
from caster_gym.report.run_folder import check_can_be_made
from caster_gym.report.tables import write_csv
from scripts.speed_accuracy import measure_accuracy
from scripts.speed_control import control_rows
from scripts.speed_growth import draw_growth, growth_rows
from scripts.speed_limits import operations_of_a_step
from scripts.speed_page import Occasion, page
from scripts.speed_peers import peer_rows
from scripts.speed_processes import FIRST_STEP, fresh, memory_rows, start_rows
from scripts.speed_robots import bare_rows, environment_rows, single_rows
from scripts.speed_timing import Row, Values, run

TURNS, SECONDS = 11, 0.25  # [s] of a row in a turn
QUICK_TURNS, QUICK_SECONDS = 2, 0.02
GROWTH = 0.4  # of these seconds, for a point of the figure of growth

Section = tuple[str, str, Sequence[Row]]


def sections(robot: Robot, name: str, cores: int, seconds: float, quick: bool) -> list[Section]:
    """Titles, remarks and rows of the page's tables."""
    starts = start_rows(name, cold=not quick)
    return [
        (
            "The equations alone",
            """RK4 steps of 5 ms in float64, from random poses and twists, under random torques. The 8 obstacles are the
            walls of a room of 4 m × 4 m and four pillars; robots bounce off them.""",
            bare_rows(robot, cores, seconds),
        ),
        (
            "Whole environments",
            """One step is a control period of 20 ms: RK4 substeps, observation, reward, infos, and the reset where an
            episode has ended. Actions are random, up to a tenth of the maximum torques, and the corridor is wide.
            Episodes therefore end by time, after 6 to 13 s; in large batches some episode ends in nearly every step.
            "Following" is CasterFollow-v0 on random paths.""",
            environment_rows(name, cores, seconds),
        ),
        ("One robot", "The time of one step.", single_rows(name, seconds)),
        (
            "Model-based control",
            """The time that one robot's action takes on one core, of those who act every 20 ms.""",
            control_rows(robot, seconds),
        ),
        (
            "Peers",
            """MuJoCo simulates the same robot as rigid bodies, and nothing else. The other rows are whole environments;
            a loop over environments counts the steps of all of them. One step of HalfCheetah consists of 5 MuJoCo steps
            of 10 ms.""",
            peer_rows(robot, name, cores, seconds),
        ),
        (
            "Torch",
            "The same equations and environments on tensors in float32, compiled.",
            torch_rows(robot, name, cores, seconds) if not quick else [],
        ),
        (
            "Start-up and memory",
            """Each row is measured in a process of its own. Memory is what a large batch adds after a small one has
            run: as growth of the process, and as counted by Python and NumPy. The environment includes Gymnasium's
            spaces and random generators.""",
            [*starts, *([] if quick else memory_rows(name))],
        ),
    ]


def torch_rows(robot: Robot, name: str, cores: int, seconds: float) -> list[Row]:
    """The rows of Torch where it is installed."""
    if find_spec("torch") is None:
        return []
    from scripts import speed_torch

    return speed_torch.torch_rows(robot, name, cores, seconds)


def write_turns(file: Path, measured: Values) -> None:
    """Every value, a line each."""
    rows = ((key, turn, f"{value:.6g}") for key, values in measured.items() for turn, value in enumerate(values))
    write_csv(file, ("row", "turn", "value"), rows)


def main(arguments: list[str] | None = None) -> None:
    """Measure, and print the page or write it where asked, with its figure and all values in a folder beside it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="chung2008", help="name of a robot or path of its file")
    parser.add_argument("--quick", action="store_true", help="a short look instead of a measurement")
    parser.add_argument("--turns", type=int, help=f"instead of {TURNS}")
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="file for the page; FILE/ gets what belongs to it")
    chosen = parser.parse_args(arguments)
    folder = Path("speed") if chosen.out is None else chosen.out.with_suffix("")
    if chosen.out is not None:
        check_can_be_made(folder)
    turns, seconds = (QUICK_TURNS, QUICK_SECONDS) if chosen.quick else (TURNS, SECONDS)
    turns = chosen.turns or turns
    robot, cores, load = load_robot(chosen.robot), min(2, get_threads()), os.getloadavg()[0]
    fresh(FIRST_STEP, chosen.robot)  # leaves compiled code on disk
    parts = sections(robot, chosen.robot, cores, seconds, chosen.quick)
    growth = growth_rows(robot, chosen.robot, cores, GROWTH * seconds, chosen.quick)
    accuracy = measure_accuracy(robot)
    measured = run([*(row for _, _, rows in parts for row in rows), *growth], turns)
    command = command_line("scripts.measure_speed", arguments)
    occasion = Occasion(command, turns, seconds, cores, (load, os.getloadavg()[0]), chosen.quick)
    text = page(parts, measured, accuracy, robot.name, operations_of_a_step(robot), folder.name, occasion)
    if chosen.out is None:
        print(text)
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_turns(folder / "turns.csv", measured)
    draw_growth(folder / "growth.png", measured, cores)
    chosen.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
