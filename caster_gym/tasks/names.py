"""What a task is called, and which classes belong to it: what cannot be meant is told where the task is defined."""

import sys
from typing import TYPE_CHECKING, Any, get_args

from caster_gym.brief import brief
from caster_gym.configuration import ConfigurationError, did_you_mean
from caster_gym.envs.observation import PreviewUnit
from caster_gym.own_code import import_own
from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.measuring import Metrics, Printed, shown
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.registry import TASKS, classes_of

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task


def check_names(task: "Task") -> None:
    """Refuse a task that is called like another one, and words that mean nothing. Raises OwnCodeError."""
    said = f"task {task.name!r}"
    if not (isinstance(task.name, str) and task.name.isidentifier()):
        raise OwnCodeError(f"{said}: its name must be one word of letters, digits and _")
    module, _, title = str(task.environment).partition(":")
    if not all(part.isidentifier() for part in (*module.split("."), title)):
        raise OwnCodeError(
            f"{said}: its environment must be written as module:Title, such as 'my_task:CasterMine', got "
            f"{task.environment!r}"
        )
    for name in [name for name in TASKS if classes_of(name) != task.environment]:
        if name == task.name:
            raise OwnCodeError(f"{said} of {module} has the name of a task of the package: give it another one")
        if title == classes_of(name).partition(":")[2]:
            raise OwnCodeError(
                f"{said}: {title}-v0 is task {name!r} of the package: give its environment another title"
            )
    if task.preview_unit not in get_args(PreviewUnit):
        units = " or ".join(map(repr, get_args(PreviewUnit)))
        raise OwnCodeError(f"{said}: its preview_unit must be {units}, got {task.preview_unit!r}")
    if not (isinstance(task.purpose, str) and task.purpose.strip()):
        raise OwnCodeError(f"{said}: its purpose must say in words what a robot is to do, got {brief(task.purpose)}")
    if not (isinstance(task.parameters, type) and issubclass(task.parameters, TaskParameters)):
        raise OwnCodeError(f"{said}: its parameters must be a subclass of TaskParameters, got {brief(task.parameters)}")
    for part in ("source", "weights", "terms"):
        if not getattr(getattr(task, part), "_fields", ()):
            raise OwnCodeError(f"{said}: its {part} must be a named tuple, got {brief(getattr(task, part))}")
    if not isinstance(task.metrics, Metrics):
        raise OwnCodeError(f"{said}: its metrics must be made by tasks.measuring.Metrics, got {brief(task.metrics)}")
    if not callable(task.metrics.measure):
        raise OwnCodeError(f"{said}: its metrics' `measure` must be a function, got {brief(task.metrics.measure)}")
    _check_verdict(said, task.metrics.verdict)


def _check_verdict(said: str, verdict: Any) -> None:
    missing = [name for name in ("_fields", "of", "failures", "merit") if not hasattr(verdict, name)]
    if missing:
        name = getattr(verdict, "__name__", verdict)
        raise OwnCodeError(
            f"{said}: its verdict, {name}, must be a named tuple with `of`, `failures` "
            f"and `merit`, and lacks {', '.join(missing)}"
        )
    for name, how in shown(verdict):
        if isinstance(how, Printed) and how.scale not in get_args(Printed.__annotations__["scale"]):
            raise OwnCodeError(f"{said}: the scale of {name!r} must be 'linear' or 'log', got {how.scale!r}")


def class_of(task: "Task", suffix: str, parent: type) -> Any:
    """One of the task's environments. Raises ConfigurationError that says what its module lacks."""
    module, _, title = task.environment.partition(":")
    name = title + suffix
    try:
        contents = vars(import_own(module))
    except ConfigurationError as error:
        raise ConfigurationError(f"task {task.name!r} has the environment {task.environment!r}: {error}") from error
    found = contents.get(name)
    if not (isinstance(found, type) and issubclass(found, parent)):
        known = [one for one, thing in contents.items() if isinstance(thing, type) and thing is not parent]
        similar = [one for one in known if issubclass(contents[one], parent)]
        what = f"; {did_you_mean(name, similar)}" if similar else ""
        raise ConfigurationError(
            f"task {task.name!r} needs a class {name}({parent.__name__}) with `definition = TASK` in "
            f"{getattr(sys.modules[module], '__file__', module)}, got {brief(found)}{what}"
        )
    belongs: Task | None = getattr(found, "definition", None)
    if belongs is None or belongs.environment != task.environment:
        told = repr(belongs.name) if belongs else "none"
        raise ConfigurationError(
            f"{module}:{name} must have `definition =` the task {task.name!r} that it belongs to, and has {told}"
        )
    return found
