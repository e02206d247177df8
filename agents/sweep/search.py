"""Choosing points of a space by Optuna, and the study in which it keeps them.

What is chosen for trial n follows from the settings and from the trials up to n − at_once alone: neither the number of
workers, nor how long each trial takes, nor a stop in between changes it. The sampler begins anew for each trial, with a
seed of its own; one that went on would repeat its first points after a stop.
"""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, RandomSampler, TPESampler
from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.study import Study
from optuna.trial import FrozenTrial, TrialState

from caster_gym.agents.sweep.outcome import Outcome
from caster_gym.agents.sweep.settings import SweepSettings
from caster_gym.configuration import ConfigurationError

OUTCOME = "outcome"  # attribute of a trial in a study
STORAGE_FILES = ("study.db", "study.db-journal", "study.log", "study.log.lock", "study.log.lock.rename")


class Search:
    """The trials of a study: their points of the space, by the keys of that, and their outcomes."""

    def __init__(self, settings: SweepSettings, folder: Path, resume: bool) -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self.settings = settings
        self.study = _open_study(settings, folder, resume)
        self.points: list[dict[str, Any]] = []
        self.outcomes: dict[int, Outcome] = {}
        for trial in self.study.get_trials(deepcopy=False):
            self.points.append(dict(trial.params))
            if trial.state.is_finished():
                self.outcomes[trial.number] = Outcome(**trial.user_attrs[OUTCOME])
        self._distributions = {key: one.distribution for key, one in settings.space.items()}

    def may_choose(self) -> bool:
        """Whether there is a next trial, and all that it depends on have ended."""
        number = len(self.points)
        return number < self.settings.trials and all(one in self.outcomes for one in self._known(number))

    def choose(self) -> int:
        """Choose the next point, and return the number of its trial."""
        number = len(self.points)
        known = self._known(number)
        past = optuna.create_study(sampler=self._sampler(number), direction="maximize")
        for i, point in enumerate(self.points):
            past.add_trial(_frozen(point, self._distributions, self.outcomes[i] if i in known else None, self.settings))
        point = past.ask(self._distributions).params
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            self.study.add_trial(_frozen(point, self._distributions, None, self.settings))
        self.points.append(point)
        return number

    def known(self, number: int) -> list[Outcome]:
        """Outcomes of the trials on which this one depends."""
        return [self.outcomes[one] for one in self._known(number)]

    def settings_of(self, number: int) -> dict[str, Any]:
        """The settings that a trial's point means."""
        return {key: one.value(self.points[number][key]) for key, one in self.settings.space.items()}

    def tell(self, number: int, outcome: Outcome) -> None:
        """Keep what became of a trial."""
        trial = next(one for one in self.study.get_trials(deepcopy=False) if one.number == number)
        full = _frozen(self.points[number], self._distributions, outcome, self.settings)
        storage = self.study._storage
        for step, score in full.intermediate_values.items():
            storage.set_trial_intermediate_value(trial._trial_id, step, score)
        storage.set_trial_user_attr(trial._trial_id, OUTCOME, outcome._asdict())
        storage.set_trial_state_values(trial._trial_id, full.state, full.values)
        self.outcomes[number] = outcome

    def _known(self, number: int) -> range:
        return range(max(0, number - self.settings.at_once + 1))

    def _sampler(self, number: int) -> BaseSampler:
        seed = int(np.random.SeedSequence([self.settings.seed, number]).generate_state(1)[0])
        if self.settings.sampler == "random":
            return RandomSampler(seed=seed)
        return TPESampler(seed=seed)  # multivariate; it takes running trials for bad ones


def _frozen(
    point: Mapping[str, Any],
    distributions: Mapping[str, BaseDistribution],
    outcome: Outcome | None,
    settings: SweepSettings,
) -> FrozenTrial:
    """A trial as Optuna keeps it, running without an outcome. One that failed counts as the worst of those pruned."""
    values: dict[int, float] = {}
    if outcome is not None:
        scores = [score for one in outcome.scores for score in one]
        values = {i + 1: score for i, score in enumerate(scores)}
    completed = outcome is not None and outcome.kind == "completed"
    return optuna.trial.create_trial(
        state=TrialState.COMPLETE if completed else TrialState.RUNNING if outcome is None else TrialState.PRUNED,
        value=outcome.score(settings.score) if outcome is not None and completed else None,
        params=dict(point),
        distributions=dict(distributions),
        intermediate_values=values,
    )


def _open_study(settings: SweepSettings, folder: Path, resume: bool) -> Study:
    try:
        study = optuna.create_study(
            storage=_storage(settings, folder), study_name=settings.study, direction="maximize", load_if_exists=True
        )
    except ModuleNotFoundError as error:
        raise ConfigurationError(f"storage {settings.storage!r} needs the Python package {error.name!r}") from error
    except Exception as error:  # of a database: whatever its driver raises
        raise ConfigurationError(f"storage {settings.storage!r} cannot be used: {error}") from error
    if study.get_trials(deepcopy=False) and not resume:
        raise ConfigurationError(
            f"the study {settings.study!r} is in {settings.storage} already; go on with it in its folder by --resume, "
            "or choose another name as 'study'"
        )
    return study


def _storage(settings: SweepSettings, folder: Path) -> BaseStorage:
    if settings.storage == "journal":
        log = str(folder / "study.log")
        return JournalStorage(JournalFileBackend(log, lock_obj=JournalFileOpenLock(log)))
    url = f"sqlite:///{(folder / 'study.db').absolute()}" if settings.storage == "sqlite" else settings.storage
    return RDBStorage(url)
