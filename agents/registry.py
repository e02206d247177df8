"""All agents by the `algorithm` that their YAML files name: ours by a name, your own as `module:Name`.

Only a file that the user names on the command line, or in a comparison, may bring code of its own: nothing that lies in
a folder of results is read here.
"""

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.predictive import PredictiveSettings
from caster_gym.agents.control.protocol import AgentSettings, ControllerSettings
from caster_gym.agents.learning.settings import LearnerSettings, PPOSettings, RslPPOSettings, SACSettings, SHACSettings
from caster_gym.configuration import ConfigurationError, parse, read_yaml
from caster_gym.own_code import OwnCode
from caster_gym.paths.naming import unknown_name
from caster_gym.shipped_files import find

AGENTS: Mapping[str, type[AgentSettings]] = {
    "computed torque": ComputedTorqueSettings,
    "predictive": PredictiveSettings,
    "ppo": PPOSettings,
    "sac": SACSettings,
    "rsl_ppo": RslPPOSettings,
    "shac": SHACSettings,
}


def read_agent(name: str | Path, changes: Mapping[str, Any] | None = None) -> AgentSettings:
    """Checked settings of an agent, with some fields changed."""
    if is_python(name):
        raise ConfigurationError(
            f"{name} is Python code, not the settings of an agent: give a YAML file with the line "
            f"'algorithm: {Path(name).stem}:Name', where Name is the class of its settings"
        )
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


def is_python(name: str | Path) -> bool:
    """Whether a name is that of a Python file, by its suffix."""
    return Path(name).suffix == ".py"


def _own_agent(reference: str, path: Path) -> type[AgentSettings]:
    """The class that a file at this path calls `module:Name`; importing its module runs the module's code."""
    try:
        kind: type[AgentSettings] = _OWN.load(reference, path.parent)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    if inspect.isabstract(kind):
        missing = " and ".join(sorted(kind.__abstractmethods__))
        raise ConfigurationError(f"{path}: {reference} must define the method {missing}")
    return kind


def _is_agent(kind: object) -> bool:
    return (
        isinstance(kind, type)
        and issubclass(kind, ControllerSettings | LearnerSettings)
        and kind not in (ControllerSettings, LearnerSettings)
    )


_OWN = OwnCode(
    "algorithm",
    "a class",
    _is_agent,
    "a class of your own, derived from ControllerSettings or LearnerSettings",
    "no class in it has settings of an agent",
)
