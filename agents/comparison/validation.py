"""Evaluates agents on the validation paths, by which policies and gains are chosen."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from caster_gym.agents.comparison.evaluation import Batch, bare, roll_out
from caster_gym.agents.control.protocol import Agent
from caster_gym.report.tables import write_csv
from caster_gym.table_files import read_lines
from caster_gym.tasks.verdicts import measured, verdict_of

VALIDATION_SEED = 500


class Validation(NamedTuple):
    """How good a policy is on validation paths."""

    steps: int
    seconds: float  # of training so far, validations left out
    verdict: Any  # of the task's metrics

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by name."""
        return {"steps": self.steps, "seconds": self.seconds, **self.verdict._asdict()}


def verdict_on(agent: Agent, validation: Batch) -> Any:
    """How good an agent is on a batch of validation paths, always from the same starts."""
    how = bare(validation).definition.metrics
    return verdict_of(how, measured(how, roll_out(agent, validation, VALIDATION_SEED), how.settling))


def write_history(path: Path, history: Sequence[Validation]) -> None:
    """The validations of a training run as CSV."""
    write_csv(path, history[0].numbers, (result.numbers.values() for result in history))


def read_history(path: Path, verdict: Any) -> list[Validation]:
    """The validations of a training run on a task with these verdicts. Raises ValueError that names the file."""
    names, history = ("steps", "seconds", *verdict._fields), []
    for number, row in enumerate(csv.DictReader(read_lines(path)), start=1):
        try:
            steps, seconds, *numbers = (float(row[name]) for name in names)
            history.append(Validation(int(steps), seconds, verdict._make(numbers)))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            wanted = f"row {number} should have a number for each of {', '.join(names)}"
            raise ValueError(f"{path} is no history of a training run: {wanted}") from error
    return history
