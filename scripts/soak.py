"""A long run that looks at every step: python -m scripts.soak --steps 1e9

Batches of robots drive for as many steps as asked, with random torques at their limits, in closed rooms with obstacles
of all kinds, with features, pushes and restarts. After each step it is checked of every robot that all numbers are
finite, that it is inside, and that no energy came from nowhere; after each leg, that memory stays. A leg depends only
on the seed and its number, so that what is found can be seen again. The page tells the figures; the table beside it has
a row for each leg. An interrupt keeps the legs that are finished, and --resume goes on behind them.
"""

import argparse
import csv
import gc
import os
import resource
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from tqdm import tqdm

from caster_gym.durable_files import write_file
from caster_gym.report.tables import write_csv
from scripts.soak_laws import DEEPEST, EXPLAINED, Energy, Inside, not_finite
from scripts.soak_page import faults_of, page
from scripts.soak_scenes import Leg, draw_leg, make_batch

ROBOTS = 2048  # in a batch
PERIODS = 1000  # control periods of a leg
FAULTS_TOLD = 3  # of a leg


class Row(NamedTuple):
    """What came of a leg."""

    leg: int
    seed: int
    robot: str
    task: str
    features: str
    autoreset: str
    steps: int  # of robots
    seconds: float
    episodes: int  # ended
    touched: int  # steps in which a robot touched something
    impacts: int
    least_gap: float  # [m]
    greatest_energy: float  # [J]
    excess: float  # [-] greatest share of an energy that work and slack leave unexplained; below zero there is none
    process: int  # how many have worked on this table before, and this one
    memory: float  # [MB] of the process after the leg
    faults: str


def run_leg(leg: Leg, seed: int, robots: int, periods: int, process: int) -> Row:
    """Let the robots of a leg drive, and check every step of theirs."""
    started, batch = time.perf_counter(), make_batch(leg, robots)
    rng, count = np.random.default_rng((seed, leg.number, 1)), batch.num_envs
    observations, infos = batch.reset(seed=leg.number)
    base: Any = batch.unwrapped
    energy, inside = (
        Energy(base.engine, base.task.time_step, leg.settings["arena"]["friction"]),
        Inside(leg, base.engine),
    )
    faults = [f"{name} is not finite at the start" for name in not_finite("observations", observations)]
    actions = np.zeros(batch.action_space.sample().shape, dtype=np.float32)
    fresh, everybody = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
    episodes = touched = impacts = 0
    least_gap, greatest, worst = np.inf, 0.0, -np.inf

    def fault(period: int, wrong: np.ndarray, what: str) -> None:
        if wrong.any():
            faults.append(f"robot {int(wrong.argmax())} in period {period} {what}")

    for period in range(periods):
        changed = rng.random(count) > leg.calm
        actions[changed] = rng.choice((-1.0, 0.0, 1.0), (int(changed.sum()), actions.shape[1]), p=(0.45, 0.1, 0.45))
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        ended = terminated | truncated
        restarted = {AutoresetMode.NEXT_STEP: fresh, AutoresetMode.SAME_STEP: ended}.get(leg.mode, ~everybody)
        if restarted.any():
            energy.read_parameters()
        excess = np.where(restarted, -1.0, energy.excess(infos["power"], infos["normal_impulse"]))
        gaps = np.minimum(infos["clearance"], inside.least_gaps(infos["pose"]))
        episodes, impacts = episodes + int(ended.sum()), impacts + int(infos["impacts"].sum())
        touched += int((infos["normal_impulse"] > 0.0).sum())
        least_gap, worst = min(least_gap, float(gaps.min())), max(worst, float(excess.max()))
        greatest = max(greatest, float(energy.kinetic.max()))
        returned = {"observations": observations, "rewards": rewards, "infos": infos}
        faults.extend(f"{name} is not finite in period {period}" for name in not_finite("", returned))
        fault(period, infos["not_finite"], "has a state that is not finite")
        fault(period, ~inside.has_centre(infos["pose"]), "has left the room")
        fault(period, ~(gaps >= -DEEPEST), f"is {-1e6 * gaps.min():.3g} µm inside an obstacle")
        fault(period, ~(excess <= EXPLAINED), f"gained {excess.max():.3g} of its energy from nowhere")
        fresh = ended
        if leg.mode is AutoresetMode.DISABLED and ended.any():
            batch.reset(options={"reset_mask": ended})
            energy.look()
            fresh = ~everybody
        if len(faults) >= FAULTS_TOLD:
            break
    batch.close()
    kinds = " ".join(one["kind"] for one in leg.features)
    steps, seconds = (period + 1) * count, time.perf_counter() - started
    del batch, base, energy, observations, infos
    gc.collect()
    return Row(
        *(leg.number, seed, leg.robot, leg.task, kinds, leg.mode.value, steps, seconds, episodes, touched, impacts),
        *(least_gap, greatest, worst, process, memory(), "; ".join(faults[:FAULTS_TOLD])),
    )


def memory() -> float:
    """Resident memory of this process, or where the system does not tell it, the most that it ever was. [MB]"""
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def read_rows(file: Path) -> list[Row]:
    """The finished legs of a table."""
    with file.open(newline="", encoding="utf-8") as lines:
        return [Row(*(kind(row[name]) for name, kind in Row.__annotations__.items())) for row in csv.DictReader(lines)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 1 if something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=float, default=2e8, help="of robots, all together")
    parser.add_argument("--out", type=Path, default=Path("docs/soak.md"), help="page; the table is legs.csv beside it")
    parser.add_argument("--robots", type=int, default=ROBOTS, help="in a batch")
    parser.add_argument("--periods", type=int, default=PERIODS, help="control periods of a leg")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", action="store_true", help="go on behind the legs that are finished")
    asked = parser.parse_args(arguments)
    table = asked.out.with_suffix("") / "legs.csv"
    if table.exists() and not asked.resume:
        raise SystemExit(f"{table} holds the legs of an earlier run: go on with --resume, or choose another --out")
    rows = read_rows(table) if table.exists() else []
    if rows and rows[0].seed != asked.seed:
        raise SystemExit(f"{table} was begun with --seed {rows[0].seed}, got {asked.seed}: choose another --out")
    process, done = 1 + max((row.process for row in rows), default=0), sum(row.steps for row in rows)
    table.parent.mkdir(parents=True, exist_ok=True)
    with tqdm(total=int(asked.steps), initial=done, unit="step", unit_scale=True, disable=None) as progress:
        try:
            while done < asked.steps:
                leg = draw_leg(asked.seed, len(rows))
                progress.set_description(f"leg {leg.number}, {leg.robot}, {leg.task}")
                rows.append(run_leg(leg, asked.seed, asked.robots, asked.periods, process))
                write_csv(table, Row._fields, rows)
                done += rows[-1].steps
                progress.update(rows[-1].steps)
                if rows[-1].faults:
                    progress.write(f"leg {leg.number}: {rows[-1].faults}")
        except KeyboardInterrupt:
            progress.write(f"interrupted: {len(rows)} legs are kept; --resume goes on")
    if rows:
        write_file(asked.out, page(rows))
    return int(bool(faults_of(rows)))


if __name__ == "__main__":
    sys.exit(main())
