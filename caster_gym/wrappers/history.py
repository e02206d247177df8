"""What was seen and done in the control periods before, behind what is seen now."""

from typing import Annotated, Literal

import numpy as np
from gymnasium.spaces import Box
from pydantic import Field

from caster_gym.arrays import Indices
from caster_gym.envs.observation import OBSERVATION_LIMIT
from caster_gym.wrappers.feature import Actions, Feature, Observations, Place, Quantities, Robots, Runtime

Periods = Annotated[int, Field(ge=0, le=100)]


class History(Feature):
    """Shows the last observations and actions behind the present observation, the latest ones first.

    From both together, an agent without memory of its own can tell delays, lags, loads and noise. Observations are
    those that the features before it show; before an episode begins, its first one is taken to have been seen, and
    actions to have been zero. Actions beyond ±1 count as ±1. Only reward terms may follow it in the list. Agents that
    decode the front of an observation act as before.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import History, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), History(observations=1, actions=3))
    >>> env.observation_space.shape == (2 * env.unwrapped.observation_space.shape[0] + 3 * 6,)
    True
    """

    kind: Literal["history"] = "history"
    observations: Periods = 1  # [control periods] before the present one
    actions: Periods = 3  # [control periods]

    def added(self, size: int, width: int) -> int:
        """As many as the last observations and actions have."""
        return self.observations * size + self.actions * width

    def runtime(self, place: Place) -> Runtime:
        """What every robot has seen and done."""
        return _History(self, place)


class _History(Runtime):
    def __init__(self, feature: History, place: Place) -> None:
        self._place, size = place, place.engine.layout.size
        self._seen = np.zeros((place.count, feature.observations, size), dtype=np.float32)  # the latest first
        self._done = np.zeros((place.count, feature.actions, place.width), dtype=np.float32)
        self._now = np.zeros((place.count, size), dtype=np.float32)
        self._fresh = np.ones(place.count, dtype=np.bool_)
        shape = (size + feature.added(size, place.width),)
        self.observation_space = Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, shape, np.float32)

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        self._done[robots], self._fresh[robots] = 0.0, True

    def act(self, actions: Actions) -> Actions:
        _push(self._done, np.clip(actions, -1.0, 1.0))
        _push(self._seen, self._now)
        return actions

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        first = self._fresh[robots]
        self._seen[robots] = np.where(first[:, None, None], observations[:, None], self._seen[robots])
        self._now[robots], self._fresh[robots] = observations, False
        parts = (observations, *(kept[robots].reshape(len(observations), -1) for kept in (self._seen, self._done)))
        return np.concatenate(parts, axis=1)


def _push(kept: Observations, latest: Observations) -> None:
    """Put the latest (robots, size) before all others (robots, count, size), whose last one is forgotten."""
    if kept.shape[1]:
        kept[:, 1:] = kept[:, :-1].copy()
        kept[:, 0] = latest
