"""A task's reward and endings, called once with numbers: what is wrong with them is told before they compile."""

import math
from collections.abc import Callable
from numbers import Real
from typing import TYPE_CHECKING, Any

from caster_gym.envs.report import Endings, Record, Situation
from caster_gym.envs.tracking import Errors, Moment, Reference
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import register
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


class _Tried(float):
    """A number, or a condition as 1 or 0, that stands for one in each robot of a batch: it has no truth value."""

    __hash__ = float.__hash__

    def __bool__(self) -> bool:
        raise TypeError(
            "conditions differ from robot to robot, and `if`, `and`, `or`, `not`, `min` and `max` take one for all: "
            "write where, minimum, maximum, clip or absolute of caster_gym.mechanics.scalars"
        )


def _calculated(name: str) -> Callable[..., Any]:
    operation: Callable[..., Any] = getattr(float, name)

    def calculate(*numbers: Any) -> Any:
        result = operation(*numbers)
        return _Tried(result) if isinstance(result, float | bool) else result

    return calculate


_OPERATIONS = "lt le eq ne ge gt add radd sub rsub mul rmul truediv rtruediv pow rpow neg pos abs"
for _name in _OPERATIONS.split():
    setattr(_Tried, f"__{_name}__", _calculated(f"__{_name}__"))
register(
    _Tried,
    lambda condition, yes, no: yes if float(condition) else no,
    lambda x: _Tried(math.sqrt(x)),
    lambda condition: float(condition) != 0.0,
)


def _tuple(kind: Any) -> str:
    fields = getattr(kind, "_fields", ())
    return f"{kind.__name__} ({', '.join(fields)})" if fields else f"a {kind.__name__}"


def _moment() -> Moment:
    """A robot on two casters that does something of everything."""
    half, ahead = _Tried(0.5), (_Tried(0.6), _Tried(0.8))
    return Moment(
        State((half, half), ahead, (half, half, half), (ahead, ahead), (), ()),
        Reference(*(half,) * len(Reference._fields)),
        Errors(*(half,) * len(Errors._fields)),
        half,
        Record(*(half,) * len(Record._fields)),
        Situation(*(half,) * len(Situation._fields)),
    )
