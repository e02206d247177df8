"""Files of paths: tables of waypoints or of timed poses, race lines, and JSON files of planners.

What is read becomes the content of a specification: waypoints of a spline, or poses with times. docs/files.md shows an
example of each kind of file.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from caster_gym.arrays import Array
from caster_gym.configuration import ConfigurationError
from caster_gym.paths.angles import AngleUnit, ZeroAxis, degrees_by_mistake, unwrapped
from caster_gym.paths.planner_files import MOST_POINTS, PLANNER_SUFFIXES, read_planner_file
from caster_gym.table_files import TABLE_SUFFIXES, read_table
from caster_gym.tables import Quantity, Table, note, note_left_out
from caster_gym.units import unlikely_radians

PATH_SUFFIXES = (*TABLE_SUFFIXES, *PLANNER_SUFFIXES)

TIME = Quantity(
    "time",
    ("time", "t", "timestamp", "stamp", "time_stamp", "header_stamp", "__time", "elapsed", "elapsed_time", "secs",
     "sec", "seconds"),
)  # fmt: skip
HEADING = Quantity("angle", ("heading", "theta", "yaw", "th", "orientation_yaw", "pose_theta", "pose_heading"))
POINT = {
    axis: Quantity(
        "length",
        (axis, f"p{axis}", f"pos_{axis}", f"position_{axis}", f"{axis}_pos", f"{axis}_position", f"translation_{axis}",
         f"t{axis}", f"pose_{axis}", f"point_{axis}", f"{wards}ing", f"utm_{wards}ing"),
    )
    for axis, wards in (("x", "east"), ("y", "north"))
}  # fmt: skip
QUATERNION = {
    f"q{axis}": Quantity("number", (f"q{axis}", f"q_{axis}", f"quat_{axis}", f"rotation_{axis}", f"orientation_{axis}"))
    for axis in "xyzw"
}
_QUANTITIES = {"time": TIME, **POINT, "heading": HEADING, "psi": Quantity("angle", ("psi",)), **QUATERNION}
_DEGREES_OF_EARTH = ("lat", "latitude", "lon", "lng", "long", "longitude", "lat_deg", "lon_deg")
_FITS, _DIFFERS = 0.2, 0.6  # [rad] mean difference from the direction of the way that says yes, and no
_LEAST_QUATERNION = 0.1  # [-] length below which one was never set
_MANY = 10  # rows that show what is usual
_GAP = 3.0  # [-] of the usual time between rows, from which on some are missing


def is_path_file(name: object) -> bool:
    """Whether a name is that of a file whose kind its suffix tells."""
    return isinstance(name, str | Path) and Path(name).suffix.lower() in PATH_SUFFIXES


def read_path_file(path: Path, unit: AngleUnit | None = None, zero_axis: ZeroAxis | None = None) -> dict[str, Any]:
    """Content of a specification: a timed path where the file has times, else a spline."""
    if path.suffix.lower() in PLANNER_SUFFIXES:
        return read_planner_file(path)
    table = _table_of(path)
    shape = "timed" if "time" in table.found else "spline"
    return {"shape": shape, **(_poses if shape == "timed" else _waypoints)(table, unit, zero_axis)}


def read_waypoints(
    path: Path, unit: AngleUnit | None = None, zero_axis: ZeroAxis | None = None, headings: bool = True
) -> dict[str, Any]:
    """The fields of a spline that a file gives; times are left out, and headings where they are not wanted."""
    if path.suffix.lower() in PLANNER_SUFFIXES:
        content = read_planner_file(path)
        if content.pop("shape") == "timed":
            content = {"waypoints": [row[1:] for row in content["poses"]], **_without(content, "poses")}
        if not headings:
            content.pop("heading", None)
            content["waypoints"] = [row[:2] for row in content["waypoints"]]
        return content
    return _waypoints(_table_of(path), unit, zero_axis, headings)


def read_poses(path: Path, unit: AngleUnit | None = None, zero_axis: ZeroAxis | None = None) -> dict[str, Any]:
    """The fields of a timed path that a file gives."""
    if path.suffix.lower() in PLANNER_SUFFIXES:
        content = read_planner_file(path)
        if content.pop("shape") != "timed":
            raise ConfigurationError(f"{path} has no times; use it as a path of shape 'spline'")
        return content
    table = _table_of(path)
    if "time" not in table.found:
        raise ConfigurationError(
            f"{path} has no column of times; call it 'time [s]', or use the file as a path of shape 'spline'"
        )
    return _poses(table, unit, zero_axis)


def _table_of(path: Path) -> Table:
    try:
        table = read_table(path).matched(_QUANTITIES)
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    if len(table.rows) > MOST_POINTS:
        raise ConfigurationError(
            f"{path} has {len(table.rows)} points, at most {MOST_POINTS} are read; keep every tenth row, or a part"
        )
    missing = [axis for axis in "xy" if axis not in table.found]
    if missing:
        if any(column.name.strip().casefold() in _DEGREES_OF_EARTH for column in table.columns):
            raise ConfigurationError(
                f"{path} has places in latitude and longitude; project them to metres, east and north of a place "
                f"nearby, and call these x and y"
            )
        names = ", ".join(POINT["x"].names[:4])
        raise ConfigurationError(
            f"{path}: no column is called {' or '.join(map(repr, missing))}; the header names "
            f"{table.header}; call the coordinates x and y (or as {names} is)"
        )
    return table


def _waypoints(
    table: Table, unit: AngleUnit | None, zero_axis: ZeroAxis | None, headings: bool = True
) -> dict[str, Any]:
    try:
        points = table.numbers(["x", "y"])
        angles, used, kept = _headings(table, points, unit, zero_axis) if headings else (None, [], {})
        if "time" in table.found:
            note(f"{table.source}: the times are left out: a spline has a law of its own; `shape: timed` keeps them")
        note_left_out(table.source, table.left_out(["time", "x", "y", *used]))
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    rows = points if angles is None else np.column_stack([points, angles])
    return {"waypoints": rows.tolist(), **kept}


def _poses(table: Table, unit: AngleUnit | None, zero_axis: ZeroAxis | None) -> dict[str, Any]:
    try:
        times, _ = table.times()
        _note_gap(table, times)
        points = table.numbers(["x", "y"])
        angles, used, kept = _headings(table, points, unit, zero_axis)
        note_left_out(table.source, table.left_out(["time", "x", "y", *used]))
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    columns = [times, points] if angles is None else [times, points, angles]
    return {"poses": np.column_stack(columns).tolist(), **kept}


def _note_gap(table: Table, times: Array) -> None:
    """Tell of the first gap in a record, across which the motion can only be guessed."""
    steps = np.diff(times)
    gaps = steps > _GAP * float(np.median(steps)) if len(steps) >= _MANY else np.zeros(0, dtype=bool)
    if gaps.any():
        row = int(gaps.argmax()) + 1
        note(
            f"{table.source}, line {table.lines[row]}: this pose comes {steps[row - 1]:.4g} s after the one before, "
            f"where {np.median(steps):.4g} s are usual; the motion goes smoothly across the gap"
        )


def _headings(
    table: Table, points: Array, unit: AngleUnit | None, zero_axis: ZeroAxis | None
) -> tuple[Array | None, list[str], dict[str, str]]:
    """Headings [rad] of a table, the columns they come from, and the unit that must stay beside them."""
    if "heading" in table.found:
        key, turn = "heading", np.pi / 2.0 if zero_axis == "y" else 0.0
    elif "psi" in table.found:
        key, turn = "psi", np.nan
    elif "qz" in table.found and "qw" in table.found:
        return planar_heading(table), list(QUATERNION), {}
    else:
        return None, [], {}
    angles, found = table.numbers([key])[:, 0], table.found[key]
    name, column = table.columns[found.place].name, f"{table.source}: column {table.columns[found.place].name!r}"
    if found.declared and unit is not None and (unit == "deg") != (found.factor != 1.0):
        raise ValueError(f"{column} says its unit in the header, and that is not {unit}; leave 'unit' out")
    if not found.declared and unit == "deg":
        angles = np.radians(angles)
    unlikely = unlikely_radians(angles)
    if unlikely is not None and not found.declared and unit is None:
        raise ValueError(
            f"{column}: a heading {degrees_by_mistake(unlikely)}; or say it in the header, as in '{name} [deg]'"
        )
    if key == "psi":
        turn = _turn_of_psi(points, angles, zero_axis, column)
    if turn != 0.0:  # whose sum with wrapped angles would no longer look wrapped
        angles = unwrapped(angles) + turn
    return angles, [key], {} if unlikely_radians(angles) is None else {"unit": "rad"}


def planar_heading(table: Table) -> Array:
    """Heading [rad] of the body x-axis from a table's unit quaternions; qx and qy may be left out."""
    none = np.zeros(len(table.rows))
    x, y, z, w = (table.numbers([name])[:, 0] if name in table.found else none for name in QUATERNION)
    short = np.hypot(np.hypot(x, y), np.hypot(z, w)) < _LEAST_QUATERNION
    if short.any():
        raise ValueError(
            f"{table.source}, line {table.lines[int(short.argmax())]}: the quaternion is zero and says no heading; "
            f"leave its columns out, and the robot faces its way"
        )
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)), dtype=np.float64)


def _turn_of_psi(points: Array, psi: Array, zero_axis: ZeroAxis | None, column: str) -> float:
    """What to add to ψ [rad], which some count from the x-axis and makers of race lines from the y-axis (north).

    Where nobody says which, ψ is compared with the direction in which the points lead.
    """
    turns = {"x": 0.0, "y": 0.5 * np.pi}
    if zero_axis is not None:
        return turns[zero_axis]
    way = np.gradient(points[:, 0] + 1j * points[:, 1]) if len(points) > 1 else 0j * psi
    moving = np.abs(way) > 0.0
    ahead = np.exp(1j * psi[moving]) * way[moving].conj()
    misses = {axis: float(np.mean(np.abs(np.angle(ahead * np.exp(1j * turn))))) for axis, turn in turns.items()}
    near, far = sorted(misses, key=lambda axis: misses[axis]) if moving.any() else ("x", "y")
    if not moving.any() or misses[near] > _FITS or misses[far] < _DIFFERS:
        raise ValueError(
            f"{column} may count from the x-axis or from the y-axis (north), and the way between the points does not "
            f"tell which; write `zero_axis: x` or `zero_axis: y` beside the file, or call the column 'heading', "
            f"which counts from x"
        )
    note(f"{column} is counted from the {near}-axis, as the way between the points shows")
    return turns[near]


def _without(content: dict[str, Any], *keys: Sequence[str] | str) -> dict[str, Any]:
    return {key: value for key, value in content.items() if key not in keys}
