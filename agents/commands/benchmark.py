"""The comparison: every agent on the same held-out paths, starts, sensors, preview and limits."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeAlias

from pydantic import Field, PositiveInt, model_validator

from caster_gym.agents.comparison import regimes, results
from caster_gym.agents.comparison.evaluation import Batch, bare, evaluation_batch
from caster_gym.agents.comparison.regimes import write_regimes
from caster_gym.agents.comparison.results import Contender, compare, write_results
from caster_gym.agents.comparison.scenarios import EACH, AnyEntrant, Entrant, Scenario, ScenarioName, tasks_of
from caster_gym.agents.comparison.task_settings import Seed, Seeds, TaskSettings
from caster_gym.agents.comparison.tuning import TUNING, Tuned, told, tune, write_tuning
from caster_gym.agents.comparison.validation import read_history
from caster_gym.agents.control.protocol import Agent, AgentSettings, ControllerSettings
from caster_gym.agents.learning import training, usual_names
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.learning.training import Job, train_all
from caster_gym.agents.registry import read_agent
from caster_gym.agents.workers.calls import Workers
from caster_gym.configuration import ConfigurationError, Frozen, Positive
from caster_gym.durable_files import write_file
from caster_gym.engines.tensor.threads import DEFAULT, limit_threads
from caster_gym.file_names import NameOrFile
from caster_gym.paths.naming import unknown_name
from caster_gym.report.provenance import write_provenance
from caster_gym.shipped_files import read_settings

WORTH_KEEPING = tuple(f"policies/*/{name}" for name in training.WORTH_KEEPING)
FILES = (
    *(*results.FILES, *regimes.FILES, TUNING, *(f"*/{name}" for name in results.FILES), "run.yaml"),
    *(f"policies/*/{name}" for name in training.FILES),
)

Made: TypeAlias = tuple[str, str]  # an agent, and the scenario that it is prepared for


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
    scenarios: Annotated[dict[ScenarioName, Scenario], Field(max_length=100)] = Field(default_factory=dict)  # features
    agents: Annotated[tuple[AnyEntrant, ...], Field(min_length=1)]  # files in configs/agents, or paths
    seeds: Seeds = (0, 1, 2, 3, 4)  # of each learned agent
    starts: PositiveInt = 1  # episodes on each test path, with different starts
    start_seed: Seed = 1000  # the same starts for every agent
    settling: Positive | None = None  # [s] what comes before counts as transient; None: as suits the task
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95

    @model_validator(mode="after")
    def _scenarios_are_there(self) -> Self:
        known = (EACH, *self.scenarios)
        for one in self.entrants:
            if one.prepared_for not in known:
                raise ValueError(f"agent {one.agent!r}: {unknown_name('scenario', one.prepared_for, known)}")
        return self

    @property
    def entrants(self) -> tuple[Entrant, ...]:
        """All that take part."""
        return tuple(one if isinstance(one, Entrant) else Entrant(agent=one) for one in self.agents)


class Comparison(NamedTuple):
    """Checked settings of a comparison and of all that takes part."""

    settings: BenchmarkSettings
    task: TaskSettings
    agents: dict[str, AgentSettings]  # by the stems of their files, and the scenario that they are prepared for
    entrants: dict[str, Entrant]  # by the same names

    @property
    def jobs(self) -> int:
        """Number of trainings at most."""
        return len(self.agents) * len(self.settings.seeds) * max(1, len(self.settings.scenarios))


def read_comparison(settings: BenchmarkSettings, changes: Mapping[str, Any] | None = None) -> Comparison:
    """Read all files that a comparison names. changes: fields to set of agents that learn, as {"n_timesteps": 1000}."""
    agents: dict[str, AgentSettings] = {}
    entrants: dict[str, Entrant] = {}
    for one in settings.entrants:
        stem = Path(one.agent).stem
        name = stem if one.prepared_for == EACH else f"{stem}_for_{one.prepared_for}"
        if name in agents:
            raise ConfigurationError(f"agents of a comparison need different file names, got {name!r} twice")
        agent = read_agent(one.agent)
        agents[name] = agent if isinstance(agent, ControllerSettings) else read_agent(one.agent, changes)
        entrants[name] = one
    return Comparison(settings, read_settings(TaskSettings, "tasks", settings.task), agents, entrants)


def run_benchmark(
    comparison: Comparison,
    folder: Path,
    threads: int = DEFAULT,
    resume: bool = False,
    workers: Workers | None = None,
) -> str:
    """Train what learns, tune what is tuned, evaluate all on the test paths; returns the table.

    threads: of each training run, of which there are as many at a time as the cores allow, and of the evaluation. The
    folder gets policies/, episodes.csv, summary.csv, table.md, run.yaml and figures. With scenarios, a folder for each
    holds its results, and table.md, scenarios.csv and regimes.png tell of all of them.

    resume: trainings in policies/ that are completed are used as they are, others go on where they stopped, and new
    ones are begun. Raises ConfigurationError where one has other settings. workers: see `train_all`.
    """
    settings, task, agents, entrants = comparison
    tasks = tasks_of(task, settings.scenarios)
    on_test = {scenario: evaluation_batch(one, one.test, settings.starts) for scenario, one in tasks.items()}
    _check_that_all_can_take_part(comparison, on_test)
    jobs = {
        made: [Job(f"{called} seed {seed}", one, agent, seed, policies / f"{called}-{seed}") for seed in settings.seeds]
        for policies in (folder / "policies",)
        for made, called, one, agent in _preparations(comparison, tasks)
        if isinstance(agent, LearnerSettings)
    }
    test = next(iter(on_test.values()))
    test.reset(seed=settings.start_seed)
    test.step(test.action_space.sample())  # compiles here once, if at all, so that the training processes need not

    tuned: dict[Made, Tuned] = {}
    names: dict[Made, str] = {}
    with limit_threads(threads):
        for made, called, one, agent in _preparations(comparison, tasks):
            names[made] = called
            if isinstance(agent, ControllerSettings):
                tuned[made] = tune(agent, evaluation_batch(one, one.validation, starts=1), *made)
    train_all([job for group in jobs.values() for job in group], threads, resume, workers)
    ready: dict[Made, list[tuple[Agent, int | None]]] = {
        **{made: [(one.controller, None)] for made, one in tuned.items()},
        **{made: [(load_policy(job.folder / "best").agent, job.seed) for job in group] for made, group in jobs.items()},
    }
    with limit_threads(threads):
        compared = {
            scenario: compare(
                _contenders({name: ready[name, one.prepared(scenario)] for name, one in entrants.items()}),
                test,
                settings.start_seed,
                settings.settling,
            )
            for scenario, test in on_test.items()
        }
    how = bare(test).definition.metrics
    texts = []
    for scenario, found in compared.items():
        here = [jobs.get((name, one.prepared(scenario)), []) for name, one in entrants.items()]
        histories = {
            job.name: read_history(job.folder / "validation.csv", how.verdict) for group in here for job in group
        }
        (folder / scenario).mkdir(exist_ok=True)
        texts.append(write_results(folder / scenario, found, on_test[scenario], settings.confidence, histories))
    text = texts[0]
    if settings.scenarios:
        results_of = {scenario: found.results for scenario, found in compared.items()}
        text = write_regimes(folder, results_of, how, settings.confidence)
    chosen = {names[made]: one for made, one in tuned.items()}
    learned = {f"{names[made]}, each of {len(group)} seeds": group[0].agent.n_timesteps for made, group in jobs.items()}
    if budgets := told(chosen, learned):
        text = f"{text}\n\n{budgets}"
        write_file(folder / "table.md", text + "\n")
        write_tuning(folder / TUNING, chosen)
    write_provenance(
        folder,
        benchmark=settings.model_dump(mode="json"),
        threads=threads,
        task=task.model_dump(mode="json"),
        agents={name: agent.model_dump(mode="json") for name, agent in agents.items()},
        tuned={name: one.settings.model_dump(mode="json") for name, one in chosen.items()},
        sources={name: agent.source for name, agent in agents.items()},
        robot=bare(test).robot.model_dump(mode="json"),
    )
    return text


def _preparations(
    comparison: Comparison, tasks: Mapping[str, TaskSettings]
) -> Iterator[tuple[Made, str, TaskSettings, AgentSettings]]:
    """What has to be trained or tuned: of which agent for which scenario, its name, the task, the agent."""
    for name, agent in comparison.agents.items():
        each = comparison.entrants[name].prepared_for == EACH
        for scenario, task in tasks.items():
            if each or comparison.entrants[name].prepared_for == scenario:
                yield (name, scenario), f"{name}-{scenario}" if each and scenario else name, task, agent


def _check_that_all_can_take_part(comparison: Comparison, on_test: Mapping[str, Batch]) -> None:
    """Refuse scenarios in which an agent that was prepared for another one would see or do what it does not know."""
    for name, entrant in comparison.entrants.items():
        if entrant.prepared_for == EACH:
            continue
        known = on_test[entrant.prepared_for]
        for scenario, test in on_test.items():
            for what, its, other in (
                ("observations", known.single_observation_space, test.single_observation_space),
                ("actions", known.single_action_space, test.single_action_space),
            ):
                if its != other:
                    raise ConfigurationError(
                        f"agent {name!r} is prepared for scenario {entrant.prepared_for!r}, but {what} of scenario "
                        f"{scenario!r} are others: {other} instead of {its}; prepare it for {EACH!r}"
                    )


def _contenders(ready: Mapping[str, Sequence[tuple[Agent, int | None]]]) -> list[Contender]:
    """All agents by the names that tables tell: their own, or where two have the same, those of the comparison."""
    namesakes = Counter(group[0][0].name for group in ready.values())
    return [
        Contender(agent.name if namesakes[agent.name] == 1 else name, agent, seed)
        for name, group in ready.items()
        for agent, seed in group
    ]
