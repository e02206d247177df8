"""Folders of results: never mixed with what was there, and never deleted unless they are ours."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MARK = ".caster-gym"  # stands in each folder that may be overwritten


def check_free(folder: Path, overwrite: bool, kept: Path | None = None) -> None:
    """Refuse a folder that holds something, unless it may be overwritten, has our mark, and is without `kept`."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not overwrite:
        raise ValueError(f"{folder} is not empty; choose another --out, or --overwrite it")
    if not (folder / MARK).is_file():
        raise ValueError(f"{folder} is not overwritten, since it does not hold results of caster-gym alone")
    for place in (Path.cwd(), *([kept] if kept else [])):
        if place.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{folder} is not overwritten, since {place} lies in it")


def prepare(folder: Path, overwrite: bool, kept: Path | None = None) -> None:
    """An empty folder with our mark, into which a long run writes as it goes on."""
    check_free(folder, overwrite, kept)
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()


@contextmanager
def staged(folder: Path, overwrite: bool) -> Iterator[Path]:
    """An empty folder that takes the place of `folder`, with our mark, once everything has been written into it.

    If the work fails or is interrupted, what was there before stays as it was.
    """
    check_free(folder, overwrite)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
        fresh, old = Path(temporary) / folder.name, Path(temporary) / "old"
        fresh.mkdir()
        yield fresh
        (fresh / MARK).touch()
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
