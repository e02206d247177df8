"""Imports user code that settings name as `module:Name`.

A module is looked for beside the file that names it, in the working folder, and among the installed packages. Importing
it runs its code, so that no file in a folder of results, which may come from a stranger, brings any.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from traceback import extract_tb
from typing import Any, NamedTuple

from caster_gym.brief import brief
from caster_gym.configuration import ConfigurationError, did_you_mean
from caster_gym.own_errors import in_words

RESULTS = ("policy.yaml", "run.yaml")  # files that mark a folder as that of a policy or of a run


class OwnCode(NamedTuple):
    """What a setting may name."""

    key: str  # of the setting
    kind: str  # what is written as module:Name, as "a class"
    fits: Callable[[object], bool]
    wanted: str  # what it must be, in words
    nothing: str  # what is said of a module without such a thing

    def load(self, reference: str, folder: Path | None = None) -> Any:
        """What `module:Name` means in a file of this folder. Raises ConfigurationError that does not name the file."""
        module, _, name = reference.partition(":")
        if module.endswith(".py"):
            better = f"{Path(module).stem}:{name}"
            raise ConfigurationError(f"a module is named without .py: {self.key} {better}, got {reference!r}")
        if not all(part.isidentifier() for part in (*module.split("."), name)):
            raise ConfigurationError(f"{self.kind} of your own is written as module:Name, got {self.key} {reference!r}")
        folder = folder and folder.absolute()
        if module not in sys.modules and folder is not None and any((folder / one).is_file() for one in RESULTS):
            raise ConfigurationError(
                f"{folder} is a folder of results, from which no code is run: copy the file to a folder of your own to "
                f"use its {self.key} {reference!r}"
            )
        places = [str(place) for place in (folder, Path.cwd()) if place is not None]
        sys.path += [place for place in dict.fromkeys(places) if place not in sys.path]
        contents = vars(import_own(module, folder))
        known = [one for one, thing in contents.items() if self.fits(thing)]
        if name not in contents:
            advice = did_you_mean(name, known) if known else self.nothing
            raise ConfigurationError(f"module {module!r} has no {name!r}; {advice}")
        if not self.fits(contents[name]):
            advice = f"; there is {' or '.join(map(repr, known))} in the same module" if known else ""
            raise ConfigurationError(f"{reference} must be {self.wanted}, got {brief(contents[name])}{advice}")
        return contents[name]


def import_own(name: str, folder: Path | None = None) -> Any:
    """A module of a user. Raises ConfigurationError that says why it cannot be imported."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise ConfigurationError(f"module {name!r} needs {error.name!r}, which is not installed") from error
        beside = "" if folder is None else f"{folder}, in "
        raise ConfigurationError(
            f"there is no module {error.name!r} in {beside}the working folder or among the installed packages"
        ) from error
    except Exception as error:  # whatever the code of others does
        lines = [line.filename for line in extract_tb(error.__traceback__) if line.name == "<module>"]
        own = [file for file in lines if not Path(file).is_relative_to(Path(__file__).parent)]
        words = in_words(error, own[-1] if own else None)
        raise ConfigurationError(f"module {name!r} cannot be imported: {words}") from error
