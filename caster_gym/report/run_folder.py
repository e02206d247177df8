"""Folders of results: checked before anything is computed, used by one process at a time, deleted only if ours.

A command that overwrites results as it goes on sets the old ones aside, within the folder, until it has results of its
own. If it is killed before, `--overwrite` first brings them back. Whatever `begun` and `staged` are told of a folder
that is a link holds for the folder that it leads to.
"""

import errno
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath

from caster_gym.durable_files import (
    MARK,
    FolderLock,
    is_temporary,
    remove_leftovers,
    replace_folder,
    scratch_folder,
    write_file,
)

BEFORE = f"{MARK}-before"  # within a folder: the results that are overwritten, and all other files are new
MOVING = f"{MARK}-moving"  # the same on their way there or back: all other files are old
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # of an address such as s3://bucket/run; a drive has one letter
_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")  # which systems leave wherever a person looks


def check_free(folder: Path, overwrite: bool, ours: Sequence[str], kept: Sequence[Path] = ()) -> None:
    """Refuse a folder that cannot be made, or that holds something.

    One that holds something may be overwritten if it has our mark, only files that the command writes, and neither one
    of `kept` nor the working folder in it. ours: patterns of these files, such as "best/*.yaml"; a * is within a name.
    """
    check_can_be_made(folder)
    if not folder.exists() or not any(_content(folder)):
        return
    reason = _reason_to_keep(folder, ours, kept)
    if overwrite and reason:
        raise ValueError(f"{folder} is not overwritten, since {reason}; choose another --out")
    if not overwrite:
        remedy = "" if reason else ", or add --overwrite to delete what is in it"
        raise ValueError(f"{folder} is not empty; choose another --out{remedy}")


def _content(folder: Path) -> Iterator[Path]:
    """What is in a folder, but our mark and what was being written when somebody was killed."""
    return (one for one in folder.iterdir() if one.name != MARK and not is_temporary(one.name))


def _reason_to_keep(folder: Path, ours: Sequence[str], kept: Sequence[Path]) -> str:
    """Why a folder must not be overwritten, or nothing."""
    if not (folder / MARK).is_file() or (folder / MARK).is_symlink():
        return "it does not hold results of caster-gym alone"
    for place in (Path.cwd(), *kept):
        if place.resolve().is_relative_to(folder.resolve()):
            return f"{place} lies in it"
    for file in _files(folder):
        if not _is_one_of(file.relative_to(folder), ours):
            return f"{file} is not a file that this command writes"
    return ""


def _files(folder: Path) -> Iterator[Path]:
    """All files and links in a folder and below, but our marks, what was left unfinished, and litter."""
    for one in sorted(folder.iterdir()):
        if one.name in (MARK, *_LITTER) or is_temporary(one.name):
            continue
        if one.is_dir() and not one.is_symlink():
            yield from _files(one)
        else:
            yield one


def _is_one_of(file: Path, patterns: Sequence[str]) -> bool:
    """Whether a name, relative to its folder or to what was set aside in it, fits one of the patterns."""
    parts = file.parts[1:] if file.parts[0] in (BEFORE, MOVING) else file.parts
    return any(PurePosixPath("/", *parts).match(f"/{pattern}") for pattern in patterns)


def check_can_be_made(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, in a sentence; leaves nothing behind."""
    if _SCHEME.fullmatch(folder.parts[0] if folder.parts else ""):
        address = f"{folder.parts[0]}//{'/'.join(folder.parts[1:])}"
        raise ValueError(
            f"results cannot be written to {address}, since locks and renames need a file system; give --out a folder, "
            "which several machines must see under the same name"
        )
    try:
        above = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists() or one.is_symlink())
        if above.is_dir():
            with scratch_folder(above):
                return
        what = "not a folder" if above.exists() else "a link to nothing"
        raise ValueError(f"results cannot be written to {folder}: {above} is {what}; choose another --out")
    except OSError as error:
        why = "new folders are not possible there" if error.errno == errno.ENOENT else error.strerror
        raise ValueError(f"results cannot be written to {folder}: {why}; choose another --out") from error


def check_file(file: Path, overwrite: bool, option: str) -> None:
    """Refuse the name of a file that cannot be written, or that is there already."""
    if file.is_dir():
        raise ValueError(f"{file} is a folder; give {option} the name of a file in it")
    if file.exists() and not file.is_file():
        raise ValueError(f"{file} is not a file but a device or the like; choose another {option}")
    home = Path(os.path.realpath(file)).parent
    if not home.is_dir():
        named = home if file.is_symlink() else file.parent
        raise ValueError(f"there is no folder {str(named)!r} to write {file.name} in; make it first")
    if file.exists() and not overwrite:
        raise ValueError(f"{file} is there already; choose another {option}, or add --overwrite to replace it")
    remove_leftovers(home)
    try:
        with scratch_folder(home):
            pass
    except OSError as error:
        why = "new files are not possible there" if error.errno == errno.ENOENT else error.strerror
        raise ValueError(f"{file} cannot be written: {why}; choose another {option}") from error


@contextmanager
def begun(
    folder: Path,
    overwrite: bool,
    result: str | Sequence[str],
    kept: Sequence[Path] = (),
    ours: Sequence[str] = (),
    resume: bool = False,
) -> Iterator[None]:
    """A locked folder with our mark, empty unless resumed, into which a long run writes as it goes on.

    result: patterns of files that are worth keeping when the work fails or is interrupted. Without any, the folder is
    again as it was, so that the next start finds nothing in its way, and what was there before is not lost. kept: files
    that the work reads, which must not lie in the folder. ours: patterns of all files that the work writes, see
    `check_free`. resume: go on in a folder of ours with what is in it.
    """
    if resume and overwrite:
        raise ValueError("--resume goes on with what is in the folder, and --overwrite deletes it: give one of the two")
    real = Path(os.path.realpath(folder))
    goes_on = resume and (real / MARK).is_file() and any(_content(real))
    if not goes_on:
        check_free(folder, overwrite, ours, kept)
    results = (result,) if isinstance(result, str) else tuple(result)
    with _locked(real, goes_on):
        if not goes_on:
            check_free(folder, overwrite, ours, kept)  # once more, now that nobody else writes there
            if (real / BEFORE).is_dir() or (real / MOVING).is_dir():
                _clear_up(real, results, ours)
        try:
            if not goes_on:
                _set_aside(real)
            yield
        except BaseException:
            if not goes_on:
                _clear_up(real, results, ours)
            raise
        shutil.rmtree(real / BEFORE, ignore_errors=True)


@contextmanager
def _locked(folder: Path, stays: bool = False) -> Iterator[None]:
    """Make and lock a folder, and clean it; if the work fails with nothing in it, what was made goes again."""
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    marked = (folder / MARK).exists()
    folder.mkdir(parents=True, exist_ok=True)
    with FolderLock(folder):
        remove_leftovers(folder, locked=True)
        try:
            yield
        except BaseException:
            if not stays and not any(_content(folder)):
                with suppress(OSError):  # somebody else may have put something there
                    if not marked:
                        (folder / MARK).unlink()
                    for one in new:
                        one.rmdir()
            raise


def _set_aside(folder: Path) -> None:
    """Move all that is in a folder to BEFORE. Killed at any instant, `_clear_up` undoes it."""
    there = list(_content(folder))
    if there:
        (folder / MOVING).mkdir()
        for one in there:
            one.rename(folder / MOVING / one.name)
        (folder / MOVING).rename(folder / BEFORE)


def _clear_up(folder: Path, results: Sequence[str], ours: Sequence[str]) -> None:
    """After a run that failed or was killed: leave its results, or, if it has none, what was there before."""
    if not (folder / MOVING).is_dir():
        if any(any(folder.glob(one)) for one in results):
            shutil.rmtree(folder / BEFORE, ignore_errors=True)
            return
        _remove(folder, ours)
        if not (folder / BEFORE).is_dir():
            return
        (folder / BEFORE).rename(folder / MOVING)
    _merge(folder / MOVING, folder)


def _merge(source: Path, target: Path) -> None:
    """Move what is in a folder into another one, and into its folders, where somebody may have put something."""
    for one in list(source.iterdir()):
        place = target / one.name
        if place.is_dir() and not one.is_symlink():
            _merge(one, place)
        else:
            one.rename(place)
    source.rmdir()


def _remove(folder: Path, ours: Sequence[str]) -> None:
    """Delete our own files in a folder, but not what was set aside, and the folders that are empty then."""
    for one in _content(folder):
        if one.name not in (BEFORE, MOVING):
            for file in _files(one) if one.is_dir() and not one.is_symlink() else [one]:
                if _is_one_of(file.relative_to(folder), ours):
                    file.unlink()
            for place, _, _ in os.walk(one, topdown=False):
                with suppress(OSError):
                    Path(place).rmdir()


@contextmanager
def staged(folder: Path, overwrite: bool, ours: Sequence[str], kept: Sequence[Path] = ()) -> Iterator[Path]:
    """An empty folder that takes the place of `folder`, with our mark, once everything has been written into it.

    If the work fails, is interrupted or killed, what was there before stays as it was. For ours and kept see `begun`.
    """
    check_free(folder, overwrite, ours, kept)
    folder = Path(os.path.realpath(folder))
    stays = folder.exists() and not any(_content(folder))  # perhaps a working folder, or a place to mount
    if os.path.ismount(folder) and not stays:
        raise ValueError(f"{folder} is not overwritten, since a disk is mounted there; give --out a folder in it")
    with _locked(folder):
        check_free(folder, overwrite, ours, kept)  # once more, now that nobody else writes there
        remove_leftovers(folder.parent)
        with scratch_folder(folder if stays else folder.parent) as fresh:
            yield fresh
            if stays:
                for one in list(fresh.iterdir()):
                    one.rename(folder / one.name)
            else:
                write_file(fresh / MARK, "")
                replace_folder(fresh, folder)
