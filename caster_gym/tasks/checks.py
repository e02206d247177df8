"""A task's reward and endings, called once with plain numbers: what is wrong with them is told before they compile."""

from collections.abc import Callable
from numbers import Real
from typing import TYPE_CHECKING, Any

from caster_gym.envs.report import Endings, Record, Situation
from caster_gym.envs.tracking import Errors, Moment, Reference
from caster_gym.mechanics.integration import State
from caster_gym.own_errors import OwnCodeError, place_of

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task


def check_reward(task: "Task", weights: Any) -> None:
    """Refuse a reward or endings that do not give the tuple that the task declares. Raises OwnCodeError.

    weights: the task's, by name.
    """
    _check(task, "reward", task.reward, task.terms, weights)
    _check(task, "endings", task.endings, Endings, weights)


def _check(task: "Task", name: str, function: Callable[[Any, Any], Any], kind: Any, weights: Any) -> None:
    said = f"the {name} of task {task.name!r}"
    try:
        given = function(_moment(), weights)
    except (ArithmeticError, ValueError):
        return  # these numbers alone may be to blame, as for a root
    except Exception as error:  # whatever the code of others does
        place = place_of(error, getattr(getattr(function, "__code__", None), "co_filename", None))
        advice = ""
        if f"{kind.__name__}.__new__()" in str(error):
            advice = f": {_tuple(kind)} takes one number for each"
        if getattr(error, "obj", None) is weights:
            parameters = task.parameters.__name__
            advice = f": {_tuple(type(weights))} names the parameters of {parameters} that it may use"
        raise OwnCodeError(f"{said}: {type(error).__name__}: {error}{advice} ({place})") from error
    if type(given) is not kind:
        raise OwnCodeError(f"{said} gives {_tuple(type(given))}, and must give {_tuple(kind)}, which the task declares")
    for field, value in zip(kind._fields, given, strict=True):
        if not isinstance(value, Real):
            raise OwnCodeError(f"{said} must give a number as {field!r}, and gives {value!r}")


def _tuple(kind: Any) -> str:
    fields = getattr(kind, "_fields", ())
    return f"{kind.__name__} ({', '.join(fields)})" if fields else f"a {kind.__name__}"


def _moment() -> Moment:
    """A robot on two casters that does something of everything."""
    return Moment(
        State((0.5, 0.5), (0.6, 0.8), (0.5, 0.5, 0.5), ((0.6, 0.8),) * 2, (), ()),
        Reference(*(0.5,) * len(Reference._fields)),
        Errors(*(0.5,) * len(Errors._fields)),
        0.5,
        Record(*(0.5,) * len(Record._fields)),
        Situation(*(0.5,) * len(Situation._fields)),
    )
