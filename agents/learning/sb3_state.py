"""All that a learner of Stable-Baselines3 needs to go on, bit for bit, in another process.

It is taken and given back between two rounds of collecting and learning, where no step is under way and the roll-out
buffer of PPO is empty.
"""

from collections import deque
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger

from caster_gym.agents.learning.progress import plain
from caster_gym.agents.learning.replay_files import ReplayFiles
from caster_gym.agents.learning.saved_state import (
    Snapshot,
    generator_arrays,
    generator_numbers,
    named,
    optimizer_arrays,
    restore_generators,
    restore_optimizer,
)
from caster_gym.agents.learning.sb3_environment import SB3VecEnv

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")


class SB3State:
    """Takes and gives back the state of a learner whose environment is an `SB3VecEnv`.

    folder: of the files of a replay buffer. kept: the state that the learner is to go on from, if it is; it is given
    back by `restore`.
    """

    def __init__(self, learner: BaseAlgorithm, folder: Path, kept: Snapshot | None) -> None:
        self.learner, self._kept = learner, kept
        self._replay: ReplayFiles | None = None
        if isinstance(learner, SAC):
            assert learner.replay_buffer is not None
            self._replay = ReplayFiles(folder, learner.replay_buffer, kept.numbers["replay"] if kept else None)

    def take(self) -> Snapshot:
        """Everything as it is now, but for the transitions of a replay buffer, which are in files of their own."""
        learner: Any = self.learner
        arrays = {
            **named("policy", learner.policy.state_dict()),
            **named("environment", _environment(learner).get_state()),
            **named("last", {"observations": learner._last_obs, "starts": learner._last_episode_starts}),
            **generator_arrays(),
        }
        for name, optimizer in _optimizers(learner).items():
            arrays |= optimizer_arrays(name, optimizer)
        if getattr(learner, "log_ent_coef", None) is not None:
            arrays |= named("entropy", {"log_ent_coef": learner.log_ent_coef})
        numbers: dict[str, Any] = {
            "counters": {name: getattr(learner, name) for name in COUNTERS},
            "episodes": list(learner.ep_info_buffer),
            "generators": generator_numbers(),
            "random_actions": learner.action_space.np_random.bit_generator.state,
            "logger": _logger_numbers(learner.logger),
        }
        if self._replay is not None:
            numbers["replay"] = self._replay.save(learner.num_timesteps // learner.n_envs)
        return Snapshot(arrays, numbers)

    def saved(self) -> None:
        """What was taken last is on the disk: files that it does not need are removed."""
        if self._replay is not None:
            self._replay.remove_old()

    def restore(self) -> None:
        """Let the learner be as it was when the state that is kept was taken."""
        learner: Any = self.learner
        if self._kept is None:
            return
        state, self._kept = self._kept, None
        learner.policy.load_state_dict(state.tensors("policy"))
        for name, optimizer in _optimizers(learner).items():
            restore_optimizer(optimizer, state, name)
        for name, tensor in state.tensors("entropy").items():
            with torch.no_grad():
                getattr(learner, name).copy_(tensor)
        _environment(learner).set_state(state.within("environment"))
        last = state.within("last")
        learner._last_obs, learner._last_episode_starts = last["observations"], last["starts"]
        for name, number in state.numbers["counters"].items():
            setattr(learner, name, number)
        learner._num_timesteps_at_start = learner.num_timesteps
        learner.ep_info_buffer = deque(state.numbers["episodes"], learner.ep_info_buffer.maxlen)
        learner.action_space.np_random.bit_generator.state = state.numbers["random_actions"]
        for name, content in state.numbers["logger"].items():
            getattr(learner.logger, name).update(content)
        restore_generators(state)


def _environment(learner: Any) -> SB3VecEnv:
    environment = learner.get_env()
    assert isinstance(environment, SB3VecEnv)
    return environment


def _optimizers(learner: Any) -> dict[str, torch.optim.Optimizer]:
    if isinstance(learner, PPO):
        return {"optimizer": learner.policy.optimizer}
    some = {"actor_optimizer": learner.actor.optimizer, "critic_optimizer": learner.critic.optimizer}
    if learner.ent_coef_optimizer is not None:
        some["entropy_optimizer"] = learner.ent_coef_optimizer
    return some


def _logger_numbers(logger: Logger) -> dict[str, dict[str, Any]]:
    """What the logger was told since it last wrote."""
    return {
        "name_to_value": {name: plain(value) for name, value in logger.name_to_value.items()},
        "name_to_count": dict(logger.name_to_count),
        "name_to_excluded": {name: list(value) for name, value in logger.name_to_excluded.items()},
    }
