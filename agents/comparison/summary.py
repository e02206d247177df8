"""From episodes to tables: means with bootstrap intervals, as CSV and as text to read."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import bootstrap

from caster_gym.arrays import Array
from caster_gym.report.tables import markdown_table, write_csv
from caster_gym.tasks.measuring import Counted, Printed, shown

RESAMPLES = 2000


class Result(NamedTuple):
    """What one agent, trained with one seed or with none, did on all test episodes."""

    agent: str
    seed: int | None
    paths: tuple[str, ...]  # name of the path of each episode
    metrics: Any  # what the task's metrics measured


class Estimate(NamedTuple):
    """Mean over episodes with its bootstrap interval, and the lowest and highest mean of a seed."""

    mean: float
    low: float
    high: float
    seed_low: float
    seed_high: float


def estimate(values: Array, confidence: float) -> Estimate:
    """Estimate from values (seeds, episodes).

    Episodes are resampled, each with all its seeds together (percentile bootstrap of the mean, scipy.stats.bootstrap),
    so that the interval speaks of other paths and starts; the spread over seeds is given apart. Missing values (NaN)
    are left out.
    """
    with_value = np.isfinite(values)
    per_seed = np.where(with_value, values, 0.0).sum(axis=1) / np.maximum(with_value.sum(axis=1), 1)
    per_seed = per_seed[with_value.any(axis=1)]
    counts = with_value.sum(axis=0)
    episodes = (np.where(with_value, values, 0.0).sum(axis=0) / np.maximum(counts, 1))[counts > 0]
    if episodes.size == 0:
        return Estimate(*[float("nan")] * 5)
    mean = float(episodes.mean())
    if episodes.size < 2 or np.ptp(episodes) == 0.0:
        return Estimate(mean, mean, mean, float(per_seed.min()), float(per_seed.max()))
    interval = bootstrap(
        (episodes,), np.mean, n_resamples=RESAMPLES, confidence_level=confidence, method="percentile", rng=0
    ).confidence_interval
    return Estimate(mean, float(interval.low), float(interval.high), float(per_seed.min()), float(per_seed.max()))


def by_agent(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Results of each agent, in the order in which agents first appear."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(result.agent, []).append(result)
    return groups


def values_of(results: Sequence[Result], metric: str) -> Array:
    """A metric of several results of the same episodes (seeds, episodes)."""
    return np.stack([getattr(result.metrics, metric) for result in results])


def table(results: Sequence[Result], confidence: float) -> str:
    """Markdown table with a column for each agent: mean and interval, then the range of the seeds' means."""
    groups = by_agent(results)
    head = [
        "",
        *[name if g[0].seed is None else f"{name}, {len(g)} seed{'s' * (len(g) > 1)}" for name, g in groups.items()],
    ]
    body = [
        [how.label, *[_cell(values_of(g, name), how, confidence) for g in groups.values()]]
        for name, how in shown(type(results[0].metrics))
    ]
    return markdown_table(head, body, padded=True)


def _cell(values: Array, how: Printed | Counted, confidence: float) -> str:
    """What the table says of the values (seeds, episodes) of an agent."""
    if isinstance(how, Counted):
        return f"{int(values.sum())} of {values.size}"
    found = estimate(values * how.factor, confidence)
    if np.isnan(found.mean):
        return "–"
    cell = f"{found.mean:.3g} [{found.low:.3g}, {found.high:.3g}]"
    return cell if len(values) < 2 else f"{cell}, seeds {found.seed_low:.3g} … {found.seed_high:.3g}"


def write_episodes(path: Path, results: Sequence[Result]) -> None:
    """Every metric of every episode of every agent and seed, in SI units."""
    rows = (
        (result.agent, "" if result.seed is None else result.seed, i, name, *(float(v[i]) for v in result.metrics))
        for result in results
        for i, name in enumerate(result.paths)
    )
    write_csv(path, ("agent", "seed", "episode", "path", *results[0].metrics._fields), rows)


def write_summary(path: Path, results: Sequence[Result], confidence: float) -> None:
    """The table's numbers for every metric, in SI units."""
    rows = (
        (agent, len(group), len(group[0].paths), metric, *estimate(values_of(group, metric), confidence))
        for agent, group in by_agent(results).items()
        for metric in group[0].metrics._fields
    )
    write_csv(path, ("agent", "seeds", "episodes", "metric", *Estimate._fields), rows)
