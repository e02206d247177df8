"""Learning by Stable-Baselines3, on the native batch of NumPy arrays."""

from typing import Any

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from caster_gym.agents.comparison.evaluation import training_batch
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.settings import PPOSettings, SACSettings
from caster_gym.agents.learning.training_run import Run


def make_learner(settings: PPOSettings | SACSettings, environment: SB3VecEnv, seed: int) -> BaseAlgorithm:
    """A fresh SB3 algorithm."""
    rate = settings.learning_rate
    schedule = (lambda remaining: rate * max(remaining, 0.0)) if settings.falling else rate
    policy: dict[str, Any] = {"net_arch": list(settings.hidden), "activation_fn": torch.nn.ReLU}
    if isinstance(settings, PPOSettings):
        return PPO(
            "MlpPolicy",
            environment,
            learning_rate=schedule,
            n_steps=settings.horizon,
            batch_size=settings.batch,
            n_epochs=settings.epochs,
            gamma=settings.discount,
            gae_lambda=settings.trace,
            clip_range=settings.clip,
            ent_coef=settings.entropy,
            policy_kwargs={**policy, "log_std_init": settings.initial_log_std},
            seed=seed,
            device="cpu",
        )
    return SAC(
        "MlpPolicy",
        environment,
        learning_rate=schedule,
        buffer_size=settings.buffer,
        learning_starts=settings.first_random,
        batch_size=settings.batch,
        tau=settings.soft_update,
        gamma=settings.discount,
        train_freq=1,
        gradient_steps=settings.updates,
        ent_coef=f"auto_{settings.entropy}",
        target_entropy=settings.target_entropy * environment.actions,
        policy_kwargs=policy,
        seed=seed,
        device="cpu",
    )


def actor_of(learner: BaseAlgorithm, settings: PPOSettings | SACSettings) -> Actor:
    """The deterministic part of a learner's policy, with a copy of its weights."""
    policy: Any = learner.policy
    if isinstance(learner, PPO):
        layers, head, squash = policy.mlp_extractor.policy_net, policy.action_net, "clip"
    else:
        layers, head, squash = policy.actor.latent_pi, policy.actor.mu, "tanh"
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    actor = Actor(linear[0].in_features, settings.hidden, head.out_features, "tanh" if squash == "tanh" else "clip")
    for ours, theirs in zip([*actor.layers, actor.head], [*linear, head], strict=True):
        ours.load_state_dict({name: tensor.clone() for name, tensor in theirs.state_dict().items()})
    return actor


class Watcher(BaseCallback):
    """Tells a run how far SB3 is."""

    def __init__(self, run: Run, settings: PPOSettings | SACSettings) -> None:
        super().__init__()
        self.run, self.settings = run, settings

    def _on_step(self) -> bool:
        if isinstance(self.model, SAC):
            self._watch()
        return True

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, SAC):
            self._watch()

    def _watch(self) -> None:
        self.run.advance(self.num_timesteps, lambda: actor_of(self.model, self.settings))


def learn_with_sb3(run: Run, settings: PPOSettings | SACSettings) -> None:
    """Train on the native batch of NumPy arrays."""
    learner = make_learner(settings, SB3VecEnv(training_batch(run.task, settings.robots)), run.seed)
    learner.set_logger(run.logger)
    try:
        learner.learn(settings.steps, callback=Watcher(run, settings))
    except ValueError as error:
        if "of distribution" in str(error):  # as Torch says of actions that are drawn from no numbers
            run.diverged(learner.num_timesteps, error)
        raise
    finally:
        run.finish(learner.num_timesteps, lambda: actor_of(learner, settings))
