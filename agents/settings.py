"""Typed settings of tasks, agents and comparisons; the YAML files in configs/ hold what differs from the defaults."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)

from caster_gym.arena.arena import Arena, read_arena
from caster_gym.configuration import ConfigurationError, Frozen, is_yaml, parse, read_yaml
from caster_gym.envs.follow_task import FollowTask
from caster_gym.envs.task import Task
from caster_gym.envs.track_task import TrackTask
from caster_gym.paths.naming import unknown_name
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.specification import PathSpecification
from caster_gym.robot import Robot, load_robot
from caster_gym.wrappers.rewards import Effort, Impact, Potential, Smoothness, Tolerance, TractionUse
from caster_gym.wrappers.specification import FeatureSpecification

from .computed_torque import KnownModel

Seed: TypeAlias = Annotated[int, Field(ge=0, lt=2**32)]
Fraction: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]
Paths: TypeAlias = Annotated[tuple[PathSpecification, ...], Field(min_length=1)]
Environment: TypeAlias = Literal["track", "follow"]
RewardSpecification: TypeAlias = Annotated[
    Potential | Tolerance | Effort | Smoothness | TractionUse | Impact, Field(discriminator="kind")
]

TASKS: dict[str, type[TrackTask | FollowTask]] = {"track": TrackTask, "follow": FollowTask}


class ChosenTask(Frozen):
    """One of the environments, with the parameters of its task."""

    environment: Environment = "track"  # CasterTrack-v0 or CasterFollow-v0
    task: TrackTask | FollowTask = Field(default={}, validate_default=True)

    @field_validator("task", mode="before")
    @classmethod
    def _of_its_environment(cls, task: Any, info: ValidationInfo) -> Any:
        environment = info.data.get("environment", "track")
        kind = TASKS[environment]
        if isinstance(task, Mapping):
            for other, model in TASKS.items():
                if misplaced := sorted(task.keys() & (model.model_fields.keys() - kind.model_fields.keys())):
                    raise ValueError(
                        f"{misplaced[0]!r} is for environment {other!r}, got it with environment {environment!r}"
                    )
            return kind.model_validate(task)
        if isinstance(task, Task) and not isinstance(task, kind):
            raise ValueError(f"must be a {kind.__name__} in environment {environment!r}, got a {type(task).__name__}")
        return task


class TaskSettings(ChosenTask):
    """A robot, its task, and the paths to train, to choose and to test on."""

    robot: Robot | str = "chung2008"  # a mapping as in configs/robots, the name of a file there, or path of one
    actuation: Literal["all"] | tuple[str, ...] | None = None  # None: as the robot file says
    arena: Arena = Arena()  # or the name of a YAML file
    wrappers: tuple[FeatureSpecification, ...] = ()  # features in training and in evaluation alike
    shaping: tuple[RewardSpecification, ...] = ()  # terms that are added to the reward in training alone
    train: Paths
    validation: Paths
    test: Paths

    @field_validator("robot", mode="before")
    @classmethod
    def _robot_may_be_a_mapping(cls, robot: Any) -> Any:
        return load_robot(robot) if isinstance(robot, Mapping) else robot

    @field_validator("arena", mode="before")
    @classmethod
    def _arena_may_be_a_file(cls, arena: Any) -> Any:
        return read_arena(arena) if arena is None or isinstance(arena, str | Path) else arena

    @field_validator("wrappers", "shaping", mode="before")
    @classmethod
    def _features_may_be_names(cls, features: Any) -> Any:
        if not isinstance(features, list | tuple):
            return features
        return [{"kind": feature} if isinstance(feature, str) else feature for feature in features]

    @model_validator(mode="after")
    def _paths_are_held_out(self) -> Self:
        for kind, paths, other, used in (
            ("test", self.test, "training", self.train),
            ("validation", self.validation, "training", self.train),
            ("test", self.test, "validation", self.validation),
        ):
            shared = [path for path in paths if _first_of(path) in map(_first_of, used)]
            if shared:
                raise ValueError(f"a {kind} path must not be among the {other} paths, got {shared[0]!r} in both")
        return self


def _first_of(path: PathSpecification) -> PathSpecification:
    """Random paths of one seed begin alike, however many they are: the first stands for all of them."""
    return path.model_copy(update={"count": 1}) if isinstance(path, RandomPaths) else path


class Learner(Frozen):
    """What PPO and SAC have in common."""

    hidden: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (128, 128)  # units of each layer, ReLU
    discount: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.97  # per control period
    learning_rate: PositiveFloat
    falling: bool = True  # learning rate falls linearly to zero
    validations: PositiveInt = 10  # how often the policy is tried on validation paths, evenly spread


class OnPolicy(Learner):
    """Proximal policy optimisation (Schulman et al., 2017), whoever computes it."""

    steps: PositiveInt = 2_000_000  # control periods of all robots together
    learning_rate: PositiveFloat = 7e-4
    robots: PositiveInt = 128
    horizon: PositiveInt = 128  # control periods between updates
    batch: PositiveInt = 2048
    epochs: PositiveInt = 5
    trace: Fraction = 0.95  # λ of generalised advantage estimation
    clip: PositiveFloat = 0.2
    initial_log_std: float = -0.7
    entropy: Annotated[float, Field(ge=0.0)] = 0.0

    @model_validator(mode="after")
    def _batches_fit(self) -> Self:
        if self.batch > self.robots * self.horizon:
            raise ValueError(
                f"a batch of {self.batch} needs at most robots · horizon = {self.robots * self.horizon} steps"
            )
        return self


class PPOSettings(OnPolicy):
    """Proximal policy optimisation by Stable-Baselines3, on NumPy arrays."""

    algorithm: Literal["ppo"]


class OnTensors(Frozen):
    """Where robots and learner live together, when observations and rewards stay Torch tensors."""

    device: str = "cpu"  # or cuda, cuda:1, …
    compile: bool = False  # fuse the robots' step into few kernels; its first call then takes minutes


class RslPPOSettings(OnPolicy, OnTensors):
    """Proximal policy optimisation by rsl-rl-lib, on tensors."""

    algorithm: Literal["rsl_ppo"]

    @model_validator(mode="after")
    def _batches_are_whole(self) -> Self:
        if self.robots * self.horizon % self.batch:
            raise ValueError(
                f"robots · horizon = {self.robots * self.horizon} steps must be a multiple of the batch of {self.batch}"
            )
        return self


class SHACSettings(Learner, OnTensors):
    """Short-horizon actor-critic (Xu et al., 2022): the policy's gradient passes through the simulator itself."""

    algorithm: Literal["shac"]
    compile: bool = True  # fuse the robots' step into few kernels, for which Torch needs a C++ compiler
    substeps: PositiveInt | None = None  # RK4 steps of a period while learning; None: as few as the casters allow
    steps: PositiveInt = 800_000  # control periods of all robots together
    learning_rate: PositiveFloat = 1.2e-2
    critic_learning_rate: PositiveFloat = 5e-3
    robots: PositiveInt = 64
    window: PositiveInt = 16  # control periods through which a gradient passes
    restarts: Annotated[float, Field(ge=0.0, le=1.0)] = 0.05  # share of the robots that start anew before a window
    critic_batch: PositiveInt = 256
    critic_epochs: PositiveInt = 4
    trace: Fraction = 0.95  # λ of the critic's targets
    soft_update: Fraction = 0.8  # share of the critic that its target takes over after every window
    greatest_gradient: PositiveFloat = 1.0  # a longer gradient of the policy is shortened to that norm
    noise: NonNegativeFloat = 0.0  # standard deviation of what exploration adds to actions

    @model_validator(mode="after")
    def _batches_fit(self) -> Self:
        if self.critic_batch > self.robots * self.window:
            most = self.robots * self.window
            raise ValueError(f"a critic_batch of {self.critic_batch} needs at most robots · window = {most} steps")
        return self


class SACSettings(Learner):
    """Soft actor-critic (Haarnoja et al., 2018), by Stable-Baselines3."""

    algorithm: Literal["sac"]
    steps: PositiveInt = 500_000
    learning_rate: PositiveFloat = 1e-3
    robots: PositiveInt = 32
    batch: PositiveInt = 256
    updates: PositiveInt = 4  # gradient steps for each control period of all robots
    buffer: PositiveInt = 500_000  # transitions
    first_random: PositiveInt = 10_000  # steps before learning starts
    soft_update: Fraction = 0.005
    entropy: PositiveFloat = 0.05  # coefficient to begin with; it is adapted
    target_entropy: float = -2.0  # [nat] for each driven motor; exploration shrinks until it is reached


class ComputedTorqueSettings(Frozen):
    """Model-based control; its natural frequency is the one of those listed that does best on validation paths."""

    algorithm: Literal["computed torque"]
    known: KnownModel = "exact"
    natural_frequencies: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (5.0, 10.0, 15.0, 20.0, 30.0)


LearnedSettings: TypeAlias = PPOSettings | SACSettings | RslPPOSettings | SHACSettings
AgentSettings: TypeAlias = LearnedSettings | ComputedTorqueSettings


class BenchmarkSettings(Frozen):
    """Which agents are compared, and how."""

    task: str = "track"  # name of a file in configs/tasks, or path of one
    agents: Annotated[tuple[str, ...], Field(min_length=1)]  # names of files in configs/agents, or paths
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)] = (0, 1, 2, 3, 4)  # of each learned agent
    starts: PositiveInt = 1  # episodes on each test path, with different starts
    start_seed: Seed = 1000  # the same starts for every agent
    settling: PositiveFloat | None = None  # [s] what comes before counts as transient; None: as suits the task
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95

    @field_validator("seeds")
    @classmethod
    def _seeds_differ(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"must differ from one another, got {list(seeds)}")
        return seeds


Settings = TypeVar("Settings", bound=BaseModel)


def find(kind: str, name: str | Path) -> Path:
    """The file of a task, agent or benchmark: one that comes with the package, by its name, or a path."""
    path = Path(name).expanduser()
    if is_yaml(path):
        return path
    folder = Path(str(files("caster_gym.configs"))) / kind
    path = folder / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in folder.glob("*.yaml")))
        raise ConfigurationError(f"there is no {name!r} in {kind}; known are {known}, or give the path of a YAML file")
    return path


def read_settings(model: type[Settings], kind: str, name: str | Path) -> Settings:
    """Checked settings from a file that `find` finds."""
    path = find(kind, name)
    return parse(model, read_yaml(path), str(path))


def read_agent(name: str | Path, changes: Mapping[str, Any] | None = None) -> AgentSettings:
    """Checked settings of an agent, with some fields changed."""
    path = find("agents", name)
    content = {**read_yaml(path), **(changes or {})}
    kinds: dict[str, type[AgentSettings]] = {
        "ppo": PPOSettings,
        "sac": SACSettings,
        "rsl_ppo": RslPPOSettings,
        "shac": SHACSettings,
        "computed torque": ComputedTorqueSettings,
    }
    algorithm = content.get("algorithm")
    if algorithm not in kinds:
        raise ConfigurationError(f"{path}: {unknown_name('algorithm', algorithm, kinds)}")
    return parse(kinds[algorithm], content, str(path))
