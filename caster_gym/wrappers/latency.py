"""Latency between commands and torques: delays, and motors that lag."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field

from caster_gym.arrays import Array
from caster_gym.envs.randomness import uniforms
from caster_gym.wrappers.feature import Actions, Feature, Place, Quantities, Runtime, Size, between

FIRST = np.zeros(1, dtype=np.int64)
Periods = Annotated[int, Field(ge=0, le=1000)]


def _rising(value: int | tuple[int, int]) -> int | tuple[int, int]:
    if isinstance(value, tuple) and value[0] > value[1]:
        raise ValueError("must rise from its first to its second number")
    return value


class ActionDelay(Feature):
    """Actions arrive late, by whole control periods; until the first one arrives, they are zero.

    >>> import gymnasium
    >>> from caster_gym.wrappers import ActionDelay, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), ActionDelay(periods=1))
    >>> observation, info = env.reset(seed=0)
    >>> info = env.step(env.action_space.high)[-1]
    >>> info["torque"].round(3)  # [N m]
    array([0., 0., 0., 0., 0., 0.])
    """

    kind: Literal["action_delay"] = "action_delay"
    periods: Annotated[Periods | tuple[Periods, Periods], AfterValidator(_rising)] = 1  # [control periods] by episode

    def runtime(self, place: Place) -> Runtime:
        """Waiting actions of every robot."""
        return _Delay(self, place)


class MotorLag(Feature):
    """Actions are followed as by a first-order lag: what remains to be done falls as exp(−t / time constant).

    Over each control period the mean of what follows is held, so that a motor's impulse is the right one.

    >>> import gymnasium
    >>> from caster_gym.wrappers import MotorLag, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), MotorLag(time_constant=0.02))
    >>> observation, info = env.reset(seed=0)
    >>> info = env.step(env.action_space.high)[-1]
    >>> info["torque"].round(3)  # [N m]
    array([0.074, 0.037, 0.074, 0.037, 0.074, 0.037])
    """

    kind: Literal["motor_lag"] = "motor_lag"
    time_constant: Size = 0.02  # [s] by episode

    def runtime(self, place: Place) -> Runtime:
        """Followed actions of every robot."""
        return _Lag(self, place)


class Lag(NamedTuple):
    """What remains to be done after a control period, as a share of what remained before."""

    end: Array  # at its end
    mean: Array  # in its mean


def lag_of(time_constants: Array | float, period: float) -> Lag:
    """Motors that lag by time constants [s]. With x = period / time constant, exp(−x) and (1 − exp(−x)) / x."""
    with np.errstate(divide="ignore"):
        x = np.float64(period) / time_constants
    return Lag(np.exp(-x), -np.expm1(-x) / x)


class _Delay(Runtime):
    def __init__(self, feature: ActionDelay, place: Place) -> None:
        low, high = feature.periods if isinstance(feature.periods, tuple) else (feature.periods, feature.periods)
        self._least, self._choices = low, high - low + 1
        self._place = place
        self._periods = np.full(place.count, low)
        self._waiting = np.zeros((high + 1, place.count, place.width), dtype=np.float32)
        self._everyone = np.arange(place.count)
        self._next = 0

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._waiting[:, robots] = 0.0
        shares = uniforms(self._place.seeds[robots], FIRST)[:, 0]
        self._periods[robots] = self._least + (self._choices * shares).astype(np.int64)

    def act(self, actions: Actions) -> Actions:
        self._waiting[self._next] = actions
        due: Actions = self._waiting[(self._next - self._periods) % len(self._waiting), self._everyone]
        self._next = (self._next + 1) % len(self._waiting)
        return due


class _Lag(Runtime):
    def __init__(self, feature: MotorLag, place: Place) -> None:
        self._range = feature.time_constant
        self._place = place
        self._left = np.zeros((place.count, 1))
        self._mean_left = np.zeros((place.count, 1))
        self._followed = np.zeros((place.count, place.width))  # at the end of the period before

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._followed[robots] = 0.0
        constants: Array = between(self._range, uniforms(self._place.seeds[robots], FIRST))
        self._left[robots], self._mean_left[robots] = lag_of(constants, self._place.period)

    def act(self, actions: Actions) -> Actions:
        remaining = self._followed - actions
        held: Actions = (actions + self._mean_left * remaining).astype(np.float32)
        self._followed = actions + self._left * remaining
        return held
