"""Operations of the equations besides +, −, × and ÷: choices, roots, and loops over casters, for every scalar.

Python's and NumPy's numbers and NumPy's arrays choose and take roots by themselves; whoever brings another kind of
scalar says with `register` how it does, as the engines on Torch do. A kind that nobody registered is a TypeError: by
its truth value or as a float it would be taken for a number that it is not. Loops over casters go through `each` and
`total`, which a compiler can unroll: the number of casters is the length of a tuple, known before the arithmetic
starts.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

Scalar: TypeAlias = Any  # a float, an array, a tensor or a symbol
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Symmetric: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
Direction: TypeAlias = tuple[Scalar, Scalar]

Where: TypeAlias = Callable[[Any, Any, Any], Any]
Sqrt: TypeAlias = Callable[[Any], Any]
Anywhere: TypeAlias = Callable[[Any], Any]

_KINDS: dict[type, tuple[Where, Sqrt, Anywhere]] = {}  # registered, the latest last
# What each type does, None being what Python does with a number. Subclasses are added as they come.
_WHERE: dict[type, Where | None] = {bool: None, np.bool_: None, int: None, float: None}
_SQRT: dict[type, Sqrt | None] = {float: None, np.float64: None, int: None, bool: None}
_ANYWHERE: dict[type, Anywhere | None] = {bool: None, np.bool_: None, int: None, float: None}


def register(kind: type, where: Where, sqrt: Sqrt, anywhere: Anywhere) -> None:
    """Teach `where`, `sqrt` and `anywhere` another kind of scalar and its subclasses, by the type of its values.

    where(condition, yes, no): by conditions of that kind, where yes and no may be numbers. anywhere(condition): a truth
    value, true if a condition may hold somewhere; a symbol, which has no value yet, always may.
    """
    _KINDS.pop(kind, None)
    _KINDS[kind] = (where, sqrt, anywhere)
    tables: tuple[dict[type, Any], ...] = (_WHERE, _SQRT, _ANYWHERE)
    for table, function in zip(tables, _KINDS[kind], strict=True):
        for known in [one for one in table if issubclass(one, kind) and one not in _KINDS]:
            del table[known]  # looked up again, for it may be nearer to the new kind
        table[kind] = function


def _functions_of(value: Scalar) -> tuple[Where | None, Sqrt | None, Anywhere | None]:
    """What a value of a type that is met for the first time does. Raises TypeError if nobody has said."""
    for kind in reversed(_KINDS):
        if isinstance(value, kind):
            return _KINDS[kind]
    if isinstance(value, np.number | np.bool_):
        return None, None, None
    name = f"{type(value).__module__}.{type(value).__qualname__}"
    raise TypeError(
        f"nobody has said how scalars of the kind {name} choose and take roots: tell "
        "caster_gym.mechanics.scalars.register(kind, where, sqrt, anywhere) before they meet the equations"
    )


def where(condition: Scalar, yes: Scalar, no: Scalar) -> Scalar:
    """`yes` where the condition holds, else `no`."""
    try:
        choose = _WHERE[type(condition)]
    except KeyError:
        choose = _WHERE[type(condition)] = _functions_of(condition)[0]
    if choose is None:
        return yes if condition else no
    return choose(condition, yes, no)


def sqrt(x: Scalar) -> Scalar:
    """Square root of x >= 0."""
    try:
        root = _SQRT[type(x)]
    except KeyError:
        root = _SQRT[type(x)] = _functions_of(x)[1]
    return math.sqrt(x) if root is None else root(x)


def anywhere(condition: Scalar) -> bool:
    """Whether a condition holds for any robot of a batch; work that nobody needs can be left out."""
    try:
        test = _ANYWHERE[type(condition)]
    except KeyError:
        test = _ANYWHERE[type(condition)] = _functions_of(condition)[2]
    return bool(condition if test is None else test(condition))


register(np.ndarray, np.where, np.sqrt, np.any)


def entry(table: Any, i: Any, j: Any) -> Any:
    """Number j of row i of a table, which may be an array or a list of lists."""
    return table[i][j]


def entries(table: Any, i: Any, places: tuple[int, ...]) -> tuple[Any, ...]:
    """Numbers of row i of such a table, those in these places."""
    return each(entry, (table, i), places[:])


def memory(nothing: Scalar, count: int) -> Any:
    """Room for so many scalars of a kind, each `nothing` at first; entries are read and set by their index."""
    return [nothing] * count


def minimum(a: Scalar, b: Scalar) -> Scalar:
    """The smaller one; b where a is not a number."""
    return where(a < b, a, b)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger one; b where a is not a number."""
    return where(a > b, a, b)


def clip(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """x, no lower than `low` and no higher than `high`."""
    return minimum(maximum(x, low), high)


def absolute(x: Scalar) -> Scalar:
    """|x|."""
    return where(x < 0.0, -x, x)


def each(function: Callable[..., Any], shared: tuple[Any, ...], *columns: tuple[Any, ...]) -> tuple[Any, ...]:
    """function(*shared, a_i, b_i, …) for every caster i, as a tuple."""
    return tuple(function(*shared, *items) for items in zip(*columns, strict=True))


def either(thing: Any, absent: Callable[..., Any], present: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """absent(*arguments) for a thing that is None, else present(thing, *arguments); known before arithmetic starts."""
    return absent(*arguments) if thing is None else present(thing, *arguments)


def apart(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """function(*arguments), for long functions that are called in several places: compiled once, and not inlined."""
    return function(*arguments)


def add(a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    """Element by element a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def total(terms: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...]:
    """Sum of equally long tuples, from the first to the last."""
    result = terms[0]
    for term in terms[1:]:
        result = add(result, term)
    return result


def greatest(values: tuple[Any, ...]) -> Any:
    """The greatest of some values."""
    result = values[0]
    for value in values[1:]:
        result = maximum(value, result)
    return result


def pairs(flat: tuple[Any, ...]) -> tuple[tuple[Any, Any], ...]:
    """(a, b, c, d, …) -> ((a, b), (c, d), …)."""
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def flatten(nested: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...]:
    """((a, b), (c, d), …) -> (a, b, c, d, …)."""
    return tuple(x for inner in nested for x in inner)
