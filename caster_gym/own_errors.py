"""Reports errors of user code in a sentence, with the file and the line."""

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager


class OwnCodeError(ValueError):
    """Code of a user has raised something; the message says whose code it is, what it raised and at which line."""


@contextmanager
def in_own_code(what: str, kind: type) -> Iterator[None]:
    """Turn whatever is raised within into an OwnCodeError that begins with these words.

    kind: the class whose code runs; of the lines on the way to the error, the last one in its file is named, or the
    last one at all if none is in it.
    """
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    try:
        yield
    except Exception as error:  # whatever the code of others does
        raise OwnCodeError(f"{what}: {in_words(error, file)}") from error


def in_words(error: Exception, file: str | None = None, advice: str = "") -> str:
    """Kind, message, file and line of an error; see `place_of`."""
    message = error.msg if isinstance(error, SyntaxError) else error  # whose text has the place in it too
    return f"{type(error).__name__}: {message}{advice} ({place_of(error, file)})"


def place_of(error: Exception, file: str | None = None) -> str:
    """The file and the line of an error: the last one in this file, if any is in it; of a syntax error, its own."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}, line {error.lineno}"
    lines = traceback.extract_tb(error.__traceback__)
    last = [*lines, *(line for line in lines if line.filename == file)][-1]
    return f"{last.filename}, line {last.lineno}"
