"""The comparison: every agent on the same held-out paths, starts, sensors, preview and limits."""

import csv
import multiprocessing
import queue
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from caster_gym.agents.comparison.evaluation import Batch, Episodes, bare, roll_out, test_batch
from caster_gym.agents.comparison.figures import write_figures
from caster_gym.agents.comparison.follow_metrics import FollowVerdict
from caster_gym.agents.comparison.metrics import yardstick
from caster_gym.agents.comparison.summary import Result, table, write_episodes, write_summary
from caster_gym.agents.comparison.track_metrics import TrackVerdict
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.agents.control.protocol import Agent
from caster_gym.agents.learning.agent_settings import AgentSettings, ComputedTorqueSettings, LearnedSettings, read_agent
from caster_gym.agents.learning.bundle import DESCRIPTION, load_policy
from caster_gym.agents.learning.training import train
from caster_gym.agents.learning.training_run import Validation, verdict_on
from caster_gym.agents.settings import BenchmarkSettings, TaskSettings, in_brief
from caster_gym.configuration import ConfigurationError, is_yaml
from caster_gym.engines.native.cores import usable_cores
from caster_gym.engines.tensor.threads import DEFAULT, limited_to
from caster_gym.report.provenance import write_provenance
from caster_gym.shipped_files import names_of, read_settings


class Job(NamedTuple):
    """One training run."""

    name: str
    task: TaskSettings
    agent: LearnedSettings
    seed: int
    folder: Path


class Comparison(NamedTuple):
    """Checked settings of a comparison and of all that takes part."""

    settings: BenchmarkSettings
    task: TaskSettings
    agents: dict[str, AgentSettings]  # by the stems of their files


class Contender(NamedTuple):
    """An agent that is ready to be compared."""

    name: str
    agent: Agent
    seed: int | None


def read_comparison(settings: BenchmarkSettings, changes: Mapping[str, Any] | None = None) -> Comparison:
    """Read all files that a comparison names. changes: fields of learned agents to set, such as {"steps": 10000}."""
    agents: dict[str, AgentSettings] = {}
    for name in settings.agents:
        stem = Path(name).stem
        if stem in agents:
            raise ConfigurationError(f"agents of a comparison need different file names, got {stem!r} twice")
        agent = read_agent(name)
        agents[stem] = agent if isinstance(agent, ComputedTorqueSettings) else read_agent(name, changes)
    return Comparison(settings, read_settings(TaskSettings, "tasks", settings.task), agents)


def run_benchmark(comparison: Comparison, folder: Path, threads: int = DEFAULT) -> str:
    """Train what learns, tune what is tuned, evaluate all on the test paths; returns the table.

    threads: of each training run, of which there are as many at a time as the cores allow, and of the evaluation. The
    folder gets policies/, episodes.csv, summary.csv, table.md, run.yaml and figures.
    """
    settings, task, agents = comparison
    jobs = [
        Job(f"{name} seed {seed}", task, agent, seed, folder / "policies" / f"{name}-{seed}")
        for name, agent in agents.items()
        if not isinstance(agent, ComputedTorqueSettings)
        for seed in settings.seeds
    ]
    test = test_batch(task, task.test, settings.starts)
    plain = bare(test)
    validation = test_batch(task, task.validation, starts=1)
    test.reset(seed=settings.start_seed)
    test.step(test.action_space.sample())  # compiles here once, if at all, so that the training processes need not

    with limited_to(threads):
        model_based = {
            name: tune(agent, validation) for name, agent in agents.items() if isinstance(agent, ComputedTorqueSettings)
        }
    train_all(jobs, threads)
    contenders: list[Contender] = []
    for name, agent in agents.items():
        if name in model_based:
            contenders.append(Contender(model_based[name][0].name, model_based[name][0], None))
        for job in (job for job in jobs if job.agent is agent):
            learned = load_policy(job.folder / "best").agent
            alone = sum(other.algorithm == job.agent.algorithm for other in agents.values()) == 1
            contenders.append(Contender(learned.name if alone else name, learned, job.seed))
    with limited_to(threads):
        results, episodes = compare(contenders, test, settings)

    text = table(results, settings.confidence)
    write_episodes(folder / "episodes.csv", results)
    write_summary(folder / "summary.csv", results, settings.confidence)
    (folder / "table.md").write_text(text + "\n", encoding="utf-8")
    histories = {job.name: read_history(job.folder, yardstick(plain.task).verdict) for job in jobs}
    write_figures(folder, episodes, histories, plain.engine.plan)
    write_provenance(
        folder,
        benchmark=settings.model_dump(mode="json"),
        threads=threads,
        task=task.model_dump(mode="json"),
        agents={name: agent.model_dump(mode="json") for name, agent in agents.items()},
        natural_frequencies={name: frequency for name, (_, frequency) in model_based.items()},
        robot=plain.robot.model_dump(mode="json"),
    )
    return text


def compare(
    contenders: Sequence[Contender], test: Batch, settings: BenchmarkSettings
) -> tuple[list[Result], dict[str, Episodes]]:
    """Results of all contenders on the same episodes, and the time series of each agent's first seed."""
    how = yardstick(bare(test).task)
    settling = how.settling if settings.settling is None else settings.settling
    results: list[Result] = []
    shown: dict[str, Episodes] = {}
    for name, agent, seed in tqdm(contenders, desc="evaluating", unit="agent"):
        episodes = roll_out(agent, test, settings.start_seed)
        shown.setdefault(name, episodes)
        results.append(Result(name, seed, episodes.names, how.measure(episodes, settling)))
    return results, shown


def tune(settings: ComputedTorqueSettings, validation: Batch) -> tuple[ComputedTorque, float]:
    """The controller whose natural frequency [rad/s] does best on validation paths, as policies are chosen there."""
    plain = bare(validation)
    if redefining := [feature for feature in getattr(validation, "features", ()) if feature.redefines_actions]:
        raise ValueError(
            f"computed torque gives torques, but the task's actions are those of {in_brief(redefining[0])}: leave that "
            "out of its wrappers"
        )
    best: tuple[tuple[float, ...], ComputedTorque, float] | None = None
    for frequency in settings.natural_frequencies:
        agent = ComputedTorque(plain.engine.layout, frequency, plain.task.control_period, settings.known)
        merit = verdict_on(agent, validation).merit
        if best is None or merit > best[0]:
            best = (merit, agent, frequency)
    assert best is not None  # there is at least one natural frequency
    return best[1], best[2]


def ready_agent(name: str, settings: TaskSettings, batch: Batch) -> Agent:
    """A trained policy from its folder, or model-based control, tuned on validation paths, by its name.

    Raises ValueError for a policy that does not fit the batch, and for an agent that must be trained first.
    """
    folder = Path(name).expanduser()
    named = name in names_of("agents") or (is_yaml(name) and folder.name != DESCRIPTION)
    known = read_agent(name) if named else None
    if isinstance(known, ComputedTorqueSettings) and not (folder / DESCRIPTION).is_file():
        return tune(known, test_batch(settings, settings.validation, starts=1))[0]
    if known is None and not folder.exists() and len(folder.parts) == 1:
        model_based = [one for one in names_of("agents") if isinstance(read_agent(one), ComputedTorqueSettings)]
        raise ValueError(
            f"there is neither a folder of a policy nor a model-based agent called {name!r}; such are "
            f"{', '.join(model_based)}"
        )
    if known is not None and not folder.is_dir():
        raise ValueError(
            f"agent {name!r} must be trained first: `caster-gym train {name} --out RUN` writes its policy to RUN/best, "
            "which is the folder to give"
        )
    bundle, plain = load_policy(folder), bare(batch)
    bundle.check_fits(plain.engine.layout, plain.task.control_period, settings.wrappers)
    return bundle.agent


def train_all(jobs: Sequence[Job], threads: int = DEFAULT) -> None:
    """Train all jobs, as many at a time as there are cores for their threads, with one progress bar over all steps.

    Interrupted by Ctrl-C, running jobs keep what they have learned, and KeyboardInterrupt is raised.
    """
    if not jobs:
        return
    workers = max(1, min(len(jobs), usable_cores() // threads))
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, _bar(jobs) as show:
        reports = manager.Queue()
        with ProcessPoolExecutor(workers, mp_context=context) as pool:
            futures = [pool.submit(_train_job, i, job, threads, reports) for i, job in enumerate(jobs)]
            try:
                while not all(future.done() for future in futures):
                    _raise_errors(futures)
                    try:
                        show(*reports.get(timeout=0.5))
                    except queue.Empty:
                        continue
                _raise_errors(futures)
            except BaseException:
                pool.shutdown(wait=True, cancel_futures=True)
                raise


def _raise_errors(futures: Sequence["Future[None]"]) -> None:
    for future in futures:
        if future.done():
            future.result()


@contextmanager
def _bar(jobs: Sequence[Job]) -> Iterator[Callable[[int, int, str], None]]:
    done = [0] * len(jobs)
    with tqdm(total=sum(job.agent.steps for job in jobs), desc="training", unit="step", unit_scale=True) as bar:

        def show(job: int, steps: int, verdict: str) -> None:
            done[job] = min(steps, jobs[job].agent.steps)
            bar.n = sum(done)
            if verdict:
                bar.set_postfix_str(f"{jobs[job].name}: {verdict}", refresh=False)
            bar.refresh()

        yield show


def _train_job(index: int, job: Job, threads: int, reports: Any) -> None:
    train(
        job.task, job.agent, job.seed, job.folder, lambda steps, verdict: reports.put((index, steps, verdict)), threads
    )


def read_history(folder: Path, verdict: type[TrackVerdict] | type[FollowVerdict]) -> list[Validation]:
    """The validations of a training run on a task with these verdicts."""
    with (folder / "validation.csv").open(newline="", encoding="utf-8") as file:
        return [
            Validation(
                int(row["steps"]),
                float(row["seconds"]),
                verdict._make(float(row[name]) for name in verdict._fields),
            )
            for row in csv.DictReader(file)
        ]
