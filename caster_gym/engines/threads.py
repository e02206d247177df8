"""Compiled code on several cores: blocks of robots shared out over threads that release the interpreter's lock.

Threads that sleep while they wait keep their speed beside other busy processes; spinning ones, as OpenMP's, then lose
most of it. How many are used is `numba.get_num_threads()`, so that NUMBA_NUM_THREADS and numba.set_num_threads hold.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba

BLOCKS_PER_THREAD = 4  # least, since waking a thread costs about as much as stepping so many blocks

_pool: ThreadPoolExecutor | None = None


def over_blocks(function: Callable[..., Any], blocks: int, *arguments: Any) -> None:
    """function(first, end, *arguments) for ranges that cover all blocks, one range a thread."""
    threads = min(numba.get_num_threads(), blocks // BLOCKS_PER_THREAD)
    if threads < 2:
        function(0, blocks, *arguments)
        return
    bounds = [blocks * i // threads for i in range(threads + 1)]
    others = [_threads().submit(function, bounds[i], bounds[i + 1], *arguments) for i in range(1, threads)]
    function(bounds[0], bounds[1], *arguments)
    for other in others:
        other.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="caster_gym")
    return _pool


def _forget() -> None:
    """A forked process has none of its parent's threads."""
    global _pool
    _pool = None


os.register_at_fork(after_in_child=_forget)
