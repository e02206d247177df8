"""All agents by the `algorithm` that their YAML files name: ours by a name, yours as `module:Name`.

Only a file that the user names on the command line, or in a comparison, may bring code of its own: nothing that lies in
a folder of results is read here.
"""

import inspect
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from caster_gym.agents.control.computed_torque import ComputedTorqueSettings
from caster_gym.agents.control.protocol import AgentSettings, ControllerSettings
from caster_gym.agents.learning.settings import (
    LearnerSettings,
    PPOSettings,
    RslPPOSettings,
    SACSettings,
    SHACSettings,
)
from caster_gym.configuration import ConfigurationError, did_you_mean, parse, read_yaml
from caster_gym.paths.naming import unknown_name
from caster_gym.shipped_files import find

AGENTS: Mapping[str, type[AgentSettings]] = {
    "computed torque": ComputedTorqueSettings,
    "ppo": PPOSettings,
    "sac": SACSettings,
    "rsl_ppo": RslPPOSettings,
    "shac": SHACSettings,
}
RESULTS = ("policy.yaml", "run.yaml")  # files that mark a folder as that of a policy or of a run


def read_agent(name: str | Path, changes: Mapping[str, Any] | None = None) -> AgentSettings:
    """Checked settings of an agent, with some fields changed."""
    path = find("agents", name)
    content = {**read_yaml(path), **(changes or {})}
    algorithm = content.get("algorithm")
    if isinstance(algorithm, str) and ":" in algorithm:
        kind = _own_agent(algorithm, path)
    elif isinstance(algorithm, str) and algorithm in AGENTS:
        kind = AGENTS[algorithm]
    else:
        known = unknown_name("algorithm", algorithm, AGENTS)
        raise ConfigurationError(f"{path}: {known}; a class of your own is written as module:Name")
    return parse(kind, content, f"{path}, as changed" if changes else str(path), path.parent)


def _own_agent(reference: str, path: Path) -> type[AgentSettings]:
    """The class that a file at this path calls `module:Name`; importing its module runs the module's code."""
    module_name, _, name = reference.partition(":")
    if not all(part.isidentifier() for part in (*module_name.split("."), name)):
        raise ConfigurationError(f"{path}: a class of your own is written as module:Name, got algorithm {reference!r}")
    if any((path.parent / one).is_file() for one in RESULTS):
        raise ConfigurationError(
            f"{path} lies in a folder of results, from which no code is run: copy it to a folder of your own to use "
            f"its algorithm {reference!r}"
        )
    sys.path += [place for place in (str(path.parent.absolute()), str(Path.cwd())) if place not in sys.path]
    found = getattr(_imported(module_name, path), name, None)
    if found is None:
        classes = [one for one, kind in vars(sys.modules[module_name]).items() if _is_agent(kind)]
        advice = did_you_mean(name, classes) if classes else "no class in it has settings of an agent"
        raise ConfigurationError(f"{path}: module {module_name!r} has no {name!r}; {advice}")
    if not _is_agent(found):
        raise ConfigurationError(
            f"{path}: {reference} must be a class derived from ControllerSettings or LearnerSettings, got {found!r}"
        )
    if inspect.isabstract(found):
        missing = " and ".join(sorted(found.__abstractmethods__))
        raise ConfigurationError(f"{path}: {reference} must define the method {missing}")
    kind: type[AgentSettings] = found
    return kind


def _imported(name: str, path: Path) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise ConfigurationError(f"{path}: module {name!r} needs {error.name!r}, which is not installed") from error
        raise ConfigurationError(
            f"{path}: there is no module {error.name!r} in {path.parent}, in the working folder or among the installed "
            "packages"
        ) from error
    except Exception as error:  # whatever the code of others does
        raise ConfigurationError(
            f"{path}: module {name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error


def _is_agent(kind: object) -> bool:
    return (
        isinstance(kind, type)
        and issubclass(kind, ControllerSettings | LearnerSettings)
        and kind not in (ControllerSettings, LearnerSettings)
    )
