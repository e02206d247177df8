"""The native batch of robots as a Stable-Baselines3 VecEnv."""

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from caster_gym.agents.comparison.evaluation import Batch, bare
from caster_gym.agents.comparison.finite_rewards import check_rewards
from caster_gym.states import AnyState, State, check_state, join_states, part_of, read_seeds, seed_arrays, without


class SB3VecEnv(VecEnv):
    """A batch of robots with SB3's conventions: same-step reset, one info dictionary per robot.

    Infos hold what SB3 needs, at the end of episodes only: `terminal_observation`, `TimeLimit.truncated`, and `episode`
    with its return `r`, length `l`, mean position error and failure. All quantities are in `last_infos` as arrays.

    >>> import caster_gym, gymnasium
    >>> from stable_baselines3 import PPO
    >>> batch = gymnasium.make_vec("caster_gym:CasterTrack-v0", num_envs=16, autoreset_mode="SameStep")
    >>> model = PPO("MlpPolicy", caster_gym.SB3VecEnv(batch), n_steps=4, batch_size=64, n_epochs=1, device="cpu")
    >>> model.learn(total_timesteps=64).num_timesteps
    64
    """

    def __init__(self, batch: Batch) -> None:
        if batch.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"SB3 needs AutoresetMode.SAME_STEP, got {batch.autoreset_mode}")
        self.batch = batch
        self.last_infos: dict[str, Any] = {}
        self._returns = np.zeros(batch.num_envs)
        self._errors = np.zeros(batch.num_envs)
        self._lengths = np.zeros(batch.num_envs, dtype=np.int64)
        self._actions: NDArray[np.float32] = np.zeros(0, dtype=np.float32)
        super().__init__(batch.num_envs, batch.single_observation_space, batch.single_action_space)
        # SB3 knows no grid, and puts the images that it gets side by side
        self.render_mode = "rgb_array" if batch.render_mode == "grid" else batch.render_mode

    @property
    def actions(self) -> int:
        """Number of actions of a robot."""
        return int(np.prod(self.batch.single_action_space.shape or ()))

    def reset(self) -> VecEnvObs:
        """Start episodes of all robots, with the seeds given by `seed` if any."""
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observations, self.last_infos = self.batch.reset(seed=seeds)
        self._reset_seeds()
        self._reset_options()
        self._returns[:], self._errors[:], self._lengths[:] = 0.0, 0.0, 0
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep a copy of the actions for `step_wait`."""
        self._actions = np.array(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """Observations, float32 rewards, dones and infos of one control period."""
        observations, rewards, terminated, truncated, infos = self.batch.step(self._actions)
        check_rewards(bare(self.batch).definition, rewards, lambda: infos)
        done = terminated | truncated
        final = infos.get("final_info", {})
        error = np.where(done, final["position_error"], infos["position_error"]) if final else infos["position_error"]
        self._returns += rewards
        self._errors += np.where(np.isfinite(error), error, bare(self.batch).task.corridor)
        self._lengths += 1
        self.last_infos = infos
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(done)
        for robot in ended:
            length = int(self._lengths[robot])
            each[robot] = {
                "terminal_observation": infos["final_obs"][robot],
                "TimeLimit.truncated": bool(truncated[robot] and not terminated[robot]),
                "episode": {
                    "r": float(self._returns[robot]),
                    "l": length,
                    "position_error": float(self._errors[robot]) / length,
                    "failed": bool(terminated[robot]),
                },
            }
        if len(ended):
            self._returns[done], self._errors[done], self._lengths[done] = 0.0, 0.0, 0
        return observations, rewards.astype(np.float32), done, each

    def get_state(self) -> State:
        """Copies of all that the batch goes on from between two steps, as a flat dictionary of arrays."""
        sums = {"returns": self._returns.copy(), "errors": self._errors.copy(), "lengths": self._lengths.copy()}
        return sums | join_states(seeds=seed_arrays(self._seeds), batch=self.batch.get_state())

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the batch did whose `get_state` gave the state: also in another process.

        Raises ValueError, with nothing changed, for a state of a batch that was made in another way. `last_infos` is
        empty until the next step.
        """
        self.batch.check_state(part_of(state, "batch"))
        check_state("the batch for SB3", without(state, "batch"), without(self.get_state(), "batch"))
        self.batch.set_state(part_of(state, "batch"))
        self._returns[:], self._errors[:] = state["returns"], state["errors"]
        self._lengths[:] = state["lengths"]
        self._seeds = read_seeds(part_of(state, "seeds"))
        self.last_infos = {}

    def close(self) -> None:
        """Release the batch."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the batch, once for each robot asked for."""
        owner = self.batch if hasattr(self.batch, attr_name) else self.batch.unwrapped
        return [getattr(owner, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Not possible: the robots of a batch have no attributes of their own."""
        raise AttributeError(f"robots of a batch share their attributes: {attr_name!r} cannot be set on some")

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Not possible: the robots of a batch have no methods of their own."""
        raise AttributeError(f"robots of a batch are no environments: {method_name!r} cannot be called on them")

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """No robot of a batch is wrapped."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A frame of each robot, one of the grid if the batch draws that, or None where it draws none."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        drawn = bare(self.batch).render()
        return list(drawn) if isinstance(drawn, tuple) else [drawn]

    def _get_indices(self, indices: VecEnvIndices) -> Iterable[int]:
        return super()._get_indices(indices)
