"""Many robots at once as a Gymnasium VectorEnv, whatever their task: one compiled call a step."""

import copy
from collections.abc import Iterator
from functools import cache, cached_property
from typing import Any, Self

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from caster_gym.arrays import Flags
from caster_gym.configuration import Frozen
from caster_gym.envs.drawing import Renderer, checked_mode
from caster_gym.envs.inputs import Seeds, checked_mask, checked_seeds, read_actions
from caster_gym.envs.native.engine import DRAW_A_PATH, Outcome, TaskEngine
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
    make_generator,
    part_of,
    read_seeds,
    seed_arrays,
    set_generator,
    without,
)

Observations = NDArray[np.float32]


class CasterVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """What the batches of all tasks share; a subclass makes the engine of its task.

    Sub-environment i is seeded with seed + i. All of Gymnasium's autoreset modes are supported; with
    AutoresetMode.DISABLED, `reset(options={"reset_mask": mask})` restarts some. All other options are those of the
    single environment, with one entry for all robots or one for each, robots in front.

    render_mode: "rgb_array" gives a tuple with the frame of each robot, as its single environment would draw it, "grid"
    one image of the first 16 side by side, "human" shows that in a window. Arrays that `reset` and `step` return are
    never read again: they may be written into.
    """

    # Gymnasium declares it for instances, so that mypy refuses the ClassVar which RUF012 asks for
    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array", "grid"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    task: Frozen  # parameters
    single_observation_space: "Box[np.float32]"
    single_action_space: "Box[np.float32]"

    def __init__(
        self, engine: TaskEngine, task: Frozen, autoreset_mode: AutoresetMode | str, render_mode: str | None
    ) -> None:
        super().__init__()
        self.num_envs = engine.count
        self.engine, self.task, self.robot = engine, task, engine.robot
        self.path_descriptions = engine.plan.descriptions  # what was made of each path of the pool
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.render_mode = checked_mode(render_mode, self.metadata)
        self.metadata = {
            **type(self).metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(1.0 / engine.control_period),
        }
        self._renderer = Renderer(engine, self.render_mode, self.metadata["render_fps"])
        self.single_observation_space = observation_space(engine)
        self.single_action_space = action_space(engine)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._actions_shape = self.action_space.shape
        self._everyone = np.ones(self.num_envs, dtype=np.bool_)
        self._seeds: list[int | None] = [None] * self.num_envs
        self._generators: dict[int, np.random.Generator] = {}  # of robots whose generator somebody has asked for
        self._seeded = np.zeros(self.num_envs, dtype=np.bool_)
        self._started = False
        self._done: Flags = np.zeros(self.num_envs, dtype=np.bool_)
        self._spec: EnvSpec | None = None

    def reset(
        self, *, seed: Seeds = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start episodes of all robots, or of those in options["reset_mask"], as the other options say."""
        given = read_options(options, self.engine, "reset_mask")
        mask = checked_mask(given["reset_mask"], self.num_envs) if "reset_mask" in given else self._everyone
        path = self.engine.checked_path(given.get("path", DRAW_A_PATH))
        wanted = read_start(given, self.engine, mask)
        seeds = checked_seeds(seed, self.num_envs)
        selected = np.flatnonzero(mask)
        for robot in selected.tolist():
            if seeds[robot] is not None or not self._seeded[robot]:
                self.engine.seed(robot, self._fresh_key(robot, seeds[robot]))
        outcome = restart_at(self.engine, selected, wanted, path[mask])
        others = self._seeded & ~mask
        if others.any():
            outcome.observations[others] = self.engine.look().observations[others]
        self._seeded |= mask
        self._started = bool(self._seeded.all())
        self._done = self._done & ~mask
        if self.render_mode == "human":
            self.render()
        return outcome.observations, self._masked(self.engine.info(outcome.reports), mask)

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Hold actions (num_envs, driven joints) for a control period.

        Raises ValueError for a wrong shape or a value that is not a number.
        """
        given = read_actions(actions, self._actions_shape)
        if np.isnan(given).any():
            raise ValueError(f"actions must hold numbers, got {given[np.isnan(given).any(axis=1)][0]}")
        if not self._started:
            raise RuntimeError("reset every robot before its first step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError(f"robot {int(self._done.argmax())} has ended its episode: reset it before the next step")
        outcome = self.engine.step(given)
        finals: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._done.any():
            outcome = self._restart_ended(outcome)
        self._done = outcome.terminated | outcome.truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            finals = self._finals(outcome, self._done)
            outcome = self.engine.restart(np.flatnonzero(self._done), outcome)
        infos = self._masked(self.engine.info(outcome.reports), self._everyone)
        if finals:
            infos = finals | infos
        if self.render_mode == "human":
            self.render()
        return outcome.observations, outcome.rewards, outcome.terminated, outcome.truncated, infos

    # Gymnasium's type knows no grid, one image of several robots
    def render(self) -> tuple[NDArray[np.uint8], ...] | NDArray[np.uint8] | None:  # type: ignore[override]
        """Frames (height, width, 3) of robots, one of a grid of the first 16, or a window, as `render_mode` says."""
        if not self._started:
            raise RuntimeError("reset every robot before they are drawn")
        return self._renderer.show_batch()

    def get_state(self) -> State:
        """Copies of all that the batch goes on from, as a flat dictionary of arrays; see `set_state`."""
        generators = np.zeros((self.num_envs, 6), dtype=np.uint64)
        for robot, generator in self._generators.items():
            generators[robot] = generator_words(generator)
        own = {
            "made_of": self._made_of,
            "done": self._done.copy(),
            "seeded": self._seeded.copy(),
            "generators_asked_for": np.isin(np.arange(self.num_envs), list(self._generators)),
            "generators": generators,
            "action_space": generator_words(self.action_space.np_random),
            "single_action_space": generator_words(self.single_action_space.np_random),
        }
        return own | join_states(seeds=seed_arrays(self._seeds), engine=self.engine.get_state())

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless `set_state` would take the state; nothing is changed."""
        check_description(state, self._made_of)
        self.engine.check_state(part_of(state, "engine"))
        check_state("the batch", without(state, "engine", "made_of"), without(self.get_state(), "engine", "made_of"))

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the batch did from which `get_state` took the state: also in another process.

        The arrays are copied. Raises ValueError, with all robots as they were, for a state of a batch that was made
        in another way. Generators are those of robots and of the action spaces.
        """
        self.check_state(state)
        self.engine.set_state(part_of(state, "engine"))
        self._done, self._seeded = state["done"].copy(), state["seeded"].copy()
        self._started = bool(self._seeded.all())
        self._seeds = read_seeds(part_of(state, "seeds"))
        self._generators = {
            int(robot): make_generator(state["generators"][robot])
            for robot in np.flatnonzero(state["generators_asked_for"])
        }
        set_generator(self.action_space.np_random, state["action_space"])
        set_generator(self.single_action_space.np_random, state["single_action_space"])

    @cached_property
    def _made_of(self) -> NDArray[np.uint8]:
        return describe_environment(self.task, self.engine, autoreset_mode=self.autoreset_mode.value)

    def __copy__(self) -> Self:
        """As independent as a deep copy: two batches around one engine would move the same robots."""
        return copy.deepcopy(self)

    @property
    def spec(self) -> EnvSpec | None:
        """How the batch was made, in plain values, so that `spec.to_json()` works."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_specification(spec)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]  # as Gymnasium's SyncVectorEnv
        """The seed of each robot; of one that was not seeded, that of a random generator."""
        return tuple(self._seed_of(robot) for robot in range(self.num_envs))

    @property  # type: ignore[misc]  # they are not to be set
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]  # as SyncVectorEnv
        """The generator of each robot, as its single environment has it. Keys of episodes are drawn from it."""
        return tuple(self._generator(robot) for robot in range(self.num_envs))

    def _seed_of(self, robot: int) -> int:
        seed = self._seeds[robot]
        if seed is None:
            self._generators[robot], seed = seeding.np_random()
            self._seeds[robot] = seed
        return seed

    def _generator(self, robot: int) -> np.random.Generator:
        """A robot's generator. Most are never asked for, so that they are made, and wound on, when they are."""
        seed = self._seed_of(robot)
        if robot not in self._generators:
            self._generators[robot] = seeding.np_random(seed)[0]
            if self._seeded[robot]:
                _draw_key(self._generators[robot])
        return self._generators[robot]

    def _fresh_key(self, robot: int, seed: int | None) -> int:
        """What all random numbers of a robot count from, by a new seed or, at its first reset, without one."""
        if seed is None and robot in self._generators:
            return _draw_key(self._generators[robot])
        self._generators.pop(robot, None)
        generator, self._seeds[robot] = seeding.np_random(seed)
        return _draw_key(generator)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        self._renderer.close()

    def _restart_ended(self, outcome: Outcome) -> Outcome:
        """The step of robots whose episode ended one step ago becomes their reset."""
        outcome = self.engine.restart(np.flatnonzero(self._done), outcome)
        outcome.rewards[self._done] = 0.0
        outcome.terminated[self._done] = False
        outcome.truncated[self._done] = False
        return outcome

    def _finals(self, outcome: Outcome, ended: Flags) -> dict[str, Any]:
        """Last observations and infos of episodes that end in this step."""
        observations = np.full(self.num_envs, None, dtype=object)
        for robot in np.flatnonzero(ended):
            observations[robot] = outcome.observations[robot].copy()
        final = self._masked(self.engine.info(np.where(ended, outcome.reports, 0.0)), ended)
        return {"final_obs": observations, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended.copy()}

    def _masked(self, infos: dict[str, Any], mask: Flags) -> dict[str, Any]:
        """Infos with a mask `_key` beside each key, an array of its own, as Gymnasium's vector environments have it.

        They are the rows of one array, since an allocation for each would take longer than the infos.
        """
        terms = infos["reward_terms"]
        names, inner = _mask_names(tuple(infos)), _mask_names(tuple(terms))
        count = len(names) + len(inner)
        table = np.ones((count, self.num_envs), np.bool_) if mask is self._everyone else np.tile(mask, (count, 1))
        masks: Iterator[Flags] = iter(table)
        terms.update(zip(inner, masks, strict=False))
        infos.update(zip(names, masks, strict=True))
        return infos


def _draw_key(generator: np.random.Generator) -> int:
    return int(generator.integers(2**63))


@cache
def _mask_names(keys: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"_{key}" for key in keys)
