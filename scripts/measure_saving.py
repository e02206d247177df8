"""What saving the state of a training costs: python -m scripts.measure_saving --out docs/resuming

Each agent trains as it is shipped, for some time. The seconds that saving takes are counted.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray
from tqdm import tqdm

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.learning.training_run import Run
from caster_gym.agents.registry import read_agent
from caster_gym.durable_files import write_file
from caster_gym.engines.tensor.threads import limit_threads
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table
from caster_gym.shipped_files import read_settings

AGENTS = ("ppo", "sac", "shac")


class Enough(Exception):  # noqa: N818  # no error: the time is over
    """So much training was asked for."""


class Cost(NamedTuple):
    """What saving has cost."""

    agent: str
    every: float  # [s] between two states
    saves: int
    seconds: float  # of all saves
    training: float  # [s] of the training from its first round on, with all saves
    state: int  # [bytes] of the last state
    replay: int  # [bytes] of the replay buffer's files


class TimedRun(Run):
    """A run that counts what saving takes, and ends after some time."""

    def __init__(
        self, folder: Path, task: TaskSettings, settings: LearnerSettings, longest: float, bar: "tqdm[None]"
    ) -> None:
        super().__init__(folder, task, settings, 0, lambda _steps, _verdict: None)
        self.longest, self.bar = longest, bar
        self.begun: float | None = None
        self.ended = self.seconds = 0.0
        self.saves = 0

    def save(self, steps: int, take: Callable[[], tuple[Mapping[str, NDArray[Any]], Mapping[str, Any]]]) -> bool:
        """As always, with the time counted."""
        now = time.perf_counter()
        self.begun = now if self.begun is None else self.begun
        self.bar.update(min(now - self.begun, self.longest) - self.bar.n)
        saved = super().save(steps, take)
        self.ended = time.perf_counter()
        self.seconds += self.ended - now
        self.saves += saved
        if self.ended - self.begun > self.longest and saved:
            raise Enough
        return saved


def measure(name: str, task: TaskSettings, settings: LearnerSettings, longest: float) -> Cost:
    """Train an agent for so many seconds, or to its end."""
    bar = tqdm(total=round(longest), desc=name, unit="s", disable=None)
    with tempfile.TemporaryDirectory() as folder, bar, limit_threads(1):
        run = TimedRun(Path(folder), task, settings, longest, bar)
        try:
            settings.learn(run)
        except Enough:
            pass
        finally:
            run.logger.close()
        sizes = {path.name: path.stat().st_size for path in run.state_folder.iterdir()}
        assert run.begun is not None
        return Cost(
            name,
            settings.save_every,
            run.saves,
            run.seconds,
            run.ended - run.begun,
            sizes.pop("state.safetensors"),
            sum(sizes.values()),
        )


def page(costs: Sequence[Cost], command: str) -> str:
    """The costs as a page."""
    columns = (
        "agent",
        "saved every [s]",
        "saves",
        "a save [ms]",
        "share of training [%]",
        "state",
        "replay buffer",
    )
    rows = [
        (
            cost.agent,
            cost.every,
            cost.saves,
            1e3 * cost.seconds / cost.saves,
            100.0 * cost.seconds / cost.training,
            f"{cost.state / 1e6:.2f} MB",
            f"{cost.replay / 1e6:.1f} MB" if cost.replay else "",
        )
        for cost in costs
    ]
    return "\n\n".join(
        [
            "# What it costs to save a training's state",
            "Each agent trained as it is shipped, on the task `track`, until the given number of states was saved. The "
            "share is that of the time from the first round of training on.",
            markdown_table(columns, rows),
            f"Made by `{command}` with {versions_in_words('numpy', 'torch', 'stable-baselines3')}.\n",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Measure what it costs to save the state of a training.")
    parser.add_argument("--seconds", type=float, default=60.0, help="of training, for each agent")
    parser.add_argument("--agents", nargs="+", default=AGENTS)
    parser.add_argument("--out", type=Path, help="folder for cost.md")
    options = parser.parse_args(arguments)
    task = read_settings(TaskSettings, "tasks", "track")
    costs = []
    for name in options.agents:
        settings = read_agent(name)
        if not isinstance(settings, LearnerSettings):
            raise ValueError(f"agent {name!r} does not learn, so that it has no state to save")
        costs.append(measure(name, task, settings, options.seconds))
    text = page(costs, command_line("scripts.measure_saving", arguments))
    print(text)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_file(options.out / "cost.md", text)


if __name__ == "__main__":
    main()
