"""One robot on a path as a Gymnasium environment, whatever its task."""

import copy
from functools import cached_property
from typing import Any, Self

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box
from numpy.typing import NDArray

from caster_gym.configuration import Frozen
from caster_gym.envs.drawing import Renderer, checked_mode
from caster_gym.envs.inputs import FLOAT32, checked_seed, read_actions
from caster_gym.envs.native.engine import DRAW_A_PATH, TaskEngine
from caster_gym.envs.report import named
from caster_gym.envs.spaces import action_space, observation_space
from caster_gym.envs.specification import describe_environment, plain_specification
from caster_gym.envs.starts import read_options, read_start, restart_at
from caster_gym.states import (
    AnyState,
    State,
    check_description,
    check_state,
    generator_words,
    join_states,
    part_of,
    read_seeds,
    seed_arrays,
    set_generator,
    without,
)

Observation = NDArray[np.float32]
_ONLY, _CHOSEN = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.bool_)


class CasterEnv(gym.Env[Observation, NDArray[np.float32]]):
    """What the environments of single robots share; a subclass makes the engine of its task.

    Copies, by `copy`, `pickle` or `cloudpickle`, go on as the original does, to the last bit, and independently of it.
    """

    # Gymnasium declares it for instances, so that mypy refuses the ClassVar which RUF012 asks for
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012

    task: Frozen  # parameters
    observation_space: "Box[np.float32]"
    action_space: "Box[np.float32]"

    def __init__(self, engine: TaskEngine, task: Frozen, render_mode: str | None) -> None:
        self.engine, self.task, self.robot = engine, task, engine.robot
        self.path_descriptions = engine.plan.descriptions  # what was made of each path of the pool
        self.observation_space = observation_space(engine)
        self.action_space = action_space(engine)
        self._action_shape, self._terms, self._slipping = self.action_space.shape, engine.plan.terms, engine.slipping
        self.render_mode = checked_mode(render_mode, self.metadata)
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / engine.control_period)}
        self._renderer = Renderer(engine, self.render_mode, self.metadata["render_fps"])
        self._started = False
        self._spec: EnvSpec | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; info as after a step. The class says which options there are."""
        given = read_options(options, self.engine)
        path = self.engine.checked_path(given.get("path", DRAW_A_PATH))
        wanted = read_start(given, self.engine, _CHOSEN)
        seed = checked_seed(seed)
        super().reset(seed=seed)
        if seed is not None or not self._started:
            self.engine.seed(0, int(self.np_random.integers(2**63)))
            self._started = True
        outcome = restart_at(self.engine, _ONLY, wanted, path)
        if self.render_mode == "human":
            self.render()
        return outcome.observations[0], self.engine.info(outcome.reports[:, 0])

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the action for a control period. Raises ValueError for a wrong shape or a value that is not a number."""
        if not (type(action) is np.ndarray and action.dtype is FLOAT32 and action.flags.carray):
            action = read_actions(action, self._action_shape, "action")
        elif action.shape != self._action_shape:
            raise ValueError(f"action must have shape {self._action_shape}, got {action.shape}")
        if not self._started:
            raise RuntimeError("reset the environment before its first step")
        observation, reward, terminated, truncated, report = self.engine.step_alone(action)
        if self.render_mode == "human":
            self.render()
        return observation, reward, terminated, truncated, named(report, self._terms, self._slipping)

    def get_state(self) -> State:
        """Copies of all that the environment goes on from, as a flat dictionary of arrays; see `set_state`."""
        own = {
            "made_of": self._made_of,
            "started": np.array(self._started),
            "generator": generator_words(self.np_random),
            "action_space": generator_words(self.action_space.np_random),
        }
        return own | join_states(seed=seed_arrays([self._np_random_seed]), engine=self.engine.get_state())

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless `set_state` would take the state; nothing is changed."""
        check_description(state, self._made_of)
        self.engine.check_state(part_of(state, "engine"))
        expected = without(self.get_state(), "engine", "made_of")
        check_state("the environment", without(state, "engine", "made_of"), expected)

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the environment did whose `get_state` gave the state: also in another process.

        The arrays are copied. Raises ValueError, with the robot as it was, for a state of an environment that was made
        in another way. Gymnasium's wrappers around this one are not part of it: `caster_gym.wrappers.wrap` sees to
        those inside of it.
        """
        self.check_state(state)
        self.engine.set_state(part_of(state, "engine"))
        set_generator(self.np_random, state["generator"])
        set_generator(self.action_space.np_random, state["action_space"])
        (self._np_random_seed,) = read_seeds(part_of(state, "seed"))
        self._started = bool(state["started"])

    @cached_property
    def _made_of(self) -> NDArray[np.uint8]:
        return describe_environment(self.task, self.engine)

    def __copy__(self) -> Self:
        """As independent as a deep copy: two environments around one engine would move the same robot."""
        return copy.deepcopy(self)

    @property
    def spec(self) -> EnvSpec | None:
        """How the environment was made, in plain values, so that `spec.to_json()` works."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_specification(spec)

    def render(self) -> NDArray[np.uint8] | None:
        """The present moment as an image (height, width, 3), or in a window, as `render_mode` says."""
        if not self._started:
            raise RuntimeError("reset the environment before it is drawn")
        return self._renderer.show()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._renderer.close()
