"""Identification of a robot's numbers from recordings of its motion.

`read_identify`, `identify_file` and `write_example` are the command; `identify` estimates from a `Recording`, which
`read_recording` reads and `record` simulates. All else is this room's own.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from caster_gym.identification.command import PAYLOAD, IdentifySettings, identify_file, read_identify, write_example
from caster_gym.identification.recording import Noise, Recording, record, write_recording
from caster_gym.identification.recording_table import read_recording
from caster_gym.identification.unknowns import robot_with

if TYPE_CHECKING:
    from caster_gym.identification.fit import Identification, identify

__all__ = [
    "PAYLOAD",
    "Identification",
    "IdentifySettings",
    "Noise",
    "Recording",
    "identify",
    "identify_file",
    "read_identify",
    "read_recording",
    "record",
    "robot_with",
    "write_example",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    """What needs Torch, which takes seconds to import: it comes when it is asked for."""
    if name in ("Identification", "identify"):
        return getattr(import_module("caster_gym.identification.fit"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
