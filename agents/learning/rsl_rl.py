"""PPO by rsl-rl-lib on tensors: observations, rewards and networks never leave the device."""

import contextlib
import io
import math
from typing import Any

import torch
from gymnasium.error import DependencyNotInstalled
from torch import Tensor

from caster_gym.agents.comparison.finite_rewards import check_rewards
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.saved_state import (
    Snapshot,
    generator_arrays,
    generator_numbers,
    named,
    optimizer_arrays,
    restore_generators,
    restore_optimizer,
)
from caster_gym.agents.learning.settings import RslPPOSettings, scheduled
from caster_gym.agents.learning.tensors import torch_fields
from caster_gym.agents.learning.training_run import Run
from caster_gym.envs.plan import SPAN
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.states import AnyState, State, check_state, join_states, part_of, without

try:
    from rsl_rl.env import VecEnv
    from rsl_rl.runners import OnPolicyRunner
    from tensordict import TensorDict
except ImportError as error:
    raise DependencyNotInstalled("rsl-rl-lib is needed for this: pip install 'caster_gym[gpu]'") from error

GROUP = "policy"  # of observations, for actor and critic alike
CRITIC_WEIGHT, GREATEST_GRADIENT = 0.5, 0.5  # Stable-Baselines3's own, so that both PPOs are the same


class RslVecEnv(VecEnv):  # type: ignore[misc]  # comes without types
    """A `TorchVectorEnv` as rsl-rl-lib wants it. Robots whose episode ends start a new one in the same step."""

    def __init__(self, batch: TorchVectorEnv, seed: int) -> None:
        self.batch, self.cfg = batch, {"seed": seed}
        self.num_envs, self.device = batch.num_envs, batch.device
        (self.num_actions,) = batch.single_action_space.shape
        self.max_episode_length = int(batch.task.engine.plan.source.spans[:, SPAN.periods].max())
        self._lengths = torch.zeros(self.num_envs, dtype=torch.int64, device=self.device)
        self._seen, self._infos = batch.reset(seed=seed)
        self._doubt = torch.zeros(self.num_envs, device=self.device)

    @property
    def episode_length_buf(self) -> Tensor:
        """Control periods that the present episode of each robot has lasted (robots,)."""
        return self._lengths

    @episode_length_buf.setter
    def episode_length_buf(self, lengths: Tensor) -> None:
        raise AttributeError(
            "an episode is as long as its path: learn with init_at_random_ep_len=False, got lengths to begin with"
        )

    def get_observations(self) -> TensorDict:
        """What the robots see now."""
        return TensorDict({GROUP: self._seen}, batch_size=[self.num_envs], device=self.device)

    def step(self, actions: Tensor) -> tuple[TensorDict, Tensor, Tensor, dict[str, Any]]:
        """Observations, rewards, ends of episodes (1 or 0), and which of them were only a matter of time."""
        self._seen, rewards, terminated, truncated, infos = self.batch.step(actions)
        self._infos, self._doubt = infos, self._doubt + (rewards - rewards)  # not 0 once one is not finite
        ended = terminated | truncated
        self._lengths = torch.where(ended, 0, self._lengths + 1)
        log = {"/position_error": infos["position_error"]}
        return self.get_observations(), rewards, ended.long(), {"time_outs": truncated & ~terminated, "log": log}

    def check_rewards(self) -> None:
        """Refuse rewards of steps so far that were not finite; to look in each step would wait for the device."""
        check_rewards(self.batch.task.definition, self._doubt, lambda: self._infos)

    def get_state(self) -> State:
        """Copies of all that the batch goes on from, on the CPU, as a flat dictionary of arrays."""
        own = {"lengths": self._lengths.cpu().numpy().copy(), "seen": self._seen.cpu().numpy().copy()}
        return own | join_states(batch=self.batch.get_state())

    def set_state(self, state: AnyState) -> None:
        """Go on as the batch did whose `get_state` gave the state; see `TorchVectorEnv.set_state`."""
        check_state("the batch for rsl-rl-lib", without(state, "batch"), without(self.get_state(), "batch"))
        self.batch.set_state(part_of(state, "batch"))
        self._lengths = torch.tensor(state["lengths"], device=self.device)
        self._seen = torch.tensor(state["seen"], device=self.device)


def make_runner(settings: RslPPOSettings, environment: RslVecEnv, seed: int) -> OnPolicyRunner:
    """rsl-rl-lib's PPO with our settings, its networks begun as Stable-Baselines3 begins them."""
    torch.manual_seed(seed)
    network = {"class_name": "MLPModel", "hidden_dims": list(settings.net_arch), "activation": "relu"}
    spread = {"class_name": "GaussianDistribution", "init_std": math.exp(settings.log_std_init), "std_type": "log"}
    configuration = {
        "num_steps_per_env": settings.n_steps,
        "check_for_nan": False,  # to look in each step would wait for the device
        "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
        "actor": {**network, "distribution_cfg": spread},
        "critic": network,
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": settings.n_epochs,
            "num_mini_batches": settings.n_envs * settings.n_steps // settings.batch_size,
            "clip_param": settings.clip_range,
            "gamma": settings.gamma,
            "lam": settings.gae_lambda,
            "value_loss_coef": CRITIC_WEIGHT,
            "entropy_coef": settings.ent_coef,
            "learning_rate": scheduled(settings.learning_rate, 1.0),
            "max_grad_norm": GREATEST_GRADIENT,
            "use_clipped_value_loss": False,
            "schedule": "fixed",
            "normalize_advantage_per_mini_batch": True,
        },
    }
    with contextlib.redirect_stdout(io.StringIO()):  # it prints its networks
        runner = OnPolicyRunner(environment, configuration, log_dir=None, device=str(environment.device))
    for model, gain in ((runner.alg.actor, 0.01), (runner.alg.critic, 1.0)):
        gains = [math.sqrt(2.0)] * (len(model.mlp) - 1)
        model.mlp.init_weights([*gains, gain])
    return runner


def actor_of(runner: OnPolicyRunner, settings: RslPPOSettings) -> Actor:
    """The deterministic part of the policy, with a copy of its weights on the CPU."""
    linear = [layer for layer in runner.alg.get_policy().mlp if isinstance(layer, torch.nn.Linear)]
    actor = Actor(linear[0].in_features, settings.net_arch, linear[-1].out_features, "clip")
    for ours, theirs in zip([*actor.layers, actor.head], linear, strict=True):
        ours.load_state_dict({name: tensor.detach().cpu().clone() for name, tensor in theirs.state_dict().items()})
    return actor


def take(runner: OnPolicyRunner, environment: RslVecEnv) -> Snapshot:
    """All that is needed to go on from between two rounds."""
    arrays = {
        **named("actor", runner.alg.actor.state_dict()),
        **named("critic", runner.alg.critic.state_dict()),
        **optimizer_arrays("optimizer", runner.alg.optimizer),
        **named("environment", environment.get_state()),
        **generator_arrays(environment.device),
    }
    return Snapshot(arrays, {"generators": generator_numbers()})


def restore(runner: OnPolicyRunner, environment: RslVecEnv, kept: Snapshot) -> None:
    """Let a learner and its robots be as when a state was taken."""
    runner.alg.actor.load_state_dict(kept.tensors("actor"))
    runner.alg.critic.load_state_dict(kept.tensors("critic"))
    restore_optimizer(runner.alg.optimizer, kept, "optimizer")
    environment.set_state(kept.within("environment"))
    restore_generators(kept, environment.device)


def learn_with_rsl_rl(run: Run, settings: RslPPOSettings) -> None:
    """Train on tensors."""
    environment = RslVecEnv(
        TorchVectorEnv(
            run.task.environment,
            settings.n_envs,
            device=settings.device,
            compile=settings.compile,
            **torch_fields(run.task),
            **run.task.task.model_dump(),
        ),
        run.seed,
    )
    runner = make_runner(settings, environment, run.seed)
    if run.saved is not None:
        restore(runner, environment, run.saved)
    steps, round_ = run.steps, settings.n_envs * settings.n_steps
    try:
        while steps < settings.n_timesteps:
            run.advance(steps, lambda: actor_of(runner, settings))
            run.save(steps, lambda: take(runner, environment))
            rate = scheduled(settings.learning_rate, 1.0 - steps / settings.n_timesteps)
            runner.alg.learning_rate = rate
            for group in runner.alg.optimizer.param_groups:
                group["lr"] = rate
            runner.learn(1)
            environment.check_rewards()
            steps += round_
            std = runner.alg.get_policy().distribution.log_std_param.detach().exp().mean().item()
            run.record(steps, {"train/learning_rate": rate, "train/std": std})
    finally:
        run.finish(steps, lambda: actor_of(runner, settings))
