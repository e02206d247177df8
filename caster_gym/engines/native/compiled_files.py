"""The folder of compiled code on disk, shared by environments with the same sources, Python and Numba.

Numba's own cache depends on where a package is installed, so that each virtual environment would compile anew, and two
processes that save different code of one function at the same time may leave it under the wrong name. Here every
specialisation has a file of its own, whose name follows from what was compiled. The first folder that can be written
gets what is new; a cache that can only be read, in a container's image or of another user, serves all the same.
"""

import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np

import caster_gym

_PACKAGE = Path(__file__).resolve().parents[2]
_SETTINGS: Any = numba.config  # makes its attributes at run time
_COMPILED_OTHERWISE = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "CPU_FEATURES")

KEPT_VERSIONS = 32  # folders beside the one in use, of which developers make one with each edit
KEPT_DAYS = 60.0  # without use
_DAY = 86400.0  # s
_OF_A_VERSION = re.compile(r"(cpython-\d+\w*-)?[0-9a-f]{16}")  # names of the folders that may be removed
_CHECKSUM = 16  # bytes in front of each file


def roots() -> Iterator[Path]:
    """Folders for compiled code, the best first: NUMBA_CACHE_DIR, or the user's cache folder; then a temporary one."""
    chosen = _SETTINGS.CACHE_DIR
    yield Path(chosen) if chosen else _of_the_user()
    temporary = Path(tempfile.gettempdir()) / f"caster_gym-{_user()}"
    if _is_ours(temporary):
        yield temporary


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
    """Content of a file that some process has kept, if it is there and whole."""
    for root in roots():
        folder = root / version()
        try:
            content = (folder / name).read_bytes()
        except OSError:
            continue
        if _checksum(content[_CHECKSUM:]) == content[:_CHECKSUM]:
            _note_use(folder)
            return content[_CHECKSUM:]
    return None


def keep(name: str, content: bytes) -> None:
    """Write a file for all processes to come. Raises OSError if no folder can be written.

    Nothing is kept after the sources have changed under a running process, whose code is of the old ones.
    """
    if source_digest() != SOURCES:
        return
    failures = []
    for root in roots():
        folder = root / version()
        unfinished = folder / f"{uuid.uuid4().hex}.part"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            unfinished.write_bytes(_checksum(content) + content)
            unfinished.replace(folder / name)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            failures.append(error)
            continue
        _remove_old_versions(root)
        return
    raise failures[0]


def _of_the_user() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "caster_gym"


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def _is_ours(folder: Path) -> bool:
    """Whether a folder, made if need be, is one in which nobody else can leave code for us to run."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    if not hasattr(os, "getuid"):
        return stat.S_ISDIR(found.st_mode)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


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
    for folder in root.iterdir():
        if _OF_A_VERSION.fullmatch(folder.name) and folder.name != version():
            try:
                others.append((folder.stat().st_mtime, folder))
            except OSError:  # another process removes them too
                continue
    others.sort(reverse=True)
    for i, (used, folder) in enumerate(others):
        if i >= KEPT_VERSIONS or time.time() - used > KEPT_DAYS * _DAY:
            shutil.rmtree(folder, ignore_errors=True)
