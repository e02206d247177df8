"""Typed settings of learners, under the names that Stable-Baselines3 and rl_zoo3 give them.

The YAML files in configs/agents hold what differs from the defaults.
"""

from abc import abstractmethod
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, PositiveInt, field_validator, model_validator

from caster_gym.agents.control.protocol import AgentSettings
from caster_gym.agents.learning import usual_names as usual
from caster_gym.configuration import Frozen, Positive

if TYPE_CHECKING:
    from caster_gym.agents.learning.training_run import Run

MOST_LAYERS = 30
MOST_WEIGHTS = 30_000_000  # between hidden layers, so that those of all layers fit into `WEIGHTS_BYTES`

Units: TypeAlias = Annotated[int, Field(gt=0, le=16_384)]
Fraction: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]


class LinearSchedule(Frozen):
    """A number that goes linearly from its start to its end while a policy is trained."""

    start: Positive
    end: NonNegativeFloat = 0.0

    def at(self, remaining: float) -> float:
        """The number when this share of the training remains, 1 … 0; beyond the end as at the end."""
        return self.end + (self.start - self.end) * max(remaining, 0.0)


Schedule: TypeAlias = Positive | LinearSchedule


def scheduled(value: Schedule, remaining: float) -> float:
    """A constant or scheduled number when this share of the training remains, 1 … 0."""
    return value.at(remaining) if isinstance(value, LinearSchedule) else value


class LearnerSettings(AgentSettings):
    """Settings of a learner, whose policy is a network of dense layers, `caster_gym.agents.learning.actor.Actor`."""

    n_timesteps: PositiveInt  # control periods of all robots together
    validations: PositiveInt = 10  # how often the policy is tried on validation paths, evenly spread
    save_every: NonNegativeFloat = 15.0  # [s] between two states from which a killed training can go on

    @property
    def name(self) -> str:
        """What tables and figures call its policies."""
        return self.algorithm.upper() if self.algorithm.isidentifier() else self.algorithm.partition(":")[2]

    @abstractmethod
    def learn(self, run: "Run") -> None:
        """Train for `n_timesteps`; call `run.advance` in between, and `run.finish` at the end in any case.

        A learner that goes on where a killed process stopped begins from `run.saved`, if that is not None, and offers
        its state to `run.save` now and then; one that does not begins anew.
        """


class GradientLearner(LearnerSettings):
    """What our learners have in common."""

    net_arch: Annotated[tuple[Units, ...], Field(min_length=1, max_length=MOST_LAYERS)] = (
        128,
        128,
    )  # units of each layer, ReLU
    gamma: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.97  # discount per control period
    learning_rate: Schedule  # a number, or {start: …, end: …}

    @field_validator("net_arch")
    @classmethod
    def _policy_can_be_read(cls, net_arch: tuple[int, ...]) -> tuple[int, ...]:
        count = sum(before * after for before, after in pairwise(net_arch))
        if count > MOST_WEIGHTS:
            raise ValueError(f"has {count} weights between its layers, at most {MOST_WEIGHTS} are read from a policy")
        return net_arch


class OnPolicy(GradientLearner):
    """Proximal policy optimisation (Schulman et al., 2017), whoever computes it."""

    n_timesteps: PositiveInt = 2_000_000
    learning_rate: Schedule = LinearSchedule(start=7e-4)
    n_envs: PositiveInt = 128  # robots
    n_steps: PositiveInt = 128  # control periods of each robot between updates
    batch_size: Annotated[int, Field(ge=2)] = 2048  # of one step, an advantage could not be normalised
    n_epochs: PositiveInt = 5
    gae_lambda: Fraction = 0.95
    clip_range: Positive = 0.2
    log_std_init: Annotated[float, Field(ge=-20.0, le=2.0)] = -0.7  # of exploration, as a share of the action
    ent_coef: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0

    @model_validator(mode="after")
    def _batches_fit(self) -> Self:
        if self.batch_size > self.n_envs * self.n_steps:
            smaller = "make it smaller, or " if self.n_envs * self.n_steps > 1 else ""
            raise ValueError(
                f"'batch_size' must be at most n_envs · n_steps = {self.n_envs * self.n_steps} steps, got "
                f"{self.batch_size}: {smaller}take a greater n_envs or n_steps"
            )
        return self


class PPOSettings(OnPolicy):
    """Proximal policy optimisation by Stable-Baselines3, on NumPy arrays."""

    usual_names: ClassVar[Mapping[str, str]] = usual.PPO
    algorithm: Literal["ppo"]

    def learn(self, run: "Run") -> None:
        """Train by Stable-Baselines3."""
        from caster_gym.agents.learning.sb3_learning import learn_with_sb3

        learn_with_sb3(run, self)


class OnTensors(Frozen):
    """Where robots and learner live together, when observations and rewards stay Torch tensors."""

    device: str = "cpu"  # or cuda, cuda:1, …
    compile: bool = False  # fuse the robots' step into few kernels; its first call then takes minutes


class RslPPOSettings(OnPolicy, OnTensors):
    """Proximal policy optimisation by rsl-rl-lib, on tensors."""

    usual_names: ClassVar[Mapping[str, str]] = usual.RSL_PPO
    algorithm: Literal["rsl_ppo"]

    @model_validator(mode="after")
    def _batches_are_whole(self) -> Self:
        if self.n_envs * self.n_steps % self.batch_size:
            whole = self.n_envs * self.n_steps
            smaller = next((size for size in range(self.batch_size, 1, -1) if whole % size == 0), None)
            larger = next(size for size in range(self.batch_size, whole + 1) if whole % size == 0)
            nearest = f"smaller one that does is {smaller}" if smaller else f"larger one that does is {larger}"
            raise ValueError(
                f"'batch_size' must divide n_envs · n_steps = {whole} steps, got {self.batch_size}: the next {nearest}"
            )
        return self

    def learn(self, run: "Run") -> None:
        """Train by rsl-rl-lib."""
        from caster_gym.agents.learning.rsl_rl import learn_with_rsl_rl

        learn_with_rsl_rl(run, self)


class SHACSettings(GradientLearner, OnTensors):
    """Short-horizon actor-critic (Xu et al., 2022): the policy's gradient passes through the simulator itself."""

    usual_names: ClassVar[Mapping[str, str]] = usual.SHAC
    algorithm: Literal["shac"]
    compile: bool = True  # fuse the robots' step into few kernels, for which Torch needs a C++ compiler
    substeps: PositiveInt | None = None  # RK4 steps of a period while learning; None: as few as the casters allow
    n_timesteps: PositiveInt = 800_000
    learning_rate: Schedule = LinearSchedule(start=1.2e-2)
    critic_learning_rate: Schedule = LinearSchedule(start=5e-3)
    n_envs: PositiveInt = 64  # robots
    n_steps: PositiveInt = 16  # control periods of the window through which a gradient passes
    restarts: Annotated[float, Field(ge=0.0, le=1.0)] = 0.05  # share of the robots that start anew before a window
    batch_size: PositiveInt = 256  # of the critic
    n_epochs: PositiveInt = 4  # of the critic
    gae_lambda: Fraction = 0.95  # λ of the critic's targets, TD(λ)
    tau: Fraction = 0.8  # share of the critic that its target takes over after every window
    max_grad_norm: Positive = 1.0  # a longer gradient of the policy is shortened to that norm
    noise: NonNegativeFloat = 0.0  # standard deviation of what exploration adds to actions

    @model_validator(mode="after")
    def _batches_fit(self) -> Self:
        if self.batch_size > self.n_envs * self.n_steps:
            raise ValueError(
                f"'batch_size' must be at most n_envs · n_steps = {self.n_envs * self.n_steps} steps, got "
                f"{self.batch_size}: make it smaller, or take a greater n_envs or n_steps"
            )
        return self

    def learn(self, run: "Run") -> None:
        """Train through the simulator."""
        from caster_gym.agents.learning.shac import learn_through_simulator

        learn_through_simulator(run, self)


class SACSettings(GradientLearner):
    """Soft actor-critic (Haarnoja et al., 2018), by Stable-Baselines3."""

    usual_names: ClassVar[Mapping[str, str]] = usual.SAC
    algorithm: Literal["sac"]
    n_timesteps: Annotated[int, Field(ge=2)] = 500_000  # some random, and then some of learning
    learning_rate: Schedule = LinearSchedule(start=1e-3)
    n_envs: PositiveInt = 32  # robots
    batch_size: PositiveInt = 256
    train_freq: PositiveInt = 1  # control periods of all robots between updates
    gradient_steps: PositiveInt = 4  # of each update
    buffer_size: PositiveInt = 500_000  # transitions
    learning_starts: PositiveInt = 10_000  # steps before learning starts
    tau: Fraction = 0.005
    ent_coef: Annotated[float, Field(gt=0.0, le=100.0)] | str = "auto_0.05"  # fixed, or adapted from auto_… on
    target_entropy_per_motor: Annotated[float, Field(ge=-20.0, le=0.6931)] = -2.0  # [nat] exploration shrinks to it

    @field_validator("ent_coef")
    @classmethod
    def _coefficient_is_adapted_or_fixed(cls, coefficient: float | str) -> float | str:
        if isinstance(coefficient, str):
            word, _, start = coefficient.partition("_")
            try:
                possible = word == "auto" and 0.0 < float(start or 1.0) <= 100.0
            except ValueError:
                possible = False
            if not possible:
                raise ValueError(
                    f"must be a number, or begin with one up to 100 and be adapted, as auto_0.05, got {coefficient!r}"
                )
        return coefficient

    @model_validator(mode="after")
    def _learning_begins(self) -> Self:
        if self.learning_starts >= self.n_timesteps:
            raise ValueError(
                f"'learning_starts' must be below n_timesteps, {self.n_timesteps}, got {self.learning_starts}: nothing "
                "would be learned"
            )
        return self

    def learn(self, run: "Run") -> None:
        """Train by Stable-Baselines3."""
        from caster_gym.agents.learning.sb3_learning import learn_with_sb3

        learn_with_sb3(run, self)
