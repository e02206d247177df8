"""Terms that are added to a task's reward, each by its name. None of them is ever anything but a finite number."""

import math
from collections.abc import Callable
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.arrays import Array, Flags
from caster_gym.configuration import ConfigurationError, Positive
from caster_gym.envs.tracking import kernel
from caster_gym.wrappers.feature import Feature, Place, Quantities, RewardRuntime, Runtime

Shape: TypeAlias = Literal["gaussian", "long_tail", "linear", "quadratic"]

OF_THE_STATE = ("clearance", "conditioning", "heading_error", "position_error", "progress", "progress_share")
"""Quantities that say where the robot is, not what was done: a potential may depend on these."""


class RewardShape(Feature):
    """How good a value of a quantity is: 1 within bounds, falling outside to value_at_margin at a margin from them."""

    quantity: str  # name of a number in info
    bounds: tuple[float | None, float | None] = (0.0, 0.0)  # [unit of the quantity] null: no bound
    margin: NonNegativeFloat = 0.0  # [unit of the quantity] 0: worth nothing outside
    value_at_margin: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1
    shape: Shape = "gaussian"
    weight: float = 1.0  # reward for a value of 1
    name: str | None = None  # of the term; by default that of the kind and the quantity

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        low, high = self.bounds
        if low is not None and high is not None and low > high:
            raise ValueError(f"bounds must rise from the first to the second, got {list(self.bounds)}")
        if self.value_at_margin == 0.0 and self.shape in ("gaussian", "long_tail"):
            raise ValueError(f"a {self.shape} shape never reaches a value_at_margin of 0; 'linear' and 'quadratic' do")
        return self

    def reward(self, quantities: Quantities) -> Array:
        """weight · shape of the quantity."""
        return self.weight * self.falloff(number(quantities, self.quantity))

    def falloff(self, values: Array) -> Array:
        """1 within bounds, less outside, never below 0; 0 for what is not a number."""
        low, high = (-np.inf if self.bounds[0] is None else self.bounds[0]), self.bounds[1]
        outside = np.maximum(np.maximum(low - values, 0.0), 0.0 if high is None else values - high)
        if self.margin == 0.0:
            return np.where(outside == 0.0, 1.0, 0.0)
        shape = falloff(outside / self.margin, self.value_at_margin, self.shape)
        return np.where(np.isnan(values), 0.0, shape)


class Potential(RewardShape):
    """Shaping by a potential Φ = weight · shape of a quantity of the state: γ Φ(s′) − Φ(s), with Φ = 0 after failure.

    It leaves every optimal policy optimal if the discount γ is the learner's (Ng, Harada and Russell, ICML 1999). An
    episode that is cut off by time keeps the potential of its last state.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Potential, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Potential(quantity="position_error", margin=0.5, discount=0.97))
    >>> observation, info = env.reset(seed=0)
    >>> round(float(env.step(env.action_space.high)[-1]["reward_terms"]["potential_position_error"]), 4)
    -0.0278
    """

    kind: Literal["potential"] = "potential"
    discount: Annotated[float, Field(gt=0.0, le=1.0)]  # γ, per control period: that of the learner
    margin: Positive  # [unit of the quantity]
    value_at_margin: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    shape: Shape = "linear"

    @model_validator(mode="after")
    def _depends_on_the_state(self) -> Self:
        if self.quantity not in OF_THE_STATE:
            raise ValueError(
                f"a potential must depend on the state alone, on one of {', '.join(OF_THE_STATE)}, "
                f"got {self.quantity!r}"
            )
        return self

    def runtime(self, place: Place) -> Runtime:
        """The potential of every robot."""
        return _Potential(self, place)


class Tolerance(RewardShape):
    """weight · shape of a quantity after the step.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Tolerance, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Tolerance(quantity="power", bounds=(None, 5.0)))
    >>> observation, info = env.reset(seed=0)
    >>> round(float(env.step(env.action_space.high)[-1]["reward_terms"]["tolerance_power"]), 4)
    1.0
    """

    kind: Literal["tolerance"] = "tolerance"

    def runtime(self, place: Place) -> Runtime:
        """The term."""
        return _OfQuantity(self.name or f"tolerance_{self.quantity}", self.reward)


class Effort(Feature):
    """−weight · mean square of the motors' torques as shares of their greatest.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Effort, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Effort(weight=0.05))
    >>> observation, info = env.reset(seed=0)
    >>> round(float(env.step(env.action_space.high)[-1]["reward_terms"]["extra_effort"]), 4)
    -0.0492
    """

    kind: Literal["effort"] = "effort"
    weight: NonNegativeFloat = 0.02
    name: str = "extra_effort"

    def runtime(self, place: Place) -> Runtime:
        """The term."""
        return _Effort(self.name, self.weight, place)


class Smoothness(Feature):
    """−weight · mean square of the change of the motors' torque shares since the step before; they start at zero.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Smoothness, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Smoothness(weight=0.1))
    >>> observation, info = env.reset(seed=0)
    >>> round(float(env.step(env.action_space.high)[-1]["reward_terms"]["smoothness"]), 4)
    -0.0985
    """

    kind: Literal["smoothness"] = "smoothness"
    weight: NonNegativeFloat = 0.05
    name: str = "smoothness"

    def runtime(self, place: Place) -> Runtime:
        """The last torques of every robot."""
        return _Smoothness(self.name, self.weight, place)


class TractionUse(Feature):
    """−weight · (use of the floor's friction − threshold), none below the threshold, and never more than weight.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import TractionUse, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), TractionUse(threshold=0.1))
    >>> observation, info = env.reset(seed=0)
    >>> round(float(env.step(env.action_space.high)[-1]["reward_terms"]["traction"]), 4)
    -0.0492
    """

    kind: Literal["traction_use"] = "traction_use"
    weight: NonNegativeFloat = 0.1
    threshold: NonNegativeFloat = 0.8  # [-] 1: the wheel that uses most is about to slip
    name: str = "traction"

    def runtime(self, place: Place) -> Runtime:
        """The term."""
        return _OfQuantity(self.name, self._reward)

    def _reward(self, quantities: Quantities) -> Array:
        return -self.weight * finite(np.clip(quantities("traction_use") - self.threshold, 0.0, 1.0))


class Impact(Feature):
    """−weight · normal impulse of obstacles on the robot during the step.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Impact, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Impact(weight=2.0))
    >>> observation, info = env.reset(seed=0)
    >>> float(env.step(env.action_space.high)[-1]["reward_terms"]["extra_impact"])  # nothing was touched
    -0.0
    """

    kind: Literal["impact"] = "impact"
    weight: NonNegativeFloat = 1.0  # [1/(N s)]
    name: str = "extra_impact"

    def runtime(self, place: Place) -> Runtime:
        """The term."""
        return _OfQuantity(self.name, self._reward)

    def _reward(self, quantities: Quantities) -> Array:
        return -self.weight * finite(quantities("normal_impulse"))


def falloff(distance: Array, value_at_one: float, shape: Shape) -> Array:
    """A function of a distance >= 0 that is 1 at 0 and the given value at 1."""
    square: Array = np.square(distance)
    if shape == "gaussian":
        return np.exp(square * math.log(value_at_one))
    if shape == "long_tail":
        return np.asarray(kernel(square * (1.0 / value_at_one - 1.0), 1.0))
    reach = distance if shape == "linear" else square
    return np.maximum(1.0 - reach * (1.0 - value_at_one), 0.0)


def shaping(before: Array, after: Array, discount: float, terminated: Flags) -> Array:
    """γ Φ(s′) − Φ(s), where a state after failure has no potential."""
    return discount * np.where(terminated, 0.0, after) - before


def finite(values: Array) -> Array:
    """The values, with 0 for what is infinite or not a number."""
    return np.where(np.isfinite(values), values, 0.0)


def number(quantities: Quantities, name: str) -> Array:
    """A quantity with one number a robot."""
    values = quantities(name)
    if values.ndim != 1:
        raise ConfigurationError(f"a reward term needs a quantity of one number, {name!r} has {values.shape[1]}")
    return values


class _Potential(RewardRuntime):
    def __init__(self, feature: Potential, place: Place) -> None:
        super().__init__(feature.name or f"potential_{feature.quantity}")
        self._feature = feature
        self._now = np.zeros(place.count)

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._now[robots] = self._feature.reward(quantities)[robots]

    def term(self, quantities: Quantities, terminated: Flags) -> Array:
        before, self._now = self._now, self._feature.reward(quantities)
        return shaping(before, self._now, self._feature.discount, terminated)


class _OfQuantity(RewardRuntime):
    """A term that depends on a quantity after the step alone."""

    def __init__(self, name: str, reward: Callable[[Quantities], Array]) -> None:
        super().__init__(name)
        self._reward = reward

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._reward(quantities)  # so that an unknown one is refused at once

    def term(self, quantities: Quantities, terminated: Flags) -> Array:
        return self._reward(quantities)


class _OfTorques(RewardRuntime):
    """A term that depends on the torques of the driven motors."""

    def __init__(self, name: str, weight: float, place: Place) -> None:
        super().__init__(name)
        robot = place.engine.robot
        self._weight = weight
        self._driven = robot.driven_indices
        self._limits = robot.max_torques[self._driven]

    def _shares(self, quantities: Quantities) -> Array:
        shares: Array = quantities("torque")[:, self._driven] / self._limits
        return shares


class _Effort(_OfTorques):
    def term(self, quantities: Quantities, terminated: Flags) -> Array:
        return -self._weight * finite(_mean_square(self._shares(quantities)))


class _Smoothness(_OfTorques):
    def __init__(self, name: str, weight: float, place: Place) -> None:
        super().__init__(name, weight, place)
        self._last = np.zeros((place.count, len(self._driven)))

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._last[robots] = 0.0

    def term(self, quantities: Quantities, terminated: Flags) -> Array:
        before, self._last = self._last, self._shares(quantities)
        return -self._weight * finite(_mean_square(self._last - before))


def _mean_square(shares: Array) -> Array:
    """Mean over motors (robots,), summed in their order however many robots there are."""
    squares: Array = np.square(shares)
    total = squares[:, 0].copy()
    for motor in range(1, squares.shape[1]):
        total += squares[:, motor]
    return np.asarray(total / squares.shape[1])
