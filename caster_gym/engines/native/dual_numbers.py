"""Dual numbers as scalars of compiled code: a value, and its derivatives along WIDTH directions at once.

The generic mechanics run on them as on plain numbers, so that no derivative needs a formula of its own. The derivatives
(the tangents) are one vector of the processor: compiled code has few more instructions with them than without, and
compiling takes hardly longer. Values are worked out exactly as plain numbers are, to the last bit. The smooth equations
need no more than +, −, ×, ÷ and roots of positive numbers; whoever compares dual numbers gets an error while compiling.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, models, overload, register_model, type_callable

from caster_gym.engines.native.compiler import INLINE

WIDTH = 8  # numbers of 64 bits in the widest registers; processors with narrower ones take several

_lower_builtin: Any = lower_builtin  # Numba ships without types
_NUMBER = ir.DoubleType()
_TANGENTS = ir.VectorType(_NUMBER, WIDTH)
_PAIR = ir.LiteralStructType([_NUMBER, _TANGENTS])
_PLACES = ir.VectorType(ir.IntType(32), WIDTH)

_COMPILED_ALONE = "dual numbers exist in compiled code alone"

Parts = tuple[Any, Any]  # value and tangents while code is made; None in place of tangents that are all zero


class Dual(types.Type):
    """A number of 64 bits with derivatives."""


_kind: Any = Dual
DUAL = _kind(f"Dual({WIDTH})")


@register_model(Dual)
class _DualModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Dual) -> None:
        super().__init__(manager, kind, _PAIR)  # type: ignore[no-untyped-call]  # Numba's


def _dual(builder: Any, value: Any, tangents: Any) -> Any:
    return builder.insert_value(builder.insert_value(_PAIR(ir.Undefined), value, 0), tangents, 1)


def _parts(builder: Any, kind: Any, scalar: Any) -> Parts:
    if not isinstance(kind, Dual):
        return scalar, None
    return builder.extract_value(scalar, 0), builder.extract_value(scalar, 1)


def _scale(builder: Any, factor: Any, tangents: Any) -> Any:
    if tangents is None:
        return None
    first = builder.insert_element(_TANGENTS(ir.Undefined), factor, ir.IntType(32)(0))
    return builder.fmul(builder.shuffle_vector(first, first, _PLACES(None)), tangents)


def _plus(builder: Any, a: Any, b: Any) -> Any:
    if a is None or b is None:
        return b if a is None else a
    return builder.fadd(a, b)


def _minus(builder: Any, a: Any, b: Any) -> Any:
    if b is None:
        return a
    return builder.fneg(b) if a is None else builder.fsub(a, b)


def _add(builder: Any, a: Parts, b: Parts) -> Parts:
    return builder.fadd(a[0], b[0]), _plus(builder, a[1], b[1])


def _subtract(builder: Any, a: Parts, b: Parts) -> Parts:
    return builder.fsub(a[0], b[0]), _minus(builder, a[1], b[1])


def _multiply(builder: Any, a: Parts, b: Parts) -> Parts:
    return builder.fmul(a[0], b[0]), _plus(builder, _scale(builder, b[0], a[1]), _scale(builder, a[0], b[1]))


def _divide(builder: Any, a: Parts, b: Parts) -> Parts:
    """d(a / b) = (da − (a / b) db) / b."""
    quotient, inverse = builder.fdiv(a[0], b[0]), builder.fdiv(_NUMBER(1.0), b[0])
    return quotient, _scale(builder, inverse, _minus(builder, a[1], _scale(builder, quotient, b[1])))


def _negate(builder: Any, a: Parts) -> Parts:
    return builder.fneg(a[0]), builder.fneg(a[1])


def _root(builder: Any, a: Parts) -> Parts:
    """d√a = da / (2 √a)."""
    root = builder.call(builder.module.declare_intrinsic("llvm.sqrt", [_NUMBER]), [a[0]])
    return root, _scale(builder, builder.fdiv(_NUMBER(0.5), root), a[1])


def _teach(operation: Callable[..., Any], rule: Callable[..., Parts], *operands: tuple[Any, ...]) -> None:
    """Let compiled code apply an operation to dual and plain numbers, for each of these kinds of operands."""

    def typing(_context: Any) -> Any:
        if len(operands[0]) == 1:
            return lambda a: DUAL if isinstance(a, Dual) else None
        return lambda a, b: DUAL if any(isinstance(a, x) and isinstance(b, y) for x, y in operands) else None

    type_callable(operation)(typing)

    def lower(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        parts = [_parts(builder, kind, one) for kind, one in zip(signature.args, arguments, strict=True)]
        return _dual(builder, *rule(builder, *parts))

    for kinds in operands:
        _lower_builtin(operation, *kinds)(lower)


_PAIRS = ((Dual, Dual), (Dual, types.Float), (types.Float, Dual))
_teach(operator.add, _add, *_PAIRS)
_teach(operator.sub, _subtract, *_PAIRS)
_teach(operator.mul, _multiply, *_PAIRS)
_teach(operator.truediv, _divide, *_PAIRS)
_teach(operator.neg, _negate, (Dual,))
_teach(math.sqrt, _root, (Dual,))


def _address(context: Any, builder: Any, kind: Any, table: Any, row: Any, first: Any) -> Any:
    """Of as many neighbours in a C-contiguous table as there are tangents."""
    array = context.make_array(kind)(context, builder, table)
    place = builder.add(builder.mul(row, builder.extract_value(array.shape, 1)), first)
    return builder.bitcast(builder.gep(array.data, [place]), _TANGENTS.as_pointer())


def _join(_typing: Any, _value: Any, table: Any, _row: Any, _first: Any) -> Any:
    """A dual number whose tangents stand in a row of a table from a column on."""

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[1], *arguments[1:])
        return _dual(builder, arguments[0], builder.load(address, align=8))

    return DUAL(types.float64, table, types.intp, types.intp), make


_join_one: Any = intrinsic(_join)


def _split(_typing: Any, _number: Any, table: Any, _row: Any, _first: Any) -> Any:
    """The value of a dual number; its tangents go into a row of a table from a column on."""

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value, tangents = _parts(builder, DUAL, arguments[0])
        builder.store(tangents, _address(context, builder, signature.args[1], *arguments[1:]), align=8)
        return value

    return types.float64(DUAL, table, types.intp, types.intp), make


_split_one: Any = intrinsic(_split)


def take(array: Any, first: Any, like: tuple[Any, ...]) -> tuple[Any, ...]:
    """As many numbers of an array (n,) as the tuple `like` has items, from an index on."""
    return tuple(array[first : first + len(like)])


def join(values: tuple[Any, ...], tangents: Any, row: Any, first: Any) -> Any:
    """Values as dual numbers, whose tangents stand in rows of an array (n, K) from `row` and from a column on."""
    raise NotImplementedError(_COMPILED_ALONE)


def split(duals: tuple[Any, ...], values: Any, tangents: Any, row: Any, first: Any) -> None:
    """Inverse of `join`, into rows of `values` (n,) and `tangents` (n, K) from `row` and from a column on."""
    raise NotImplementedError(_COMPILED_ALONE)


@overload(take, jit_options=INLINE, strict=False)
def _take(array: Any, first: Any, like: Any) -> Any:
    half = len(like) // 2
    if half == 0:
        return lambda array, first, like: (array[first],)
    return lambda array, first, like: take(array, first, like[:half]) + take(array, first + half, like[half:])


@overload(join, jit_options=INLINE, strict=False)
def _joined(values: Any, tangents: Any, row: Any, first: Any) -> Any:
    half = len(values) // 2
    if half == 0:
        return lambda values, tangents, row, first: (_join_one(values[0], tangents, row, first),)
    return lambda values, tangents, row, first: (
        join(values[:half], tangents, row, first) + join(values[half:], tangents, row + half, first)
    )


@overload(split, jit_options=INLINE, strict=False)
def _splitting(duals: Any, values: Any, tangents: Any, row: Any, first: Any) -> Any:
    half = len(duals) // 2

    def split_one(duals: Any, values: Any, tangents: Any, row: Any, first: Any) -> None:
        values[row] = _split_one(duals[0], tangents, row, first)

    def split_halves(duals: Any, values: Any, tangents: Any, row: Any, first: Any) -> None:
        split(duals[:half], values, tangents, row, first)
        split(duals[half:], values, tangents, row + half, first)

    return split_halves if half else split_one
