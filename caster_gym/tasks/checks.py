"""A task's reward and endings, called with a few numbers: what is wrong with them is told before they compile."""

import math
from collections.abc import Callable
from numbers import Real
from typing import TYPE_CHECKING, Any

from caster_gym.brief import brief
from caster_gym.envs.report import Endings, Record, Situation
from caster_gym.envs.tracking import Errors, Moment, Reference
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import register
from caster_gym.own_errors import OwnCodeError, in_words

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task


def check_reward(task: "Task", weights: Any) -> None:
    """Refuse a reward or endings that do not give the tuple that the task declares. Raises OwnCodeError.

    weights: the task's, by name.
    """
    _check(task, "reward", task.reward, task.terms, weights)
    _check(task, "endings", task.endings, Endings, weights)


def _check(task: "Task", name: str, function: Callable[[Any, Any], Any], kind: Any, weights: Any) -> None:
    said, failed = f"the {name} of task {task.name!r}", []
    for words, moment in _moments():
        try:
            given = function(moment, weights)
        except (ArithmeticError, ValueError) as error:
            failed.append(error)
            continue  # these numbers alone may be to blame, as for a root
        except Exception as error:  # whatever the code of others does
            advice = ""
            if f"{kind.__name__}.__new__()" in str(error):
                advice = f": {_tuple(kind)} takes one number for each"
            if getattr(error, "obj", None) is weights:
                parameters = task.parameters.__name__
                advice = f": {_tuple(type(weights))} names the parameters of {parameters} that it may use"
            if _Tried.__name__ in str(error):
                advice = f": {_ADVICE}"
            raise _raised(said, error, function, advice) from error
        if type(given) is not kind:
            given = _tuple(type(given))
            raise OwnCodeError(f"{said} gives {given}, and must give {_tuple(kind)}, which the task declares")
        for field, value in zip(kind._fields, given, strict=True):
            if not isinstance(value, Real | _Tried):
                raise OwnCodeError(f"{said} must give a number as {field!r}, and gives {brief(value)}")
            number = value.value if isinstance(value, _Tried) else value
            if not math.isfinite(number):
                raise OwnCodeError(
                    f"{said} must give a finite number as {field!r}, and gives {number} {words} ({_start(function)})"
                )
    if len(failed) == len(_moments()):
        raise _raised(said, failed[0], function, ", as at all other moments that were tried") from failed[0]


def _raised(said: str, error: Exception, function: Callable[..., Any], advice: str) -> OwnCodeError:
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    return OwnCodeError(f"{said}: {in_words(error, file, advice)}")


def _start(function: Callable[..., Any]) -> str:
    code = getattr(function, "__code__", None)
    return f"{code.co_filename}, line {code.co_firstlineno}" if code else getattr(function, "__name__", "")


_ADVICE = (
    "write where, minimum, maximum, clip, absolute or sqrt of caster_gym.mechanics.scalars, which take numbers and "
    "tensors alike"
)


class _Tried:
    """A number, or a condition as 1 or 0, that stands for one in each robot of a batch.

    It has no truth value, and functions that take a single number refuse it.
    """

    __array_ufunc__ = None  # NumPy's functions refuse it, and leave products with it to those below

    def __init__(self, value: float) -> None:
        self.value = float(value)

    def __repr__(self) -> str:
        return f"{self.value!r}"

    def __bool__(self) -> bool:
        raise TypeError(
            "conditions differ from robot to robot, and `if`, `and`, `or`, `not`, `min` and `max` take one for all: "
            + _ADVICE
        )

    def _alone(self, *_: Any) -> Any:
        raise TypeError(
            "numbers differ from robot to robot, and functions of Python, `math` and NumPy take one for all: "
            f"calculate with +, -, *, / and **, or {_ADVICE}"
        )

    __float__ = __int__ = __index__ = __round__ = __array__ = __array_function__ = _alone


def _calculated(name: str) -> Callable[..., Any]:
    operation: Callable[..., Any] = getattr(float, name)

    def calculate(*numbers: Any) -> Any:
        result = operation(*(one.value if isinstance(one, _Tried) else one for one in numbers))
        return _Tried(result) if isinstance(result, float | bool) else result

    return calculate


_OPERATIONS = "lt le eq ne ge gt add radd sub rsub mul rmul truediv rtruediv pow rpow neg pos abs"
for _name in _OPERATIONS.split():
    setattr(_Tried, f"__{_name}__", _calculated(f"__{_name}__"))
register(
    _Tried,
    lambda condition, yes, no: yes if condition.value else no,
    lambda x: _Tried(math.sqrt(x.value)),
    lambda condition: condition.value != 0.0,
)


def _tuple(kind: Any) -> str:
    fields = getattr(kind, "_fields", ())
    return f"{kind.__name__} ({', '.join(fields)})" if fields else f"a {kind.__name__}"


def _moments() -> tuple[tuple[str, Moment], ...]:
    """Moments of a robot on two casters, in words: one that does something of everything, one that does nothing."""
    half, ahead = _Tried(0.5), (_Tried(0.6), _Tried(0.8))
    zero, straight, far = _Tried(0.0), (_Tried(1.0), _Tried(0.0)), _Tried(math.inf)
    busy = Moment(
        State((half, half), ahead, (half, half, half), (ahead, ahead), (), ()),
        Reference(*(half,) * len(Reference._fields)),
        Errors(*(half,) * len(Errors._fields)),
        half,
        Record(*(half,) * len(Record._fields)),
        Situation(*(half,) * len(Situation._fields)),
    )
    idle = Moment(
        State((zero, zero), straight, (zero, zero, zero), (straight, straight), (), ()),
        Reference(*(zero,) * len(Reference._fields))._replace(cos=straight[0]),
        Errors(*(zero,) * len(Errors._fields))._replace(cos=straight[0]),
        zero,
        Record(*(zero,) * len(Record._fields)),
        Situation(zero, zero, clearance=far),
    )
    return (
        ("for a robot that moves beside its reference", busy),
        ("for a robot at rest on its reference, without obstacles", idle),
    )
