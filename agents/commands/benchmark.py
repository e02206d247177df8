"""The comparison: every agent on the same held-out paths, starts, sensors, preview and limits."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field, PositiveInt

from caster_gym.agents.comparison import results
from caster_gym.agents.comparison.evaluation import bare, evaluation_batch
from caster_gym.agents.comparison.results import Contender, compare, write_results
from caster_gym.agents.comparison.task_settings import Seed, Seeds, TaskSettings
from caster_gym.agents.comparison.validation import read_history, tune
from caster_gym.agents.control.protocol import Agent, AgentSettings, ControllerSettings
from caster_gym.agents.learning import training, usual_names
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.learning.training import Job, train_all
from caster_gym.agents.registry import read_agent
from caster_gym.agents.workers.calls import Workers
from caster_gym.configuration import ConfigurationError, Frozen, Positive
from caster_gym.engines.tensor.threads import DEFAULT, limit_threads
from caster_gym.file_names import NameOrFile
from caster_gym.report.provenance import write_provenance
from caster_gym.shipped_files import read_settings

WORTH_KEEPING = tuple(f"policies/*/{name}" for name in training.WORTH_KEEPING)
FILES = (*results.FILES, "run.yaml", *(f"policies/*/{name}" for name in training.FILES))


class BenchmarkSettings(Frozen):
    """Which agents are compared, and how."""

    usual_names: ClassVar[Mapping[str, str]] = {
        **usual_names.OF_LEARNERS,
        **dict.fromkeys(
            TaskSettings.model_fields.keys() - {"task"}, "it is a key of a task, whose name or file is given as 'task'"
        ),
        "seed": "seeds",
        "n_seeds": "'seeds' lists them: [0, 1, 2]",
        "agent": "agents",
        "threads": "the number of threads is given by --threads",
        "n_eval_episodes": "starts",
    }
    task: NameOrFile = "track"  # name of a file in configs/tasks, or path of one
    agents: Annotated[tuple[NameOrFile, ...], Field(min_length=1)]  # names of files in configs/agents, or paths
    seeds: Seeds = (0, 1, 2, 3, 4)  # of each learned agent
    starts: PositiveInt = 1  # episodes on each test path, with different starts
    start_seed: Seed = 1000  # the same starts for every agent
    settling: Positive | None = None  # [s] what comes before counts as transient; None: as suits the task
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95


class Comparison(NamedTuple):
    """Checked settings of a comparison and of all that takes part."""

    settings: BenchmarkSettings
    task: TaskSettings
    agents: dict[str, AgentSettings]  # by the stems of their files


def read_comparison(settings: BenchmarkSettings, changes: Mapping[str, Any] | None = None) -> Comparison:
    """Read all files that a comparison names. changes: fields to set of agents that learn, as {"n_timesteps": 1000}."""
    agents: dict[str, AgentSettings] = {}
    for name in settings.agents:
        stem = Path(name).stem
        if stem in agents:
            raise ConfigurationError(f"agents of a comparison need different file names, got {stem!r} twice")
        agent = read_agent(name)
        agents[stem] = agent if isinstance(agent, ControllerSettings) else read_agent(name, changes)
    return Comparison(settings, read_settings(TaskSettings, "tasks", settings.task), agents)


def run_benchmark(
    comparison: Comparison,
    folder: Path,
    threads: int = DEFAULT,
    resume: bool = False,
    workers: Workers | None = None,
) -> str:
    """Train what learns, tune what is tuned, evaluate all on the test paths; returns the table.

    threads: of each training run, of which there are as many at a time as the cores allow, and of the evaluation. The
    folder gets policies/, episodes.csv, summary.csv, table.md, run.yaml and figures.

    resume: trainings in policies/ that are completed are used as they are, others go on where they stopped, and new
    ones are begun. Raises ConfigurationError where one has other settings. workers: see `train_all`.
    """
    settings, task, agents = comparison
    jobs = [
        Job(f"{name} seed {seed}", task, agent, seed, folder / "policies" / f"{name}-{seed}")
        for name, agent in agents.items()
        if isinstance(agent, LearnerSettings)
        for seed in settings.seeds
    ]
    test = evaluation_batch(task, task.test, settings.starts)
    validation = evaluation_batch(task, task.validation, starts=1)
    test.reset(seed=settings.start_seed)
    test.step(test.action_space.sample())  # compiles here once, if at all, so that the training processes need not

    with limit_threads(threads):
        tuned = {
            name: tune(agent, validation, name)
            for name, agent in agents.items()
            if isinstance(agent, ControllerSettings)
        }
    train_all(jobs, threads, resume, workers)
    ready: dict[str, list[tuple[Agent, int | None]]] = {
        name: [(tuned[name].controller, None)]
        if name in tuned
        else [(load_policy(job.folder / "best").agent, job.seed) for job in jobs if job.agent is agent]
        for name, agent in agents.items()
    }
    namesakes = Counter(group[0][0].name for group in ready.values())
    contenders = [
        Contender(agent.name if namesakes[agent.name] == 1 else name, agent, seed)
        for name, group in ready.items()
        for agent, seed in group
    ]
    with limit_threads(threads):
        compared = compare(contenders, test, settings.start_seed, settings.settling)
    verdict = bare(test).definition.metrics.verdict
    histories = {job.name: read_history(job.folder / "validation.csv", verdict) for job in jobs}
    text = write_results(folder, compared, test, settings.confidence, histories)
    write_provenance(
        folder,
        benchmark=settings.model_dump(mode="json"),
        threads=threads,
        task=task.model_dump(mode="json"),
        agents={name: agent.model_dump(mode="json") for name, agent in agents.items()},
        tuned={name: best.model_dump(mode="json") for name, (_, best) in tuned.items()},
        sources={name: agent.source for name, agent in agents.items()},
        robot=bare(test).robot.model_dump(mode="json"),
    )
    return text
