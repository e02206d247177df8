"""Specifications of paths in YAML and Python, and the trajectories made from them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from caster_gym.bounded_files import expanded
from caster_gym.brief import LONGEST_VALUE
from caster_gym.configuration import ConfigurationError, is_yaml, parse, read_yaml
from caster_gym.paths.advice import timed_remedy
from caster_gym.paths.angles import plain_lists
from caster_gym.paths.feasibility import check_feasible
from caster_gym.paths.naming import unknown_name
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, Ellipse, Lemniscate, RoundedSquare
from caster_gym.paths.splines import Spline
from caster_gym.paths.timed import Timed, timed_path
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

AnyPath: TypeAlias = Circle | Ellipse | Lemniscate | RoundedSquare | Spline | Timed | RandomPaths
PathSpecification: TypeAlias = Annotated[AnyPath, Field(discriminator="shape")]
PathLike: TypeAlias = (
    str | Path | Mapping[str, Any] | AnyPath | Trajectory | NDArray[np.floating[Any] | np.integer[Any]] | Sequence[Any]
)

_SHAPES: dict[str, type[AnyPath]] = {kind.model_fields["shape"].default: kind for kind in get_args(AnyPath)}
_POINT_SIZES = {2: "spline", 3: "spline", 4: "timed"}  # numbers of (x, y), (x, y, heading), (time, x, y, heading)


def read_paths(path: PathLike) -> tuple[AnyPath, ...]:
    """Paths, read and checked, from a name, a file, an array, a mapping, a Trajectory, or a sequence of these.

    The name of a shape stands for it with its defaults; that of a file, for what docs/files.md says; a mapping holds a
    shape and its parameters. A list or an array of points (x, y) [m] or (x, y, heading) [m, m, rad] is a spline; one of
    (time, x, y, heading) [s, m, m, rad], and a Trajectory, are timed. Raises ConfigurationError that names the shape,
    the key and the value.

    >>> import caster_gym
    >>> caster_gym.read_paths([(0, 0), (1, 0), (1, 1)])[0].shape
    'spline'
    >>> [path.shape for path in caster_gym.read_paths(["circle", {"shape": "lemniscate", "duration": 8.0}])]
    ['circle', 'lemniscate']
    """
    if isinstance(path, get_args(AnyPath)):
        return (path,)
    if isinstance(path, Trajectory):
        return (timed_path(path),)
    if isinstance(path, str | Path):
        return (_named(path),)
    if isinstance(path, Mapping):
        return (_read(path, "path"),)
    points = plain_lists(path)
    if isinstance(points, list):
        size = _size_of_points(points)
        if size is not None:
            shape = _POINT_SIZES[size]
            return (_read({"shape": shape, "waypoints" if shape == "spline" else "poses": points}, "path"),)
        paths = tuple(one for item in path for one in read_paths(item))
        if not paths:
            raise ConfigurationError("at least one path is needed, got none")
        return paths
    raise ConfigurationError(
        f"a path is a name, a file, a mapping, a Trajectory, a list of points or a sequence of these, "
        f"got {_brief(path)}"
    )


def _named(path: str | Path) -> AnyPath:
    """The path of a file or of the name of a shape."""
    file = expanded(path)
    if is_yaml(file):
        content = read_yaml(file)
        if isinstance(content.get("file"), str):  # relative to the file in which it stands
            try:
                content["file"] = str(file.parent / expanded(content["file"]))
            except ValueError as error:
                raise ConfigurationError(f"{path}: 'file': {error}") from error
        return _read(content, f"{path}: path")
    if not (isinstance(path, Path) or file.suffix or len(file.parts) > 1):
        return _read({"shape": path}, "path")
    from caster_gym.paths.files import PATH_SUFFIXES, is_path_file, read_path_file  # late: most paths have no file

    if not is_path_file(file):
        raise ConfigurationError(
            f"{str(path)!r} is no file of a path by its name: those end in .yaml, {', '.join(PATH_SUFFIXES)}; "
            f"shapes are {', '.join(sorted(_SHAPES))}"
        )
    return _read(read_path_file(file), f"{path}: path")


def _brief(path: Any) -> str:
    text = repr(path)
    return text if len(text) <= LONGEST_VALUE else f"a {type(path).__name__}"


def _size_of_points(items: list[Any]) -> int | None:
    """Numbers of each point of a list of points, or None for a list of something else."""
    if not items or not all(isinstance(item, list) and item and not isinstance(item[0], list) for item in items):
        return None
    numbers = all(isinstance(number, Real) and not isinstance(number, bool) for item in items for number in item)
    sizes = {len(item) for item in items}
    if not numbers:
        return None
    if len(sizes) > 1 or not sizes <= set(_POINT_SIZES):
        got = " to ".join(str(size) for size in sorted({min(sizes), max(sizes)}))
        raise ConfigurationError(
            f"a list of points has (x, y) or (x, y, heading) for each waypoint of a spline, or (time, x, y, heading) "
            f"for each pose of a timed path, the same for all of them; got {got} numbers"
        )
    return sizes.pop()


def build_trajectories(path: PathLike, robot: Robot, time_step: float) -> tuple[Trajectory, ...]:
    """The timed trajectories of all paths. Time step in s.

    Raises ValueError for one that the motors of the robot cannot drive; the message says what would suffice instead.

    >>> import caster_gym
    >>> robot = caster_gym.load_robot("chung2008")
    >>> (trajectory,) = caster_gym.build_trajectories("lemniscate", robot, time_step=0.02)
    >>> trajectory.duration, trajectory.samples.shape
    (12.0, (601, 10))
    """
    built: list[Trajectory] = []
    for specification in read_paths(path):
        try:
            trajectories = specification.trajectories(time_step)
        except ValueError as error:
            remedy = timed_remedy(specification, robot, time_step)
            advice = f"; {remedy} would suffice" if remedy else ""
            raise ValueError(f"path {specification.shape!r}: {error}{advice}") from error
        check_feasible(specification, trajectories, robot)
        built.extend(trajectories)
    names = distinct_names([one.name for one in built])
    return tuple(one if one.name == name else replace(one, name=name) for one, name in zip(built, names, strict=True))


def distinct_names(names: Sequence[str]) -> list[str]:
    """The names, with a number behind those that were there before."""
    seen: Counter[str] = Counter()
    apart = []
    for name in names:
        seen[name] += 1
        apart.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return apart


def _read(content: Mapping[str, Any], source: str) -> AnyPath:
    shape = content.get("shape")
    if not isinstance(shape, str) or shape not in _SHAPES:
        raise ConfigurationError(f"{source}: {unknown_name('shape', shape, _SHAPES)}")
    return parse(_SHAPES[shape], content, f"{source} {shape!r}")
