"""Training a policy, by Stable-Baselines3 or on tensors; the best one is chosen on validation paths.

With the same settings, seed, number of threads and versions on the same machine, a training run repeats bit for bit.
"""

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from .actor import Actor
from .bundle import Bundle, PolicyDescription, save_bundle
from .evaluation import Batch, bare, roll_out, test_batch, training_batch
from .metrics import Verdict, in_words, yardstick
from .protocol import Agent
from .provenance import versions, write_provenance
from .sb3_environment import CasterVecEnv
from .settings import (
    LearnedSettings,
    Learner,
    PPOSettings,
    RslPPOSettings,
    SACSettings,
    SHACSettings,
    TaskSettings,
)

VALIDATION_SEED = 500
Report = Callable[[int, str], None]  # called with steps done and the last verdict in words, "" before the first


class Validation(NamedTuple):
    """How good a policy is on validation paths."""

    steps: int
    seconds: float  # of training so far, validations left out
    verdict: Verdict

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by name."""
        return {"steps": self.steps, "seconds": self.seconds, **self.verdict._asdict()}


def verdict_on(agent: Agent, validation: Batch) -> Verdict:
    """How good an agent is on a batch of validation paths, always from the same starts."""
    how = yardstick(bare(validation).task)
    verdict: Verdict = how.verdict.of(how.measure(roll_out(agent, validation, VALIDATION_SEED), how.settling))
    return verdict


def make_learner(settings: PPOSettings | SACSettings, environment: CasterVecEnv, seed: int) -> BaseAlgorithm:
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


def actor_of(learner: BaseAlgorithm, settings: Learner) -> Actor:
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


class Run:
    """The folder of a training run: validates policies, keeps them all and the best one, and tells how far it is.

    steps: done so far. logger: for what else there is to record; it writes progress.csv and TensorBoard events.
    """

    def __init__(self, folder: Path, task: TaskSettings, settings: LearnedSettings, seed: int, report: Report) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.task, self.settings, self.seed, self.report = folder, task, settings, seed, report
        self.logger = configure(str(folder), ["csv", "tensorboard"])
        self.validation = test_batch(task, task.validation, starts=1)
        self.history: list[Validation] = []
        self.best: Validation | None = None
        self.steps = 0
        self._validating = 0.0
        self._started = time.perf_counter()
        self._due = settings.steps / settings.validations

    def advance(self, steps: int, actor: Callable[[], Actor]) -> None:
        """So many steps are done by now; validate what `actor` returns where that is due."""
        self.steps = steps
        if steps >= self._due:
            self._due += self.settings.steps / self.settings.validations
            self.validate(actor())
        self.report(steps, in_words(self.history[-1].verdict) if self.history else "")

    def finish(self, steps: int, actor: Callable[[], Actor]) -> None:
        """Validate what has been learned since the last time."""
        self.steps = steps
        if not self.history or self.history[-1].steps < steps:
            self.validate(actor())

    def validate(self, actor: Actor) -> None:
        """Try a policy on the validation paths, keep it, and keep it as the best one if it is."""
        begun = time.perf_counter()
        bundle = Bundle(self._describe(actor), actor)
        result = Validation(
            self.steps, begun - self._started - self._validating, verdict_on(bundle.agent, self.validation)
        )
        self.history.append(result)
        for name, value in result.numbers.items():
            self.logger.record(f"validation/{name}", value)
        save_bundle(self.folder / "checkpoints" / f"{self.steps:010d}", bundle)
        if self.best is None or result.verdict.merit > self.best.verdict.merit:
            self.best = result
            save_bundle(self.folder / "best", bundle)
        self._write_history()
        self._validating += time.perf_counter() - begun

    def _describe(self, actor: Actor) -> PolicyDescription:
        return PolicyDescription(
            format=1,
            name=self.settings.algorithm.upper(),
            squash=actor.squash,
            hidden=self.settings.hidden,
            robot=bare(self.validation).robot,
            environment=self.task.environment,
            task=self.task.task,
            wrappers=self.task.wrappers,
            actions=actor.head.out_features,
            trained_with={"settings": self.settings.model_dump(mode="json"), "seed": self.seed, "steps": self.steps},
            versions=versions(),
        )

    def _write_history(self) -> None:
        with (self.folder / "validation.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.history[0].numbers)
            writer.writerows(result.numbers.values() for result in self.history)


class Watcher(BaseCallback):
    """Tells a run how far SB3 is."""

    def __init__(self, run: Run) -> None:
        super().__init__()
        self.run = run

    def _on_step(self) -> bool:
        if isinstance(self.model, SAC):
            self._watch()
        return True

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, SAC):
            self._watch()

    def _watch(self) -> None:
        self.run.advance(self.num_timesteps, lambda: actor_of(self.model, self.run.settings))


def learn_with_sb3(run: Run, settings: PPOSettings | SACSettings) -> None:
    """Train on the native batch of NumPy arrays."""
    learner = make_learner(settings, CasterVecEnv(training_batch(run.task, settings.robots)), run.seed)
    learner.set_logger(run.logger)
    try:
        learner.learn(settings.steps, callback=Watcher(run))
    finally:
        run.finish(learner.num_timesteps, lambda: actor_of(learner, settings))


def train(
    task: TaskSettings, settings: LearnedSettings, seed: int, folder: Path, report: Report, threads: int = 2
) -> Validation:
    """Train into a folder: bundles best/ and checkpoints/, validation.csv, progress.csv, TensorBoard events, run.yaml.

    Interrupted by Ctrl-C, it validates and keeps what it has learned so far, then raises KeyboardInterrupt.
    """
    torch.set_num_threads(threads)
    learn = _learning(settings)
    run = Run(folder, task, settings, seed, report)
    completed = False
    try:
        learn(run, settings)
        completed = True
    finally:
        if run.history:
            write_provenance(
                folder,
                task=task.model_dump(mode="json"),
                agent=settings.model_dump(mode="json"),
                seed=seed,
                threads=threads,
                completed=completed,
                seconds=run.history[-1].seconds,
                validations=[result.numbers for result in run.history],
            )
        run.logger.close()
    assert run.best is not None  # whoever learns finishes with a validation
    return run.best


def _learning(settings: LearnedSettings) -> Callable[[Run, Any], None]:
    """Who learns with such settings."""
    if isinstance(settings, SHACSettings):
        from .shac import learn_through_simulator

        return learn_through_simulator
    if isinstance(settings, RslPPOSettings):
        from .rsl_rl import learn_with_rsl_rl

        return learn_with_rsl_rl
    return learn_with_sb3
