"""Reports errors of user code in a sentence, with the file and the line."""

import inspect
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from pydantic import PydanticUserError

from caster_gym.brief import brief

_OURS = 2  # of a traceback that belong to us: `in_own_code`, and who calls code of others within it


class OwnCodeError(ValueError):
    """Code of a user has raised something; the message says whose code it is, what it raised and at which line."""


@contextmanager
def in_own_code(what: str, kind: Callable[..., Any]) -> Iterator[None]:
    """Turn whatever is raised within into an OwnCodeError that begins with these words.

    kind: the class or function whose code runs. Of the lines on the way to the error, the last one in its file is
    named, or the last one at all if none is in it; its first line if a call did not even enter it.
    """
    file = getattr(sys.modules.get(getattr(kind, "__module__", "")), "__file__", None)
    try:
        yield
    except Exception as error:  # whatever the code of others does
        here = len(traceback.extract_tb(error.__traceback__)) == _OURS
        if here and isinstance(error, TypeError):
            raise OwnCodeError(f"{what}: TypeError: {error} ({_beginning(kind)})") from error
        raise OwnCodeError(f"{what}: {in_words(error, file)}") from error


def _beginning(kind: Callable[..., Any]) -> str:
    """The file and the line where a class or function begins."""
    try:
        return f"{inspect.getsourcefile(kind)}, line {inspect.getsourcelines(kind)[1]}"
    except (OSError, TypeError):  # it has no source
        return brief(kind)


def in_words(error: Exception, file: str | None = None, advice: str = "") -> str:
    """Kind, message, file and line of an error; see `place_of`."""
    return f"{type(error).__name__}: {_message(error)}{advice} ({place_of(error, file)})"


def _message(error: Exception) -> object:
    """What an error says, without the place or the address that some say too."""
    if isinstance(error, SyntaxError):
        return error.msg
    if isinstance(error, PydanticUserError):
        if error.code == "model-field-missing-annotation":
            return f"{error.message.partition(';')[0]}: write `name: type = value`, as in `speed: float = 1.0`"
        return error.message
    return error


def place_of(error: Exception, file: str | None = None) -> str:
    """The file and the line of an error: the last one in this file, if any is in it; of a syntax error, its own."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}, line {error.lineno}"
    lines = traceback.extract_tb(error.__traceback__)
    last = [*lines, *(line for line in lines if line.filename == file)][-1]
    return f"{last.filename}, line {last.lineno}"
