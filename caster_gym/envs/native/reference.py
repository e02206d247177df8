"""References and rewards of a task, as compiled code reads them.

A task has a reference source, a named tuple of arrays, and says which functions go with its type: `register_task`. The
functions below are chosen by that type while compiling, so that a task pays for nothing that only another one needs.
"""

import sys
from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload, register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed, teach
from caster_gym.engines.native.lanes import counting
from caster_gym.engines.native.outside_sources import is_own, note_outside
from caster_gym.envs import observation, report, tracking
from caster_gym.envs.tracking import evaluate_by
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import each

teach(report)
teach(tracking)
teach(observation, observation.observe)


class TaskCode(NamedTuple):
    """What compiled code calls for the robots of a task."""

    name: str  # in announcements
    fetch: Callable[..., Any]  # see `fetch_reference`
    weights: Callable[..., Any]  # the named tuple of the reward's numbers, with `corridor` and `touching_ends`
    reward: Callable[..., Any]  # a named tuple of terms from a `Moment` and weights, on generic scalars
    endings: Callable[..., Any]  # `Endings` from the same


_BY_SOURCE: dict[Any, TaskCode] = {}
_BY_WEIGHTS: dict[Any, TaskCode] = {}
_taught: set[str] = set()
_TASKS = "caster_gym.tasks."


def register_task(source: Any, code: TaskCode) -> None:
    """Let compiled code lead and reward robots whose reference source is of that type.

    Source and weights are types of that task alone: others would change what is compiled for it. The code may call all
    functions of its modules, and those of other modules of a user's own that stand there by their names.
    """
    for table, kind in ((_BY_SOURCE, source), (_BY_WEIGHTS, code.weights)):
        if table.setdefault(kind, code).name != code.name:
            raise ValueError(f"{kind.__name__} of task {code.name!r} belongs to task {table[kind].name!r}: subclass it")
        table[kind] = code
    modules = {part.__module__ for part in (source, code.fetch, code.weights, code.reward, code.endings)}
    note_outside((source, code.weights), modules)
    for name in modules:
        _teach_with_helpers(name, name.partition(".")[0])


def _teach_with_helpers(name: str, top: str) -> None:
    """Teach a module's functions to the compiler, and those of the modules from which it has taken functions."""
    if name in _taught or not (name.startswith(_TASKS) or is_own(name, top)):
        return
    _taught.add(name)
    teach(sys.modules[name])
    for function in vars(sys.modules[name]).values():
        if isinstance(function, FunctionType):
            _teach_with_helpers(function.__module__, top)


def task_code(source: type) -> TaskCode:
    """What belongs to a type of reference source."""
    return _BY_SOURCE[source]


def code_of(source: Any) -> TaskCode:
    """What belongs to the compiler's type of a reference source."""
    return _BY_SOURCE[source.instance_class]


def borrowed_source(source: Any) -> Any:
    """The reference source with its arrays borrowed, in compiled code."""
    return source


def fetch_reference(
    block: Any, lane: Any, row: Any, state: State, clock: Any, path: Any, before: Any, source: Any
) -> Any:
    """Write reference and previewed points of a robot from a row on; returns its progress [m] and the share of it.

    before: progress [m] so far, negative at the start of an episode.
    """
    return _BY_SOURCE[type(source)].fetch(block, lane, row, state, clock, path, before, source)


def weights_of(source: Any) -> Any:
    """The weights of the task of a reference source, by name."""
    return _BY_SOURCE[type(source)].weights(*source.weights)


def evaluate(state: Any, reference: Any, torques: Any, record: Any, situation: Any, robot: Any, weights: Any) -> Any:
    """Errors, endings, and the reward's terms."""
    code = _BY_WEIGHTS[type(weights)]
    return evaluate_by(state, reference, torques, record, situation, robot, weights, code.endings, code.reward)


@register_jitable(**INLINE)
def _entry(numbers: Any, i: Any) -> Any:
    return numbers[i]


def _borrowed_part(part: Any) -> Any:
    return part


@overload(_borrowed_part, jit_options=INLINE, strict=False)
def _borrow_arrays(part: Any) -> Any:
    if isinstance(part, types.Array):
        return lambda part: borrowed(part)
    return lambda part: part


@overload(borrowed_source, jit_options=INLINE, strict=False)
def _borrowed_source(source: Any) -> Any:
    kind = source.instance_class
    return lambda source: kind(*each(_borrowed_part, (), source[:]))


@overload(fetch_reference, jit_options=INLINE, strict=False)
def _fetch_reference(
    block: Any, lane: Any, row: Any, state: Any, clock: Any, path: Any, before: Any, source: Any
) -> Any:
    fetch = code_of(source).fetch
    return lambda block, lane, row, state, clock, path, before, source: fetch(
        block, lane, row, state, clock, path, before, source
    )


@overload(weights_of, jit_options=INLINE, strict=False)
def _weights_of(source: Any) -> Any:
    weights: Any = code_of(source).weights
    like = (0.0,) * len(weights._fields)
    return lambda source: weights(*each(_entry, (source.weights,), counting(like)))


@overload(evaluate, jit_options=INLINE, strict=False)
def _evaluate(state: Any, reference: Any, torques: Any, record: Any, situation: Any, robot: Any, weights: Any) -> Any:
    code = _BY_WEIGHTS[weights.instance_class]
    endings, reward = code.endings, code.reward
    return lambda state, reference, torques, record, situation, robot, weights: evaluate_by(
        state, reference, torques, record, situation, robot, weights, endings, reward
    )
