"""Loops over casters and other short tuples, unrolled while compiling.

Up to four items are written out, longer tuples are halved, since the compiler's recursion is limited. Every shape of
tuple is compiled once for itself: writing out makes fewer of them.
"""

from typing import Any

from numba import types
from numba.extending import overload

from caster_gym.mechanics import scalars

# Numba's stubs do not know all options, hence Any. Nobody calls these functions from C: without the entries for it, a
# sixth of the time of compiling is saved.
COMPILED: Any = {"no_cfunc_wrapper": True}
INLINE: Any = {"forceinline": True, **COMPILED}


@overload(scalars.add, jit_options=INLINE, strict=False)
def _add(a: Any, b: Any) -> Any:
    half = len(a) // 2
    if len(a) > 4:
        return lambda a, b: scalars.add(a[:half], b[:half]) + scalars.add(a[half:], b[half:])
    return [
        lambda a, b: (),
        lambda a, b: (a[0] + b[0],),
        lambda a, b: (a[0] + b[0], a[1] + b[1]),
        lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2]),
        lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]),
    ][len(a)]


@overload(scalars.total, jit_options=INLINE, strict=False)
def _total(terms: Any) -> Any:
    add = scalars.add
    if len(terms) > 4:  # always from the first to the last
        return lambda terms: add(add(add(add(scalars.total(terms[:-4]), terms[-4]), terms[-3]), terms[-2]), terms[-1])
    return [
        lambda terms: terms[0],
        lambda terms: add(terms[0], terms[1]),
        lambda terms: add(add(terms[0], terms[1]), terms[2]),
        lambda terms: add(add(add(terms[0], terms[1]), terms[2]), terms[3]),
    ][len(terms) - 1]


@overload(scalars.greatest, jit_options=INLINE, strict=False)
def _greatest(values: Any) -> Any:
    if len(values) == 1:
        return lambda values: values[0]
    return lambda values: scalars.maximum(values[-1], scalars.greatest(values[:-1]))


@overload(scalars.pairs, jit_options=INLINE, strict=False)
def _pairs(flat: Any) -> Any:
    if len(flat) == 2:
        return lambda flat: ((flat[0], flat[1]),)
    half = len(flat) // 4 * 2
    return lambda flat: scalars.pairs(flat[:half]) + scalars.pairs(flat[half:])


@overload(scalars.flatten, jit_options=INLINE, strict=False)
def _flatten(nested: Any) -> Any:
    half = len(nested) // 2  # [:] since the compiler does not add named tuples
    if len(nested) > 4:
        return lambda nested: scalars.flatten(nested[:half]) + scalars.flatten(nested[half:])
    return [
        lambda nested: (),
        lambda nested: nested[0][:],
        lambda nested: nested[0][:] + nested[1][:],
        lambda nested: nested[0][:] + nested[1][:] + nested[2][:],
        lambda nested: nested[0][:] + nested[1][:] + nested[2][:] + nested[3][:],
    ][len(nested)]


@overload(scalars.either, jit_options=INLINE, strict=False)
def _either(thing: Any, absent: Any, present: Any, arguments: Any) -> Any:
    if getattr(thing, "value", thing) in (None, types.none):  # Omitted where it is a default
        return lambda thing, absent, present, arguments: absent(*arguments)
    return lambda thing, absent, present, arguments: present(thing, *arguments)


@overload(scalars.apart, strict=False)
def _apart(function: Any, arguments: Any) -> Any:
    return lambda function, arguments: function(*arguments)


@overload(scalars.each, jit_options=INLINE, strict=False)
def _each(function: Any, shared: Any, *columns: Any) -> Any:
    count, half = len(columns[0]), len(columns[0]) // 2
    if any(len(column) != count for column in columns):
        raise TypeError(f"loops go over equally many items, got {', '.join(str(len(column)) for column in columns)}")
    if count < len(_EACH[len(columns)]):
        return _EACH[len(columns)][count]
    if len(columns) == 1:
        return lambda function, shared, *columns: (
            scalars.each(function, shared, columns[0][:half]) + scalars.each(function, shared, columns[0][half:])
        )
    if len(columns) == 2:
        return lambda function, shared, *columns: (
            scalars.each(function, shared, columns[0][:half], columns[1][:half])
            + scalars.each(function, shared, columns[0][half:], columns[1][half:])
        )
    return lambda function, shared, *columns: (
        scalars.each(function, shared, columns[0][:half], columns[1][:half], columns[2][:half])
        + scalars.each(function, shared, columns[0][half:], columns[1][half:], columns[2][half:])
    )


# by number of columns and of items
_EACH: dict[int, list[Any]] = {
    1: [
        lambda function, shared, *columns: (),
        lambda function, shared, *columns: (function(*shared, columns[0][0]),),
        lambda function, shared, *columns: (function(*shared, columns[0][0]), function(*shared, columns[0][1])),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0]),
            function(*shared, columns[0][1]),
            function(*shared, columns[0][2]),
        ),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0]),
            function(*shared, columns[0][1]),
            function(*shared, columns[0][2]),
            function(*shared, columns[0][3]),
        ),
    ],
    2: [
        lambda function, shared, *columns: (),
        lambda function, shared, *columns: (function(*shared, columns[0][0], columns[1][0]),),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0]),
            function(*shared, columns[0][1], columns[1][1]),
        ),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0]),
            function(*shared, columns[0][1], columns[1][1]),
            function(*shared, columns[0][2], columns[1][2]),
        ),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0]),
            function(*shared, columns[0][1], columns[1][1]),
            function(*shared, columns[0][2], columns[1][2]),
            function(*shared, columns[0][3], columns[1][3]),
        ),
    ],
    3: [
        lambda function, shared, *columns: (),
        lambda function, shared, *columns: (function(*shared, columns[0][0], columns[1][0], columns[2][0]),),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0], columns[2][0]),
            function(*shared, columns[0][1], columns[1][1], columns[2][1]),
        ),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0], columns[2][0]),
            function(*shared, columns[0][1], columns[1][1], columns[2][1]),
            function(*shared, columns[0][2], columns[1][2], columns[2][2]),
        ),
        lambda function, shared, *columns: (
            function(*shared, columns[0][0], columns[1][0], columns[2][0]),
            function(*shared, columns[0][1], columns[1][1], columns[2][1]),
            function(*shared, columns[0][2], columns[1][2], columns[2][2]),
            function(*shared, columns[0][3], columns[1][3], columns[2][3]),
        ),
    ],
}
