"""Short-horizon actor-critic (Xu et al., 2022): follows the gradient of the return through the simulator.

The robots run for a short window under the policy. What they earn in it, plus what a critic expects of the states at
its end, is a smooth function of the policy's weights, and `TorchTask` passes its gradient back through every period.
The critic learns from the same window, from targets of TD(λ), and a slowly following copy of it looks beyond the end.
Before each window some robots, drawn at random, start anew: otherwise all would be in the same part of an episode at
the same time, and what is hardest, the first second from a start with the casters turned anyhow, would be rare.
"""

import copy
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

from caster_gym import load_robot
from caster_gym.agents.comparison.finite_rewards import check_rewards
from caster_gym.agents.comparison.task_settings import TaskSettings
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
from caster_gym.agents.learning.settings import SHACSettings, scheduled
from caster_gym.agents.learning.tensors import check_compiler, torch_fields
from caster_gym.agents.learning.training_run import Run
from caster_gym.engines.time_step import longest_time_step, substeps_for
from caster_gym.envs.tensor.state import TaskOutcome, TaskState
from caster_gym.envs.tensor.task import TorchTask

MOMENTA = (0.7, 0.95)  # of the policy's Adam, as the paper has them: gradients through a simulator scatter little


class Window(NamedTuple):
    """What a critic learns from; first axis: control periods."""

    observations: Tensor  # (window, robots, size)
    rewards: Tensor  # (window, robots)
    after: Tensor  # (window, robots) what the target critic expects at the end of each period, 0 where all is over
    ended: Tensor  # bool (window, robots)


class Critic(nn.Module):
    """Discounted rewards expected from what robots observe on, learned as their mean: a number near 1."""

    def __init__(self, inputs: int, hidden: tuple[int, ...], discount: float) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise((inputs, *hidden)):
            layers += [nn.Linear(before, after), nn.ReLU()]
        head = nn.Linear(hidden[-1], 1)
        with torch.no_grad():
            head.weight *= 0.1
            head.bias.fill_(0.5)
        self.mean, self.periods = nn.Sequential(*layers, head), 1.0 / (1.0 - discount)

    def forward(self, observations: Tensor) -> Tensor:
        """Expected returns (…) for observations (…, size)."""
        returns: Tensor = self.periods * self.mean(observations)[..., 0]
        return returns

    def loss(self, observations: Tensor, returns: Tensor) -> Tensor:
        """Mean square error of the mean rewards."""
        loss: Tensor = ((self(observations) - returns) / self.periods).square().mean()
        return loss


class ShortHorizon:
    """A policy, its critic, and the robots on which both learn."""

    def __init__(self, task: TorchTask, settings: SHACSettings, seed: int) -> None:
        torch.manual_seed(seed)
        size, actions = task.layout.size, len(task.robot.driven)
        self.task, self.settings = task, settings
        self.actor = Actor(size, settings.net_arch, actions, "tanh").to(task.device, task.dtype)
        self.critic = Critic(size, settings.net_arch, settings.gamma).to(task.device, task.dtype)
        self.target = copy.deepcopy(self.critic).requires_grad_(False)
        # `improve` sets the rates
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), betas=MOMENTA, fused=True)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), fused=True)
        keys = torch.randint(2**63 - 1, (settings.n_envs,), dtype=torch.int64).to(task.device)
        self.state, self.outcome = task.begin(keys)

    def improve(self, progress: float) -> dict[str, float]:
        """One window and one step of both; progress of the training, 0 … 1. Returns what is worth recording."""
        rate = scheduled(self.settings.learning_rate, 1.0 - progress)
        self._set_rate(self.actor_optimizer, rate)
        self._set_rate(self.critic_optimizer, scheduled(self.settings.critic_learning_rate, 1.0 - progress))
        self.start_some_anew()
        gain, window = self.gain()
        self.actor_optimizer.zero_grad()
        torch.autograd.backward(-gain)
        norm = nn.utils.clip_grad_norm_(self.actor.parameters(), self.settings.max_grad_norm)
        if bool(torch.isfinite(norm)):  # a robot that blew up must not take the policy with it
            self.actor_optimizer.step()
        loss = self.teach_critic(window)
        return {
            "reward": float(window.rewards.mean()),
            "gradient": float(norm),
            "critic_loss": loss,
            "learning_rate": rate,
        }

    def take(self) -> Snapshot:
        """All that is needed to go on from between two windows."""
        arrays = generator_arrays(self.task.device)
        for name, module in self._networks.items():
            arrays |= named(name, module.state_dict())
        arrays |= optimizer_arrays("actor_optimizer", self.actor_optimizer)
        arrays |= optimizer_arrays("critic_optimizer", self.critic_optimizer)
        arrays |= named("robots", self.state._asdict()) | named("outcome", self.outcome._asdict())
        return Snapshot(arrays, {"generators": generator_numbers()})

    def restore(self, kept: Snapshot) -> None:
        """Be as when a state was taken."""
        for name, module in self._networks.items():
            module.load_state_dict(kept.tensors(name))
        restore_optimizer(self.actor_optimizer, kept, "actor_optimizer")
        restore_optimizer(self.critic_optimizer, kept, "critic_optimizer")
        robots, outcome = (
            {key: one.to(self.task.device) for key, one in kept.tensors(part).items()} for part in ("robots", "outcome")
        )
        self.state, self.outcome = TaskState(**robots), TaskOutcome(**outcome)
        restore_generators(kept, self.task.device)

    @property
    def _networks(self) -> dict[str, nn.Module]:
        return {"actor": self.actor, "critic": self.critic, "target": self.target}

    def start_some_anew(self) -> None:
        """A new episode for each robot with the probability that the settings say."""
        chosen = torch.rand(self.settings.n_envs, device=self.task.device) < self.settings.restarts
        if bool(chosen.any()):
            self.state, self.outcome = self.task.restart(self.state, self.outcome, where=chosen)

    def gain(self) -> tuple[Tensor, Window]:
        """Mean discounted return per period of a window under the present policy, and the window.

        The robots have moved on afterwards, and carry no gradient into the next window.
        """
        discount, last = self.settings.gamma, self.settings.n_steps - 1
        state, outcome = self.state, self.outcome
        total = torch.zeros((), dtype=self.task.dtype, device=self.task.device)
        weight = torch.ones_like(state.progress)
        seen, met = [], []
        for k in range(self.settings.n_steps):
            seen.append(outcome.observations.detach())
            state, outcome = self.task.step(state, self._explore(outcome.observations))
            check_rewards(self.task.definition, outcome.rewards.detach(), partial(self.task.info, outcome.report))
            ended = outcome.ended
            met.append((outcome.observations.detach(), outcome.rewards.detach(), outcome.terminated, ended))
            total = total + (weight * outcome.rewards).sum()
            weight = discount * weight
            any_ended = bool(ended.any())
            if any_ended or k == last:
                over = torch.ones_like(ended) if k == last else ended
                value = self._expected(outcome.observations, outcome.terminated)
                total = total + torch.where(over, weight * value, 0.0).sum()
                weight = torch.where(over, 1.0, weight)
            if any_ended:
                state, outcome = self.task.restart(state, outcome)
        self.state, self.outcome = state.detached(), _detached(outcome)
        after, rewards, terminated, ends = (torch.stack(parts) for parts in zip(*met, strict=True))
        window = Window(torch.stack(seen), rewards, self._expected(after, terminated), ends)
        return total / (self.settings.n_steps * self.settings.n_envs), window

    def _explore(self, observations: Tensor) -> Tensor:
        actions: Tensor = self.actor(observations)
        return actions + self.settings.noise * torch.randn_like(actions) if self.settings.noise else actions

    def _expected(self, observations: Tensor, terminated: Tensor) -> Tensor:
        """What the target critic expects after a period, from its observations before anything starts anew."""
        return torch.where(terminated, 0.0, self.target(observations))

    def teach_critic(self, window: Window) -> float:
        """Several passes over the window in batches drawn at random; returns the mean loss of the last one."""
        observations = window.observations.flatten(0, 1)
        targets = td_lambda(window, self.settings.gamma, self.settings.gae_lambda).flatten()
        losses: list[Tensor] = []
        for _ in range(self.settings.n_epochs):
            order = torch.randperm(len(targets), device=targets.device)
            losses = []
            for batch in torch.split(order, self.settings.batch_size):
                loss = self.critic.loss(observations[batch], targets[batch])
                self.critic_optimizer.zero_grad()
                torch.autograd.backward(loss)
                self.critic_optimizer.step()
                losses.append(loss.detach())
        with torch.no_grad():
            for slow, fast in zip(self.target.parameters(), self.critic.parameters(), strict=True):
                slow.lerp_(fast, self.settings.tau)
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


def make_task(task: TaskSettings, settings: SHACSettings) -> TorchTask:
    """The task through which gradients pass. Raises ValueError if its step is to be compiled and cannot be."""
    check_compiler(settings)
    return TorchTask(
        task.environment,
        device=settings.device,
        compile=settings.compile,
        diagnostics=False,
        **torch_fields(task),
        **{**task.task.model_dump(), "substeps": settings.substeps or _fewest_substeps(task)},
    )


def _fewest_substeps(task: TaskSettings) -> int:
    """RK4 steps of a control period: as few as the robot's casters allow, at most the task's own.

    Where wheels may slip, the task's own: the error of such a time step is of first order.
    """
    if task.task.slippery is not None:
        return task.task.substeps
    robot = load_robot(task.robot)
    return min(substeps_for(task.task.control_period, longest_time_step(robot)), task.task.substeps)


def learn_through_simulator(run: Run, settings: SHACSettings) -> None:
    """Train on tensors."""
    learner = ShortHorizon(make_task(run.task, settings), settings, run.seed)
    if run.saved is not None:
        learner.restore(run.saved)
    steps = run.steps
    try:
        while steps < settings.n_timesteps:
            run.advance(steps, lambda: frozen(learner.actor))
            run.save(steps, learner.take)
            facts = learner.improve(steps / settings.n_timesteps)
            steps += settings.n_steps * settings.n_envs
            run.record(steps, {f"train/{name}": value for name, value in facts.items()})
    finally:
        run.finish(steps, lambda: frozen(learner.actor))


def frozen(actor: Actor) -> Actor:
    """A copy of a policy on the CPU that does not learn any more."""
    return copy.deepcopy(actor).to("cpu", torch.float32).requires_grad_(False)


def _detached(outcome: TaskOutcome) -> TaskOutcome:
    """The same outcome without its past."""
    return TaskOutcome(*(tensor.detach() for tensor in outcome))
