"""Teaches Numba the generic mechanics, and keeps what it compiles on disk.

The number of casters is the length of a tuple, hence part of a type: loops over casters unroll while compiling, every
intermediate value is a register, and a loop over the robots of a block becomes SIMD instructions. Arithmetic stays
strict IEEE, so that one robot alone and the same robot in a batch agree to the last bit.
"""

import hashlib
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic, overload, register_jitable

from caster_gym.engines.numba_loops import INLINE
from caster_gym.mechanics import (
    actuation,
    caster,
    contact,
    contact_impulses,
    dynamics,
    first_contact,
    ground,
    impulse,
    integration,
    linear,
    motors,
    plant,
    scalars,
    separation,
)

__all__ = ["INLINE", "announce_compilation", "borrowed", "compiled", "teach"]

_PACKAGE = Path(__file__).resolve().parent.parent
_SETTINGS: Any = numba.config  # makes its attributes at run time
_LOOPS_AND_CHOICES = {scalars.where, scalars.sqrt, scalars.each, scalars.add, scalars.total, scalars.pairs}
_LOOPS_AND_CHOICES |= {
    scalars.flatten,
    scalars.greatest,
    scalars.register,
    scalars.anywhere,
    scalars.entry,
    scalars.memory,
}


def teach(module: ModuleType) -> None:
    """Let compiled code call every function that a module defines, inlined."""
    for function in vars(module).values():
        own = isinstance(function, FunctionType) and function.__module__ == module.__name__
        if own and function not in _LOOPS_AND_CHOICES:
            register_jitable(**INLINE)(function)


def compiled(function: Callable[..., Any]) -> Any:
    """The function compiled at its first call, or read from the cache of an earlier process."""
    with _cache_folder():
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)


def announce_compilation(function: Callable[..., Any], work: str) -> None:
    """Say on stderr that compiling is ahead, unless the cache holds the compiled function already."""
    pattern = f"*{function.__name__}-*.nbi"
    if not any((_cache_root(_SETTINGS.CACHE_DIR) / _source_digest()).rglob(pattern)):
        print(f"caster_gym compiles {work}, once on this machine; this takes 15 to 40 s", file=sys.stderr)


@contextmanager
def _cache_folder() -> Iterator[None]:
    """Numba's cache in a folder of its own for each version of our sources: Numba itself watches one file only."""
    previous = _SETTINGS.CACHE_DIR
    _SETTINGS.CACHE_DIR = str(_cache_root(previous) / _source_digest())
    try:
        yield
    finally:
        _SETTINGS.CACHE_DIR = previous


def _cache_root(chosen: str) -> Path:
    """NUMBA_CACHE_DIR if set, else the user's cache folder, else a temporary one."""
    if chosen:
        return Path(chosen)
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "caster_gym"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.gettempdir()) / "caster_gym"
    return folder if os.access(folder, os.W_OK) else Path(tempfile.gettempdir()) / "caster_gym"


def _source_digest() -> str:
    """Short hash of every source file whose code may be compiled; what is Torch's is not."""
    digest = hashlib.sha256()
    for folder in ("mechanics", "engines", "envs"):
        for file in sorted((_PACKAGE / folder).glob("*.py")):
            if not file.name.startswith("torch_"):
                digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


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
for _module in (separation, first_contact, contact_impulses, contact):
    teach(_module)
