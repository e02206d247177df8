"""Typed settings of agents; the YAML files in configs/agents hold what differs from the defaults."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from caster_gym.agents import usual_names as usual
from caster_gym.agents.control.computed_torque import KnownModel
from caster_gym.configuration import ConfigurationError, Frozen, parse, read_yaml
from caster_gym.paths.naming import unknown_name
from caster_gym.shipped_files import find

Units: TypeAlias = Annotated[int, Field(gt=0, le=16_384)]
Fraction: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]


class Learner(Frozen):
    """What PPO and SAC have in common."""

    hidden: Annotated[tuple[Units, ...], Field(min_length=1)] = (128, 128)  # units of each layer, ReLU
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


class SHACSettings(Learner, OnTensors):
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


class SACSettings(Learner):
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


class ComputedTorqueSettings(Frozen):
    """Model-based control; its natural frequency is the one of those listed that does best on validation paths."""

    usual_names: ClassVar[Mapping[str, str]] = usual.COMPUTED_TORQUE
    algorithm: Literal["computed torque"]
    known: KnownModel = "exact"
    natural_frequencies: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (5.0, 10.0, 15.0, 20.0, 30.0)


LearnedSettings: TypeAlias = PPOSettings | SACSettings | RslPPOSettings | SHACSettings
AgentSettings: TypeAlias = LearnedSettings | ComputedTorqueSettings


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
    return parse(kinds[algorithm], content, f"{path}, as changed" if changes else str(path), path.parent)
