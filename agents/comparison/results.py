"""Evaluates agents on the same episodes and writes the folder of results: tables, episodes as CSV, figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from caster_gym.agents.comparison.evaluation import Batch, bare, roll_out
from caster_gym.agents.comparison.figures import write_figures
from caster_gym.agents.comparison.summary import Result, table, write_episodes, write_summary
from caster_gym.agents.comparison.validation import Validation
from caster_gym.agents.control.protocol import Agent
from caster_gym.durable_files import write_file
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.verdicts import measured

FILES = (
    *("table.md", "episodes.csv", "summary.csv"),
    *(f"{name}.png" for name in ("paths", "speeds", "errors", "torques", "learning", "overview")),
)


class Contender(NamedTuple):
    """An agent that is ready to be compared."""

    name: str
    agent: Agent
    seed: int | None


class Compared(NamedTuple):
    """Results of all contenders on the same episodes, and the time series of each agent's first seed."""

    results: list[Result]
    episodes: dict[str, Episodes]


def compare(contenders: Sequence[Contender], test: Batch, seed: int, settling: float | None = None) -> Compared:
    """Run all contenders from the same starts.

    settling [s]: what comes before counts as transient; None: as suits the task.
    """
    how = bare(test).definition.metrics
    settling = how.settling if settling is None else settling
    results: list[Result] = []
    shown: dict[str, Episodes] = {}
    for name, agent, of_agent in tqdm(contenders, desc="evaluating", unit="agent", disable=None):
        episodes = roll_out(agent, test, seed)
        shown.setdefault(name, episodes)
        results.append(Result(name, of_agent, episodes.names, measured(how, episodes, settling)))
    return Compared(results, shown)


def write_results(
    folder: Path,
    compared: Compared,
    test: Batch,
    confidence: float,
    histories: Mapping[str, Sequence[Validation]],
    words: str = "",
) -> str:
    """Write table.md, episodes.csv, summary.csv and figures; returns the table, below the words if there are any."""
    results, episodes = compared
    text = "\n\n".join([*([words] if words else []), table(results, confidence)])
    write_episodes(folder / "episodes.csv", results)
    write_summary(folder / "summary.csv", results, confidence)
    write_file(folder / "table.md", text + "\n")
    write_figures(folder, episodes, histories, bare(test).engine.plan, bare(test).definition.pictures)
    return text
