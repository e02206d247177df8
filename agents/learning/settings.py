"""Typed settings of learners; the YAML files in configs/agents hold what differs from the defaults."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from caster_gym.agents.control.protocol import AgentSettings
from caster_gym.agents.learning import usual_names as usual
from caster_gym.configuration import Frozen

if TYPE_CHECKING:
    from caster_gym.agents.learning.training_run import Run

Units: TypeAlias = Annotated[int, Field(gt=0, le=16_384)]
Fraction: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]


class LearnerSettings(AgentSettings):
    """Settings of a learner, whose policy is a network of dense layers, `caster_gym.agents.learning.actor.Actor`."""

    steps: PositiveInt  # control periods of all robots together
    validations: PositiveInt = 10  # how often the policy is tried on validation paths, evenly spread

    @property
    def name(self) -> str:
        """What tables and figures call its policies."""
        return self.algorithm.upper() if self.algorithm.isidentifier() else self.algorithm.partition(":")[2]

    @abstractmethod
    def learn(self, run: "Run") -> None:
        """Train for `steps`, with calls of `run.advance` in between, and of `run.finish` at the end in any case."""


class GradientLearner(LearnerSettings):
    """What our learners have in common."""

    hidden: Annotated[tuple[Units, ...], Field(min_length=1)] = (128, 128)  # units of each layer, ReLU
    discount: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.97  # per control period
    learning_rate: PositiveFloat
    falling: bool = True  # learning rate falls linearly to zero


class OnPolicy(GradientLearner):
    """Proximal policy optimisation (Schulman et al., 2017), whoever computes it."""

    steps: PositiveInt = 2_000_000  # control periods of all robots together
    learning_rate: PositiveFloat = 7e-4
    robots: PositiveInt = 128
    horizon: PositiveInt = 128  # control periods between updates
    batch: Annotated[int, Field(ge=2)] = 2048  # of one step, an advantage could not be normalised
    epochs: PositiveInt = 5
    trace: Fraction = 0.95  # λ of generalised advantage estimation
    clip: PositiveFloat = 0.2
    initial_log_std: Annotated[float, Field(ge=-20.0, le=2.0)] = -0.7  # of exploration, as a share of the action
    entropy: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0  # weight of exploration's entropy in the loss

    @model_validator(mode="after")
    def _batches_fit(self) -> Self:
        if self.batch > self.robots * self.horizon:
            smaller = "make it smaller, or " if self.robots * self.horizon > 1 else ""
            raise ValueError(
                f"'batch' must be at most robots · horizon = {self.robots * self.horizon} steps, got {self.batch}: "
                f"{smaller}take more robots or a longer horizon"
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
        if self.robots * self.horizon % self.batch:
            whole = self.robots * self.horizon
            smaller = next((size for size in range(self.batch, 1, -1) if whole % size == 0), None)
            larger = next(size for size in range(self.batch, whole + 1) if whole % size == 0)
            nearest = f"smaller one that does is {smaller}" if smaller else f"larger one that does is {larger}"
            raise ValueError(
                f"'batch' must divide robots · horizon = {whole} steps, got {self.batch}: the next {nearest}"
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
            raise ValueError(
                f"'critic_batch' must be at most robots · window = {self.robots * self.window} steps, got "
                f"{self.critic_batch}: make it smaller, or take more robots or a longer window"
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
    steps: Annotated[int, Field(ge=2)] = 500_000  # some random, and then some of learning
    learning_rate: PositiveFloat = 1e-3
    robots: PositiveInt = 32
    batch: PositiveInt = 256
    updates: PositiveInt = 4  # gradient steps for each control period of all robots
    buffer: PositiveInt = 500_000  # transitions
    first_random: PositiveInt = 10_000  # steps before learning starts
    soft_update: Fraction = 0.005
    entropy: Annotated[float, Field(gt=0.0, le=100.0)] = 0.05  # coefficient to begin with; it is adapted
    target_entropy: Annotated[
        float, Field(ge=-20.0, le=0.6931)
    ] = -2.0  # [nat] for each driven motor; exploration shrinks until it is reached

    @model_validator(mode="after")
    def _learning_begins(self) -> Self:
        if self.first_random >= self.steps:
            raise ValueError(
                f"'first_random' must be below the steps in all, {self.steps}, got {self.first_random}: nothing would "
                "be learned"
            )
        return self

    def learn(self, run: "Run") -> None:
        """Train by Stable-Baselines3."""
        from caster_gym.agents.learning.sb3_learning import learn_with_sb3

        learn_with_sb3(run, self)
