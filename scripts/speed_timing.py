"""How speed is measured: many short turns of all rows, so that a busy moment of the machine hits all of them alike."""

import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

RATE = "steps/s"
Values = Mapping[str, Sequence[float]]  # of each row by its key, one a turn


class Goal(NamedTuple):
    """What a number ought to reach."""

    bound: float
    at_least: bool

    def reached(self, value: float) -> bool:
        """Whether the number is as good as the bound or better."""
        return value >= self.bound if self.at_least else value <= self.bound

    def __str__(self) -> str:
        return f"{'≥' if self.at_least else '≤'} {shown(self.bound)}"


def at_least(bound: float) -> Goal:
    """A goal for what is better when greater."""
    return Goal(bound, True)


def at_most(bound: float) -> Goal:
    """A goal for what is better when smaller."""
    return Goal(bound, False)


class Row(NamedTuple):
    """Something to measure, over and over."""

    key: str
    name: str
    unit: str
    measure: Callable[[], float]  # once, in that unit
    goal: Goal | None = None
    turns: int | None = None  # in which it is measured; None for all


class Ratio(NamedTuple):
    """One row over another, turn by turn, so that what slows both falls out."""

    name: str
    over: str  # key of a row
    under: str
    factor: float = 1.0
    goal: Goal | None = None

    def values(self, measured: Values) -> list[float]:
        """The ratio in every turn in which both were measured."""
        pairs = zip(measured.get(self.over, ()), measured.get(self.under, ()), strict=False)
        return [self.factor * over / under for over, under in pairs]


class Work(NamedTuple):
    """What is timed, and what is done before each time without being timed."""

    call: Callable[[], int]  # returns how many steps it made
    prepare: Callable[[], object] = lambda: None


def rate(work: Work, seconds: float) -> float:
    """Steps per second over at least so long; the first call is not counted, since it compiles and fills the caches."""
    work.prepare()
    work.call()
    steps, passed = 0, 0.0
    while passed < seconds or not steps:
        work.prepare()
        start = time.perf_counter()
        steps += work.call()
        passed += time.perf_counter() - start
    return steps / passed


def run(rows: Sequence[Row], turns: int) -> dict[str, list[float]]:
    """All rows in every turn, in an order drawn anew for each."""
    measured: dict[str, list[float]] = {row.key: [] for row in rows}
    if len(measured) < len(rows):
        raise ValueError("two rows have the same key")
    rng = np.random.default_rng(0)
    with tqdm(total=sum(min(turns, row.turns or turns) for row in rows), file=sys.stderr, disable=None) as progress:
        for turn in range(turns):
            for i in rng.permutation(len(rows)):
                if turn < (rows[i].turns or turns):
                    progress.set_description(rows[i].name)
                    measured[rows[i].key].append(rows[i].measure())
                    progress.update()
    return measured


def middle(values: Iterable[float]) -> float:
    """The median."""
    return float(np.median(list(values)))


def spread(values: Iterable[float]) -> str:
    """The middle half of the values; nothing for a single one."""
    listed = list(values)
    if len(listed) < 2:
        return ""
    low, high = np.quantile(listed, (0.25, 0.75))
    return f"{shown(float(low))} – {shown(float(high))}"


def shown(value: float) -> str:
    """Three digits, thousands separated."""
    if abs(value) < 999.5:
        return f"{value:.3g}"
    unit = 10 ** (len(str(round(abs(value)))) - 3)
    return f"{round(value / unit) * unit:,}"
