"""Files are read here, whoever wrote them: regular ones of a bounded size, whole, without waiting for anything.

A name may lead to a pipe that nobody writes to, to an endless device or to more than fits into the memory. None of them
is opened to be read: what is wrong is told in a sentence that names the file.
"""

import errno
import os
import stat
from pathlib import Path

from caster_gym.brief import brief

# Greatest sizes [bytes]. All that is read is turned into objects within about a second and 200 MB.
YAML_BYTES = 4 << 20  # four times what a task with a timed path of 15,000 poses takes
TABLE_BYTES = 8 << 20  # 50,000 rows of ten columns
PLANNED_BYTES = 4 << 20  # 20,000 samples as planners write them in JSON
WEIGHTS_BYTES = 128 << 20  # 33 million weights, in single precision

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
_FLAGS = (os.O_RDONLY, *(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY")))


def read_bytes(path: str | Path, most: int, remedy: str = "") -> bytes:
    """Content of a regular file of at most so many bytes; remedy: what to do about one that is larger.

    Raises ValueError that names the file and says what is wrong with it.
    """
    path = expanded(path)
    try:
        _check(path, path.stat(), most, remedy)  # before it is opened, which may do something to a device
        handle = os.open(path, sum(_FLAGS))
        with os.fdopen(handle, "rb") as file:
            _check(path, os.fstat(handle), most, remedy)  # what is open now, whatever the name meant before
            content = file.read(most + 1)  # it may still grow
    except FileNotFoundError:
        raise ValueError(f"there is no file {str(path)!r}") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from error
    _check_size(path, len(content), most, remedy)
    return content


def expanded(path: str | Path) -> Path:
    """The path with the home of whoever it begins with, as in ~/runs; there may be nothing at it.

    Raises ValueError for an unknown user, and for what cannot be the name of a file.
    """
    if "\0" in str(path):
        raise ValueError(f"{brief(str(path))} is no name of a file: it holds a zero byte")
    try:
        found = Path(path).expanduser()
        found.lstat()
    except RuntimeError:
        raise ValueError(f"{brief(str(path))} begins with the home of a user that is not known here") from None
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise ValueError(f"{brief(str(path))} is no name of a file: it is too long") from None
    return found


def _check(path: Path, found: os.stat_result, most: int, remedy: str) -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = next((words for is_kind, words in _KINDS if is_kind(found.st_mode)), "something else")
        raise ValueError(f"{path} is {kind}, not a file")
    _check_size(path, found.st_size, most, remedy)


def _check_size(path: Path, size: int, most: int, remedy: str) -> None:
    if size > most:
        raise ValueError(f"{path} is too large: {size / 2**20:.3g} MiB, at most {most / 2**20:.3g} are read{remedy}")
