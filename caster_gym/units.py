"""Units as people write them, and angles that can hardly be radians."""

import math
import re

import numpy as np
from numpy.typing import ArrayLike

UNITS: dict[str, dict[str, float]] = {  # by quantity, the size of each in SI; the first one is meant where none is said
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "mrad": 1e-3, "rev": 2.0 * math.pi},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "ft/s": 0.3048},
    "rate": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "mrad/s": 1e-3, "rev/s": 2.0 * math.pi, "rpm": math.pi / 30.0},
    "torque": {"N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "kN m": 1e3},
    "number": {"": 1.0},  # parts of a quaternion
}

_OTHER_NAMES = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "µs": "us", "μs": "us", "microseconds": "us", "nsec": "ns", "nanosecond": "ns", "nanoseconds": "ns",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "µm": "um", "μm": "um",
    "radian": "rad", "radians": "rad", "°": "deg", "º": "deg", "degree": "deg", "degrees": "deg",
    "revolution": "rev", "revolutions": "rev", "turn": "rev", "turns": "rev",
    "mps": "m/s", "m/sec": "m/s", "ms^-1": "m/s", "cmps": "cm/s", "mmps": "mm/s", "kmh": "km/h", "kph": "km/h",
    "radps": "rad/s", "rads": "rad/s", "rad/sec": "rad/s", "°/s": "deg/s", "degps": "deg/s", "dps": "deg/s",
    "deg/sec": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s", "1/min": "rpm", "r/min": "rpm",
    "nm": "N m", "mnm": "mN m", "ncm": "N cm", "knm": "kN m",
}  # fmt: skip

MOST_ANGLE = 2.0 * math.pi  # [rad] beyond which an angle that stands alone says nothing more
MOST_TURNS = 8.0 * math.pi  # [rad] beyond which angles in a row are taken for radians only if they are said to be
_DEGREES = 5.0  # [deg] multiples of which people write
_LEAST_DEGREES = 10.0  # [deg] from which on such a multiple is no angle in radians
_NEAR = 0.01  # [rad] from a multiple of a quarter turn, within which a number was written in radians


def read_unit(text: str, quantity: str) -> str | None:
    """The unit of a quantity, from the ways in which it is written: [Nm], [N·m], [°], [µs]; None for no such unit."""
    units = UNITS[quantity]
    plain = re.sub(r"\s*[·⋅∙*]\s*|\s+", " ", text.strip())
    for spelled in (plain, plain.replace(" ", ""), plain.casefold(), plain.replace(" ", "").casefold()):
        unit = _OTHER_NAMES.get(spelled, spelled)
        if quantity == "torque" and plain.startswith("M"):
            return None  # 1 MN m is not 1 mN m
        if unit in units:
            return unit
    return None


def is_unit(text: str) -> bool:
    """Whether a text is a unit of some quantity."""
    return any(read_unit(text, quantity) for quantity in UNITS)


def unlikely_radians(angles: ArrayLike) -> float | None:
    """The first of some angles in a row that can hardly be radians, or None.

    Beyond one turn these are multiples of five degrees from ten on, such as 45 and 90, and beyond four turns whatever
    is no multiple of a quarter turn, such as 31.416.
    """
    values = np.asarray(angles, dtype=np.float64).ravel()
    size = np.abs(values)
    quarter = np.abs(values / (0.5 * np.pi) - np.round(values / (0.5 * np.pi))) * 0.5 * np.pi < _NEAR
    written = (size >= _LEAST_DEGREES) & (np.abs(np.remainder(size + 1e-9, _DEGREES)) < 2e-9)
    unlikely = np.flatnonzero(written | ((size > MOST_TURNS) & ~quarter))
    return float(values[unlikely[0]]) if len(unlikely) else None


def unlikely_angle(angle: float) -> bool:
    """Whether an angle that stands alone, and need not be more than a turn, can hardly be radians."""
    return abs(angle) > MOST_ANGLE + _NEAR
