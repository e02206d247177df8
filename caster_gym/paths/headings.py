"""Headings along a path: along the tangent, fixed, spinning, or through given angles."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field, NonNegativeFloat, model_validator

from caster_gym.arrays import Array, Plane
from caster_gym.configuration import ConfigurationError, Frozen
from caster_gym.paths.angles import AngleUnit, plain_lists, read_angle, read_angles
from caster_gym.paths.naming import unknown_name
from caster_gym.paths.points import check_long
from caster_gym.paths.rounding import HEADING_UNITS, headings_note, rounding

_EIGHTH = 45.0  # [deg] numbers of revolutions that are twice that or more, and multiples of it, are degrees

Slopes: TypeAlias = tuple[Plane, Plane, Plane, Plane]  # a curve p and its first three derivatives


class _Kind(Frozen):
    """What all kinds of headings share."""

    _angle: ClassVar[str] = "angle"  # the field that is given in rad or `unit`

    @model_validator(mode="before")
    @classmethod
    def _in_radians(cls, content: Any) -> Any:
        return read_angle(content, cls._angle)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was made of the numbers, in words."""
        return ()


class Tangent(_Kind):
    """Along the path."""

    kind: Literal["tangent"] = "tangent"
    offset: float = 0.0  # [rad] or `unit`, from the tangent to the body x-axis, counter-clockwise
    unit: AngleUnit | None = None  # of the offset
    _angle = "offset"

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """Angle [rad] and its first two derivatives by the share of the path, 0 … 1, as the slopes are.

        The angle is the imaginary part of ln p′, whose derivative is p″ / p′.
        """
        _, first, second, third = slopes
        with np.errstate(divide="ignore", invalid="ignore"):  # Trajectory refuses what is not finite
            bend = second / first
            return np.angle(first) + self.offset, bend.imag, (third / first - bend**2).imag


class Fixed(_Kind):
    """At one angle."""

    kind: Literal["fixed"] = "fixed"
    angle: float = 0.0  # [rad] or `unit`
    unit: AngleUnit | None = None  # of the angle

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """As for Tangent."""
        return np.full_like(share, self.angle), np.zeros_like(share), np.zeros_like(share)


class Spinning(_Kind):
    """Turning in proportion to the progress."""

    kind: Literal["spinning"] = "spinning"
    turns: float = 1.0  # [rev] over the whole path, counter-clockwise
    angle: float = 0.0  # [rad] or `unit`, at the start
    unit: AngleUnit | None = None  # of the angle; turns are revolutions always

    @model_validator(mode="after")
    def _turns_are_no_degrees(self) -> Self:
        if abs(self.turns) >= 2.0 * _EIGHTH and self.turns % _EIGHTH == 0.0:
            raise ValueError(
                f"'turns' counts revolutions, and {self.turns:g} looks like degrees; if it is, write "
                f"{self.turns / 360.0:.6g}, got {self.turns:g}"
            )
        return self

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """As for Tangent."""
        whole = 2.0 * np.pi * self.turns
        return self.angle + whole * share, np.full_like(share, whole), np.zeros_like(share)


class Profile(_Kind):
    """Through given angles, smoothly."""

    longest_list: ClassVar[int] = 100_000
    kind: Literal["profile"] = "profile"
    # [rad] or `unit`, not wrapped: 6.283 is a turn away from 0
    angles: Annotated[tuple[float, ...], Field(min_length=2)]
    progress: tuple[float, ...] | None = None  # [-] share of the path at each angle, 0 … 1; None spaces them evenly
    unit: AngleUnit | None = None  # of the angles
    # [rad] root mean square distance from the angles; None: 0, unless so many are so close that their rounding would
    # bend the profile: then what that rounding explains
    tolerance: NonNegativeFloat | None = None

    @model_validator(mode="before")
    @classmethod
    def _in_radians(cls, content: Any) -> Any:
        angles = plain_lists(content.get("angles")) if isinstance(content, Mapping) else None
        if not isinstance(angles, list):
            return content
        check_long(angles, "angle")
        check_long(content.get("progress"), "progress")
        turned, unit = read_angles(angles, content.get("unit"), "an angle")
        return {**{key: value for key, value in content.items() if key != "unit"}, "angles": turned, **unit}

    @model_validator(mode="after")
    def _progress_ascends(self) -> Self:
        p = self.progress
        if p is not None:
            if len(p) != len(self.angles):
                raise ValueError(f"needs one progress for each angle, got {len(p)} for {len(self.angles)}")
            if p[0] != 0.0 or p[-1] != 1.0 or any(b <= a for a, b in pairwise(p)):
                raise ValueError(f"progress must ascend from 0 to 1, got {list(p)}")
        return self

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """As for Tangent."""
        from caster_gym.paths.interpolation import open_spline  # SciPy takes a while to import
        from caster_gym.paths.smoothing import fit_smoothing_spline

        angles = np.asarray(self.angles)
        at = np.linspace(0.0, 1.0, len(angles)) if self.progress is None else np.asarray(self.progress)
        if self._allowed[0] > 0.0 and len(angles) > 2:
            spline = fit_smoothing_spline(angles[:, None], at, np.ones(len(at)), self._allowed[0], False)
            angle, first, second = (spline(share, order)[:, 0] for order in range(3))
        else:
            angle, first, second, _ = open_spline(at, angles, share)
        return angle, first, second

    @property
    def _allowed(self) -> tuple[float, float]:
        """Tolerance and step of the angles' rounding. [rad]"""
        derived, step = rounding(np.asarray(self.angles)[:, None], HEADING_UNITS)
        return (derived if self.tolerance is None else self.tolerance), step

    @property
    def notes(self) -> tuple[str, ...]:
        allowed, step = self._allowed
        return (headings_note(allowed, step if self.tolerance is None else None),) if allowed > 0.0 else ()


_KINDS: dict[str, type[Frozen]] = {"tangent": Tangent, "fixed": Fixed, "spinning": Spinning, "profile": Profile}


def _read_heading(value: Any) -> Any:
    """A heading by the name of its kind, or by a mapping with its kind in it."""
    content = {"kind": value} if isinstance(value, str) else value
    if not isinstance(content, Mapping):
        return value
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ConfigurationError(unknown_name("kind", kind, _KINDS))
    return content


Heading = Annotated[Tangent | Fixed | Spinning | Profile, Field(discriminator="kind"), BeforeValidator(_read_heading)]
