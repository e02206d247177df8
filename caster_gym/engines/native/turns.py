"""Lets one process at a time do a long piece of work, which all other processes then find done."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows, where every process does the work itself
    fcntl = None

LONGEST_WAIT = 600.0  # s, beyond which whoever has the turn is taken to be stuck
_LOOK_AGAIN = 0.1  # s


class Turn:
    """A turn at a piece of work, held until `end`; a process that dies loses it."""

    def __init__(self, file: Path, handle: int) -> None:
        self._file, self._handle = file, handle

    def end(self) -> None:
        """Let the next one in."""
        self._file.unlink(missing_ok=True)
        os.close(self._handle)


def take_turn(file: Path, on_waiting: Callable[[], None]) -> Turn | None:
    """Wait until no other process works on what the file stands for; None if that cannot be known.

    on_waiting is called once if somebody else is at it.
    """
    if fcntl is None:
        return None
    end, waiting = time.monotonic() + LONGEST_WAIT, False
    while True:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError:  # nowhere to write
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(handle)
            if not isinstance(error, BlockingIOError) or time.monotonic() > end:
                return None
        else:
            return Turn(file, handle)
        if not waiting:
            waiting = True
            on_waiting()
        time.sleep(_LOOK_AGAIN)
