"""Paths through waypoints, typed or read from a CSV file."""

import csv
import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from caster_gym.paths.headings import Heading, Slopes, Tangent
from caster_gym.paths.shapes import Shape
from caster_gym.paths.trajectory import Array

Waypoint = tuple[float, float] | tuple[float, float, float]

_TOO_CLOSE = 1e-9  # [m] two waypoints are one


class Spline(Shape):
    """A smooth curve through waypoints, four times continuously differentiable."""

    shape: Literal["spline"] = "spline"
    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=2)]  # (x, y) [m] or (x, y, heading) [m, m, rad]
    file: Annotated[str | None, Field(exclude=True)] = None  # CSV with the header x,y or x,y,heading; read at once
    closed: bool = False  # back to the first waypoint, which is not repeated
    # None: the waypoints' headings, else the tangent; wider than the field of Shape, which `turn` below makes good
    heading: Heading | None = None  # type: ignore[assignment]

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, content: Any) -> Any:
        if not isinstance(content, dict) or content.get("file") is None:
            return content
        if "waypoints" in content:
            raise ValueError("give either 'waypoints' or a 'file' of them, not both")
        return {**content, "waypoints": read_waypoints(Path(str(content["file"])))}

    @model_validator(mode="after")
    def _waypoints_make_a_curve(self) -> Self:
        if self.closed and len(self.waypoints) < 3:
            raise ValueError(f"a closed spline needs at least 3 waypoints, got {len(self.waypoints)}")
        if not self.closed and self.laps > 1:
            raise ValueError(f"an open spline has one lap, got laps {self.laps}; set 'closed' for a round course")
        if len({len(waypoint) for waypoint in self.waypoints}) > 1:
            raise ValueError("either every waypoint has a heading or none has")
        if self._has_headings and self.heading is not None:
            raise ValueError("the waypoints have headings already: leave 'heading' out, or their third numbers")
        for i, chord in enumerate(self._chords, start=1):
            if chord < _TOO_CLOSE:
                last = self.closed and i == len(self.waypoints)
                hint = "; a closed spline returns to its first waypoint by itself" if last else ""
                raise ValueError(f"waypoints {i} and {1 if last else i + 1} are the same point{hint}")
        return self

    @property
    def _has_headings(self) -> bool:
        return len(self.waypoints[0]) == 3

    @property
    def _points(self) -> Array:
        """Waypoints (n, 2 or 3) of one lap, first to last; each heading is on the turn nearest to the one before."""
        points = np.asarray(self.waypoints + self.waypoints[:1] if self.closed else self.waypoints)
        if self._has_headings:
            points[:, 2] = np.unwrap(points[:, 2])
        return points

    @property
    def _chords(self) -> Array:
        steps = np.diff(self._points[:, :2], axis=0)
        return np.hypot(steps[:, 0], steps[:, 1])

    @property
    def _stations(self) -> Array:
        """u at the waypoints, in proportion to the chords between them, so that the speed varies little."""
        lengths = np.concatenate([[0.0], np.cumsum(self._chords)])
        return np.asarray(lengths / lengths[-1], dtype=np.float64)

    def _through(self, values: Array, u: Array) -> Array:
        from caster_gym.paths.interpolation import closed_spline, open_spline  # SciPy takes a while to import

        return (closed_spline if self.closed else open_spline)(self._stations, values, u)

    def curve(self, u: Array) -> Slopes:
        points = self._points
        x, y = self._through(points[:, 0], u), self._through(points[:, 1], u)
        a, b, c, d = (x[n] + 1j * y[n] for n in range(4))
        return a, b, c, d

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        if not self._has_headings:
            return (self.heading or Tangent()).turn(share, slopes)
        angles, u = self._points[:, 2], share * self.laps
        whole = angles[-1] - angles[0] if self.closed else 0.0  # [rad] a lap, spread evenly: what is left is periodic
        rest = self._through(angles - whole * self._stations, u)
        return rest[0] + whole * u, (rest[1] + whole) * self.laps, rest[2] * self.laps**2


def read_waypoints(path: Path) -> tuple[tuple[float, ...], ...]:
    """Waypoints of a CSV file with the header x,y or x,y,heading, in m and rad; empty lines do not count.

    Raises ValueError that names the file, the line and the value.
    """
    try:
        with path.expanduser().open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file))
    except FileNotFoundError:
        raise ValueError(f"there is no file {str(path)!r}") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} cannot be read as CSV: {error}") from error
    header = [name.strip().lower() for name in lines[0]] if lines else []
    if header not in (["x", "y"], ["x", "y", "heading"]):
        raise ValueError(f"{path}, line 1: the header must be x,y or x,y,heading, got {','.join(header)!r}")
    waypoints = []
    for number, line in enumerate(lines[1:], start=2):
        if not any(value.strip() for value in line):
            continue
        if len(line) != len(header):
            raise ValueError(
                f"{path}, line {number}: expected {len(header)} values, got {len(line)}: {','.join(line)!r}"
            )
        waypoints.append(tuple(_number(value, f"{path}, line {number}") for value in line))
    return tuple(waypoints)


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{where}: {text.strip()!r} is not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{where}: a coordinate must be finite, got {text.strip()!r}")
    return value
