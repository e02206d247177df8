"""Chooses the settings of model-based controllers on validation paths, and tells what that cost."""

import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from caster_gym.agents.comparison.evaluation import Batch, bare, roll_out
from caster_gym.agents.comparison.task_settings import in_brief
from caster_gym.agents.comparison.validation import VALIDATION_SEED
from caster_gym.agents.control.own_controller import candidates_of, controller_of
from caster_gym.agents.control.protocol import Agent, ControllerSettings
from caster_gym.configuration import ConfigurationError
from caster_gym.control.episodes import reset_of
from caster_gym.own_errors import OwnCodeError
from caster_gym.report.tables import write_csv
from caster_gym.tasks.measuring import costs

TUNING = "tuning.csv"
Search: TypeAlias = Generator[Sequence[ControllerSettings], Any, None]  # takes the best settings so far


class Tried(NamedTuple):
    """Settings that were tried on validation paths."""

    controller: Agent
    settings: ControllerSettings
    verdict: Any  # of the task's metrics
    torque_variation: float  # [1/s] mean over episodes
    periods: int  # control periods that were simulated

    @property
    def merit(self) -> tuple[float, ...]:
        """What makes settings better than others: the verdict's merit alone."""
        merit: tuple[float, ...] = self.verdict.merit
        return merit


class Tuned(NamedTuple):
    """A controller with the settings that did best on validation paths, and all that were tried there."""

    controller: Agent
    settings: ControllerSettings
    tried: tuple[Tried, ...] = ()  # none if there was nothing to choose

    @property
    def periods(self) -> int:
        """Control periods that were simulated to find it."""
        return sum(one.periods for one in self.tried)


def tune(settings: ControllerSettings, validation: Batch, called: str | None = None, scenario: str = "") -> Tuned:
    """The controller whose settings, of those that it proposes, do best on validation paths, as policies are chosen.

    called: what messages call the agent, its algorithm if nothing else; scenario: the one to which the paths belong.
    """
    plain = bare(validation)
    features = getattr(validation, "features", ())
    if redefining := [feature for feature in features if feature.redefines_actions]:
        raise ValueError(
            f"{settings.algorithm} gives torques, but the task's actions are those of {in_brief(redefining[0])}: leave "
            "that out of its wrappers"
        )
    layout, period = plain.engine.layout, plain.task.control_period
    called = called or settings.algorithm
    where = f"agent {called!r}" + (f" in scenario {scenario!r}" if scenario else "")
    with _named(where):
        settings = settings.informed(layout, features)

    def made(one: ControllerSettings) -> Agent:
        with _named(where):
            return controller_of(one, layout, period, called)

    search = _candidates_alone(settings, called) if settings.is_own else settings.search()
    known: list[ControllerSettings] = []
    tried: list[Tried] = []
    proposed: Sequence[ControllerSettings] | None = next(search)
    while proposed is not None:
        known += [one for one in proposed if one not in known]
        if len(known) > 1:
            tried += [_try(made(one), one, validation) for one in known[len(tried) :]]
        best = best_of(tried, 0.0).settings if tried else known[0]
        proposed = _next(search, best)
    if tried:
        chosen = best_of(tried, settings.calmness)
        return Tuned(chosen.controller, chosen.settings, tuple(tried))
    controller = made(known[0])
    if settings.is_own:  # another one acts once, so that mistakes show before anything is trained
        other = made(known[0])
        reset_of(other)(np.ones(validation.num_envs, dtype=np.bool_))
        other.act(validation.reset(seed=VALIDATION_SEED)[0])
    return Tuned(controller, known[0])


def best_of(tried: Sequence[Tried], slack: float) -> Tried:
    """What has done best; with slack, the one with the calmest torques of those that are nearly as good.

    slack: share by which the last number of a merit, an error or a reward, may be worse.
    """
    best = max(tried, key=lambda one: one.merit)
    if slack == 0.0:
        return best
    *first, last = best.merit
    near = [one for one in tried if list(one.merit[:-1]) == first and last - one.merit[-1] <= slack * abs(last)]
    return min(near, key=lambda one: one.torque_variation)


def front_of(tried: Sequence[Tried]) -> list[bool]:
    """Which of them no other one surpasses in merit and in calmness of the torques, the Pareto front."""
    return [
        not any(
            other.merit >= one.merit
            and other.torque_variation <= one.torque_variation
            and (other.merit > one.merit or other.torque_variation < one.torque_variation)
            for other in tried
        )
        for one in tried
    ]


def told(tuned: Mapping[str, Tuned], learned: Mapping[str, int] | None = None) -> str:
    """How many control periods tuning and learning took; empty where nothing was tuned.

    learned: control periods of agents that learn, by name, without those of their validations.
    """
    parts = [f"{name} {one.periods:,} ({len(one.tried)} settings)" for name, one in tuned.items() if one.tried]
    if not parts:
        return ""
    parts += [f"{name} {steps:,}" for name, steps in (learned or {}).items()]
    return f"Control periods simulated to tune and to learn: {'; '.join(parts)}. What was tried is in {TUNING}."


def write_tuning(path: Path, tuned: Mapping[str, Tuned]) -> None:
    """All settings that were tried for each agent, in SI units, in the order in which they were."""
    all_tried = [
        (name, one, on_front, one.settings == of.settings)
        for name, of in tuned.items()
        for one, on_front in zip(of.tried, front_of(of.tried), strict=True)
    ]
    names = all_tried[0][1].verdict._fields if all_tried else ()
    rows = (
        (
            name,
            number,
            *map(float, one.verdict),
            one.torque_variation,
            one.periods,
            int(on_front),
            int(chosen),
            _differing(one.settings),
        )
        for number, (name, one, on_front, chosen) in enumerate(all_tried, start=1)
    )
    write_csv(
        path, ("agent", "trial", *names, "torque_variation", "control_periods", "on_front", "chosen", "settings"), rows
    )


def _differing(settings: ControllerSettings) -> str:
    """The settings that are not defaults, as JSON."""
    return json.dumps(settings.model_dump(mode="json", exclude_defaults=True), ensure_ascii=False)


def _try(controller: Agent, settings: ControllerSettings, validation: Batch) -> Tried:
    how = bare(validation).definition.metrics
    episodes = roll_out(controller, validation, VALIDATION_SEED)
    metrics = how.measure(episodes, how.settling)
    variation = float(np.mean(costs(episodes).torque_variation))
    return Tried(controller, settings, how.verdict.of(metrics), variation, int(np.isfinite(episodes.reward).sum()))


def _next(search: Search, best: ControllerSettings) -> Sequence[ControllerSettings] | None:
    try:
        return search.send(best)
    except StopIteration:
        return None


def _candidates_alone(settings: ControllerSettings, called: str) -> Search:
    """The search of a user's own agent."""
    yield candidates_of(settings, called)


@contextmanager
def _named(where: str) -> Iterator[None]:
    """Begin what is wrong with settings by whose they are; errors of a user's own code say that themselves."""
    try:
        yield
    except (OwnCodeError, ConfigurationError):
        raise
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from error
