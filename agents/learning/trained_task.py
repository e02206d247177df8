"""On which task an agent is tried: the one that is asked for, else the one that it was trained on."""

from pathlib import Path
from typing import NamedTuple

from caster_gym.agents.learning.bundle import DESCRIPTION
from caster_gym.agents.settings import TaskSettings
from caster_gym.configuration import parse, read_yaml
from caster_gym.shipped_files import names_of, read_settings

DEFAULT_TASK = "track"
RUN = "run.yaml"  # beside the policies of a training run


class Chosen(NamedTuple):
    """A task, and a sentence that says which one it is."""

    settings: TaskSettings
    words: str


def choose_task(agent: str, task: str | None) -> Chosen:
    """The task of that name; without one that which a policy was trained on, or the usual one.

    agent: folder of a policy, or name of another agent. Which task a policy was trained on stands in the run.yaml of
    its training run, one or two folders above it.
    """
    run = _run_of(agent)
    trained = None if run is None else _trained_on(run)
    if task is None and trained is not None:
        return Chosen(trained, f"Task {_named(trained) or f'of {run}'}, on which the policy was trained.")
    name = DEFAULT_TASK if task is None else task
    settings = read_settings(TaskSettings, "tasks", name)
    if trained is not None:
        other = _named(trained) or f"that of {run}"
        same, differs = ", on which the policy was trained.", f"; the policy was trained on another one, {other}."
        return Chosen(settings, f"Task {name}{same if trained == settings else differs}")
    if task is None and (Path(agent).expanduser() / DESCRIPTION).is_file():
        return Chosen(settings, f"Task {name}, since no {RUN} above {agent} tells on which it was trained; see --task.")
    return Chosen(settings, f"Task {name}.")


def _run_of(agent: str) -> Path | None:
    """The run.yaml of the training run of a policy, if it is where training puts it."""
    folder = Path(agent).expanduser()
    if not (folder / DESCRIPTION).is_file():
        return None
    above = folder.absolute().parents[:2]  # of best/, and of what stands in checkpoints/
    return next((one / RUN for one in above if (one / RUN).is_file()), None)


def _trained_on(run: Path) -> TaskSettings | None:
    """The task that a run.yaml records; None of one that is not that of a training run."""
    content = read_yaml(run)
    if "agent" not in content or not isinstance(content.get("task"), dict):
        return None
    return parse(TaskSettings, content["task"], f"{run}: task")


def _named(settings: TaskSettings) -> str:
    """The name of a task that comes with the package, or nothing."""
    return next((name for name in names_of("tasks") if read_settings(TaskSettings, "tasks", name) == settings), "")
