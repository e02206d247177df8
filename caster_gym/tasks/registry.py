"""All tasks by name. A name leads to the object of its task, which is imported when somebody asks for it.

Wherever a task is named, `module:Name` stands for a `Task` of a module of one's own, which needs no entry here.
"""

import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from gymnasium import register, registry

from caster_gym.configuration import ConfigurationError
from caster_gym.own_code import OwnCode

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task

TASKS = {
    "track": "caster_gym.tasks.track:TASK",
    "follow": "caster_gym.tasks.follow:TASK",
    "hold": "caster_gym.tasks.hold:TASK",
}


KNOWN = f"{', '.join(map(repr, TASKS))} or 'module:Name' of your own"


def find_task(name: "str | Task", folder: Path | None = None) -> "Task":
    """The task of that name, of the form `module:Name`, or itself. Raises ValueError that says which there are.

    folder: of the file that names it, in which its module may lie.
    """
    if not isinstance(name, str):
        return name
    if name in TASKS:
        return _shipped_task(name)
    if ":" not in name:
        raise ValueError(f"the task must be {KNOWN}, got {name!r}")
    return _own_task(name, folder)


def refuse_imports(name: object, source: str) -> None:
    """Refuse a task of a module that is not loaded yet, in a file that a stranger may have written."""
    if isinstance(name, str) and ":" in name and name.partition(":")[0] not in sys.modules:
        raise ConfigurationError(
            f"{source}: 'environment' is {name!r}, but a file of a policy must not load code: give the policy's task "
            "yourself by --task, or import its module first"
        )


def all_tasks() -> Iterator["Task"]:
    """The tasks that come with the package."""
    return map(find_task, TASKS)


def register_environments(name: str) -> None:
    """Make a task known to Gymnasium, so that `gymnasium.make` and `make_vec` find its environments.

    name: as for `find_task`. One of the package is not imported for that.
    """
    if name in TASKS:
        place = classes_of(name)
    else:
        task = find_task(name)
        place = task.environment
        _ = task.single, task.batch  # which it says now if it has none
    known = registry.get(identity := f"{place.partition(':')[2]}-v0")
    if known is not None and known.entry_point != f"{place}Env":
        raise ValueError(
            f"{identity} is made by {known.entry_point} already: give the environment of {name!r} another title"
        )
    register(id=identity, entry_point=f"{place}Env", vector_entry_point=f"{place}VectorEnv")


def classes_of(name: str) -> str:
    """Module and first part of the names of the environments of a task of the package, which is not imported."""
    return f"{TASKS[name].partition(':')[0]}.environment:Caster{name.title()}"


def _own_task(reference: str, folder: Path | None) -> "Task":
    from caster_gym.tasks.task import Task

    def is_task(thing: object) -> bool:
        return isinstance(thing, Task)

    kind = OwnCode("environment", "a task", is_task, "a caster_gym.tasks.task.Task", "nothing in it is a Task")
    task: Task = kind.load(reference, folder)
    return task


@cache
def _shipped_task(name: str) -> "Task":
    module, _, attribute = TASKS[name].partition(":")
    task: Task = getattr(import_module(module), attribute)
    return task
