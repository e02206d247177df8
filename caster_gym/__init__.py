"""Omnidirectional robots on powered casters: exact dynamics, Gymnasium environments, learned and model-based control.

All that users need is handed on from here, and is imported when it is first asked for; docs/api.md lists it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from caster_gym.tasks import registry as _tasks

if TYPE_CHECKING:
    from caster_gym import mechanics, wrappers
    from caster_gym.agents.control.computed_torque import ComputedTorque
    from caster_gym.agents.control.observer_torque import ObserverTorque
    from caster_gym.agents.control.predictive import PredictiveControl
    from caster_gym.agents.learning.bundle import load_policy
    from caster_gym.agents.learning.sb3_environment import SB3VecEnv
    from caster_gym.arena.arena import Arena
    from caster_gym.arena.packing import surroundings
    from caster_gym.configuration import ConfigurationError
    from caster_gym.engines.native.derivatives import PeriodDerivatives
    from caster_gym.engines.native.fleet import Fleet
    from caster_gym.engines.numpy_model import Model
    from caster_gym.engines.tensor.fleet import TorchFleet
    from caster_gym.engines.tensor.model import TorchModel
    from caster_gym.envs.observation import ObservationLayout
    from caster_gym.envs.tensor.task import TorchTask
    from caster_gym.envs.tensor.vector_env import TorchVectorEnv
    from caster_gym.export.mjcf import mjcf
    from caster_gym.floor import Floor
    from caster_gym.paths.specification import build_trajectories, read_paths
    from caster_gym.paths.trajectory import Trajectory
    from caster_gym.robot import Robot, load_robot
    from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
    from caster_gym.tasks.hold.environment import CasterHoldEnv, CasterHoldVectorEnv
    from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv

__version__ = "0.1.0"
__all__ = [
    "Arena",
    "CasterFollowEnv",
    "CasterFollowVectorEnv",
    "CasterHoldEnv",
    "CasterHoldVectorEnv",
    "CasterTrackEnv",
    "CasterTrackVectorEnv",
    "ComputedTorque",
    "ConfigurationError",
    "Fleet",
    "Floor",
    "Model",
    "ObservationLayout",
    "ObserverTorque",
    "PeriodDerivatives",
    "PredictiveControl",
    "Robot",
    "SB3VecEnv",
    "TorchFleet",
    "TorchModel",
    "TorchTask",
    "TorchVectorEnv",
    "Trajectory",
    "build_trajectories",
    "load_policy",
    "load_robot",
    "mechanics",
    "mjcf",
    "read_paths",
    "surroundings",
    "wrappers",
]

# The module that each name comes from. Whoever moves one changes it here and among the imports above.
_HOMES = {
    "Arena": "caster_gym.arena.arena",
    "CasterFollowEnv": "caster_gym.tasks.follow.environment",
    "CasterFollowVectorEnv": "caster_gym.tasks.follow.environment",
    "CasterHoldEnv": "caster_gym.tasks.hold.environment",
    "CasterHoldVectorEnv": "caster_gym.tasks.hold.environment",
    "CasterTrackEnv": "caster_gym.tasks.track.environment",
    "CasterTrackVectorEnv": "caster_gym.tasks.track.environment",
    "ComputedTorque": "caster_gym.agents.control.computed_torque",
    "ConfigurationError": "caster_gym.configuration",
    "Fleet": "caster_gym.engines.native.fleet",
    "Floor": "caster_gym.floor",
    "Model": "caster_gym.engines.numpy_model",
    "ObservationLayout": "caster_gym.envs.observation",
    "ObserverTorque": "caster_gym.agents.control.observer_torque",
    "PeriodDerivatives": "caster_gym.engines.native.derivatives",
    "PredictiveControl": "caster_gym.agents.control.predictive",
    "Robot": "caster_gym.robot",
    "SB3VecEnv": "caster_gym.agents.learning.sb3_environment",
    "TorchFleet": "caster_gym.engines.tensor.fleet",
    "TorchModel": "caster_gym.engines.tensor.model",
    "TorchTask": "caster_gym.envs.tensor.task",
    "TorchVectorEnv": "caster_gym.envs.tensor.vector_env",
    "Trajectory": "caster_gym.paths.trajectory",
    "build_trajectories": "caster_gym.paths.specification",
    "load_policy": "caster_gym.agents.learning.bundle",
    "load_robot": "caster_gym.robot",
    "mjcf": "caster_gym.export.mjcf",
    "read_paths": "caster_gym.paths.specification",
    "surroundings": "caster_gym.arena.packing",
}
_MODULES = ("mechanics", "wrappers")

for _name in _tasks.TASKS:
    _tasks.register_environments(_name)


def __getattr__(name: str) -> Any:
    if name not in _HOMES and name not in _MODULES:
        raise AttributeError(f"module 'caster_gym' has no attribute {name!r}")
    try:
        found = import_module(f"caster_gym.{name}") if name in _MODULES else getattr(import_module(_HOMES[name]), name)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("caster_gym"):
            raise
        raise ImportError(
            f"caster_gym.{name} needs {error.name}, which the core does without: pip install 'caster_gym[train]'"
        ) from error
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*(name for name in globals() if name.startswith("__")), *__all__})
