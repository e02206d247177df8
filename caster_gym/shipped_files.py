"""Files that come with the package, by kind and name: tasks, agents, designs, benchmarks."""

from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from caster_gym.bounded_files import expanded
from caster_gym.brief import brief
from caster_gym.configuration import ConfigurationError, is_yaml, parse, read_yaml

Settings = TypeVar("Settings", bound=BaseModel)


def names_of(kind: str) -> list[str]:
    """Names of the tasks, agents, designs or benchmarks that come with the package."""
    return sorted(file.stem for file in _folder_of(kind).glob("*.yaml"))


def _folder_of(kind: str) -> Path:
    return Path(str(files("caster_gym.configs"))) / kind


def find(kind: str, name: str | Path) -> Path:
    """The file of a task, agent, design or benchmark: one that comes with the package, by its name, or a path."""
    if is_yaml(name):
        path = expanded(name)
        if not path.exists() and path.stem in names_of(kind):
            raise ConfigurationError(
                f"there is no file {str(name)!r}; what comes with the package is called {path.stem!r}"
            )
        return path
    name = str(name)
    if name not in names_of(kind):
        own = own_file(name)
        known = f"known are {', '.join(names_of(kind))}, or give the path of a YAML file"
        raise ConfigurationError(
            f"there is no {brief(name)} in {kind}; {f'did you mean the file {own!r}?' if own else known}"
        )
    return _folder_of(kind) / f"{name}.yaml"


def own_file(name: str) -> str | None:
    """The YAML file that was perhaps meant by a name without its suffix, if there is one."""
    with suppress(ValueError):  # it cannot be the name of a file
        return next((f"{name}{suffix}" for suffix in (".yaml", ".yml") if expanded(f"{name}{suffix}").is_file()), None)
    return None


def read_settings(model: type[Settings], kind: str, name: str | Path) -> Settings:
    """Checked settings from a file that `find` finds."""
    path = find(kind, name)
    return parse(model, read_yaml(path), str(path), path.parent)
