"""A training run, for any learner: validates policies and keeps them in a folder."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np
from stable_baselines3.common.logger import KVWriter, configure

from caster_gym.agents.comparison.evaluation import bare, evaluation_batch
from caster_gym.agents.comparison.metrics import in_words
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation, verdict_on, write_history
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import Bundle, PolicyDescription, save_bundle
from caster_gym.agents.learning.settings import GradientLearner, LearnerSettings, scheduled
from caster_gym.envs.observation import ObservationLayout
from caster_gym.report.provenance import versions

STEPS = "time/total_timesteps"  # SB3's column of steps in progress.csv
Report = Callable[[int, str], None]  # called with steps done and the last verdict in words, "" before the first


class Run:
    """The folder of a training run: validates policies, keeps them all and the best one, and tells how far it is.

    steps: done so far. logger: what SB3 records by; it writes progress.csv and TensorBoard events.
    """

    def __init__(self, folder: Path, task: TaskSettings, settings: LearnerSettings, seed: int, report: Report) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.task, self.settings, self.seed, self.report = folder, task, settings, seed, report
        self.logger = configure(str(folder), ["csv", "tensorboard"])
        self.validation = evaluation_batch(task, task.validation, starts=1)
        self.history: list[Validation] = []
        self.best: Validation | None = None
        self.steps = 0
        self._diverged = False
        self._validating = 0.0
        self._started = time.perf_counter()
        self._due = settings.n_timesteps / settings.validations

    @property
    def layout(self) -> ObservationLayout:
        """What the parts of an observation mean."""
        return bare(self.validation).engine.layout

    @property
    def actions(self) -> int:
        """Number of actions of a robot."""
        return int(np.prod(self.validation.single_action_space.shape or ()))

    def advance(self, steps: int, actor: Callable[[], Actor]) -> None:
        """So many steps are done by now; validate what `actor` returns where that is due."""
        self.steps = steps
        if steps >= self._due:
            self._due += self.settings.n_timesteps / self.settings.validations
            self.validate(actor())
        self.report(steps, in_words(self.history[-1].verdict) if self.history else "")

    def finish(self, steps: int, actor: Callable[[], Actor]) -> None:
        """Validate what has been learned since the last time, unless that has diverged."""
        self.steps = steps
        if not self._diverged and (not self.history or self.history[-1].steps < steps):
            self.validate(actor())

    def diverged(self, steps: int, cause: BaseException | None = None) -> NoReturn:
        """End the run, whose policy is no longer one; what was validated before is kept."""
        self._diverged = True
        advice = ""
        if isinstance(self.settings, GradientLearner):
            rate = scheduled(self.settings.learning_rate, 1.0)
            advice = f", with a learning_rate of {rate:g}; try a smaller one"
        raise ValueError(f"training has diverged after {steps} steps{advice}") from cause

    def validate(self, actor: Actor) -> None:
        """Try a policy on the validation paths, keep it, and keep it as the best one if it is."""
        if not all(bool(weights.isfinite().all()) for weights in actor.state_dict().values()):
            self.diverged(self.steps)
        begun = time.perf_counter()
        bundle = Bundle(self._describe(actor), actor)
        result = Validation(
            self.steps, begun - self._started - self._validating, verdict_on(bundle.agent, self.validation)
        )
        self.history.append(result)
        self.record(self.steps, {f"validation/{name}": value for name, value in result.numbers.items()})
        save_bundle(self.folder / "checkpoints" / f"{self.steps:010d}", bundle)
        if self.best is None or result.verdict.merit > self.best.verdict.merit:
            self.best = result
            save_bundle(self.folder / "best", bundle)
        write_history(self.folder / "validation.csv", self.history)
        self._validating += time.perf_counter() - begun

    def record(self, steps: int, numbers: Mapping[str, float]) -> None:
        """Write numbers to progress.csv and TensorBoard at once, at their own step.

        SB3 dumps what its logger was told when its next round ends: at a later step, and never after the last one.
        """
        values = {STEPS: steps, **numbers}
        excluded: dict[str, tuple[str, ...]] = {name: ("tensorboard",) if name == STEPS else () for name in values}
        for writer in self.logger.output_formats:
            assert isinstance(writer, KVWriter)
            writer.write(values, excluded, steps)

    def _describe(self, actor: Actor) -> PolicyDescription:
        return PolicyDescription(
            format=1,
            name=self.settings.name,
            squash=actor.squash,
            hidden=actor.hidden,
            robot=self.task.described_robot,
            environment=self.task.environment,
            task=self.task.task,
            wrappers=self.task.wrappers,
            actions=actor.head.out_features,
            trained_with={"settings": self.settings.model_dump(mode="json"), "seed": self.seed, "steps": self.steps},
            versions=versions(),
        )
