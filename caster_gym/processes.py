"""How commands and their worker processes end: SIGTERM is treated like Ctrl-C, and no worker outlives its parent.

A command that SIGTERM has ended returns 143, as shells expect it, which is 128 + 15, and after Ctrl-C 130.
"""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of <sys/prctl.h>


class Terminated(KeyboardInterrupt):  # like the name that it stands for
    """SIGTERM has come: to be treated like Ctrl-C."""


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """What a command returns that was interrupted."""
    return 128 + (signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT)


@contextmanager
def interruptible() -> Iterator[None]:
    """Within the block, SIGTERM raises Terminated, and Ctrl-C KeyboardInterrupt.

    Once one of the two has come, SIGTERM does nothing more: what there is has still to be saved. Signals that the
    process was started to ignore stay ignored. In another thread than the main one nothing changes.
    """
    came: list[int] = []

    def interrupt(number: int, _: FrameType | None) -> NoReturn:
        came.append(number)
        signal.signal(signal.SIGTERM, _do_nothing)
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, interrupt)
    try:
        yield
    except KeyboardInterrupt as error:
        if came[:1] == [signal.SIGTERM] and not isinstance(error, Terminated):  # Ray makes one of its own of it
            raise Terminated from error
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def end_with_parent() -> None:
    """Let this process, which multiprocessing has started, end at once when its parent has ended, however it did."""
    parent = multiprocessing.parent_process()
    assert parent is not None, "only a process that was started has a parent"

    def wait_for_parent() -> None:
        parent.join()
        os._exit(1)

    if sys.platform == "linux":  # at once, even while no thread of Python can run
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    threading.Thread(target=wait_for_parent, daemon=True).start()


def _do_nothing(number: int, _: FrameType | None) -> None:
    """SIGTERM has come before."""
