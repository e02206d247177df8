"""Environments with features, for one robot or a batch."""

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self, TypeAlias, overload

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from numpy.typing import NDArray

from caster_gym.arrays import Array, Flags
from caster_gym.envs.inputs import read_actions
from caster_gym.envs.specification import plain
from caster_gym.states import (
    AnyState,
    State,
    check_description,
    check_state,
    describe,
    generator_words,
    join_states,
    part_of,
    set_generator,
    without,
)
from caster_gym.wrappers.feature import Actions, Feature, Observations
from caster_gym.wrappers.infos import batch_of_one, last, tell
from caster_gym.wrappers.plants import WheelErrors
from caster_gym.wrappers.specification import read_features
from caster_gym.wrappers.stack import Stack

Env: TypeAlias = gym.Env[Any, Any]
Batch: TypeAlias = VectorEnv[Any, Any, Any]
if TYPE_CHECKING:
    AnyVectorWrapper: TypeAlias = VectorWrapper[Any, Any, Any, Any, Any]
else:
    AnyVectorWrapper = VectorWrapper  # takes no parameters in Gymnasium 1.2

_BETWEEN = (OrderEnforcing, PassiveEnvChecker, TimeLimit)  # wrappers that change no observation, reward or action
_ONLY = np.zeros(1, dtype=np.int64)
_RUNNING = np.zeros(1, dtype=np.bool_)


class FeatureEnv(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """An environment of caster_gym with features; see `wrap`."""

    def __init__(self, env: Env, features: Sequence[Feature | Mapping[str, Any]] = ()) -> None:
        self.features = _checked([read_features([one])[0] if isinstance(one, Mapping) else one for one in features])
        RecordConstructorArgs.__init__(self, features=plain(self.features))
        gym.Wrapper.__init__(self, env)
        self._stack = Stack(_engine(env), _task(env), self.features, *_spaces(env.action_space, env.observation_space))
        self.action_space, self.observation_space = self._stack.action_space, self._stack.observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        shown = self._stack.begin(_ONLY, observation[None], batch_of_one(info))[0]
        tell(info, 0.0, dict.fromkeys(self._stack.terms, 0.0))
        return shown, info

    def step(self, action: Actions) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Hold the action for a control period. Raises ValueError for a wrong shape or a value that is not a number."""
        given = _checked_actions(action, self.action_space, "action")
        observation, task_reward, terminated, truncated, info = self.env.step(self._stack.act(given[None])[0])
        terms = self._stack.score(batch_of_one(info), {}, _RUNNING, np.array([terminated]))
        numbers = {name: float(term[0]) for name, term in terms.items()}
        reward = float(task_reward)
        tell(info, reward, numbers)
        for number in numbers.values():
            reward += number
        return self._stack.observe(observation[None])[0], reward, terminated, truncated, info

    def get_state(self) -> State:
        """Copies of all that the environment goes on from, as a flat dictionary of arrays, with its features' memory.

        Gymnasium's TimeLimit inside is part of it.
        """
        limits = [-1 if one._elapsed_steps is None else one._elapsed_steps for one in self._time_limits()]
        own: State = {
            "made_of": _describe(self.features),
            "elapsed": np.array(limits, dtype=np.int64),
            "action_space": generator_words(self.action_space.np_random),
        }
        return own | join_states(env=_bare(self.env).get_state(), features=self._stack.get_state())

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless `set_state` would take the state; nothing is changed."""
        check_description(state, _describe(self.features))
        _bare(self.env).check_state(part_of(state, "env"))
        others = "made_of", "env", "features"
        check_state("the environment", without(state, *others), without(self.get_state(), *others))
        self._stack.check_state(part_of(state, "features"))

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the environment did whose `get_state` gave the state: also in another process.

        Raises ValueError, with nothing changed, for a state of an environment that was made in another way.
        """
        self.check_state(state)
        if state["env/started"]:
            self.env.reset()  # Gymnasium's wrappers want to have seen one
        _bare(self.env).set_state(part_of(state, "env"))
        self._stack.set_state(part_of(state, "features"))
        for limit, elapsed in zip(self._time_limits(), state["elapsed"].tolist(), strict=True):
            limit._elapsed_steps = None if elapsed < 0 else elapsed
        set_generator(self.action_space.np_random, state["action_space"])

    def _time_limits(self) -> "list[TimeLimit[Any, Any]]":
        """Those inside, from the outermost on."""
        found, inside = [], self.env
        while isinstance(inside, gym.Wrapper):
            if isinstance(inside, TimeLimit):
                found.append(inside)
            inside = inside.env
        return found

    def __copy__(self) -> Self:
        """As independent as a deep copy: both would move the same robot."""
        return copy.deepcopy(self)


class FeatureVectorEnv(AnyVectorWrapper):
    """A batch of caster_gym with features, equal bit for bit to a SyncVectorEnv of `FeatureEnv`; see `wrap`."""

    def __init__(self, env: Batch, features: Sequence[Feature] = ()) -> None:
        super().__init__(env)
        self.features = _checked(features)
        self.autoreset_mode = AutoresetMode(env.metadata["autoreset_mode"])
        inside = _engine(env), _task(env)
        spaces = _spaces(env.single_action_space, env.single_observation_space)
        self._stack = stack = Stack(*inside, self.features, *spaces)
        self.single_action_space, self.single_observation_space = stack.action_space, stack.observation_space
        self.action_space = batch_space(self.single_action_space, env.num_envs)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self._ended: Flags = np.zeros(env.num_envs, dtype=np.bool_)
        self._shown: Observations = np.zeros(self.observation_space.shape or (), dtype=np.float32)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start episodes of all robots, or of those in options["reset_mask"]."""
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # a list will do
        mask = np.array((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        self._begin(mask, observations, infos)
        self._ended = self._ended & ~mask
        nothing = np.zeros(self.num_envs)
        tell(infos, nothing, {name: nothing.copy() for name in self._stack.terms}, mask)
        return self._shown.copy(), infos

    def step(self, actions: Actions) -> tuple[Observations, Array, Flags, Flags, dict[str, Any]]:
        """Hold actions for a control period. Raises ValueError for a wrong shape or a value that is not a number."""
        given = _checked_actions(actions, self.action_space)
        observations, task_rewards, terminated, truncated, infos = self.env.step(self._stack.act(given))
        ended, self._ended = self._ended, terminated | truncated
        at_once = self.autoreset_mode is AutoresetMode.SAME_STEP
        fresh = self._ended if at_once else ended & (self.autoreset_mode is AutoresetMode.NEXT_STEP)
        terms = self._stack.score(infos, infos.get("final_info", {}), fresh, terminated)
        self._shown = self._stack.observe(last(observations, infos))
        if not at_once:  # the step of fresh robots was their reset
            terms = {name: np.where(fresh, 0.0, term) for name, term in terms.items()}
        rewards = task_rewards.copy()
        for term in terms.values():
            rewards += term
        if fresh.any():
            if at_once:
                self._tell_finals(infos, task_rewards, terms, fresh)
            self._begin(fresh, observations, infos)
        going_on = {name: np.where(fresh, 0.0, term) for name, term in terms.items()}
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        tell(infos, np.where(fresh, 0.0, task_rewards), going_on, everyone)
        return self._shown.copy(), rewards, terminated, truncated, infos

    def get_state(self) -> State:
        """Copies of all that the batch goes on from, as a flat dictionary of arrays, with its features' memory."""
        own = {
            "made_of": _describe(self.features),
            "ended": self._ended.copy(),
            "shown": self._shown.copy(),
            "action_space": generator_words(self.action_space.np_random),
            "single_action_space": generator_words(self.single_action_space.np_random),
        }
        return own | join_states(env=_bare(self.env).get_state(), features=self._stack.get_state())

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless `set_state` would take the state; nothing is changed."""
        check_description(state, _describe(self.features))
        _bare(self.env).check_state(part_of(state, "env"))
        others = "made_of", "env", "features"
        check_state("the batch", without(state, *others), without(self.get_state(), *others))
        self._stack.check_state(part_of(state, "features"))

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the batch did whose `get_state` gave the state: also in another process.

        Raises ValueError, with nothing changed, for a state of a batch that was made in another way.
        """
        self.check_state(state)
        _bare(self.env).set_state(part_of(state, "env"))
        self._stack.set_state(part_of(state, "features"))
        self._ended, self._shown = state["ended"].copy(), state["shown"].copy()
        set_generator(self.action_space.np_random, state["action_space"])
        set_generator(self.single_action_space.np_random, state["single_action_space"])

    def __copy__(self) -> Self:
        """As independent as a deep copy: both would move the same robots."""
        return copy.deepcopy(self)

    def _begin(self, mask: Flags, observations: Observations, infos: dict[str, Any]) -> None:
        """New episodes of some robots."""
        robots = np.flatnonzero(mask)
        self._shown[robots] = self._stack.begin(robots, observations[robots], infos)

    def _tell_finals(self, infos: dict[str, Any], task_rewards: Array, terms: dict[str, Array], ended: Flags) -> None:
        """Put what the last step of ended episodes showed and brought into final_obs and final_info."""
        for robot in np.flatnonzero(ended):
            infos["final_obs"][robot] = self._shown[robot].copy()
        lasts = {name: np.where(ended, term, 0.0) for name, term in terms.items()}
        tell(infos["final_info"], np.where(ended, task_rewards, 0.0), lasts, ended)


@overload
def wrap(env: Env, *features: Feature) -> FeatureEnv: ...
@overload
def wrap(env: Batch, *features: Feature) -> FeatureVectorEnv: ...
def wrap(env: Env | Batch, *features: Feature) -> FeatureEnv | FeatureVectorEnv:
    """An environment of caster_gym, single or a batch, with features in the order of their list.

    The first feature is nearest to the environment: observations pass it first, actions last. Rewards are the task's
    plus the terms that features add, in their order; info["reward_terms"] holds them all by name and
    info["task_reward"] what the task alone gave. Raises ValueError for environments and features that do not fit.

    >>> import gymnasium
    >>> from caster_gym.wrappers import Effort, Payload, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), Payload(mass=(0, 2)), Effort())
    >>> observation, info = env.reset(seed=0)
    >>> "extra_effort" in info["reward_terms"], info["task_reward"]
    (True, 0.0)
    """
    if isinstance(env, VectorEnv):
        return FeatureVectorEnv(env, features)
    if isinstance(env, gym.Env):
        return FeatureEnv(env, features)
    raise ValueError(f"only Gymnasium environments can have features, got {env!r}")


def _bare(env: Any) -> Any:
    """The environment of caster_gym inside."""
    return env.unwrapped


def _describe(features: Sequence[Feature]) -> NDArray[np.uint8]:
    return describe({"features": [{"feature": type(one).__name__, **plain(one)} for one in features]})


def _engine(env: Env | Batch) -> Any:
    """The engine behind an environment that nothing has changed. Raises ValueError if there is none."""
    engine = getattr(env.unwrapped, "engine", None)
    if not hasattr(engine, "on_restart"):
        hint = ""
        if hasattr(env.unwrapped, "envs"):
            hint = "; wrap each environment inside instead, or make a native batch with gym.make_vec"
        raise ValueError(f"features need an environment of caster_gym such as CasterTrack-v0, got {env}{hint}")
    inside = env
    while inside is not env.unwrapped:
        if isinstance(inside, FeatureEnv | FeatureVectorEnv):
            raise ValueError("this environment has been wrapped before: give all features to one call of wrap")
        if not isinstance(inside, _BETWEEN):
            raise ValueError(f"{type(inside).__name__} must stand outside of the features, not inside: {env}")
        inside = inside.env
    return engine


def _task(env: Env | Batch) -> Any:
    return getattr(env.unwrapped, "task", None)


def _checked(features: Sequence[Feature]) -> tuple[Feature, ...]:
    """The features, of which one at most gives actions another meaning."""
    for feature in features:
        if not isinstance(feature, Feature):
            raise ValueError(f"a feature is one of caster_gym.wrappers, or read by read_features, got {feature!r}")
    redefining = [type(feature).__name__ for feature in features if feature.redefines_actions]
    if len(redefining) > 1:
        raise ValueError(
            f"only one feature can say what actions mean, got {' and '.join(redefining)}: each expects torques inside"
        )
    if sum(isinstance(feature, WheelErrors) for feature in features) > 1:
        raise ValueError("wheel_errors may stand once among the features: the encoders know one described size")
    return tuple(features)


def _spaces(*spaces: Any) -> "tuple[gym.spaces.Box[Any], gym.spaces.Box[Any]]":
    actions, observations = spaces
    for what, space in (("actions", actions), ("observations", observations)):
        if not isinstance(space, gym.spaces.Box):
            raise ValueError(f"features need {what} in a Box, got {space}")
    return actions, observations


def _checked_actions(actions: Any, space: Any, name: str = "actions") -> NDArray[np.float32]:
    given = read_actions(actions, space.shape, name)
    if np.isnan(given).any():
        raise ValueError(
            f"{name} must hold numbers, got {given[np.isnan(given).any(axis=-1)] if given.ndim > 1 else given}"
        )
    return given
