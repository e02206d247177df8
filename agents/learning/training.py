"""Training policies, one or many at a time; the best of each run is chosen on validation paths.

With the same settings, seed, number of threads and versions on the same machine, a training run repeats bit for bit.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from caster_gym.agents.comparison.metrics import in_words
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation
from caster_gym.agents.learning.bundle import DESCRIPTION, WEIGHTS
from caster_gym.agents.learning.resuming import best_of, is_completed
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.learning.training_run import Enough, EnoughError, Report, Run
from caster_gym.agents.workers.calls import Call, Reported, Workers
from caster_gym.agents.workers.opening import open_workers
from caster_gym.durable_files import MARK, FolderLock
from caster_gym.engines.tensor.threads import DEFAULT, limit_threads
from caster_gym.own_errors import in_own_code
from caster_gym.report.provenance import write_provenance

FILES = (
    *(MARK, "run.yaml", "validation.csv", "progress.csv", "events.out.tfevents.*", "state/*"),
    *(f"{folder}/{name}" for folder in ("best", "checkpoints/*") for name in (DESCRIPTION, WEIGHTS)),
)  # patterns of what is in the folder of a run
WORTH_KEEPING = ("best/policy.yaml", "state/state.safetensors")  # of a run that was stopped


def train(
    task: TaskSettings,
    settings: LearnerSettings,
    seed: int,
    folder: Path,
    report: Report,
    threads: int = DEFAULT,
    resume: bool = False,
    enough: Enough | None = None,
) -> Validation:
    """Train into a folder: bundles best/ and checkpoints/, validation.csv, progress.csv, TensorBoard events, run.yaml.

    Interrupted by Ctrl-C, it validates and keeps what it has learned so far, then raises KeyboardInterrupt.

    resume: go on where the training in this folder stopped, however its process ended; the result is the same to the
    last bit as without a stop. A folder without one is begun; one that is completed is left as it is, and its best
    validation returned. Raises ConfigurationError where the training there has other settings.

    enough: is asked after each validation whether the training ends there, as if it were completed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with FolderLock(folder):
        facts = {
            "task": task.model_dump(mode="json"),
            "agent": settings.model_dump(mode="json"),
            "robot": task.described_robot.model_dump(mode="json"),
            "source": settings.source,
            "seed": seed,
            "threads": threads,
        }
        if resume and is_completed(folder, facts):
            return best_of(folder, task)
        write_provenance(folder, **facts, completed=False)
        run = Run(folder, task, settings, seed, report, resume)
        run.enough = enough
        completed = False
        try:
            with limit_threads(threads), _told(settings), suppress(EnoughError):
                settings.learn(run)
            completed = True
        finally:
            if run.history:
                measured = {
                    "seconds": run.history[-1].seconds,
                    "validations": [result.numbers for result in run.history],
                }
                write_provenance(folder, **facts, completed=completed and run.best is not None, **measured)
            run.logger.close()
        if run.best is None:
            raise ValueError(
                f"{settings.algorithm} has learned nothing: its method learn must call run.finish at the end"
            )
        run.remove_state()
        return run.best


def _told(settings: LearnerSettings) -> AbstractContextManager[None]:
    """What a learner of a user's own raises becomes a sentence with its place; others say what they have to."""
    if not settings.is_own:
        return nullcontext()
    return in_own_code(f"agent {settings.algorithm!r}: its method learn", type(settings))


class Job(NamedTuple):
    """One training run."""

    name: str
    task: TaskSettings
    agent: LearnerSettings
    seed: int
    folder: Path


def train_all(
    jobs: Sequence[Job], threads: int = DEFAULT, resume: bool = False, workers: Workers | None = None
) -> None:
    """Train all jobs, as many at a time as there are cores for their threads, with one progress bar over all steps.

    Interrupted by Ctrl-C, running jobs keep what they have learned, and KeyboardInterrupt is raised. resume: see
    `train`; jobs that are completed take no time. workers: who trains; None: processes on this machine.
    """
    if not jobs:
        return
    with workers or open_workers("local", threads, len(jobs)) as at_work, _bar(jobs) as show:
        for job in jobs:
            there = job._replace(folder=job.folder.absolute())
            at_work.submit(Call(job.name, _train_job, (there, threads, resume), again=(there, threads, True)))
        for event in at_work.events():
            if isinstance(event, Reported):
                show(event.number, *event.content)


@contextmanager
def _bar(jobs: Sequence[Job]) -> Iterator[Callable[[int, int, str], None]]:
    done = [0] * len(jobs)
    total = sum(job.agent.n_timesteps for job in jobs)
    with tqdm(total=total, desc="training", unit="step", unit_scale=True, disable=None) as bar:

        def show(job: int, steps: int, verdict: str) -> None:
            done[job] = min(steps, jobs[job].agent.n_timesteps)
            bar.n = sum(done)
            if verdict:
                bar.set_postfix_str(f"{jobs[job].name}: {verdict}", refresh=False)
            bar.refresh()

        yield show


def _train_job(job: Job, threads: int, resume: bool, report: Callable[[tuple[int, str]], None]) -> None:
    best = train(job.task, job.agent, job.seed, job.folder, lambda *progress: report(progress), threads, resume)
    report((job.agent.n_timesteps, in_words(best.verdict)))
