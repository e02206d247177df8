"""Compiled code on several cores: threads that release the interpreter's lock share the blocks of robots.

Threads that sleep while they wait keep their speed beside other busy processes; spinning ones, as OpenMP's, then lose
most of it. How many are used follows from the environment, see `default_threads`, until `set_threads` is called. The
pool of Numba is left alone: waking it would change the number of threads that Torch uses.
"""

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

from caster_gym.engines.native.cores import default_threads

BLOCKS_PER_SHARE = 4  # least, since waking a thread costs about as much as stepping so many blocks
SHARES_PER_THREAD = 4  # a thread that wakes late, or beside a busy process, leaves more of them to the others

_count = 0  # until the first use: schedulers set affinity and environment after a process has started, too
_pool: ThreadPoolExecutor | None = None


def get_threads() -> int:
    """Greatest number of threads that a batch is stepped with."""
    global _count
    if _count == 0:
        _count = default_threads()
    return _count


def set_threads(count: int) -> None:
    """Step batches with so many threads at most. Raises ValueError for fewer than one."""
    global _count, _pool
    if count < 1:
        raise ValueError(f"the number of threads must be 1 or more, got {count}")
    if _pool is not None and count != _count:
        _pool.shutdown()
        _pool = None
    _count = count


def over_blocks(function: Callable[..., Any], blocks: int, *arguments: Any) -> None:
    """function(first, end, *arguments) for ranges that cover all blocks; threads take one after the other.

    After an error, or an interrupt, those that nobody has begun are left out, and nothing goes on behind the caller's
    back.
    """
    count = _count or get_threads()
    shares = min(count * SHARES_PER_THREAD, blocks // BLOCKS_PER_SHARE)
    if count < 2 or shares < 2:
        function(0, blocks, *arguments)
        return
    bounds = [blocks * i // shares for i in range(shares + 1)]
    untaken = iter(pairwise(bounds))

    def work() -> None:
        for first, end in untaken:
            function(first, end, *arguments)

    others = [_threads().submit(work) for _ in range(min(count, shares) - 1)]
    try:
        work()
    finally:
        deque(untaken, maxlen=0)
        wait([other for other in others if not other.cancel()])
    for other in others:
        if not other.cancelled():
            other.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(_count, thread_name_prefix="caster_gym")
    return _pool


def _forget() -> None:
    """A forked process has none of its parent's threads."""
    global _pool
    _pool = None


os.register_at_fork(after_in_child=_forget)
