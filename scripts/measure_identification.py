"""How often the intervals of `caster-gym identify` contain the truth, with the model's friction and with others.

    python -m scripts.measure_identification --recordings 200 --out docs/identification

Recordings come from `scripts.maximal_bodies`, which shares no equation with the package, in steps of 1 ms, with noise.
Each fit leaves its rows in coverage.csv at once, and those that are there are not made again. coverage.md is the table.
"""

import argparse
import csv
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from caster_gym.arrays import Array
from caster_gym.identification import Noise, Recording, identify, robot_with
from caster_gym.report.tables import markdown_table
from caster_gym.robot import Robot, load_robot
from scripts.maximal_bodies import FrictionLaw, MaximalBodies

NOISE = Noise(position=1e-3, heading=2e-3, velocity=1e-2, yaw_rate=1e-2, steering=2e-3, rolling=2e-3)
TRUTH = {"payload_mass": 1.0, "payload_x": 0.03, "payload_y": -0.02, "roll_coulomb": 4e-3, "steer_coulomb": 2e-3}
KNOWN = {"roll_viscous": 3e-4, "steer_viscous": 2e-4}
LAWS = {
    "the model's own": FrictionLaw(),
    "five times sharper at zero": FrictionLaw(speed=0.02),
    "ten times sharper at zero (tanh)": FrictionLaw(speed=0.01, sharp=True),
    "30 % greater below 1 rad/s (Stribeck)": FrictionLaw(breakaway=0.3),
    "viscous part bent by 20 % at 20 rad/s": FrictionLaw(bend=0.2),
}
SECONDS, STEP, SUBSTEPS = 2.0, 0.02, 20
_FREQUENCIES = np.array([0.2, 0.5, 1.1, 2.3])  # [Hz]
_SHARE = 0.5  # [-] of the greatest force
_CRUISE = 0.25  # [-] of the top speed at which drag balances it
_FIELDS = ("law", "recording", "name", "truth", "estimate", "half_width", "doubted", "seconds")


def bare_robot() -> Robot:
    """The robot as it is thought to be: chung2008 with two of its casters, for speed, and viscous friction."""
    robot = load_robot("chung2008")
    return robot_with(robot.model_copy(update={"casters": robot.casters[:2]}), KNOWN)


def recordings(law: FrictionLaw, count: int, seed: int) -> list[Recording]:
    """Recordings of the robot with its payload, each driven by random forces, with noise on all that is measured."""
    robot = robot_with(bare_robot(), TRUTH)
    bodies, rng = MaximalBodies(robot, law), np.random.default_rng(seed)
    limits = np.array([motor.max_torque for caster in robot.casters for motor in (caster.roll, caster.steer)])
    reach = (robot.platform.inertia / robot.platform.mass) ** 0.5
    force = _SHARE * sum(one.roll.max_torque / one.radius for one in robot.casters) * np.array([1.0, 1.0, reach])
    drag = force * np.array([1.0, 1.0, reach]) / (_CRUISE * robot.top_speed)
    phases = rng.uniform(-np.pi, np.pi, (count, len(_FREQUENCIES), 3))
    frequencies = _FREQUENCIES[:, None] * rng.uniform(0.8, 1.25, phases.shape)
    motion = bodies.at_rest(rng.uniform(-np.pi, np.pi, (count, robot.caster_count)))
    rows: list[tuple[Array, ...]] = []
    for k in range(round(SECONDS / STEP) + 1):
        waves = np.sin(2.0 * np.pi * frequencies * k * STEP + phases).sum(axis=1) / len(_FREQUENCIES) ** 0.5
        wanted = force * waves - drag * motion.twist
        unit_twists = np.broadcast_to(np.eye(3)[:, None], (3, count, 3))
        rates = [bodies.joint_rates(twist, motion.steering)[0].reshape(count, -1) for twist in unit_twists]
        shares = (np.linalg.pinv(limits * np.stack(rates, axis=1), rcond=1e-3) @ wanted[..., None])[..., 0]
        torque = limits * np.clip(shares, -1.0, 1.0)
        rows.append((*motion, torque))
        motion = bodies.simulate(motion, torque, STEP, SUBSTEPS)
    pose, twist, steering, rolling, torque = (np.stack(parts, axis=1) for parts in zip(*rows, strict=True))
    lanes = zip(pose, steering, torque, twist, rolling, strict=True)
    return [Recording(STEP, *lane).noisy(NOISE, np.random.default_rng((seed, i))) for i, lane in enumerate(lanes)]


class Held(NamedTuple):
    """What an interval says of an unknown of one recording."""

    law: str
    recording: int
    name: str
    truth: float
    estimate: float
    half_width: float
    doubted: bool  # whether it was warned of
    seconds: float  # that the whole fit took

    @property
    def holds(self) -> bool:
        """Whether the interval holds the truth."""
        return abs(self.estimate - self.truth) <= self.half_width


def fitted(recording: Recording, law: str, number: int) -> list[Held]:
    """A row for each unknown."""
    start = time.perf_counter()
    found = identify(bare_robot(), recording, tuple(TRUTH))
    seconds = time.perf_counter() - start
    return [
        Held(law, number, name, truth, float(value), float(half), name in found.doubted, seconds)
        for (name, truth), value, half in zip(TRUTH.items(), found.estimates, found.half_widths, strict=True)
    ]


def read_rows(path: Path) -> list[Held]:
    """The rows of a file that an earlier call left; none if there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8") as file:
        return [
            Held(
                row["law"],
                int(row["recording"]),
                row["name"],
                float(row["truth"]),
                float(row["estimate"]),
                float(row["half_width"]),
                row["doubted"] == "True",
                float(row["seconds"]),
            )
            for row in csv.DictReader(file)
        ]


def coverage_table(rows: list[Held]) -> str:
    """Shares of intervals that hold the truth, of those that are not warned of, a row for each law."""
    names, laws = list(TRUTH), list(dict.fromkeys(row.law for row in rows))
    groups = [(law, [row for row in rows if row.law == law]) for law in laws]
    if len(laws) > 2:
        groups.append(("all other laws", [row for row in rows if row.law != laws[0]]))
    lines = []
    for title, own in groups:
        trusted = [row for row in own if not row.doubted]
        count = len({(row.law, row.recording) for row in own})
        warned = len({(row.law, row.recording) for row in own if row.doubted})
        cells = [_share([row for row in trusted if row.name == name]) for name in names]
        lines.append((title, str(count), str(warned), *cells, _share(trusted)))
    return markdown_table(("friction", "recordings", "with a warning", *names, "all"), lines)


def _share(rows: list[Held]) -> str:
    return f"{100.0 * np.mean([row.holds for row in rows]):.1f} %" if rows else "–"


def main() -> None:
    """Measure what is not there yet, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=200, help="with the model's own law, and as many with others")
    parser.add_argument("--out", type=Path, default=Path("docs/identification"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "coverage.csv"
    own, *others = LAWS
    wanted = [(own, i) for i in range(arguments.recordings)]
    wanted += [(others[i % len(others)], i // len(others)) for i in range(arguments.recordings)]
    done = {(row.law, row.recording) for row in read_rows(path)}
    missing = [case for case in wanted if case not in done]
    half = (len(missing) + 1) // 2
    missing = [case for pair in zip(missing[:half], [*missing[half:], None], strict=False) for case in pair if case]
    counts = {law: 1 + max(i for name, i in wanted if name == law) for law in LAWS}
    made: dict[str, list[Recording]] = {}
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not done:
            writer.writerow(_FIELDS)
        for law, number in tqdm(missing, desc="recordings", file=sys.stderr, disable=None):
            if law not in made:
                made[law] = recordings(LAWS[law], counts[law], list(LAWS).index(law))
            writer.writerows(fitted(made[law][number], law, number))
            file.flush()
    table = coverage_table(read_rows(path))
    (arguments.out / "coverage.md").write_text(table + "\n", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
