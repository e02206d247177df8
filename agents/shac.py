"""Short-horizon actor-critic (Xu et al., 2022): the policy climbs its own return's gradient, through the simulator.

The robots run for a short window under the policy. What they earn in it, plus what a critic expects of the states at
its end, is a smooth function of the policy's weights, and `TorchTask` passes its gradient back through every period.
The critic learns from the same window, from targets of TD(λ), and a slowly following copy of it looks beyond the end.
"""

import copy
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

from caster_gym.envs.torch_task import TaskOutcome, TaskState, TorchTask

from .actor import Actor
from .settings import SHACSettings
from .tensors import torch_fields
from .training import Run


class Window(NamedTuple):
    """What a critic learns from; first axis: control periods."""

    observations: Tensor  # (window, robots, size)
    rewards: Tensor  # (window, robots)
    after: Tensor  # (window, robots) what the target critic expects at the end of each period, 0 where all is over
    ended: Tensor  # bool (window, robots)


class ShortHorizon:
    """A policy, its critic, and the robots on which both learn."""

    def __init__(self, task: TorchTask, settings: SHACSettings, seed: int) -> None:
        torch.manual_seed(seed)
        size, actions = task.layout.size, len(task.robot.driven)
        self.task, self.settings = task, settings
        self.actor = Actor(size, settings.hidden, actions, "tanh").to(task.device, task.dtype)
        _begin_gently(self.actor.head)
        self.critic = _critic(size, settings.hidden).to(task.device, task.dtype)
        self.target = copy.deepcopy(self.critic).requires_grad_(False)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), settings.learning_rate)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), settings.critic_learning_rate)
        keys = torch.randint(2**63 - 1, (settings.robots,), dtype=torch.int64).to(task.device)
        self.state, outcome = task.begin(keys)
        self.observations = outcome.observations

    def improve(self, progress: float) -> dict[str, float]:
        """One window and one step of both; progress of the training, 0 … 1. Returns what is worth recording."""
        left = 1.0 - progress if self.settings.falling else 1.0
        self._set_rate(self.actor_optimizer, left * self.settings.learning_rate)
        self._set_rate(self.critic_optimizer, left * self.settings.critic_learning_rate)
        gain, window = self.gain()
        self.actor_optimizer.zero_grad()
        torch.autograd.backward(-gain)
        norm = nn.utils.clip_grad_norm_(self.actor.parameters(), self.settings.greatest_gradient)
        if bool(torch.isfinite(norm)):  # a robot that blew up must not take the policy with it
            self.actor_optimizer.step()
        loss = self._teach_critic(window)
        return {
            "reward": float(window.rewards.mean()),
            "gradient": float(norm),
            "critic_loss": loss,
            "learning_rate": left * self.settings.learning_rate,
        }

    def gain(self) -> tuple[Tensor, Window]:
        """Mean discounted return per period of a window under the present policy, and the window.

        The robots have moved on afterwards, and carry no gradient into the next window.
        """
        discount = self.settings.discount
        state, observations = self.state.detached(), self.observations.detach()
        total = torch.zeros((), dtype=self.task.dtype, device=self.task.device)
        weight = torch.ones_like(state.progress)
        seen, rewards, after, ended = [], [], [], []
        for k in range(self.settings.window):
            seen.append(observations.detach())
            state, outcome = self.task.step(state, self._explore(observations))
            value = torch.where(outcome.terminated, 0.0, self.target(outcome.observations)[:, 0])
            over = outcome.ended if k < self.settings.window - 1 else torch.ones_like(outcome.ended)
            total = total + (weight * outcome.rewards + torch.where(over, discount * weight * value, 0.0)).sum()
            weight = torch.where(over, 1.0, discount * weight)
            rewards.append(outcome.rewards.detach())
            after.append(value.detach())
            ended.append(outcome.ended)
            state, observations = self._begin_again(state, outcome)
        self.state, self.observations = state.detached(), observations.detach()
        window = Window(torch.stack(seen), torch.stack(rewards), torch.stack(after), torch.stack(ended))
        return total / (self.settings.window * self.settings.robots), window

    def _explore(self, observations: Tensor) -> Tensor:
        actions: Tensor = self.actor(observations)
        return actions + self.settings.noise * torch.randn_like(actions) if self.settings.noise else actions

    def _begin_again(self, state: TaskState, outcome: TaskOutcome) -> tuple[TaskState, Tensor]:
        """New episodes where they have ended, if any has."""
        if bool(outcome.ended.any()):
            state, outcome = self.task.restart(state, outcome)
        return state, outcome.observations

    def _teach_critic(self, window: Window) -> float:
        """Several passes over the window in batches drawn at random; returns the mean loss of the last one."""
        size = self.settings.critic_batch
        observations = window.observations.flatten(0, 1)
        targets = td_lambda(window, self.settings.discount, self.settings.trace).flatten()
        losses: list[Tensor] = []
        for _ in range(self.settings.critic_epochs):
            losses = []
            for batch in torch.split(torch.randperm(len(targets), device=targets.device), size):
                loss = (self.critic(observations[batch])[:, 0] - targets[batch]).square().mean()
                self.critic_optimizer.zero_grad()
                torch.autograd.backward(loss)
                nn.utils.clip_grad_norm_(self.critic.parameters(), self.settings.greatest_gradient)
                self.critic_optimizer.step()
                losses.append(loss.detach())
        with torch.no_grad():
            for slow, fast in zip(self.target.parameters(), self.critic.parameters(), strict=True):
                slow.lerp_(fast, self.settings.soft_update)
        return float(torch.stack(losses).mean())

    @staticmethod
    def _set_rate(optimizer: torch.optim.Optimizer, rate: float) -> None:
        for group in optimizer.param_groups:
            group["lr"] = rate


def td_lambda(window: Window, discount: float, trace: float) -> Tensor:
    """Targets of TD(λ) (window, robots): returns that trust the critic more the later it is asked."""
    targets = torch.empty_like(window.rewards)
    following = window.after[-1]
    for k in reversed(range(len(targets))):
        mixed = (1.0 - trace) * window.after[k] + trace * following
        following = window.rewards[k] + discount * torch.where(window.ended[k], window.after[k], mixed)
        targets[k] = following
    return targets


def learn_through_simulator(run: Run, settings: SHACSettings) -> None:
    """Train on tensors."""
    task = TorchTask(
        run.task.environment,
        fields=run.task.task.model_dump(),
        device=settings.device,
        compile=settings.compile,
        **torch_fields(run.task),
    )
    learner = ShortHorizon(task, settings, run.seed)
    steps = 0
    try:
        while steps < settings.steps:
            run.advance(steps, lambda: frozen(learner.actor))
            facts = learner.improve(steps / settings.steps)
            steps += settings.window * settings.robots
            for name, value in facts.items():
                run.logger.record(f"train/{name}", value)
            run.logger.dump(steps)
    finally:
        run.finish(steps, lambda: frozen(learner.actor))


def frozen(actor: Actor) -> Actor:
    """A copy of a policy on the CPU that does not learn any more."""
    return copy.deepcopy(actor).to("cpu", torch.float32).requires_grad_(False)


def _critic(size: int, hidden: tuple[int, ...]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise((size, *hidden)):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers, nn.Linear(hidden[-1], 1))


def _begin_gently(head: nn.Linear) -> None:
    """A fresh policy hardly pushes, so that its first windows stay on the path."""
    with torch.no_grad():
        head.weight *= 0.01
        head.bias.zero_()
