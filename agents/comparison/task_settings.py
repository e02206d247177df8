"""Typed settings of tasks; the YAML files in configs/tasks hold what differs from the defaults."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import (
    AfterValidator,
    Field,
    SerializeAsAny,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from caster_gym.arena.arena import Arena, read_arena
from caster_gym.configuration import Frozen
from caster_gym.file_names import FOLDER, NameOrFile, beside_its_file, is_file_name, with_files_beside
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.specification import PathSpecification
from caster_gym.robot import Robot, load_robot
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.registry import KNOWN, TASKS, all_tasks, find_task
from caster_gym.wrappers.feature import Feature
from caster_gym.wrappers.rewards import Effort, Impact, Potential, Smoothness, Tolerance, TractionUse
from caster_gym.wrappers.specification import FeatureSpecification

MOST_PATHS = 200  # of each kind

Seed: TypeAlias = Annotated[int, Field(ge=0, lt=2**32)]


def _differ(seeds: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"must differ from one another, got {list(seeds)}")
    return seeds


Seeds: TypeAlias = Annotated[tuple[Seed, ...], Field(min_length=1), AfterValidator(_differ)]  # of several trainings
Fraction: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]
Paths: TypeAlias = Annotated[tuple[PathSpecification, ...], Field(min_length=1, max_length=MOST_PATHS)]
RewardSpecification: TypeAlias = Annotated[
    Potential | Tolerance | Effort | Smoothness | TractionUse | Impact, Field(discriminator="kind")
]

SHOWN = 4  # of the items of a list in a message


def _usual_names(parameters: set[str]) -> dict[str, str]:
    """Answers to keys beside `task` that belong into it, or that stand elsewhere; parameters: those of all tasks."""
    inside = {name: f"write it inside of 'task', as task: {{{name}: …}}" for name in parameters}
    usual = {
        name: f"write it inside of 'task', as task: {{{here}: …}}"
        for name, here in TaskParameters.usual_names.items()
        if here in parameters
    }
    return {
        **inside,
        **usual,
        **dict.fromkeys(("parameters", "params", "task_parameters", "fields"), "task"),
        "env": "environment",
        "env_id": "environment",
        "path": "the paths are those of 'train', 'validation' and 'test'",
        "paths": "the paths are those of 'train', 'validation' and 'test'",
        "max_episode_steps": TaskParameters.usual_names["max_episode_steps"],
        "seed": "random paths have a 'seed' of their own, and training runs are given one by --seed",
        "n_envs": "the number of robots is set by 'n_envs' of an agent",
        "num_envs": "the number of robots is set by 'n_envs' of an agent",
        "obstacles": "obstacles stand in 'arena'",
        "rewards": "shaping",
        "eval": "validation",
        "evaluation": "test",
    }


class ChosenTask(Frozen):
    """One of the environments, with the parameters of its task."""

    environment: str = "track"  # a task by its name, or module:Name of one's own
    task: SerializeAsAny[TaskParameters] = Field(default={}, validate_default=True)

    @field_validator("environment")
    @classmethod
    def _is_a_task(cls, environment: str, info: ValidationInfo) -> str:
        if environment not in TASKS and ":" not in environment:
            raise PydanticCustomError("misread", "should be {kind}", {"kind": KNOWN})
        find_task(environment, (info.context or {}).get(FOLDER))
        return environment

    @field_validator("task", mode="before")
    @classmethod
    def _of_its_environment(cls, task: Any, info: ValidationInfo) -> Any:
        environment = info.data.get("environment", "track")
        kind = find_task(environment).parameters
        if isinstance(task, Mapping):
            for other in all_tasks():
                known = other.parameters.model_fields.keys() - kind.model_fields.keys()
                if misplaced := sorted(task.keys() & known):
                    raise ValueError(
                        f"{misplaced[0]!r} is for environment {other.name!r}, got it with environment {environment!r}"
                    )
            if unknown := [key for key in task if key not in kind.model_fields]:  # refused for this kind of task alone
                problems = [
                    InitErrorDetails(type="extra_forbidden", loc=(kind.__name__, str(key)), input=task[key])
                    for key in unknown
                ]
                raise ValidationError.from_exception_data(kind.__name__, problems)
            return kind.model_validate(task)
        if isinstance(task, TaskParameters) and not isinstance(task, kind):
            raise ValueError(f"must be a {kind.__name__} in environment {environment!r}, got a {type(task).__name__}")
        return task


class TaskSettings(ChosenTask):
    """A robot, its task, and the paths to train, to choose and to test on."""

    usual_names: ClassVar[Mapping[str, str]] = _usual_names(
        {name for task in all_tasks() for name in task.parameters.model_fields}
    )

    robot: Robot | NameOrFile = "chung2008"  # a mapping as in configs/robots, the name of a file there, or path of one
    actuation: Literal["all"] | tuple[str, ...] | None = None  # None: as the robot file says
    arena: Arena = Arena()  # or the name of a YAML file
    wrappers: tuple[FeatureSpecification, ...] = ()  # features in training and in evaluation alike
    shaping: tuple[RewardSpecification, ...] = ()  # terms that are added to the reward in training alone
    train: Paths
    validation: Paths
    test: Paths

    _files_beside = field_validator("train", "validation", "test", mode="before")(with_files_beside)

    @field_validator("robot", mode="before")
    @classmethod
    def _robot_may_be_a_mapping(cls, robot: Any) -> Any:
        return load_robot(robot) if isinstance(robot, Mapping) else robot

    @field_validator("arena", mode="before")
    @classmethod
    def _arena_may_be_a_file(cls, arena: Any, info: ValidationInfo) -> Any:
        if isinstance(arena, str | Path):
            return read_arena(beside_its_file(arena, info) if is_file_name(str(arena)) else arena)
        return read_arena(arena) if arena is None else arena

    @field_validator("wrappers", "shaping", mode="before")
    @classmethod
    def _features_may_be_names(cls, features: Any) -> Any:
        if not isinstance(features, list | tuple):
            return features
        return [{"kind": feature} if isinstance(feature, str) else feature for feature in features]

    @property
    def described_robot(self) -> Robot:
        """The robot with its driven joints, as its file says, whatever friction the task's floor has."""
        robot = load_robot(self.robot)
        return robot if self.actuation is None else robot.with_actuation(self.actuation)

    @model_validator(mode="after")
    def _paths_are_held_out(self) -> Self:
        for kind, paths, other, used in (
            ("test", self.test, "training", self.train),
            ("validation", self.validation, "training", self.train),
            ("test", self.test, "validation", self.validation),
        ):
            starts = {_first_of(path): k for k, path in reversed(list(enumerate(used, start=1)))}
            for i, path in enumerate(paths, start=1):
                if (k := starts.get(_first_of(path))) is not None:
                    raise ValueError(
                        f"a {kind} path must not be among the {other} paths, got {in_brief(path)} as {kind} path "
                        f"{i} and as {other} path {k}; {_remedy(path)}"
                    )
        return self


def in_brief(one: PathSpecification | Feature) -> str:
    """A path or a feature as one would write it: without what is as always, and without all points of long lists."""
    name = "kind" if isinstance(one, Feature) else "shape"
    content = {name: getattr(one, name), **one.model_dump(mode="json", exclude_defaults=True)}
    if isinstance(one, RandomPaths):
        content = {"shape": one.shape, "seed": one.seed}
    told = (
        f"{key}: {f'{len(it)} points' if isinstance(it, list) and len(it) > SHOWN else it}"
        for key, it in content.items()
    )
    return f"{{{', '.join(told)}}}"


def _remedy(path: PathSpecification) -> str:
    return "give one of them another seed" if isinstance(path, RandomPaths) else "change one of them, or leave it out"


def _first_of(path: PathSpecification) -> PathSpecification:
    """Random paths of one seed begin alike, however many they are: the first stands for all of them."""
    return path.model_copy(update={"count": 1}) if isinstance(path, RandomPaths) else path
