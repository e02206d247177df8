"""Kills trainings and goes on with them: python -m scripts.pull_the_plug --kills 100 --out docs/resuming

Real processes of `caster-gym train`, `benchmark` and `sweep` are ended by SIGKILL, or one of their writes fails, with a
full disk (ENOSPC) or a broken one (EIO), until they are done. What they leave is compared byte by byte with what an
undisturbed process left.
"""

import argparse
import random
import shutil
import sys
import tempfile
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tqdm import tqdm

from caster_gym.durable_files import write_file
from caster_gym.engines.native.cores import usable_cores
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table
from scripts.disturbing import (
    INTERVAL,
    Disturbance,
    build_library,
    differing,
    disturb,
    run_undisturbed,
    write_settings,
)


class Tally:
    """What several threads have met so far."""

    def __init__(self, bar: "tqdm[Any]") -> None:
        self.met: list[Disturbance] = []
        self.different: list[str] = []
        self.runs = 0
        self.stopped = False
        self._bar, self._lock = bar, threading.Lock()

    def add(self, met: Sequence[Disturbance], different: Sequence[str]) -> None:
        """Count a run that was disturbed until it was done."""
        with self._lock:
            self.met += met
            self.different += different
            self.runs += 1
            self._bar.update(self.kills - self._bar.n)

    @property
    def kills(self) -> int:
        """How many processes were killed."""
        return sum(one.how == "kill" for one in self.met)


def pull(kills: int, seed: int, names: Sequence[str] | None = None) -> Tally:
    """Disturb all commands in turns, one on each core, until there were so many kills."""
    with tempfile.TemporaryDirectory() as place, tqdm(total=kills, desc="kills", disable=None) as bar:
        tally = Tally(bar)
        library = build_library(Path(place))
        folders = [Path(place) / str(number) for number in range(usable_cores())]
        for folder in folders:
            folder.mkdir()
            commands = write_settings(folder)
        chosen = list(names or commands)
        works = [run_undisturbed(name, commands[name], folders[0]) for name in chosen]

        def disturb_in_turns(number: int) -> None:
            generator, turn = random.Random(f"{seed} {number}"), number
            while tally.kills < kills and not tally.stopped:
                work = works[turn % len(works)]
                try:
                    met = disturb(work, folders[number], library, generator)
                except RuntimeError:
                    tally.stopped = True
                    raise
                tally.add(met, [f"{work.name}: {name}" for name in differing(work, folders[number])])
                shutil.rmtree(folders[number] / "run")
                turn += 1

        with ThreadPoolExecutor(len(folders)) as threads:
            try:
                list(threads.map(disturb_in_turns, range(len(folders))))
            except KeyboardInterrupt:  # what was seen so far is reported, once the present runs are done
                tally.stopped = True
        return tally


def page(met: Sequence[Disturbance], different: Sequence[str], runs: int, command: str) -> str:
    """What happened, as a page."""
    rows = [
        (
            work,
            *(sum(one.work == work and one.how == how for one in met) for how in ("kill", "ENOSPC", "EIO")),
            max((one.lost for one in met if one.work == work), default=0.0),
        )
        for work in dict.fromkeys(one.work for one in met)
    ]
    kills = sum(one.how == "kill" for one in met)
    return "\n\n".join(
        [
            "# Processes that were killed",
            f"{runs} runs were disturbed until they were done: {kills} times by SIGKILL and {len(met) - kills} "
            "times by a write that failed, at random instants, also while the process started. Files that differ from "
            f"those of an undisturbed run: {len(different)}.",
            markdown_table(("command", "kills", "ENOSPC", "EIO", "longest work lost [s]"), rows),
            f"A state was saved every {INTERVAL} s. Work lost is the time from the last state that was saved, or from "
            "the start of the process if it has saved none, to the kill: it includes the start of the process, and the "
            "round of collecting and learning at whose end the next state would have been saved.",
            f"Made by `{command}` with {versions_in_words('numpy', 'torch', 'stable-baselines3')}.\n",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Kill trainings at random instants, go on with them, compare.")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", help="commands to disturb, such as 'train ppo'")
    parser.add_argument("--out", type=Path, help="folder for kills.md")
    options = parser.parse_args(arguments)
    tally = pull(options.kills, options.seed, options.only)
    different = tally.different
    text = page(tally.met, different, tally.runs, command_line("scripts.pull_the_plug", arguments))
    print(text)
    if different:
        sys.exit("\n".join(["these files differ:", *different]))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_file(options.out / "kills.md", text)


if __name__ == "__main__":
    main()
