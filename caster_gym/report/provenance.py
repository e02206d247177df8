"""Provenance of results: versions, commit and settings, written beside them."""

import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import yaml

import caster_gym
from caster_gym.durable_files import write_file

PACKAGES = ("numpy", "numba", "gymnasium", "torch", "stable-baselines3", "scipy")


def versions() -> dict[str, str]:
    """Versions of caster_gym, its commit, Python and the packages that results depend on."""
    found = {"caster_gym": caster_gym.__version__, "commit": commit(), "python": platform.python_version()}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def versions_in_words(*packages: str) -> str:
    """Versions of Python and of those of the packages that are installed, on one line."""
    found = {"Python": platform.python_version()}
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return ", ".join(f"{name} {number}" for name, number in found.items())


def command_line(module: str, arguments: Sequence[str] | None) -> str:
    """The command that runs a module with these arguments, or, if None, with those of this process."""
    return shlex.join(["python", "-m", module, *(sys.argv[1:] if arguments is None else arguments)])


def commit() -> str:
    """Commit of the checkout that runs, with "+" if files differ from it; "unknown" for an installed package."""
    folder = Path(caster_gym.__file__).parent
    try:
        hash_ = _git(folder, "rev-parse", "--short=12", "HEAD")
        tracked = _git(folder, "ls-files", "__init__.py")
        changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return (hash_ + ("+" if changed else "")) if tracked else "unknown"


def write_provenance(folder: Path, **content: Any) -> None:
    """run.yaml: the command, the versions, and whatever else explains how a result came about."""
    folder.mkdir(parents=True, exist_ok=True)
    program = Path(sys.argv[0])
    name = f"python -m {program.parent.name}" if program.name == "__main__.py" else program.name
    full = {"command": " ".join([name, *sys.argv[1:]]), "versions": versions(), **content}
    write_file(folder / "run.yaml", yaml.safe_dump(full, sort_keys=False, allow_unicode=True))


def _git(folder: Path, *arguments: str) -> str:
    result = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=True, timeout=10)
    return result.stdout.strip()
