"""Sensor packets that get lost: the robot goes on with what it saw last."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from caster_gym.arrays import Indices
from caster_gym.envs.randomness import uniforms
from caster_gym.wrappers.feature import Feature, Observations, Place, Quantities, Robots, Runtime


class DroppedPackets(Feature):
    """In each control period the observation gets lost with some probability; the last one that arrived is shown.

    The first one of an episode always arrives.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import DroppedPackets, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), DroppedPackets(probability=0.2))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["dropped_packets"] = "dropped_packets"
    probability: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1  # [-] of each control period

    def runtime(self, place: Place) -> Runtime:
        """What every robot saw last."""
        return _DroppedPackets(self, place)


class _DroppedPackets(Runtime):
    def __init__(self, feature: DroppedPackets, place: Place) -> None:
        self._place, self._probability = place, feature.probability
        self._last = np.zeros((place.count, place.engine.layout.size), dtype=np.float32)
        self._fresh = np.ones(place.count, dtype=np.bool_)

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        self._fresh[robots] = True

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        drawn = uniforms(self._place.seeds[robots], self._place.clocks[robots, None])[:, 0]
        lost = (drawn < self._probability) & ~self._fresh[robots]
        shown: Observations = np.where(lost[:, None], self._last[robots], observations)
        self._last[robots], self._fresh[robots] = shown, False
        return shown
