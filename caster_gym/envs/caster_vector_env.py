"""Many robots at once as a Gymnasium VectorEnv, whatever their task: one compiled call a step."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from caster_gym.envs.drawing import Easel, checked_mode
from caster_gym.envs.setup import action_space, observation_space
from caster_gym.envs.task import Task
from caster_gym.envs.task_engine import DRAW_A_PATH, Outcome, TaskEngine

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]
DRAWN = 16  # robots of a batch at most


class CasterVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """What the batches of all tasks share; a subclass makes the engine of its task.

    Sub-environment i is seeded with seed + i. All of Gymnasium's autoreset modes are supported; with
    AutoresetMode.DISABLED, `reset(options={"reset_mask": mask})` restarts some.
    """

    # Gymnasium declares it for instances, so that mypy refuses the ClassVar which RUF012 asks for
    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, engine: TaskEngine, task: Task, autoreset_mode: AutoresetMode | str, render_mode: str | None
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
            "render_fps": round(1.0 / task.control_period),
        }
        self._easel = Easel(engine, self.render_mode, self.metadata["render_fps"])
        self.single_observation_space = observation_space(engine)
        self.single_action_space = action_space(engine)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._seeded = np.zeros(self.num_envs, dtype=np.bool_)
        self._started = False
        self._done: Flags = np.zeros(self.num_envs, dtype=np.bool_)
        self._observations: Observations = np.zeros((self.num_envs, engine.layout.size), dtype=np.float32)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start episodes of all robots, or of those in options["reset_mask"].

        options["path"] chooses trajectories by their index in the pool: one for all, or an array (num_envs,).
        """
        mask = self._mask(options)
        path = self.engine.checked_path((options or {}).get("path", DRAW_A_PATH))
        selected = np.flatnonzero(mask)
        for robot, chosen in zip(selected.tolist(), np.array(self._seeds(seed), dtype=object)[mask], strict=True):
            if chosen is not None or not self._seeded[robot]:
                generator, _ = seeding.np_random(chosen)
                self._seeded[robot] = True
                self.engine.seed(robot, int(generator.integers(2**63)))
        self._started = bool(self._seeded.all())
        self._done = self._done & ~mask
        outcome = self.engine.restart(selected, path=path[mask])
        self._observations = np.where(mask[:, None], outcome.observations, self._observations)
        if self.render_mode == "human":
            self.render()
        return self._observations, _masked(self.engine.info(outcome.reports), mask)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Hold actions (num_envs, driven joints) for a control period.

        Raises ValueError for a wrong shape or a value that is not a number.
        """
        given = np.asarray(actions, dtype=np.float32)
        if given.shape != self.action_space.shape:
            raise ValueError(f"actions must have shape {self.action_space.shape}, got {given.shape}")
        if np.isnan(given).any():
            raise ValueError(f"actions must hold numbers, got {given[np.isnan(given).any(axis=1)][0]}")
        if not self._started:
            raise RuntimeError("reset every robot before its first step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError(f"robot {int(self._done.argmax())} has ended its episode: reset it before the next step")
        outcome = self.engine.step(np.ascontiguousarray(given))
        infos: dict[str, Any] = {}
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._done.any():
            outcome = self._restart_ended(outcome)
        self._done = outcome.terminated | outcome.truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            infos = self._finals(outcome, self._done)
            outcome = self.engine.restart(np.flatnonzero(self._done), outcome)
        infos |= _masked(self.engine.info(outcome.reports), everyone)
        self._observations = outcome.observations
        if self.render_mode == "human":
            self.render()
        return outcome.observations, outcome.rewards, outcome.terminated, outcome.truncated, infos

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]  # Gymnasium's type has tuples of frames
        """The first 16 robots in a grid: one image (height, width, 3), or a window, as `render_mode` says.

        Gymnasium's RecordVideo for batches asks for a frame of each robot, and so cannot film this.
        """
        if not self._started:
            raise RuntimeError("reset every robot before they are drawn")
        return self._easel.show(range(min(self.num_envs, DRAWN)))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        self._easel.close()

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
        final = _masked(self.engine.info(np.where(ended, outcome.reports, 0.0)), ended)
        return {"final_obs": observations, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended.copy()}

    def _mask(self, options: dict[str, Any] | None) -> Flags:
        if options is None or "reset_mask" not in options:
            return np.ones(self.num_envs, dtype=np.bool_)
        mask = options["reset_mask"]
        if (
            not isinstance(mask, np.ndarray)
            or mask.dtype != np.bool_
            or mask.shape != (self.num_envs,)
            or not mask.any()
        ):
            raise ValueError(
                f"options['reset_mask'] must be a boolean array of shape ({self.num_envs},) with at least one True, "
                f"got {mask!r}"
            )
        return mask.copy()

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"seed must be one number or {self.num_envs} of them, got {len(seed)}")
        return list(seed)


def _masked(infos: dict[str, Any], mask: Flags) -> dict[str, Any]:
    """Infos with a mask `_key` beside each key, the same for all, as Gymnasium's vector environments give them."""
    result = infos | dict.fromkeys(_mask_names(tuple(infos)), mask)
    for key, value in infos.items():
        if isinstance(value, dict):
            result[key] = _masked(value, mask)
    return result


@cache
def _mask_names(keys: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"_{key}" for key in keys)


def check_counts(num_envs: int, max_episode_steps: int | None) -> None:
    """Refuse batches without robots and episodes without steps."""
    if num_envs < 1:
        raise ValueError(f"num_envs must be 1 or more, got {num_envs}")
    if max_episode_steps is not None and max_episode_steps < 1:
        raise ValueError(f"max_episode_steps must be 1 or more, got {max_episode_steps}")
