"""What a second thread does to training beside other busy processes: measured in pairs, and a section of the page."""

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from tqdm import tqdm

from caster_gym.engines.native.cores import usable_cores
from caster_gym.engines.tensor.threads import limit_threads
from caster_gym.report.pages import paragraph
from caster_gym.report.tables import markdown_table
from scripts.speed_timing import RATE, middle, shown

COUNTS = (1, 2)  # of threads
PAIRS = 5
SPIN = """
import os, sys, threading
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
while True:
    pass
"""  # until the process that holds the other end of its input has ended


class Round(NamedTuple):
    """One round of collecting and updating beside busy processes."""

    threads: int
    seconds: float  # of the clock
    processor: float  # seconds of the processor


class Beside(NamedTuple):
    """All rounds, the threads in turn, and what they ran beside."""

    rounds: Sequence[Round]
    periods: int  # control periods of a round
    processes: int  # busy ones beside it

    def of(self, threads: int, what: str) -> list[float]:
        """That of each round with so many threads."""
        return [getattr(one, what) for one in self.rounds if one.threads == threads]


@contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """So many processes that compute without end, each on one core."""
    processes = [subprocess.Popen([sys.executable, "-c", SPIN], stdin=subprocess.PIPE) for _ in range(count)]
    try:
        yield
    finally:
        for one in processes:
            one.kill()
            one.communicate()


def train_beside(learner: BaseAlgorithm, periods: int, pairs: int = PAIRS) -> Beside:
    """Rounds with one thread and with two, in pairs whose order is drawn, while all cores but one are busy."""
    learner.learn(periods)  # compiles, and is not counted
    rounds: list[Round] = []
    rng, processes = np.random.default_rng(0), max(1, usable_cores() - 1)
    with busy_processes(processes), tqdm(total=pairs * len(COUNTS), desc="beside busy processes", disable=None) as bar:
        for _ in range(pairs):
            for threads in rng.permutation(COUNTS).tolist():
                with limit_threads(threads):
                    clock, processor = time.perf_counter(), time.process_time()
                    learner.learn(periods, reset_num_timesteps=False)
                    rounds.append(Round(threads, time.perf_counter() - clock, time.process_time() - processor))
                bar.update()
    return Beside(rounds, periods, processes)


def section(beside: Beside) -> str:
    """What was measured, as Markdown."""
    one, two = COUNTS
    ratios = {
        what: middle(b / a for a, b in zip(beside.of(one, what), beside.of(two, what), strict=True))
        for what in ("seconds", "processor")
    }
    processes = f"{beside.processes} busy process{'es' if beside.processes > 1 else ''}"
    rows = [
        (
            str(threads),
            f"{shown(beside.periods / middle(beside.of(threads, 'seconds')))} {RATE}",
            f"{shown(1e6 * middle(beside.of(threads, 'processor')) / beside.periods)} µs",
        )
        for threads in COUNTS
    ]
    text = f"""Training uses one thread unless `--threads` says otherwise. Here PPO trains beside {processes}, so that
        one core is left to it, in {len(beside.of(one, "seconds"))} pairs of rounds. With two threads it takes
        {shown(ratios["seconds"])} times as long by the clock and {shown(ratios["processor"])} times as much processor
        time, because the two wait for each other. The results differ, too, because sums depend on how they are divided
        among the threads."""
    heads = ("threads", "training with PPO, by the clock", "processor time for a control period")
    return "\n\n".join(["## Beside other processes", paragraph(text), markdown_table(heads, rows)])
