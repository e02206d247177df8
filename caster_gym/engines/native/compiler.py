"""Makes Numba compile the generic mechanics.

The number of casters is the length of a tuple, hence part of a type: loops over casters unroll while compiling, every
intermediate value is a register, and a loop over the robots of a block becomes SIMD instructions. Arithmetic stays
strict IEEE, so that one robot alone and the same robot in a batch agree to the last bit.
"""

import math
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic, overload, register_jitable

from caster_gym.engines.native.compilation import Describe, share
from caster_gym.engines.native.loops import COMPILED, INLINE
from caster_gym.mechanics import (
    actuation,
    caster,
    caster_masses,
    contact,
    contact_impulses,
    contact_table,
    dynamics,
    first_contact,
    floor,
    floor_friction,
    free_casters,
    grip_or_slip,
    ground,
    impulse,
    integration,
    linear,
    motors,
    plant,
    room,
    scalars,
    separation,
    slip,
    slip_energy,
    slip_impact,
    slip_state,
    slip_tilt,
)

__all__ = ["INLINE", "borrowed", "compiled", "teach"]

_LOOPS_AND_CHOICES = {scalars.where, scalars.sqrt, scalars.each, scalars.add, scalars.total, scalars.pairs}
_LOOPS_AND_CHOICES |= {
    scalars.flatten,
    scalars.either,
    scalars.apart,
    scalars.greatest,
    scalars.register,
    scalars.anywhere,
    scalars.entry,
    scalars.memory,
}


def teach(module: ModuleType, *except_for: Callable[..., Any]) -> None:
    """Let compiled code call every function that a module defines, inlined; but those that it overloads by itself."""
    for function in vars(module).values():
        own = isinstance(function, FunctionType) and function.__module__ == module.__name__
        if own and function not in _LOOPS_AND_CHOICES and function not in except_for:
            register_jitable(**INLINE)(function)


def compiled(function: Callable[..., Any], describe: Describe | None = None) -> Any:
    """The function compiled at its first call, or read from the cache of an earlier process.

    describe: tells what is compiled, from the types of the arguments. None for what only compiled code calls.
    """
    dispatcher: Any = numba.njit(error_model="numpy", nogil=True, **COMPILED)(function)
    share(dispatcher, function, describe)
    return dispatcher


def _borrowed(_typing: Any, array: Any) -> Any:
    """The same array without a count of its references, which the caller must keep alive.

    Compiled code counts them, atomically, whenever it takes an array out of a tuple: that made the distance to an
    obstacle thirty times slower.
    """

    def view_of(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        view = context.make_array(array)(context, builder, arguments[0])
        null: Any = cgutils.get_null_value
        view.meminfo, view.parent = null(view.meminfo.type), null(view.parent.type)
        return view._getvalue()

    return array(array), view_of


borrowed: Any = intrinsic(_borrowed)


@overload(scalars.where, jit_options=INLINE, strict=False)
def _where(condition: Any, yes: Any, no: Any) -> Any:
    return lambda condition, yes, no: yes if condition else no


@overload(scalars.anywhere, jit_options=INLINE, strict=False)
def _anywhere(condition: Any) -> Any:
    return lambda condition: condition


@overload(scalars.entry, jit_options=INLINE, strict=False)
def _entry(table: Any, i: Any, j: Any) -> Any:
    return lambda table, i, j: table[i, j]  # table[i][j] would make an array of the row


@overload(scalars.memory, jit_options=INLINE, strict=False)
def _memory(nothing: Any, count: Any) -> Any:
    return lambda nothing, count: np.zeros(count)


@overload(scalars.sqrt, jit_options=INLINE, strict=False)
def _sqrt(x: Any) -> Any:
    return lambda x: math.sqrt(x)


for _module in (scalars, linear, caster, dynamics, integration, motors, plant, ground, impulse, actuation):
    teach(_module)
for _module in (
    separation,
    first_contact,
    contact_table,
    contact_impulses,
    contact,
    caster_masses,
    free_casters,
    floor_friction,
    floor,
    slip,
    slip_state,
    slip_impact,
    slip_energy,
    slip_tilt,
    grip_or_slip,
    room,
):
    teach(_module)
