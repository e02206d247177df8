"""Evaluates agents on the validation paths, by which policies and gains are chosen."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from caster_gym.agents.comparison.evaluation import Batch, bare, roll_out
from caster_gym.agents.comparison.task_settings import in_brief
from caster_gym.agents.control.own_controller import candidates_of, controller_of
from caster_gym.agents.control.protocol import Agent, ControllerSettings
from caster_gym.report.tables import write_csv
from caster_gym.table_files import read_lines

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


class Tuned(NamedTuple):
    """A controller, and the settings that did best on validation paths."""

    controller: Agent
    settings: ControllerSettings


def verdict_on(agent: Agent, validation: Batch) -> Any:
    """How good an agent is on a batch of validation paths, always from the same starts."""
    how = bare(validation).definition.metrics
    return how.verdict.of(how.measure(roll_out(agent, validation, VALIDATION_SEED), how.settling))


def tune(settings: ControllerSettings, validation: Batch, called: str | None = None) -> Tuned:
    """The controller whose settings, of the candidates, do best on validation paths, as policies are chosen there.

    called: what messages call the agent, its algorithm if nothing else.
    """
    plain = bare(validation)
    if redefining := [feature for feature in getattr(validation, "features", ()) if feature.redefines_actions]:
        raise ValueError(
            f"{settings.algorithm} gives torques, but the task's actions are those of {in_brief(redefining[0])}: leave "
            "that out of its wrappers"
        )
    layout, period = plain.engine.layout, plain.task.control_period
    called = called or settings.algorithm
    tried = [Tuned(controller_of(one, layout, period, called), one) for one in candidates_of(settings, called)]
    if len(tried) > 1:
        return max(tried, key=lambda one: verdict_on(one.controller, validation).merit)
    if settings.is_own:  # another one acts once, so that mistakes show before anything is trained
        controller_of(tried[0].settings, layout, period, called).act(validation.reset(seed=VALIDATION_SEED)[0])
    return tried[0]


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
