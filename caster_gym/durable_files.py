"""Files and folders that are there whole or not at all, whenever a process or the power ends, and locks of folders.

What is being written has a temporary name, `.caster-gym-HOST-PID-…`, in the folder where it will lie. A process that is
killed leaves it behind; `remove_leftovers` removes it once that process is gone.
"""

import ctypes
import errno
import os
import platform
import re
import shutil
import stat
import sys
import threading
import time
import uuid
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ClassVar

MARK = ".caster-gym"  # a file in each folder that is ours; locks are on it
_HOST = re.sub(r"[^A-Za-z0-9]+", "-", platform.node())[:40] or "here"
_PROCESS = uuid.uuid4().hex[:8]  # numbers of processes are used again, above all in containers
_TEMPORARY = re.compile(rf"\{MARK}-(?P<host>.+)-(?P<pid>\d+)-(?P<process>[0-9a-f]{{8}})-[0-9a-f]{{8}}")
_SET_ASIDE = f"{MARK}-old-"  # before the name of a folder that is about to be replaced
_NO_SUCH_OPERATION = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}
_AT_FDCWD, _EXCHANGE, _SWAP = -100, 2, 2  # of <fcntl.h>, <linux/fs.h> and Darwin's <sys/stdio.h>
_LOCKED_BYTE = 1 << 30  # on Windows nobody can read what is locked: far behind the holder's number
_LOOK_AGAIN = 0.05  # [s]
PATIENCE = 1.0  # [s] that a process which has just been killed may still take to end


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file, text as UTF-8: at every instant the old file is there, or the new one, whole and on the disk.

    If that fails, the old file stays and nothing is left behind. A link stays, and what it points to is replaced.
    """
    path = Path(os.path.realpath(path))
    _refuse_devices(path)
    temporary = path.with_name(temporary_name())
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
    _sync_names(path.parent)


def move_file(finished: Path, path: Path) -> None:
    """Let a file that is complete, on the same disk, take the place of another, as `write_file` does."""
    path = Path(os.path.realpath(path))
    _refuse_devices(path)
    _sync_content(finished)
    finished.replace(path)
    _sync_names(path.parent)


def replace_folder(fresh: Path, folder: Path) -> None:
    """Let a folder that is complete, on the same disk, take the place of another, which is removed if it is there.

    The two are exchanged, so that at every instant one of them is there. A file system that cannot exchange folders,
    such as NFS, sees two renames; a process that is killed between them leaves the old folder under another name in the
    same place, where `remove_leftovers` gives it its name back.
    """
    folder = Path(os.path.realpath(folder))
    for place, _, names in os.walk(fresh):
        for name in names:
            _sync_content(Path(place, name))
        _sync_names(Path(place))
    if not folder.exists():
        fresh.rename(folder)
    elif not _exchange(fresh, folder):
        aside = folder.with_name(_SET_ASIDE + folder.name)
        shutil.rmtree(aside, ignore_errors=True)
        folder.rename(aside)
        try:
            fresh.rename(folder)
        except BaseException:
            aside.rename(folder)
            raise
        fresh = aside
    _sync_names(folder.parent)
    shutil.rmtree(fresh, ignore_errors=True)


@contextmanager
def scratch_folder(where: Path) -> Iterator[Path]:
    """An empty folder with a temporary name in another one, for what is renamed when it is finished."""
    folder = where / temporary_name()
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def temporary_name() -> str:
    """A name that no other file has, and that tells which process made it."""
    return f"{MARK}-{_HOST}-{os.getpid()}-{_PROCESS}-{uuid.uuid4().hex[:8]}"


def remove_leftovers(folder: Path, locked: bool = False) -> None:
    """Remove what processes that are gone have left unfinished in a folder, and complete what they had begun to rename.

    locked: the caller has the lock of the folder and nobody else writes there or below, so that all unfinished goes.
    """
    with suppress(OSError):  # what cannot be removed is in nobody's way
        for one in list(folder.iterdir()):
            is_folder = one.is_dir() and not one.is_symlink()
            found = _TEMPORARY.fullmatch(one.name)
            named = one.with_name(one.name.removeprefix(_SET_ASIDE))
            if named != one and not named.exists():
                one.rename(named)
            elif named != one or (found and (locked or _is_gone(**found.groupdict()))):
                shutil.rmtree(one, ignore_errors=True) if is_folder else one.unlink(missing_ok=True)
            elif locked and is_folder:
                remove_leftovers(one, locked)


def is_temporary(name: str) -> bool:
    """Whether a file of that name is one of those that `remove_leftovers` is for."""
    return name.startswith(_SET_ASIDE) or _TEMPORARY.fullmatch(name) is not None


class FolderInUseError(ValueError):
    """A folder that another process, or thread, uses."""


class FolderLock:
    """Keeps other processes and threads out of a folder while the block runs; ends with the process, however that ends.

    The lock is on the folder's mark, which is made if it is not there. One thread may lock a folder several times.

    patience: [s] to wait for somebody else to end.
    Raises FolderInUseError, which says who uses the folder.
    """

    _holders: ClassVar[dict[tuple[int, int], int]] = {}  # threads, by the mark that they have locked

    def __init__(self, folder: Path, patience: float = PATIENCE) -> None:
        self._folder, self._patience = folder, patience
        self._handle: int | None = None

    def __enter__(self) -> "FolderLock":
        end = time.monotonic() + self._patience
        while not self._take():
            if time.monotonic() >= end:
                raise FolderInUseError(
                    f"{self._folder} is in use by {self._holder()}: wait until that has ended, or choose another folder"
                )
            time.sleep(_LOOK_AGAIN)
        return self

    def __exit__(self, *_: object) -> None:
        if self._handle is not None:
            with suppress(OSError):  # the folder may be gone
                os.ftruncate(self._handle, 0)
            del self._holders[self._key]
            os.close(self._handle)
            self._handle = None

    def _take(self) -> bool:
        """Try once to lock the mark that stands in the folder."""
        mark = self._folder / MARK
        handle = os.open(mark, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        found = os.fstat(handle)
        self._key = (found.st_dev, found.st_ino)
        if (holder := self._holders.get(self._key)) is not None or not _lock(handle):
            os.close(handle)
            return holder == threading.get_ident()
        if not mark.exists() or not os.path.samestat(found, mark.stat()):
            os.close(handle)  # somebody has replaced the folder meanwhile
            return self._take()
        self._handle, self._holders[self._key] = handle, threading.get_ident()
        with suppress(OSError):  # on a full disk nobody learns who the holder is
            os.ftruncate(handle, 0)
            os.write(handle, f"{os.getpid()} {_HOST}\n".encode())
        return True

    def _holder(self) -> str:
        try:
            pid, host = (self._folder / MARK).read_text().split()
        except (OSError, ValueError):
            return "another process"
        return f"process {pid}" + ("" if host == _HOST else f" on {host}")


def _lock(handle: int) -> bool:
    """Lock an open file unless somebody else has; where the file system has no locks, nobody has, and a warning."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
            os.lseek(handle, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EACCES, errno.EDEADLK):
            return False
        warnings.warn(
            f"this file system has no locks ({error.strerror}): nothing keeps two processes out of one folder",
            RuntimeWarning,
            stacklevel=4,
        )
    return True


def _is_gone(host: str, pid: str, process: str) -> bool:
    """Whether a process of this machine has ended; of others it is not known."""
    if host != _HOST or os.name != "posix":
        return False
    if int(pid) == os.getpid():
        return process != _PROCESS
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except OSError:  # of somebody else
        return False
    return False


def _refuse_devices(path: Path) -> None:
    """Only files are replaced: a device or a pipe in their place would be gone."""
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(path.stat().st_mode):
            kind = errno.EISDIR if path.is_dir() else errno.EINVAL
            raise OSError(kind, "is a folder" if path.is_dir() else "is not a regular file", str(path))


def _sync_content(file: Path) -> None:
    """Let the content of a file reach the disk."""
    handle = os.open(file, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sync_names(folder: Path) -> None:
    """Let the names in a folder reach the disk, where that can be asked for."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _NO_SUCH_OPERATION:
            raise
    finally:
        os.close(handle)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders in one step; False, with nothing done, where the system or the file system cannot."""
    library: Any = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
    names = os.fsencode(one), os.fsencode(other)
    if hasattr(library, "renameat2"):
        failed = library.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], ctypes.c_uint(_EXCHANGE))
    elif hasattr(library, "renamex_np"):
        failed = library.renamex_np(*names, ctypes.c_uint(_SWAP))
    else:
        return False
    if failed and (number := ctypes.get_errno()) not in _NO_SUCH_OPERATION:
        raise OSError(number, os.strerror(number), str(other))
    return not failed
