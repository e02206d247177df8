"""What the equations need besides +, −, × and ÷: choices, roots, and loops over casters, for every kind of scalar.

An engine whose scalars are neither numbers nor NumPy arrays says with `register` how they choose and take roots.
Loops over casters go through `each` and `total`, which a compiler can unroll: the number of casters is the length of a
tuple, known before the arithmetic starts.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

Scalar: TypeAlias = Any  # a float, an array, a tensor or a symbol
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Symmetric: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
Direction: TypeAlias = tuple[Scalar, Scalar]

_WHERE: dict[type, Callable[[Any, Any, Any], Any]] = {np.ndarray: np.where}
_SQRT: dict[type, Callable[[Any], Any]] = {np.ndarray: np.sqrt}
_ANYWHERE: dict[type, Callable[[Any], Any]] = {np.ndarray: np.any}


def register(
    kind: type,
    where: Callable[[Any, Any, Any], Any],
    sqrt: Callable[[Any], Any],
    anywhere: Callable[[Any], Any],
) -> None:
    """Teach `where`, `sqrt` and `anywhere` another kind of scalar, by the type of its values."""
    _WHERE[kind] = where
    _SQRT[kind] = sqrt
    _ANYWHERE[kind] = anywhere


def where(condition: Scalar, yes: Scalar, no: Scalar) -> Scalar:
    """`yes` where the condition holds, else `no`."""
    choose = _WHERE.get(type(condition))
    if choose is None:
        return yes if condition else no
    return choose(condition, yes, no)


def sqrt(x: Scalar) -> Scalar:
    """Square root of x >= 0."""
    root = _SQRT.get(type(x))
    return math.sqrt(x) if root is None else root(x)


def anywhere(condition: Scalar) -> bool:
    """Whether a condition holds for any robot of a batch; work that nobody needs can be left out."""
    test = _ANYWHERE.get(type(condition))
    return bool(condition if test is None else test(condition))


def entry(table: Any, i: Any, j: Any) -> Any:
    """Number j of row i of a table, which may be an array or a list of lists."""
    return table[i][j]


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
