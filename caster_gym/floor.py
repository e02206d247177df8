"""A floor of finite friction, as it is written in YAML and Python. Points are in W."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import Field

from caster_gym.configuration import ConfigurationError, Frozen, Positive, parse

GREATEST = 1e3  # [-] far above any floor; wheels then roll as if they could not slip, as long as none lifts

Friction = Annotated[float, Field(ge=0.0, le=GREATEST)]


class Patch(Frozen):
    """A disc of the floor with a friction of its own, such as a patch of ice."""

    usual_names: ClassVar[Mapping[str, str]] = {
        "mu": "friction",
        "centre": "give the centre as 'x' and 'y' [m]",
        "center": "give the centre as 'x' and 'y' [m]",
        "position": "give the centre as 'x' and 'y' [m]",
        "size": "radius",
    }
    friction: Friction  # [-] between it and a wheel whose contact point lies on it
    x: float  # [m] its centre
    y: float
    radius: Positive  # [m]


class Floor(Frozen):
    """A floor of finite friction. Without one the floor grips: wheels roll and never slip.

    >>> import caster_gym, numpy as np
    >>> model = caster_gym.Model(caster_gym.load_robot("chung2008"))
    >>> ice = caster_gym.Floor(friction=0.05)
    >>> states = model.simulate(np.zeros(9), [0.1, 0, 0.1, 0, 0.1, 0], dt=0.005, steps=200, floor=ice)
    >>> float(states[-1, 3].round(2))  # vx [m/s] after 1 s: friction · gravity · time, since all wheels spin
    0.49
    """

    usual_names: ClassVar[Mapping[str, str]] = {
        "mu": "friction",
        "floor_friction": "friction",
        "coefficient": "friction",
        "discs": "patches",
        "ice": "patches",
    }
    friction: Friction | None = None  # [-] else the robot's own `floor_friction`
    contact_time: Positive = 0.01  # [s] of an impact, in which the floor holds wheels by friction · load · time
    patches: tuple[Patch, ...] = ()  # where they overlap, the last one counts


FloorLike: TypeAlias = str | Floor | Mapping[str, Any] | None


def load_floor(floor: FloorLike) -> Floor | None:
    """A floor of finite friction from the mapping in a YAML file, or None for "grip" and None."""
    if isinstance(floor, Floor):
        return floor
    if isinstance(floor, Mapping):
        return parse(Floor, floor, "the floor")
    if floor is None or floor == "grip":
        return None
    raise ConfigurationError(f"floor must be 'grip' or a mapping such as {{friction: 0.7}}, got {floor!r}")
