"""Whether a folder holds a training that can go on, or is completed: its run.yaml says what it was started with."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation, read_history
from caster_gym.agents.learning.bundle import DESCRIPTION, WEIGHTS, load_policy
from caster_gym.brief import brief
from caster_gym.configuration import ConfigurationError, read_yaml
from caster_gym.tasks.registry import find_task

RUN = "run.yaml"
RESULTS = ("best", "checkpoints", "state")  # of a training, which never are there without its run.yaml
FREE = ("agent.save_every",)  # settings on which no result depends


def is_completed(folder: Path, facts: Mapping[str, Any], what: str = "training", free: Collection[str] = FREE) -> bool:
    """Whether the training, or what else it is called, in a folder is completed; False if there is none.

    facts: settings of the one that is asked for, by their keys in run.yaml. Raises ConfigurationError that names the
    first setting in which the one in the folder differs, but for those that are free to change.
    """
    path = folder / RUN
    if not path.exists():
        if left := [name for name in RESULTS if (folder / name).exists()]:
            raise ConfigurationError(
                f"{folder} holds {left[0]}, but no {RUN}, which says how that was made: put it back, or choose another "
                "folder"
            )
        return False
    found = read_yaml(path)
    if unknown := [key for key in facts if key not in found]:
        raise ConfigurationError(f"{path} does not say with which {unknown[0]!r} the {what} was started: put it back")
    for name, before, now in _differences({key: found.get(key) for key in facts}, facts):
        if name not in free:
            raise ConfigurationError(
                f"{folder} holds a {what} with {name} {before!r}, and now it is {now!r}: a {what} goes on with the "
                "settings it was started with; choose another folder for others"
            )
    completed = found.get("completed", False)
    if not isinstance(completed, bool):
        raise ConfigurationError(f"{path} says completed: {brief(completed)}, which should be true or false")
    return completed


def best_of(folder: Path, task: TaskSettings) -> Validation:
    """The best validation of a completed training. Raises ConfigurationError where what it has left is not whole."""
    try:
        history = read_history(folder / "validation.csv", find_task(task.environment).metrics.verdict)
        check_checkpoints(folder, history)
        load_policy(folder / "best")
    except ValueError as error:
        raise ConfigurationError(
            f"{folder} holds a completed training of which something is gone: {error}; put it back, or train anew, "
            "with --overwrite or in another folder"
        ) from error
    return max(history, key=lambda one: one.verdict.merit)


def checkpoint_name(steps: int) -> str:
    """Name of the folder of a policy that was validated after so many steps."""
    return f"{steps:010d}"


def check_checkpoints(folder: Path, history: Sequence[Validation]) -> None:
    """Raise ValueError unless the policies of all validations are there."""
    for one in history:
        checkpoint = folder / "checkpoints" / checkpoint_name(one.steps)
        if gone := [name for name in (DESCRIPTION, WEIGHTS) if not (checkpoint / name).is_file()]:
            raise ValueError(f"there is no file {str(checkpoint / gone[0])!r}")


def _differences(before: Any, now: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Names, values before and values now of all in which settings differ."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in {**now, **before}:
            inner = f"{name}.{key}" if name else str(key)
            yield from _differences(before.get(key), now.get(key), inner)
    elif before != now:
        yield name, before, now
