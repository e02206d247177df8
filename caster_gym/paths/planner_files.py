"""Files of planners of the FIRST Robotics Competition: WPILib, Choreo and PathPlanner."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from caster_gym.bounded_files import PLANNED_BYTES
from caster_gym.brief import cut
from caster_gym.configuration import ConfigurationError
from caster_gym.table_files import read_text
from caster_gym.tables import note
from caster_gym.units import unlikely_radians

PLANNER_SUFFIXES = (".json", ".path", ".traj")

MOST_POINTS = 30_000  # ten minutes at 50 Hz
_POINTS = 16  # of each Bézier curve, through which the spline goes


def read_planner_file(path: Path) -> dict[str, Any]:
    """Content of a specification, from the samples of a trajectory or the Bézier curves of a path.

    Raises ConfigurationError that names the file and says what is missing.
    """
    try:
        text = read_text(path, PLANNED_BYTES)
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    try:
        content = json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise ConfigurationError(f"{path}, line {error.lineno}: cannot be read as JSON: {error.msg}") from error
    except (ValueError, RecursionError) as error:  # of numbers without end, and of lists in lists in lists
        raise ConfigurationError(f"{path} cannot be read as JSON: {error}") from error
    samples = _samples(content)
    try:
        if samples is not None:
            return _timed(samples, path)
        if isinstance(content, dict) and isinstance(content.get("waypoints"), list):
            return _bezier(content, path)
    except ConfigurationError:
        raise
    except (KeyError, TypeError, IndexError, AttributeError, ValueError, ArithmeticError) as error:
        raise ConfigurationError(f"{path}: {cut(str(error))} is missing or of the wrong kind in it") from error
    raise ConfigurationError(
        f"{path} is none of the JSON files that are known: a list of states with time and pose (WPILib), samples with "
        f"t, x, y and heading (Choreo), waypoints with anchors (PathPlanner)"
    )


def _refuse_constant(word: str) -> None:
    raise ValueError(f"{word} is no finite number")


def _samples(content: Any) -> list[Any] | None:
    """The samples of a trajectory, wherever the versions of the tools have them."""
    if isinstance(content, list):
        return content if all(isinstance(one, dict) for one in content) else None
    if not isinstance(content, dict):
        return None
    inner = content.get("trajectory")
    for holder in (inner if isinstance(inner, dict) else {}, content):
        for key in ("samples", "states"):
            if isinstance(holder.get(key), list):
                return list(holder[key])
    return None


def _timed(samples: list[Any], path: Path) -> dict[str, Any]:
    if len(samples) < 2:
        raise ConfigurationError(f"{path} has {len(samples)} samples; generate the trajectory before it is exported")
    if len(samples) > MOST_POINTS:
        raise ConfigurationError(f"{path} has {len(samples)} samples, at most {MOST_POINTS} are read")
    poses = np.array([_pose(sample) for sample in samples], dtype=np.float64)
    poses[:, 0] -= poses[0, 0]
    poses[:, 3] = np.unwrap(poses[:, 3])
    kept = {} if unlikely_radians(poses[:, 3]) is None else {"unit": "rad"}
    return {"shape": "timed", "poses": poses.tolist(), **kept}


def _pose(sample: dict[str, Any]) -> tuple[float, float, float, float]:
    """Time [s], x, y [m] and heading [rad] of a sample."""
    time = sample[next((key for key in ("time", "t", "timestamp") if key in sample), "time")]
    if "pose" not in sample:
        return float(time), float(sample["x"]), float(sample["y"]), float(sample["heading"])
    place, rotation = sample["pose"]["translation"], sample["pose"]["rotation"]
    heading = float(rotation["radians"])  # along the way; PathPlanner has that of the robot beside it
    if sample.get("holonomicRotation") is not None:
        heading = float(np.radians(float(sample["holonomicRotation"])))
    return float(time), float(place["x"]), float(place["y"]), heading


def _bezier(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """Waypoints along the Bézier curves, and the rotations between which the robot turns evenly by the way."""
    waypoints = content["waypoints"]
    if len(waypoints) < 2:
        raise ConfigurationError(f"{path} has {len(waypoints)} waypoints; a path needs at least two")
    if len(waypoints) * _POINTS > MOST_POINTS:
        raise ConfigurationError(f"{path} has {len(waypoints)} waypoints, at most {MOST_POINTS // _POINTS} are read")
    anchors = [_point(waypoint.get("anchor") or waypoint["anchorPoint"]) for waypoint in waypoints]
    u = np.arange(_POINTS) / _POINTS
    parts = []
    for i, (start, end) in enumerate(pairwise(anchors)):
        leaving, reaching = waypoints[i].get("nextControl"), waypoints[i + 1].get("prevControl")
        if leaving is None or reaching is None:
            raise KeyError(f"nextControl of waypoint {i + 1} or prevControl of waypoint {i + 2}")
        a, b = _point(leaving), _point(reaching)
        parts.append((1 - u) ** 3 * start + 3 * (1 - u) ** 2 * u * a + 3 * (1 - u) * u**2 * b + u**3 * end)
    points = np.concatenate([*parts, anchors[-1:]])
    if content.get("pointTowardsZones"):
        note(f"{path}: the zones in which the robot points towards a place are left out")
    return {
        "shape": "spline",
        "waypoints": np.column_stack([points.real, points.imag]).tolist(),
        **_turning(content, points),
    }


def _turning(content: dict[str, Any], points: np.ndarray[Any, Any]) -> dict[str, Any]:
    """The heading through the rotations of start, end and targets [deg], by their places on the path."""
    last = len(content["waypoints"]) - 1
    targets: dict[float, float] = {}
    for i, waypoint in enumerate(content["waypoints"]):
        if waypoint.get("holonomicAngle") is not None:  # until 2023
            targets[float(i)] = float(waypoint["holonomicAngle"])
    for target in content.get("rotationTargets") or []:
        targets[float(target["waypointRelativePos"])] = float(target["rotationDegrees"])
    start = content.get("idealStartingState") or content.get("previewStartingState")
    for place, state in ((0.0, start), (float(last), content.get("goalEndState"))):
        if isinstance(state, dict) and state.get("rotation") is not None:
            targets[place] = float(state["rotation"])
    if not targets:
        return {}
    places = sorted(targets)
    angles = np.unwrap(np.radians([targets[place] for place in places])).tolist()
    if places[0] > 0.0:
        places, angles = [0.0, *places], [angles[0], *angles]
    if places[-1] < last:
        places, angles = [*places, float(last)], [*angles, angles[-1]]
    ways = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(points)))])
    progress = np.interp(places, np.arange(len(points)) / _POINTS, ways / ways[-1])
    progress[0], progress[-1] = 0.0, 1.0
    if np.ptp(angles) == 0.0:
        return {"heading": {"kind": "fixed", "angle": angles[0]}}
    heading = {"kind": "profile", "angles": angles, "progress": progress.tolist(), "unit": "rad"}
    return {"heading": heading}


def _point(point: dict[str, Any]) -> complex:
    return complex(float(point["x"]), float(point["y"]))
