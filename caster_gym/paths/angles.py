"""Angles in their stated unit, checked for degrees given as radians."""

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator

from caster_gym.arrays import Array
from caster_gym.configuration import ConfigurationError
from caster_gym.units import UNITS, unlikely_angle, unlikely_radians

AngleUnit: TypeAlias = Literal["rad", "deg"]
ZeroAxis: TypeAlias = Literal["x", "y"]

_CALM = 1.0  # [rad] from row to row: in between, angles that are wrapped jump by a turn
_MANY = 10  # rows that show what is usual


def plain_lists(values: Any) -> Any:
    """Lists and numbers of Python instead of NumPy's, however deep."""
    if isinstance(values, np.ndarray | np.generic):
        return values.tolist()
    return [plain_lists(value) for value in values] if isinstance(values, list | tuple) else values


def read_angle(content: Any, key: str) -> Any:
    """A mapping whose one angle is in rad. `unit` stays only where it is needed to read the same again.

    Raises ConfigurationError for an angle without a unit that can hardly be in radians.
    """
    if not isinstance(content, Mapping) or not _is_number(content.get(key, 0.0)):
        return content
    angle, unit, rest = content.get(key), content.get("unit"), dict(content)
    if angle is None or unit not in (None, "rad", "deg"):
        return content
    rest.pop("unit", None)
    if unit is None and unlikely_angle(angle):
        raise ConfigurationError(f"{key!r} {degrees_by_mistake(angle)}")
    turned = float(angle * UNITS["angle"][unit or "rad"]) if unit == "deg" else angle
    return {**rest, key: turned, **({"unit": "rad"} if unlikely_angle(turned) else {})}


def read_angles(angles: Sequence[Any], unit: Any, what: str) -> tuple[list[Any], dict[str, str]]:
    """Angles in a row in rad, and the unit that must stay beside them to be read the same again.

    Raises ConfigurationError for angles without a unit that can hardly be in radians. `what`: what they are of.
    """
    if unit not in (None, "rad", "deg") or not all(_is_number(angle) for angle in angles):
        return list(angles), {} if unit is None else {"unit": unit}
    turned = [float(angle * UNITS["angle"]["deg"]) for angle in angles] if unit == "deg" else list(angles)
    unlikely = unlikely_radians(turned)
    if unit is None and unlikely is not None:
        raise ConfigurationError(f"{what} {degrees_by_mistake(unlikely)}")
    return turned, {} if unlikely is None else {"unit": "rad"}


def degrees_by_mistake(angle: float) -> str:
    """Sentence that refuses an angle that can hardly be in radians, and says what to write."""
    return (
        f"of {angle:g} can hardly be in radians: write `unit: deg` in the same mapping if it is in degrees "
        f"({np.radians(angle):.6g} rad), else `unit: rad`"
    )


def _no_degrees(angle: float) -> float:
    if unlikely_angle(angle):
        raise ValueError(
            f"must be in radians, got {angle:g}, which can hardly be; "
            f"if that is in degrees, write {np.radians(math.remainder(angle, 360.0)):.6g}"
        )
    return angle


Rotation: TypeAlias = Annotated[float, AfterValidator(_no_degrees)]  # [rad] a single angle that has no unit beside it


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def unwrapped(angles: Array) -> Array:
    """Angles [rad] as they stand, if some are beyond what wrapped ones are, else on the turn nearest to the one before.

    Many angles from 0 to a turn are taken to be wrapped if they change little from row to row but for jumps of a turn.
    """
    steps = np.abs(np.diff(angles))
    half = bool(np.abs(angles).max(initial=0.0) <= np.pi + 1e-6)
    whole = bool(((angles >= -1e-6) & (angles <= 2.0 * np.pi + 1e-6)).all())
    calm = len(angles) >= _MANY and bool(((steps < _CALM) | (steps > 2.0 * np.pi - _CALM)).all())
    return np.asarray(np.unwrap(angles) if half or (whole and calm) else angles, dtype=np.float64)
