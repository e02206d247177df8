"""Whether a folder holds a training that can go on, or is completed: its run.yaml says what it was started with."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation, read_history
from caster_gym.configuration import ConfigurationError, read_yaml
from caster_gym.tasks.registry import find_task

RUN = "run.yaml"
FREE = ("agent.save_every",)  # settings on which no result depends


def is_completed(folder: Path, facts: Mapping[str, Any], what: str = "training", free: Collection[str] = FREE) -> bool:
    """Whether the training, or what else it is called, in a folder is completed; False if there is none.

    facts: settings of the one that is asked for, by their keys in run.yaml. Raises ConfigurationError that names the
    first setting in which the one in the folder differs, but for those that are free to change.
    """
    path = folder / RUN
    if not path.exists():
        return False
    found = read_yaml(path)
    for name, before, now in _differences({key: found.get(key) for key in facts}, facts):
        if name not in free:
            raise ConfigurationError(
                f"{folder} holds a {what} with {name} {before!r}, and now it is {now!r}: a {what} goes on with the "
                "settings it was started with; choose another folder for others"
            )
    return found.get("completed") is True


def best_of(folder: Path, task: TaskSettings) -> Validation:
    """The best validation of a completed training."""
    history = read_history(folder / "validation.csv", find_task(task.environment).metrics.verdict)
    return max(history, key=lambda one: one.verdict.merit)


def _differences(before: Any, now: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Names, values before and values now of all in which settings differ."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in {**now, **before}:
            inner = f"{name}.{key}" if name else str(key)
            yield from _differences(before.get(key), now.get(key), inner)
    elif before != now:
        yield name, before, now
