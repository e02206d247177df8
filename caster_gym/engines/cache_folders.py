"""Folders for compiled code, into which nobody else can put code for us to run.

A folder is trusted if it belongs to this user or to root, and neither its group nor others can write to it; links are
followed first, and nobody else may be able to rename what lies above. Root's folders, such as those in the image of a
container, are trusted since root can do anything anyway: they are read, and seldom can be written. What lies above may
also belong to whoever owns `/`, as root appears in containers that do not map it; and it may be writable if it is
sticky, like `/tmp`, where only owners rename. A folder that is not trusted is left alone, and one line says why.
"""

import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

NAME = "caster_gym"
_WRITABLE = stat.S_IWGRP | stat.S_IWOTH
_said: set[str] = set()  # by this process


def cache_folders(chosen: str | None = None) -> Iterator[Path]:
    """Trusted folders for compiled code, made if they can be: the chosen one, else the user's, then a temporary one.

    The temporary folder is the user's own, with mode 0700. It may be that there is no folder at all.
    """
    for find in (partial(_lasting_folder, chosen), _temporary_folder):
        if (folder := find()) is not None:
            yield folder


def fault_of(folder: Path, above: bool = False) -> str | None:
    """Why a folder (resolved) is not to be trusted, or None.

    above: what is asked for is only whether others can rename what lies in it.
    """
    if not hasattr(os, "getuid"):  # Windows, where these folders are within the user's profile
        return None
    for place in (folder, *folder.parents):
        found = place.stat()
        higher = above or place != folder
        if found.st_uid not in _owners(higher):
            return f"{place} belongs to user {found.st_uid}, who could put other code there"
        if found.st_mode & _WRITABLE and not (higher and found.st_mode & stat.S_ISVTX):
            return f"others can write to {place} (mode {stat.S_IMODE(found.st_mode):04o})"
    return None


def is_trusted(found: os.stat_result) -> bool:
    """Whether an open file is a regular one that nobody else can have written."""
    if not hasattr(os, "getuid"):
        return stat.S_ISREG(found.st_mode)
    return stat.S_ISREG(found.st_mode) and found.st_uid in _owners(False) and not found.st_mode & _WRITABLE


def say(sentence: str) -> None:
    """Tell the user something, whether Python shows warnings or not."""
    print(f"{NAME}: {sentence}", file=sys.stderr, flush=True)


def say_once(sentence: str, subject: str | None = None) -> None:
    """The same, once about each subject; without one, once in these words."""
    if (subject or sentence) not in _said:
        _said.add(subject or sentence)
        say(sentence)


def _lasting_folder(chosen: str | None) -> Path | None:
    """The folder that the user has chosen, or his usual one."""
    try:
        wanted = Path(chosen or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        wanted = wanted if chosen else wanted / NAME
        wanted.mkdir(mode=0o755, parents=True, exist_ok=True)
        folder = wanted.resolve(strict=True)
        fault = fault_of(folder)
    except (OSError, RuntimeError):  # no folder can be made there, or nobody knows where home is
        return None
    if fault is None:
        return folder
    say_once(f"compiled code is not kept in {wanted}: {fault}; NUMBA_CACHE_DIR may name another folder")
    return None


def _temporary_folder() -> Path | None:
    """A folder among temporary files that is this user's alone."""
    try:
        folder = Path(tempfile.gettempdir()).resolve(strict=True) / f"{NAME}-{_user()}"
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        trusted = _is_private(folder.lstat()) and fault_of(folder.parent, above=True) is None
    except OSError:
        return None
    return folder if trusted else None


def _owners(higher: bool) -> set[int]:
    """Users whose folders are trusted; higher: for what lies above the folder itself."""
    return {os.getuid(), 0} | ({Path("/").stat().st_uid} if higher else set())


def _is_private(found: os.stat_result) -> bool:
    if not stat.S_ISDIR(found.st_mode):  # a link, above all
        return False
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and stat.S_IMODE(found.st_mode) == 0o700)


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
