"""Applies the features of an environment in their order, for one robot or for a batch."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Box

from caster_gym.arrays import Array, Flags, Indices, Seeds
from caster_gym.configuration import ConfigurationError, did_you_mean
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.states import AnyState, State, check_state, join_states, part_of, without
from caster_gym.wrappers.draws import seeds_of, streams
from caster_gym.wrappers.feature import (
    Actions,
    Feature,
    Observations,
    Place,
    PlantRuntime,
    PushingRuntime,
    Quantities,
    RewardRuntime,
    Robots,
    Runtime,
)

if TYPE_CHECKING:
    from caster_gym.envs.native.engine import TaskEngine
    from caster_gym.tasks.parameters import TaskParameters

EVERYONE = slice(None)
_TRIED = 32  # draws of the plants that are checked beforehand


class Stack:
    """Features in the order of their list, from the environment outwards.

    Actions pass the last feature first, observations the first one. An engine tells of new episodes while it starts
    them, when the features that change the plant do their work; all others begin once the last step of the episode
    before has been looked at.
    """

    def __init__(
        self,
        engine: "TaskEngine",
        task: "TaskParameters",
        features: Sequence[Feature],
        action_space: "Box[Any]",
        observation_space: "Box[Any]",
    ) -> None:
        if any(isinstance(getattr(hook, "__self__", None), Stack) for hook in engine.on_restart):
            raise ValueError("this environment has been wrapped before: give all features to one call of wrap")
        self._engine, self._task = engine, task
        self.action_space, self.observation_space = action_space, observation_space
        self._clocks = np.zeros(engine.count, dtype=np.int64)
        # an array for each feature: a pickled or copied stack still shares them, as it would not share views of one
        self._seeds = [np.zeros(engine.count, dtype=np.uint64) for _ in features]
        self._coming = np.zeros((len(features), engine.count), dtype=np.uint64)  # of episodes that were started
        self._streams = streams([getattr(feature, "kind", type(feature).__name__) for feature in features])
        self._runtimes = [self._started(i, feature) for i, feature in enumerate(features)]
        self._check_order(features)
        self._names = [f"{i}_{getattr(one, 'kind', type(one).__name__)}" for i, one in enumerate(features)]
        self._rewards = [one for one in self._runtimes if isinstance(one, RewardRuntime)]
        self._plants = [(i, one) for i, one in enumerate(self._runtimes) if isinstance(one, PlantRuntime)]
        self._pushes = [one for one in self._runtimes if isinstance(one, PushingRuntime)]
        names = [reward.name for reward in self._rewards]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"the reward term {min(twice)!r} is there twice: give one of them another 'name'")
        if taken := set(names) & set(engine.plan.terms):
            raise ValueError(f"the task has a reward term {min(taken)!r} of its own: give yours another 'name'")
        self._nominal = np.array([pack_parameters(robot_parameters(engine.robot))])
        if self._plants:
            self._check_plants()
        engine.on_restart.append(self._on_restart)

    def _started(self, index: int, feature: Feature) -> Runtime:
        width = self.action_space.shape[0]
        runtime = feature.runtime(Place(self._engine, self._task, width, self._seeds[index], self._clocks))
        self.action_space = runtime.action_space or self.action_space
        self.observation_space = runtime.observation_space or self.observation_space
        return runtime

    def _check_order(self, features: Sequence[Feature]) -> None:
        """Refuse features behind one that shows more than they know of."""
        for place, one in enumerate(features):
            behind = zip(features[place + 1 :], self._runtimes[place + 1 :], strict=True)
            if one.added(1, 1) and (
                others := [later for later, runtime in behind if not isinstance(runtime, RewardRuntime)]
            ):
                first, second = (getattr(it, "kind", type(it).__name__) for it in (others[0], one))
                raise ValueError(f"feature {first!r} must stand before {second!r}, which only reward terms may follow")

    def _check_plants(self) -> None:
        """Refuse plants that the time step cannot follow: at the ends of their ranges, and some draws between."""
        extremes = self._nominal
        drawn = np.repeat(self._nominal, _TRIED, axis=0)
        keys, episodes = np.arange(_TRIED, dtype=np.uint64), np.zeros(_TRIED, dtype=np.uint64)
        for i, plant in self._plants:
            extremes = plant.extremes(extremes)
            drawn = plant.rebuild(drawn, seeds_of(keys, episodes, self._streams[i]))
        what = f"robots like {self._engine.robot.name!r} as the environment's features may make them"
        self._engine.check_parameters(np.concatenate([extremes, drawn]), what)

    def _on_restart(self, robots: Indices) -> None:
        keys, episodes = self._engine.episodes(robots)
        for i, of in enumerate(self._streams):
            self._coming[i, robots] = seeds_of(keys, episodes, of)
        if self._plants:
            rows = np.repeat(self._nominal, len(robots), axis=0)
            for i, plant in self._plants:
                rows = plant.rebuild(rows, self._coming[i, robots])
            # checked at the start; here it would take longer than steps
            self._engine.set_parameters(robots, rows, checked=True)

    def begin(self, robots: Indices, observations: Observations, infos: Mapping[str, Any]) -> Observations:
        """What some robots show after their reset; observations are theirs, infos those of all robots."""
        for seeds, coming in zip(self._seeds, self._coming, strict=True):
            seeds[robots] = coming[robots]
        self._clocks[robots] = 0
        quantities = _quantities(infos, {}, np.zeros(0, dtype=np.bool_))
        for runtime in self._runtimes:
            runtime.begin(robots, quantities)
        return self.observe(observations, robots)

    def act(self, actions: Actions) -> Actions:
        """Actions for the environment, and pushes for its plant."""
        for runtime in reversed(self._runtimes):
            actions = runtime.act(actions)
        if self._pushes:
            self._engine.wrenches = sum((push.wrenches() for push in self._pushes), np.zeros((self._engine.count, 3)))
        return actions

    def score(
        self, infos: Mapping[str, Any], final: Mapping[str, Any], ended: Flags, terminated: Flags
    ) -> dict[str, Array]:
        """Terms (robots,) of a step by name. Robots in `ended` have their last quantities in `final`."""
        self._clocks += 1
        quantities = _quantities(infos, final, ended)
        for runtime in self._runtimes:
            runtime.look(quantities)
        return {reward.name: reward.term(quantities, terminated) for reward in self._rewards}

    def observe(self, observations: Observations, robots: Robots = EVERYONE) -> Observations:
        """What is shown of some robots whose environment shows these observations."""
        for runtime in self._runtimes:
            observations = runtime.observe(observations, robots)
        return observations

    def get_state(self) -> State:
        """Copies of all that the features remember."""
        own = {"clocks": self._clocks.copy(), "seeds": self._own_seeds(), "coming": self._coming.copy()}
        return own | join_states(**{name: one.get_state() for name, one in self._named().items()})

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless the state is one of these features in this order."""
        named = self._named()
        own = {"clocks": self._clocks, "seeds": self._own_seeds(), "coming": self._coming}
        check_state("the features", without(state, *named), own)
        for name, runtime in named.items():
            runtime.check_state(part_of(state, name))

    def set_state(self, state: AnyState) -> None:
        """Go on from a state that `get_state` gave and `check_state` has seen."""
        self._clocks[:], self._coming[:] = state["clocks"], state["coming"]
        for seeds, saved in zip(self._seeds, state["seeds"], strict=True):
            seeds[:] = saved
        for name, runtime in self._named().items():
            runtime.set_state(part_of(state, name))

    def _own_seeds(self) -> Seeds:
        """Seeds (features, robots)."""
        return np.array(self._seeds, dtype=np.uint64).reshape(self._coming.shape)

    def _named(self) -> dict[str, Runtime]:
        """Features at work by place and kind, as "0_payload"."""
        return dict(zip(self._names, self._runtimes, strict=True))

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the added reward terms."""
        return tuple(reward.name for reward in self._rewards)


def _quantities(infos: Mapping[str, Any], final: Mapping[str, Any], ended: Flags) -> Quantities:
    """Looks quantities up by name, those of robots whose episode has ended among the final ones."""

    def look_up(name: str) -> Array:
        if name not in infos:
            numbers = [key for key, value in infos.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f"]
            raise ConfigurationError(f"info has no quantity {name!r} here; {did_you_mean(name, numbers)}")
        values = np.asarray(infos[name], dtype=np.float64)
        if not final:
            return values
        return np.where(ended.reshape(-1, *[1] * (values.ndim - 1)), final[name], values)

    return look_up
