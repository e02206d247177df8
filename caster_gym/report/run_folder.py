"""Folders of results: checked before anything is computed, never mixed with other files, deleted only if ours."""

import errno
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

MARK = ".caster-gym"  # stands in each folder that may be overwritten


def check_free(folder: Path, overwrite: bool, kept: Path | None = None) -> None:
    """Refuse a folder that cannot be made, or that holds something.

    One that holds something may be overwritten if it has our mark and neither `kept` nor the working folder in it.
    """
    check_can_be_made(folder)
    if not folder.exists() or not any(folder.iterdir()):
        return
    reason = _reason_to_keep(folder, kept)
    if overwrite and reason:
        raise ValueError(f"{folder} is not overwritten, since {reason}; choose another --out")
    if not overwrite:
        remedy = "" if reason else ", or add --overwrite to delete what is in it"
        raise ValueError(f"{folder} is not empty; choose another --out{remedy}")


def _reason_to_keep(folder: Path, kept: Path | None) -> str:
    """Why a folder must not be overwritten, or nothing."""
    if not (folder / MARK).is_file():
        return "it does not hold results of caster-gym alone"
    for place in (Path.cwd(), *([kept] if kept else [])):
        if place.resolve().is_relative_to(folder.resolve()):
            return f"{place} lies in it"
    return ""


def check_can_be_made(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, in a sentence; leaves nothing behind."""
    try:
        above = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists() or one.is_symlink())
        if above.is_dir():
            with tempfile.TemporaryDirectory(dir=above, prefix=".caster-gym-"):
                return
        raise ValueError(f"results cannot be written to {folder}: {above} is not a folder; choose another --out")
    except OSError as error:
        why = "new folders are not possible there" if error.errno == errno.ENOENT else error.strerror
        raise ValueError(f"results cannot be written to {folder}: {why}; choose another --out") from error


def check_file(file: Path, overwrite: bool, option: str) -> None:
    """Refuse the name of a file that cannot be written, or that is there already."""
    if file.is_dir():
        raise ValueError(f"{file} is a folder; give {option} the name of a file in it")
    if not file.absolute().parent.is_dir():
        raise ValueError(f"there is no folder {str(file.parent)!r} to write {file.name} in; make it first")
    if file.exists() and not overwrite:
        raise ValueError(f"{file} is there already; choose another {option}, or add --overwrite to replace it")
    try:
        with tempfile.TemporaryDirectory(dir=file.absolute().parent, prefix=".caster-gym-"):
            pass
    except OSError as error:
        why = "new files are not possible there" if error.errno == errno.ENOENT else error.strerror
        raise ValueError(f"{file} cannot be written: {why}; choose another {option}") from error


@contextmanager
def begun(folder: Path, overwrite: bool, result: str, kept: Sequence[Path] = ()) -> Iterator[None]:
    """An empty folder with our mark, into which a long run writes as it goes on.

    result: pattern of files that are worth keeping when the work fails or is interrupted. Without any, the folder is
    again as it was, so that the next start finds nothing in its way, and what was there before is not lost. kept: files
    that the work reads, which must not lie in the folder.
    """
    for one in (None, *kept):
        check_free(folder, overwrite, one)
    folder = folder.absolute()
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        aside: Path | None = None
        if any(folder.iterdir()):
            beside = tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.")
            aside = Path(stack.enter_context(beside))
            _move_content(folder, aside)
        (folder / MARK).touch()
        try:
            yield
        except BaseException:
            if not any(folder.glob(result)):
                _empty(folder)
                if aside:
                    _move_content(aside, folder)
                with suppress(OSError):  # somebody else may have put something there
                    for one in new:
                        one.rmdir()
            raise


def _empty(folder: Path) -> None:
    for one in folder.iterdir():
        if one.is_dir() and not one.is_symlink():
            shutil.rmtree(one)
        else:
            one.unlink()


def _move_content(source: Path, target: Path) -> None:
    for one in list(source.iterdir()):
        shutil.move(one, target / one.name)


@contextmanager
def staged(folder: Path, overwrite: bool, kept: Path | None = None) -> Iterator[Path]:
    """An empty folder that takes the place of `folder`, with our mark, once everything has been written into it.

    If the work fails or is interrupted, what was there before stays as it was.
    """
    check_free(folder, overwrite, kept)
    folder = folder.absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    empty = folder.exists() and not any(folder.iterdir())  # perhaps a working folder, or a place to mount: it stays
    home = folder if empty else folder.parent
    with tempfile.TemporaryDirectory(dir=home, prefix=f".{folder.name}.") as temporary:
        fresh, old = Path(temporary) / folder.name, Path(temporary) / "old"
        fresh.mkdir()
        yield fresh
        (fresh / MARK).touch()
        if empty:
            _move_content(fresh, folder)
            return
        if folder.exists():
            folder.rename(old)
        try:
            fresh.rename(folder)
        except BaseException:
            if old.exists():
                old.rename(folder)
            raise


def replace_file(file: Path, text: str) -> None:
    """Write a text file at once: whoever reads it finds the old one or the new one, whole."""
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=file.parent, delete=False) as fresh:
        fresh.write(text)
    Path(fresh.name).chmod(0o644)
    Path(fresh.name).replace(file)
