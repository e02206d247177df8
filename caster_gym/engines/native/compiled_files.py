"""The files of compiled code on disk, shared by environments with the same sources, Python and Numba.

Numba's own cache depends on where a package is installed, so that each virtual environment would compile anew, and two
processes that save different code of one function at the same time may leave it under the wrong name. Here every
specialisation has a file of its own, whose name follows from what was compiled. The first folder that can be written
gets what is new; a cache that can only be read, such as root's in a container's image, serves all the same. Reading a
file runs code in it, so that only those are read which nobody else can have written; see `cache_folders`.
"""

import hashlib
import os
import re
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np

import caster_gym
from caster_gym.durable_files import remove_leftovers, temporary_name
from caster_gym.engines.cache_folders import cache_folders, is_trusted, say_once

_PACKAGE = Path(__file__).resolve().parents[2]
_SETTINGS: Any = numba.config  # makes its attributes at run time
_COMPILED_OTHERWISE = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "CPU_FEATURES")

KEPT_VERSIONS = 32  # folders beside the one in use, of which developers make one with each edit
KEPT_DAYS = 60.0  # without use
_DAY = 86400.0  # s
_OF_A_VERSION = re.compile(r"(cpython-\d+\w*-)?[0-9a-f]{16}")  # names of the folders that may be removed
_CHECKSUM = 16  # bytes in front of each file
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def roots() -> Iterator[Path]:
    """Trusted folders for compiled code, the best first: NUMBA_CACHE_DIR or the user's cache; then a temporary one."""
    return cache_folders(_SETTINGS.CACHE_DIR)


def version_folder() -> Path | None:
    """Where code of this version is kept first of all; None if there is no folder for it."""
    return next((root / version() for root in roots()), None)


def source_digest() -> str:
    """Short hash of every source file whose code may be compiled; what is Torch's is not."""
    digest = hashlib.sha256()
    for folder in ("mechanics", "engines", "envs", "tasks"):
        for file in sorted((_PACKAGE / folder).rglob("*.py")):
            if "tensor" not in (file.parent.name, file.stem):
                digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


SOURCES = source_digest()  # of what this process has read


@cache
def version() -> str:
    """Name of the folder for these sources, this Python and Numba, and what Numba is told in its settings."""
    told = [getattr(_SETTINGS, name, None) for name in _COMPILED_OTHERWISE]
    parts = (SOURCES, caster_gym.__version__, numba.__version__, np.__version__.split(".")[0])
    digest = hashlib.sha256(repr((parts, told)).encode()).hexdigest()[:16]
    return f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}-{digest}"


def read(name: str) -> bytes | None:
    """Content of a file that some process has kept, if it is there and whole; one that is damaged is removed."""
    for root in roots():
        folder = root / version()
        try:
            content = _trusted_content(folder / name)
        except FileNotFoundError:
            continue
        except OSError:  # a link, a folder, or of somebody else
            content = b""
        if _checksum(content[_CHECKSUM:]) == content[:_CHECKSUM]:
            _note_use(folder)
            return content[_CHECKSUM:]
        _remove(folder / name)
    return None


def remove(name: str) -> None:
    """Remove a file whose content, although whole, is not what its name says."""
    for root in roots():
        if os.path.lexists(root / version() / name):
            _remove(root / version() / name)


def keep(name: str, content: bytes) -> None:
    """Write a file for all processes to come. Raises OSError if no folder can be written.

    Nothing is kept after the sources have changed under a running process, whose code is of the old ones.
    """
    if source_digest() != SOURCES:
        return
    failure = OSError("there is no folder that only this user can write to")
    for root in roots():
        folder = root / version()
        try:
            folder.mkdir(mode=0o755, exist_ok=True)
            _write(folder / name, _checksum(content) + content)
        except OSError as error:
            failure = error
            continue
        _remove_old_versions(root)
        return
    raise failure


def _trusted_content(file: Path) -> bytes:
    """Content of a file that nobody else can have written. Raises OSError."""
    handle = os.open(file, _READ)
    try:
        if not is_trusted(os.fstat(handle)):
            raise PermissionError(f"others can write to {file}")
        with os.fdopen(handle, "rb", closefd=False) as opened:
            return opened.read()
    finally:
        os.close(handle)


def _write(file: Path, content: bytes) -> None:
    """Write a file, all of it or nothing, that only this user can write again."""
    remove_leftovers(file.parent)
    unfinished = file.with_name(temporary_name())
    try:
        with os.fdopen(os.open(unfinished, _NEW, 0o644), "wb") as opened:
            opened.write(content)
        unfinished.replace(file)
    except BaseException:
        with suppress(OSError):
            unfinished.unlink()
        raise


def _remove(file: Path) -> None:
    """Remove what is not to be read again, and say so, once for all that is found."""
    what = f"{file} is damaged, or not of this user"
    try:
        file.unlink()
    except OSError as error:
        say_once(f"{what}: it is left aside, since it cannot be removed ({error.strerror})", "damage")
    else:
        say_once(f"{what}: it was removed and is compiled again, as are others like it", "damage")


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_CHECKSUM).digest()


def _note_use(folder: Path) -> None:
    """Let a folder's time tell when it was last used, to a day."""
    try:
        if time.time() - folder.stat().st_mtime > _DAY:
            os.utime(folder)
    except OSError:  # somebody else's, or gone
        return


def _remove_old_versions(root: Path) -> None:
    """Remove folders of versions that nobody has used for long, and the longest unused of too many."""
    others = []
    for folder in _inside(root):
        if _OF_A_VERSION.fullmatch(folder.name) and folder.name != version():
            try:
                others.append((folder.stat().st_mtime, folder))
            except OSError:  # another process removes them too
                continue
    others.sort(reverse=True)
    for i, (used, folder) in enumerate(others):
        if i >= KEPT_VERSIONS or time.time() - used > KEPT_DAYS * _DAY:
            shutil.rmtree(folder, ignore_errors=True)


def _inside(root: Path) -> list[Path]:
    try:
        return list(root.iterdir())
    except OSError:
        return []
