"""Calls that other processes work off, and what is heard of them meanwhile."""

import pickle
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Self

ATTEMPTS = 5  # of a call whose process is killed, or whose machine is lost, again and again


class Call(NamedTuple):
    """A call of `function(*arguments, report)`, which may `report(anything)` while it lasts; all of it is pickled.

    If its process is killed, another one calls it again, and it must go on from what is left, or give the same.
    """

    name: str  # in messages
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    again: tuple[Any, ...] | None = None  # arguments of later calls, if they are others

    def work(self, attempt: int) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """What is called at an attempt, 1, 2, …"""
        return self.function, self.arguments if attempt == 1 or self.again is None else self.again


class Reported(NamedTuple):
    """What a call has reported."""

    number: int  # of the call, as `submit` has returned it
    content: Any


class Finished(NamedTuple):
    """What a call has returned."""

    number: int
    result: Any


class Workers(AbstractContextManager["Workers"], ABC):
    """Processes that work off calls, in the order in which they are submitted, as many at a time as there are places.

    If the block is left by an error or by Ctrl-C, running calls are interrupted by a KeyboardInterrupt, and waited for.
    """

    places: int

    @abstractmethod
    def submit(self, call: Call) -> int:
        """Add a call; returns its number, 0, 1, …"""

    @abstractmethod
    def events(self) -> Iterator[Reported | Finished]:
        """What is heard until all calls are finished, also those that are submitted meanwhile.

        Raises what a call raises, and ChildProcessError for one whose process was lost ATTEMPTS times.
        """

    def __enter__(self) -> Self:
        return self


def portable(error: Exception) -> Exception:
    """An error that can be sent to another process, with the lines that led to it as a note."""
    trace = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # its class, which may be a user's, asks for more than its message
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(trace)
    return error


def named(error: Exception, name: str) -> Exception:
    """The error of a call, whose name stands before sentences for users."""
    if type(error) is ValueError:
        return ValueError(f"{name}: {error}")
    error.add_note(f"in {name}")
    return error


def lost(call: Call, why: str) -> ChildProcessError:
    """The error of a call whose process was lost too often."""
    return ChildProcessError(f"{call.name}: its process has ended {ATTEMPTS} times before the work was done ({why})")
