"""Omnidirectional robots on powered casters: exact dynamics, Gymnasium environments, learned and model-based control"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from gymnasium import register

if TYPE_CHECKING:
    from caster_gym.engines.numpy_model import Model
    from caster_gym.robot import Robot, load_robot

__version__ = "0.1.0"
__all__ = ["Model", "Robot", "load_robot"]

_HOMES = {"Model": "caster_gym.engines.numpy_model", "Robot": "caster_gym.robot", "load_robot": "caster_gym.robot"}

register(
    id="CasterTrack-v0",
    entry_point="caster_gym.envs.caster_track:CasterTrackEnv",
    vector_entry_point="caster_gym.envs.caster_track:CasterTrackVectorEnv",
)
register(
    id="CasterFollow-v0",
    entry_point="caster_gym.envs.caster_follow:CasterFollowEnv",
    vector_entry_point="caster_gym.envs.caster_follow:CasterFollowVectorEnv",
)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'caster_gym' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    parts = (name for name, it in globals().items() if name.startswith("__") or isinstance(it, ModuleType))
    return sorted({*parts, *__all__})
