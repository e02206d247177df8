"""Which agent and which task the arguments of a command mean."""

from pathlib import Path
from typing import NamedTuple

from caster_gym.agents.comparison.evaluation import Batch, bare, evaluation_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.tuning import Tuned, tune
from caster_gym.agents.control.protocol import Agent, ControllerSettings
from caster_gym.agents.learning.bundle import DESCRIPTION, load_policy
from caster_gym.agents.registry import is_python, read_agent
from caster_gym.bounded_files import expanded
from caster_gym.configuration import is_yaml, parse, read_yaml
from caster_gym.own_code import RESULTS
from caster_gym.shipped_files import names_of, own_file, read_settings
from caster_gym.tasks.registry import refuse_imports

DEFAULT_TASK = "track"
RUN = "run.yaml"  # beside the policies of a training run


class ChosenTask(NamedTuple):
    """A task, and a sentence that says which one it is."""

    settings: TaskSettings
    words: str


class ChosenAgent(NamedTuple):
    """An agent, and how a model-based one was tuned."""

    agent: Agent
    tuned: Tuned | None


def choose_agent(name: str, settings: TaskSettings, batch: Batch) -> ChosenAgent:
    """A trained policy from its folder, or model-based control, tuned on validation paths, by its name.

    Raises ValueError for a policy that does not fit the batch, and for an agent that must be trained first.
    """
    folder = expanded(name)
    named = name in names_of("agents") or is_python(name) or (is_yaml(name) and folder.name not in RESULTS)
    known = read_agent(name) if named else None
    if isinstance(known, ControllerSettings) and not (folder / DESCRIPTION).is_file():
        tuned = tune(known, evaluation_batch(settings, settings.validation, starts=1), name)
        return ChosenAgent(tuned.controller, tuned)
    if known is None and not folder.exists() and len(folder.parts) == 1:
        model_based = [one for one in names_of("agents") if isinstance(read_agent(one), ControllerSettings)]
        own = own_file(name)
        advice = f"did you mean the file {own!r}?" if own else f"such are {', '.join(model_based)}"
        raise ValueError(f"there is neither a folder of a policy nor a model-based agent called {name!r}; {advice}")
    if known is not None and not folder.is_dir():
        raise ValueError(
            f"agent {name!r} must be trained first: `caster-gym train {name} --out RUN` writes its policy to RUN/best, "
            "which is the folder to give"
        )
    bundle, plain = load_policy(folder), bare(batch)
    bundle.check_fits(plain.engine.layout, plain.task.control_period, settings.wrappers)
    return ChosenAgent(bundle.agent, None)


def choose_task(agent: str, task: str | None) -> ChosenTask:
    """The task of that name; without one that which a policy was trained on, or the usual one.

    agent: folder of a policy, or name of another agent. Which task a policy was trained on stands in the run.yaml of
    its training run, one or two folders above it.
    """
    name = DEFAULT_TASK if task is None else task
    settings = read_settings(TaskSettings, "tasks", name)  # which may load code, as a file of the run must not
    run = _run_of(agent)
    trained = None if run is None else task_of_run(run)
    if task is None and trained is not None:
        return ChosenTask(trained, f"Task {_named(trained) or f'of {run}'}, on which the policy was trained.")
    if trained is not None:
        other = _named(trained) or f"that of {run}"
        same, differs = ", on which the policy was trained.", f"; the policy was trained on another one, {other}."
        return ChosenTask(settings, f"Task {name}{same if trained == settings else differs}")
    if task is None and (expanded(agent) / DESCRIPTION).is_file():
        words = f"Task {name}, since no {RUN} above {agent} tells on which it was trained; see --task."
        return ChosenTask(settings, words)
    return ChosenTask(settings, f"Task {name}.")


def _run_of(agent: str) -> Path | None:
    """The run.yaml of the training run of a policy, if it is where training puts it."""
    folder = expanded(agent)
    if not (folder / DESCRIPTION).is_file():
        return None
    above = folder.absolute().parents[:2]  # of best/, and of what stands in checkpoints/
    return next((one / RUN for one in above if (one / RUN).is_file()), None)


def task_of_run(run: Path) -> TaskSettings | None:
    """The task that a run.yaml records; None of one that is not that of a training run."""
    content = read_yaml(run)
    if "agent" not in content or not isinstance(content.get("task"), dict):
        return None
    refuse_imports(content["task"].get("environment"), f"{run}: task")
    return parse(TaskSettings, content["task"], f"{run}: task")


def _named(settings: TaskSettings) -> str:
    """The name of a task that comes with the package, or nothing."""
    return next((name for name in names_of("tasks") if read_settings(TaskSettings, "tasks", name) == settings), "")
