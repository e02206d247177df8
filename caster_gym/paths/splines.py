"""Paths through waypoints, typed or read from a file."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.arrays import Array
from caster_gym.paths.angles import AngleUnit, ZeroAxis, plain_lists, read_angles
from caster_gym.paths.headings import Fixed, Heading, Slopes, Tangent
from caster_gym.paths.points import check_long
from caster_gym.paths.shapes import SIZES, Shape
from caster_gym.paths.trajectory import LEAST_STEPS, MOST_STEPS, Trajectory, rounded_down, whole_steps
from caster_gym.paths.walks import MOST_ROUNDED, Walk
from caster_gym.paths.waypoints import SAME_PLACE, Track, Turns, read_track

Waypoint = tuple[float, float] | tuple[float, float, float]

_LEAST_SIZE = 10.0  # [-] a path through waypoints is at least so many tolerances long or wide
_LEAST_LEG = 0.2  # [s] of each leg from rest to rest, where the duration leaves so much
_TURN_WAY = 0.3  # [m/rad] a turn on the spot takes as long as this way


class Spline(Shape):
    """A smooth curve through waypoints, or beside them if they are noisy, four times continuously differentiable.

    It is at rest where waypoints of one place have different headings, and turns there on the spot. Waypoints of a
    single place keep the robot there. Other repeated waypoints say nothing: a stay at a place needs times.
    """

    longest_list: ClassVar[int] = MOST_STEPS
    shape: Literal["spline"] = "spline"
    # (x, y) [m] or (x, y, heading) [m, m, rad or `unit`]
    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1)]
    file: Annotated[str | None, Field(exclude=True)] = None  # that holds them, see docs/files.md; read at once
    unit: AngleUnit | None = None  # of the waypoints' headings
    zero_axis: Annotated[ZeroAxis | None, Field(exclude=True)] = None  # from which the file counts headings
    closed: bool = False  # back to the first waypoint, which need not be repeated
    # [m] root mean square distance from the waypoints; None: 0, through them, unless so many are so close that their
    # rounding would bend the curve: then what that rounding explains
    tolerance: NonNegativeFloat | None = None
    heading_tolerance: NonNegativeFloat | None = None  # [rad] the same for the waypoints' headings
    # headings of waypoints: each on the turn nearest to the one before, or as written; auto: as written where some is
    # beyond half a turn, but for headings that wrap from 2π to 0
    turns: Turns = "auto"
    # None: the waypoints' headings, else the tangent; wider than the field of Shape, which `turn` below makes good
    heading: Heading | None = None  # type: ignore[assignment]

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        rest = {key: value for key, value in content.items() if key != "unit"}
        if content.get("file") is not None:
            if "waypoints" in content:
                raise ValueError("give either 'waypoints' or a 'file' of them, not both")
            file, unit, zero_axis = Path(str(content["file"])), content.get("unit"), content.get("zero_axis")
            from caster_gym.paths.files import read_waypoints  # late: most paths have no file

            return {**read_waypoints(file, unit, zero_axis, content.get("heading") is None), **rest, "file": str(file)}
        waypoints = plain_lists(content.get("waypoints"))
        check_long(waypoints, "waypoint", (2, 3))
        if not isinstance(waypoints, list) or not all(isinstance(one, list) and len(one) == 3 for one in waypoints):
            return content if waypoints is None else {**content, "waypoints": waypoints}
        angles, kept = read_angles([one[2] for one in waypoints], content.get("unit"), "a heading")
        turned = [[*one[:2], angle] for one, angle in zip(waypoints, angles, strict=True)]
        return {**rest, "waypoints": turned, **kept}

    @model_validator(mode="after")
    def _waypoints_make_a_curve(self) -> Self:
        if not self.closed and self.laps > 1:
            round_course = "; set 'closed' for a round course" if self._could_be_closed else ""
            raise ValueError(f"an open spline has one lap, got laps {self.laps}{round_course}")
        if len({len(waypoint) for waypoint in self.waypoints}) > 1:
            raise ValueError("either every waypoint has a heading or none has")
        if self._has_headings and self.heading is not None:
            raise ValueError("the waypoints have headings already: leave 'heading' out, or their third numbers")
        x, y, *_ = zip(*self.waypoints, strict=True)
        extent = max(max(x) - min(x), max(y) - min(y))
        if extent > SAME_PLACE and _LEAST_SIZE * (self.tolerance or 0.0) > extent:
            raise ValueError(
                f"a tolerance of {self.tolerance:g} m is more than a tenth of the {extent:.3g} m that the waypoints "
                f"extend; at most {rounded_down(extent / _LEAST_SIZE):g} m would suffice"
            )
        fewest = _fewest_places(self._track)
        if fewest < 3:
            raise ValueError(f"a closed spline needs at least 3 waypoints at different places, got {fewest}")
        return self

    @property
    def _could_be_closed(self) -> bool:
        return len({waypoint[:2] for waypoint in self.waypoints}) > 1 and _fewest_places(self._read(closed=True)) >= 3

    @property
    def _has_headings(self) -> bool:
        return len(self.waypoints[0]) == 3

    @property
    def _track(self) -> Track:
        return self._read(self.closed)

    def _read(self, closed: bool) -> Track:
        return _read_track(self.waypoints, closed, self.laps, self.tolerance, self.heading_tolerance, self.turns)

    @property
    def description(self) -> str:
        """What was made of the waypoints."""
        count = len(self.waypoints)
        notes = self.heading.notes if self.heading is not None else ()
        return "; ".join([f"spline of {count} waypoint{'s' if count > 1 else ''}", *self._track.notes, *notes])

    @property
    def _walks(self) -> tuple[Walk, ...]:
        return _walks(self.waypoints, self.closed, self.laps, self.tolerance, self.heading_tolerance, self.turns)

    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]:
        walks = self._walks
        if len(walks) == 1:
            return super().trajectories(time_step)
        steps = whole_steps(self.duration, time_step)
        least = LEAST_STEPS * time_step
        if least * len(walks) > steps * time_step * (1.0 + 1e-9):
            raise ValueError(
                f"a duration of {self.duration:g} s is too short for {len(walks)} legs from rest to rest, each of "
                f"which needs at least {LEAST_STEPS} time steps of {time_step:g} s"
            )
        # time by the root of the way: then all legs need about the same greatest acceleration
        efforts = np.sqrt([walk.way + _TURN_WAY * walk.turning for walk in walks])
        least = max(min(_LEAST_LEG, steps * time_step / len(walks)), least)
        times = least + (steps * time_step - least * len(walks)) * efforts / efforts.sum()
        ends = np.cumsum(times)
        moments = np.arange(steps + 1) * time_step
        legs = np.searchsorted(ends[:-1], moments, side="right")
        share = np.clip((moments - (ends - times)[legs]) / times[legs], 0.0, 1.0)
        tables = [
            self._walked(walk.curve, walk.turn, 1, share[legs == k], float(times[k])) for k, walk in enumerate(walks)
        ]
        return (Trajectory(self.shape, time_step, np.concatenate(tables), self.description),)

    def curve(self, u: Array) -> Slopes:
        return self._walks[0].curve(u)

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        (walk,) = self._walks
        if self._has_headings:
            angle, first, second = walk.turn(share * self.laps, slopes)
            return angle, first * self.laps, second * self.laps**2
        heading = self.heading or Tangent()
        if walk.way == 0.0 and isinstance(heading, Tangent):
            heading = Fixed(angle=heading.offset)  # there is no tangent: as along x
        return heading.turn(share, slopes)

    def without_headings(self) -> Self:
        """The same way, always at the first heading."""
        if not self._has_headings:
            return self
        bare = tuple((x, y) for x, y, *_ in self.waypoints)
        return self.model_copy(
            update={"waypoints": bare, "heading": Fixed(angle=float(np.array(self.waypoints)[0, 2]))}
        )

    def with_fixed_heading(self) -> Self | None:
        return None if self._has_headings else super().with_fixed_heading()

    def widen(self) -> Iterator[tuple[Self, str]]:
        x, y, *_ = zip(*self.waypoints, strict=True)
        most = max(max(x) - min(x), max(y) - min(y)) / _LEAST_SIZE
        for tolerance in SIZES:
            if self._track.tolerance < tolerance <= most:
                yield self.model_copy(update={"tolerance": tolerance}), f"a tolerance of {tolerance:g} m"


def _fewest_places(track: Track) -> int:
    """Different places of its closed leg; 3, which are enough, if it has none."""
    return min((len(leg.points) - 1 for leg in track.legs if leg.closed), default=3)


@lru_cache(maxsize=32)
def _read_track(
    waypoints: tuple[Waypoint, ...],
    closed: bool,
    laps: int,
    tolerance: float | None,
    heading_tolerance: float | None,
    turns: Turns,
) -> Track:
    return read_track(waypoints, closed, laps, tolerance, heading_tolerance, turns)


@lru_cache(maxsize=32)
def _walks(
    waypoints: tuple[Waypoint, ...],
    closed: bool,
    laps: int,
    tolerance: float | None,
    heading_tolerance: float | None,
    turns: Turns,
) -> tuple[Walk, ...]:
    track = _read_track(waypoints, closed, laps, tolerance, heading_tolerance, turns)
    most = np.inf if tolerance is not None else MOST_ROUNDED * track.tolerance
    return tuple(Walk(leg, track.tolerance, most, track.heading_tolerance) for leg in track.legs)
