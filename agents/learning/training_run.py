"""A training run, for any learner: validates policies and keeps them in a folder."""

import hashlib
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.logger import KVWriter, Logger

from caster_gym.agents.comparison.evaluation import bare, evaluation_batch
from caster_gym.agents.comparison.metrics import in_words
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation, verdict_on, write_history
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import Bundle, PolicyDescription, save_bundle
from caster_gym.agents.learning.progress import Events, ProgressTable, plain
from caster_gym.agents.learning.resuming import check_checkpoints, checkpoint_name
from caster_gym.agents.learning.saved_state import Snapshot, load_state, save_state
from caster_gym.agents.learning.settings import GradientLearner, LearnerSettings, scheduled
from caster_gym.configuration import ConfigurationError
from caster_gym.durable_files import remove_leftovers, replace_folder, scratch_folder
from caster_gym.envs.observation import ObservationLayout
from caster_gym.report.provenance import versions

STEPS = "time/total_timesteps"  # SB3's column of steps in progress.csv
Enough = Callable[[Sequence[Validation]], bool]  # whether a run ends after these validations, before its time
Report = Callable[[int, str], None]  # called with steps done and the last verdict in words, "" before the first


class DivergedError(ValueError):
    """Training has led to a policy that is none."""


class EnoughError(Exception):
    """Ends a run after a validation, as if it had done all its steps."""


class Run:
    """The folder of a training run: validates policies, keeps them all and the best one, and tells how far it is.

    steps: done so far. logger: what SB3 records by; it writes progress.csv and TensorBoard events. saved: what the
    learner is to go on from, if the run goes on from where another process was stopped; all else in the folder is then
    as it was when that was saved.
    """

    def __init__(
        self,
        folder: Path,
        task: TaskSettings,
        settings: LearnerSettings,
        seed: int,
        report: Report,
        resume: bool = False,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.task, self.settings, self.seed, self.report = folder, task, settings, seed, report
        self.validation = evaluation_batch(task, task.validation, starts=1)
        self.history: list[Validation] = []
        self.best: Validation | None = None
        self.steps = 0
        self.enough: Enough | None = None
        self._diverged = False
        self._validating = 0.0
        self._due = settings.n_timesteps / settings.validations
        state = load_state(self._state_file) if resume else None
        self.saved = None if state is None else Snapshot(state.arrays, state.numbers["learner"])
        kept = {} if state is None else state.numbers["run"]
        if kept and kept["training"] != self._training:
            raise ConfigurationError(f"{self._state_file} is the state of another training: delete it to begin anew")
        self._started = time.perf_counter() - kept.get("seconds", 0.0)
        self._saved_at = time.perf_counter()
        if kept:
            verdict = bare(self.validation).definition.metrics.verdict
            self.steps, self._due = kept["steps"], kept["due"]
            self.history = [Validation(one[0], one[1], verdict(*one[2])) for one in kept["history"]]
            self.best = next((one for one in self.history if one.steps == kept["best"]), None)
        self._bring_back()
        self._table = ProgressTable(folder / "progress.csv", kept.get("columns", ()), kept.get("rows", 0))
        self.logger = Logger(str(folder), [self._table, Events(folder, self.steps if kept else None)])

    @property
    def _training(self) -> str:
        """What tells this training from others."""
        content = (self.task.model_dump_json(), self.settings.model_dump_json(exclude={"save_every"}), self.seed)
        return hashlib.sha256(repr(content).encode()).hexdigest()

    @property
    def state_folder(self) -> Path:
        """Where everything is that a run needs to go on, until it is completed."""
        return self.folder / "state"

    @property
    def _state_file(self) -> Path:
        return self.state_folder / "state.safetensors"

    def save(self, steps: int, take: Callable[[], tuple[Mapping[str, NDArray[Any]], Mapping[str, Any]]]) -> bool:
        """Save the arrays and numbers that `take` returns, as `saved` of a later run, if the last time was long ago.

        It is called often, wherever a learner could go on from what it has in memory. Returns whether it was saved.
        """
        now = time.perf_counter()
        if now - self._saved_at < self.settings.save_every:
            return False
        learner = Snapshot(*take())
        numbers = {
            "training": self._training,
            "steps": steps,
            "due": self._due,
            "seconds": now - self._started - self._validating,
            "history": [[one.steps, one.seconds, [plain(number) for number in one.verdict]] for one in self.history],
            "best": self.best and self.best.steps,
            "columns": self._table.columns,
            "rows": self._table.rows,
        }
        save_state(self._state_file, Snapshot(learner.arrays, {"run": numbers, "learner": learner.numbers}))
        self._saved_at = time.perf_counter()
        return True

    def remove_state(self) -> None:
        """Remove what a completed run no longer needs to go on."""
        shutil.rmtree(self.state_folder, ignore_errors=True)

    def _bring_back(self) -> None:
        """Let the folder hold what it held when the state was saved that is gone on from; or nothing."""
        remove_leftovers(self.folder, locked=True)
        checkpoints = self.folder / "checkpoints"
        try:
            check_checkpoints(self.folder, self.history)
        except ValueError as error:
            raise ConfigurationError(
                f"{error}, which was there when the state of this training was saved: put it back, or delete "
                f"{self.state_folder} to begin anew"
            ) from error
        if checkpoints.is_dir():
            remove_leftovers(checkpoints, locked=True)
            known = {checkpoint_name(one.steps) for one in self.history}
            for one in checkpoints.iterdir():
                if one.name not in known:
                    shutil.rmtree(one)
        if self.best is not None:
            self._keep_best(self.best)
        if self.history:
            write_history(self.folder / "validation.csv", self.history)
        else:
            (self.folder / "validation.csv").unlink(missing_ok=True)
        if self.saved is None:
            shutil.rmtree(self.state_folder, ignore_errors=True)
            for events in self.folder.glob("events.out.tfevents.*"):
                events.unlink()

    def _keep_best(self, result: Validation) -> None:
        """Let best/ hold the policy that was validated then."""
        with scratch_folder(self.folder) as scratch:
            fresh = scratch / "best"
            shutil.copytree(self.folder / "checkpoints" / checkpoint_name(result.steps), fresh)
            replace_folder(fresh, self.folder / "best")

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
            if self.enough is not None and self.enough(self.history):
                raise EnoughError
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
        raise DivergedError(f"training has diverged after {steps} steps{advice}") from cause

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
        save_bundle(self.folder / "checkpoints" / checkpoint_name(self.steps), bundle)
        if self.best is None or result.verdict.merit > self.best.verdict.merit:
            self.best = result
            self._keep_best(result)
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
