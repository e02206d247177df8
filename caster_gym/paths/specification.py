"""Paths as they are written in YAML and in Python, and the trajectories they stand for."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_args

from pydantic import Field

from caster_gym.configuration import ConfigurationError, parse, read_yaml
from caster_gym.paths.advice import timed_remedy
from caster_gym.paths.feasibility import check_feasible
from caster_gym.paths.naming import unknown_name
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, Ellipse, Lemniscate, RoundedSquare
from caster_gym.paths.splines import Spline
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

AnyPath: TypeAlias = Circle | Ellipse | Lemniscate | RoundedSquare | Spline | RandomPaths
PathSpecification: TypeAlias = Annotated[AnyPath, Field(discriminator="shape")]

_SHAPES: dict[str, type[AnyPath]] = {kind.model_fields["shape"].default: kind for kind in get_args(AnyPath)}


def read_paths(path: str | Mapping[str, Any] | AnyPath | Sequence[Any]) -> tuple[AnyPath, ...]:
    """Checked paths from a name, a mapping with its shape and parameters, a checked path, or a sequence of these.

    A name is that of a shape with its defaults, a YAML file of one mapping, or a CSV file of waypoints. Raises
    ConfigurationError that names the shape, the key and the value.
    """
    if isinstance(path, Sequence) and not isinstance(path, str):
        paths = tuple(one for item in path for one in read_paths(item))
        if not paths:
            raise ConfigurationError("at least one path is needed, got none")
        return paths
    if isinstance(path, get_args(AnyPath)):
        return (path,)
    if isinstance(path, str) and path.endswith((".yaml", ".yml")):
        return (_read(read_yaml(Path(path).expanduser()), f"{path}: path"),)
    if isinstance(path, str):
        return (_read({"shape": "spline", "file": path} if path.endswith(".csv") else {"shape": path}, "path"),)
    if isinstance(path, Mapping):
        return (_read(path, "path"),)
    raise ConfigurationError(f"a path is a name, a mapping or a sequence of these, got {path!r}")


def build_trajectories(
    path: str | Mapping[str, Any] | AnyPath | Sequence[Any], robot: Robot, time_step: float
) -> tuple[Trajectory, ...]:
    """The timed trajectories of all paths. Time step in s.

    Raises ValueError for one that the motors of the robot cannot drive; the message says what would do.
    """
    built: list[Trajectory] = []
    for specification in read_paths(path):
        try:
            trajectories = specification.trajectories(time_step)
        except ValueError as error:
            remedy = timed_remedy(specification, robot, time_step)
            advice = f"; {remedy} would do" if remedy else ""
            raise ValueError(f"path {specification.shape!r}: {error}{advice}") from error
        check_feasible(specification, trajectories, robot)
        built.extend(trajectories)
    names = named_apart([one.name for one in built])
    return tuple(one if one.name == name else replace(one, name=name) for one, name in zip(built, names, strict=True))


def named_apart(names: Sequence[str]) -> list[str]:
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
