"""Settings of a search, and the tasks and agents that it tries."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field, NonNegativeInt, PositiveInt, field_validator

from caster_gym.agents.comparison.task_settings import Seed, Seeds, TaskSettings
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.registry import read_agent
from caster_gym.agents.sweep.space import Dimension, with_settings
from caster_gym.configuration import ConfigurationError, Frozen, parse, read_yaml
from caster_gym.file_names import NameOrFile
from caster_gym.shipped_files import find

OWNERS = ("agent", "task")  # what keys of the space begin with


class Pruning(Frozen):
    """Trainings that are worse than completed ones were after as many validations end there."""

    percentile: Annotated[float, Field(gt=0.0, le=100.0)] = 50.0  # [%] goes on: who is among so many best ones
    trials: PositiveInt = 5  # completed ones to compare with; before, all go on
    validations: NonNegativeInt = 2  # after so many first ones all go on


class SweepSettings(Frozen):
    """What is searched, and how. Results follow from these settings alone, not from the number of cores."""

    usual_names: ClassVar[Mapping[str, str]] = {
        "n_trials": "trials",
        "parameters": "space",
        "search_space": "space",
        "study_name": "study",
        "pruner": "pruning",
        "n_jobs": "as many trials run at a time as the cores allow, and at most 'at_once'",
        "timeout": "a search may be stopped at any time, and goes on by --resume",
        "threads": "the number of threads is given by --threads",
    }

    task: NameOrFile = "track"  # name of a file in configs/tasks, or path of one
    agent: NameOrFile = "ppo"  # name of a file in configs/agents, or path of one; it must learn
    fixed: dict[str, Any] = Field(default_factory=dict)  # of all trials, beyond those files; by keys as in the space
    space: Annotated[dict[str, Dimension], Field(min_length=1)]  # by keys such as agent.gamma or task.task.preview
    trials: PositiveInt = 20
    seeds: Seeds = (0,)  # of the trainings of each trial
    score: Literal["mean", "worst"] = "mean"  # of a trial, over its seeds
    sampler: Literal["tpe", "random"] = "tpe"
    seed: Seed = 0  # of the sampler
    at_once: PositiveInt = 8  # trial n is chosen when trial n − at_once has ended, and knows of no later one
    pruning: Pruning | None = Pruning()
    storage: str = "sqlite"  # a file study.db in the folder; journal: study.log there; or a database's URL
    study: str = "sweep"  # name in that database

    @field_validator("space", "fixed")
    @classmethod
    def _keys_say_whose_settings(cls, keys: dict[str, Any]) -> dict[str, Any]:
        for key in keys:
            owner, dot, name = key.partition(".")
            if owner not in OWNERS or not dot or not all(name.split(".")):
                raise ValueError(f"keys name fields of 'agent' or 'task', as agent.learning_rate, got {key!r}")
        return keys

    @field_validator("storage")
    @classmethod
    def _storage_is_known(cls, storage: str) -> str:
        if storage not in ("sqlite", "journal") and "://" not in storage:
            raise ValueError(
                f"should be sqlite, journal, or the URL of a database, as postgresql://user@host/name, got {storage!r}"
            )
        return storage


class Candidate(NamedTuple):
    """What a trial trains."""

    task: TaskSettings
    agent: LearnerSettings


class Sweep(NamedTuple):
    """Checked settings of a search, and the content of the files that it begins with."""

    settings: SweepSettings
    changes: Mapping[str, Any]  # of --set, to fields of the agent

    def candidate(self, point: Mapping[str, Any]) -> Candidate:
        """Task and agent with the settings of a point of the space, by its keys. Raises ConfigurationError."""
        chosen = {**self.settings.fixed, **point}
        of = {
            owner: {key.partition(".")[2]: value for key, value in chosen.items() if key.startswith(f"{owner}.")}
            for owner in OWNERS
        }
        path = find("tasks", self.settings.task)
        task = parse(TaskSettings, with_settings(read_yaml(path), of["task"]), str(path), path.parent)
        begun = {**read_yaml(find("agents", self.settings.agent)), **self.changes}
        agent = read_agent(self.settings.agent, with_settings(begun, of["agent"]))
        if not isinstance(agent, LearnerSettings):
            raise ConfigurationError(f"agent {self.settings.agent!r} does not learn, so that no search can train it")
        return Candidate(task, agent)


def read_sweep(settings: SweepSettings, changes: Mapping[str, Any] | None = None) -> Sweep:
    """A search whose files are there and whose every dimension has a value that fits.

    changes: fields to set of the agent, as {"n_timesteps": 1000}. Raises ConfigurationError.
    """
    sweep = Sweep(settings, changes or {})
    sweep.candidate({})
    for key, dimension in settings.space.items():
        problems = []
        for value in dimension.examples:
            try:
                sweep.candidate({key: value})
            except ConfigurationError as error:
                problems.append(error)
        if len(problems) == len(dimension.examples):
            raise ConfigurationError(f"{key!r} of the space: {problems[0]}") from problems[0]
    return sweep


def run_folders(settings: SweepSettings, folder: Path, number: int) -> list[Path]:
    """The folders of the trainings of a trial, one for each seed."""
    trials = folder.absolute() / "trials"
    if len(settings.seeds) == 1:
        return [trials / f"{number:04d}"]
    return [trials / f"{number:04d}-{seed}" for seed in settings.seeds]
