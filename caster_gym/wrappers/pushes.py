"""Pushes from outside, at random times."""

from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat

from caster_gym.arrays import Array
from caster_gym.configuration import Positive
from caster_gym.envs.randomness import uniforms
from caster_gym.wrappers.feature import Feature, Place, PushingRuntime, Quantities, Range, Runtime, Size, between

_DRAWS = 4  # a control period: whether, how hard, whither, how twisting


class Pushes(Feature):
    """A force at C in any direction, with a moment, now and then; it turns with the robot while it lasts.

    The impulse of a push is its force times its duration. A push that begins during another one takes its place.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Pushes, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Pushes(rate=1.0, force=(0.0, 5.0)))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["pushes"] = "pushes"
    rate: NonNegativeFloat = 0.5  # [1/s] mean number of pushes; the waiting time is exponential
    force: Size = (0.0, 5.0)  # [N]
    moment: Range = 0.0  # [N m] counter-clockwise
    duration: Positive = 0.1  # [s] rounded to control periods, at least one

    def runtime(self, place: Place) -> Runtime:
        """The present push of every robot."""
        return _Pushes(self, place)


class _Pushes(PushingRuntime):
    def __init__(self, feature: Pushes, place: Place) -> None:
        self._feature, self._place = feature, place
        self._chance = -np.expm1(-feature.rate * place.period)  # of at least one within a control period
        self._length = max(1, round(feature.duration / place.period))
        self._left = np.zeros(place.count, dtype=np.int64)  # control periods
        self._wrenches = np.zeros((place.count, 3))

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._left[robots] = 0

    def wrenches(self) -> Array:
        indices = _DRAWS * self._place.clocks[:, None] + np.arange(_DRAWS)
        new = np.flatnonzero(uniforms(self._place.seeds, indices[:, :1])[:, 0] < self._chance)
        if new.size:
            shares = uniforms(self._place.seeds[new], indices[new, 1:])
            force, angle = between(self._feature.force, shares[:, 0]), 2.0 * np.pi * shares[:, 1]
            self._wrenches[new, 0] = force * np.cos(angle)
            self._wrenches[new, 1] = force * np.sin(angle)
            self._wrenches[new, 2] = between(self._feature.moment, shares[:, 2])
            self._left[new] = self._length
        lasting = self._left > 0
        self._left[lasting] -= 1
        return np.where(lasting[:, None], self._wrenches, 0.0)
