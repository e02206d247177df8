"""All tasks by name. A name leads to the object of its task, which is imported when somebody asks for it.

Wherever a task is named, `module:Name` stands for a `Task` of a module of one's own, which needs no entry here.
"""

import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from gymnasium import register

from caster_gym.configuration import ConfigurationError

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task

TASKS = {
    "track": "caster_gym.tasks.track:TASK",
    "follow": "caster_gym.tasks.follow:TASK",
    "hold": "caster_gym.tasks.hold:TASK",
}


KNOWN = f"{', '.join(map(repr, TASKS))} or 'module:Name' of your own"


def find_task(name: "str | Task") -> "Task":
    """The task of that name, of the form `module:Name`, or itself. Raises ValueError that says which there are."""
    if not isinstance(name, str):
        return name
    if name not in TASKS and ":" not in name:
        raise ValueError(f"the task must be {KNOWN}, got {name!r}")
    return _loaded(TASKS.get(name, name))


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
    place = f"{TASKS[name].partition(':')[0]}.environment:Caster{name.title()}" if name in TASKS else ""
    place = place or find_task(name).environment
    register(id=f"{place.partition(':')[2]}-v0", entry_point=f"{place}Env", vector_entry_point=f"{place}VectorEnv")


@cache
def _loaded(place: str) -> "Task":
    from caster_gym.tasks.task import Task

    module, _, name = place.partition(":")
    try:
        found: Any = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"there is no task {place!r}: {error}") from error
    if not isinstance(found, Task):
        raise ValueError(f"{place!r} must be a caster_gym.tasks.task.Task, got {found!r}")
    return found
