"""Learning by Stable-Baselines3, on the native batch of NumPy arrays."""

from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from caster_gym.agents.comparison.evaluation import training_batch
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.sb3_state import SB3State
from caster_gym.agents.learning.settings import LinearSchedule, PPOSettings, SACSettings
from caster_gym.agents.learning.training_run import Run


def make_learner(settings: PPOSettings | SACSettings, environment: VecEnv, seed: int) -> BaseAlgorithm:
    """A fresh SB3 algorithm."""
    rate = settings.learning_rate
    policy: dict[str, Any] = {"net_arch": list(settings.net_arch), "activation_fn": torch.nn.ReLU}
    shared: dict[str, Any] = {
        "policy": "MlpPolicy",
        "env": environment,
        "learning_rate": rate.at if isinstance(rate, LinearSchedule) else rate,
        "batch_size": settings.batch_size,
        "gamma": settings.gamma,
        "ent_coef": settings.ent_coef,
        "seed": seed,
        "device": "cpu",
    }
    if isinstance(settings, PPOSettings):
        return RoundsCounted(
            **shared,
            n_steps=settings.n_steps,
            n_epochs=settings.n_epochs,
            gae_lambda=settings.gae_lambda,
            clip_range=settings.clip_range,
            policy_kwargs={**policy, "log_std_init": settings.log_std_init},
        )
    return SAC(
        **shared,
        buffer_size=settings.buffer_size,
        learning_starts=settings.learning_starts,
        tau=settings.tau,
        train_freq=settings.train_freq,
        gradient_steps=settings.gradient_steps,
        target_entropy=settings.target_entropy_per_motor * int(np.prod(environment.action_space.shape or ())),
        policy_kwargs=policy,
    )


def actor_of(learner: BaseAlgorithm, settings: PPOSettings | SACSettings) -> Actor:
    """The deterministic part of a learner's policy, with a copy of its weights."""
    policy: Any = learner.policy
    if isinstance(learner, PPO):
        layers, head = policy.mlp_extractor.policy_net, policy.action_net
    else:
        layers, head = policy.actor.latent_pi, policy.actor.mu
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    squash: Literal["clip", "tanh"] = "clip" if isinstance(learner, PPO) else "tanh"
    actor = Actor(linear[0].in_features, settings.net_arch, head.out_features, squash)
    for ours, theirs in zip([*actor.layers, actor.head], [*linear, head], strict=True):
        ours.load_state_dict({name: tensor.clone() for name, tensor in theirs.state_dict().items()})
    return actor


class RoundsCounted(PPO):
    """PPO that counts its rounds from the first step on, also when it goes on where another process stopped."""

    def dump_logs(self, iteration: int = 0) -> None:
        """Write what was recorded."""
        super().dump_logs(self.num_timesteps // (self.n_steps * self.n_envs))


class Watcher(BaseCallback):
    """Tells a run how far SB3 is, and saves and gives back its state between rounds."""

    def __init__(self, run: Run, settings: PPOSettings | SACSettings, state: SB3State) -> None:
        super().__init__()
        self.run, self.settings, self.state = run, settings, state

    def _on_training_start(self) -> None:
        self.state.restore()

    def _on_step(self) -> bool:
        if isinstance(self.model, SAC):
            self._watch()
        return True

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, SAC):
            self._watch()
        if self.run.save(self.model.num_timesteps, self.state.take):
            self.state.saved()

    def _watch(self) -> None:
        self.run.advance(self.model.num_timesteps, lambda: actor_of(self.model, self.settings))


def learn_with_sb3(run: Run, settings: PPOSettings | SACSettings) -> None:
    """Train on the native batch of NumPy arrays."""
    learner = make_learner(settings, SB3VecEnv(training_batch(run.task, settings.n_envs)), run.seed)
    learner.set_logger(run.logger)
    state = SB3State(learner, run.state_folder, run.saved)
    try:
        learner.learn(settings.n_timesteps, callback=Watcher(run, settings, state))
    except ValueError as error:
        if "of distribution" in str(error):  # as Torch says of actions that are drawn from no numbers
            run.diverged(learner.num_timesteps, error)
        raise
    finally:
        run.finish(learner.num_timesteps, lambda: actor_of(learner, settings))
