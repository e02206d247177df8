"""What MJCF readers take from an exported robot: `python -m scripts.measure_readers --out docs/export.md`.

Each reader is installed in an environment of its own in a temporary folder, with pinned versions, and asked by its
probe in scripts/readers. The table between the markers of the page is replaced.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from tqdm import tqdm

from caster_gym.export.mjcf import mjcf
from caster_gym.report.pages import between_marks
from caster_gym.report.tables import markdown_table
from caster_gym.robot import Robot, load_robot
from scripts.readers.facts import FACTS, READERS

PROBES = Path(__file__).parent / "readers"
BEGIN, END = "<!-- table readers: begin -->", "<!-- table readers: end -->"
STEP = 2e-3  # [s]


def single() -> Robot:
    """A robot whose motors turn one joint each, with ratios, and with friction of every kind."""
    robot = load_robot("chung2008")
    motor = robot.casters[0].roll.model_copy(
        update={"armature": 1e-3, "viscous": 2e-3, "coulomb": 3e-3, "max_torque": 0.2}
    )
    update = {"gear": ((3.0, 0.0), (0.0, 2.0)), "roll": motor, "steer": motor, "scrub": 4e-3}
    return robot.model_copy(update={"casters": tuple(caster.model_copy(update=update) for caster in robot.casters)})


def ask(name: str, folder: Path, files: list[Path]) -> dict[str, str]:
    """Install a reader and run its probe. Raises RuntimeError if it fails or leaves a fact out."""
    probe, packages = READERS[name]
    place = folder / probe
    venv.create(place, with_pip=True)
    python = place / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True, stderr=subprocess.DEVNULL)
    done = subprocess.run(
        [python, PROBES / f"{probe}.py", *files], capture_output=True, text=True, check=False, cwd=folder
    )
    if done.returncode != 0:
        raise RuntimeError(f"{name}: {done.stderr[-2000:]}")
    facts: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    if set(facts) != set(FACTS):
        raise RuntimeError(f"{name} answers {sorted(facts)}; asked were {sorted(FACTS)}")
    return facts


def table(answers: dict[str, dict[str, str]]) -> str:
    """One row a fact, one column a reader."""
    return markdown_table(("", *answers), [(fact, *(facts[fact] for facts in answers.values())) for fact in FACTS])


def main() -> None:
    """Ask every reader and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="page with the markers of the table")
    arguments = parser.parse_args()
    page = arguments.out.read_text(encoding="utf-8")
    if BEGIN not in page or END not in page:
        sys.exit(f"{arguments.out} has no lines {BEGIN!r} and {END!r} for the table")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = [folder / "single.xml", folder / "coupled.xml"]
        for file, robot in zip(files, (single(), load_robot("tidybot2")), strict=True):
            file.write_text(mjcf(robot, STEP), encoding="utf-8")
        answers = {reader: ask(reader, folder, files) for reader in tqdm(READERS, unit="reader", disable=None)}
    arguments.out.write_text(between_marks(page, BEGIN, END, f"\n{table(answers)}\n"), encoding="utf-8")


if __name__ == "__main__":
    main()
