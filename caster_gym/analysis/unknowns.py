"""Numbers of a robot that a recording can tell, by name: the payload, friction, and the trail.

A payload is a load that is fixed to the platform, as `caster_gym.wrappers.Payload` fixes it; a negative mass is
something that the robot lacks. Each of the other names stands for one number that all casters share.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from caster_gym.configuration import did_you_mean, parse
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, robot_parameters, with_load
from caster_gym.mechanics.scalars import Scalar
from caster_gym.robot import Caster, Robot

UNITS = {
    "payload_mass": "kg",
    "payload_x": "m",  # its mass centre, forward of C
    "payload_y": "m",  # and left of C
    "payload_inertia": "kg m²",  # about a vertical axis through its mass centre; 0: a point
    "roll_viscous": "N m s/rad",
    "roll_coulomb": "N m",
    "steer_viscous": "N m s/rad",
    "steer_coulomb": "N m",
    "scrub": "N m s/rad",
    "trail": "m",
}
_OF_CASTERS = tuple(UNITS)[4:]
SIGNED = ("payload_mass", "payload_x", "payload_y")  # may be negative in a robot file


class Unknown(NamedTuple):
    """What is known of an unknown before the recording is looked at. All in its unit."""

    name: str
    start: float
    scale: float  # a large difference for this robot
    bounds: tuple[float, float]

    @property
    def unit(self) -> str:
        """Its unit."""
        return UNITS[self.name]


def unknowns(
    robot: Robot,
    names: Sequence[str],
    starts: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[Unknown, ...]:
    """The named unknowns of a robot, the file's numbers at first. Raises ValueError for a name that is not known.

    Friction may come out negative, within its interval of zero; other bounds keep the robot possible.
    """
    if not names:
        raise ValueError(f"at least one unknown must be named; known are {', '.join(UNITS)}")
    if len(set(names)) < len(names):
        raise ValueError(f"an unknown is named twice in {list(names)}")
    check_names(names)
    own, sizes, limits = values_of(robot), _scales(robot), _bounds(robot)
    own["payload_mass"] = sizes["payload_mass"]  # where there is no load its place does not show
    own.update(starts or {})
    limits.update(bounds or {})
    found = tuple(Unknown(name, float(own[name]), sizes[name], limits[name]) for name in names)
    for one in found:
        if not one.bounds[0] <= one.start <= one.bounds[1] or one.bounds[0] == one.bounds[1]:
            raise ValueError(
                f"{one.name} must start between its bounds {one.bounds[0]:g} and {one.bounds[1]:g} {one.unit}, "
                f"got {one.start:g} {one.unit}"
            )
    if "trail" in names and found[list(names).index("trail")].bounds[0] <= 0.0:
        raise ValueError("the lower bound of the trail must be positive")
    return found


def check_names(names: Sequence[str]) -> None:
    """Refuse a name that is not that of an unknown."""
    for name in names:
        if name not in UNITS:
            raise ValueError(f"unknown quantity {name!r} to identify; {did_you_mean(name, UNITS)}")


def values_of(robot: Robot) -> dict[str, float]:
    """All values as the robot file gives them, for the casters those of the first; there is no payload yet."""
    caster = robot.casters[0]
    return {**dict.fromkeys(UNITS, 0.0), **{name: _of_caster(caster, name) for name in _OF_CASTERS}}


def check_alike(robot: Robot, names: Sequence[str]) -> None:
    """Refuse unknowns that all casters are to share but that differ from caster to caster."""
    for name in names:
        if name in _OF_CASTERS:
            values = sorted({_of_caster(caster, name) for caster in robot.casters})
            if len(values) > 1:
                raise ValueError(
                    f"all casters of robot {robot.name!r} must have the same {name} for it to be identified, "
                    f"got {values[0]:g} … {values[-1]:g} {UNITS[name]}"
                )


def parameters_with(robot: Robot, values: Mapping[str, Scalar], dynamics: Dynamics = "exact") -> RobotParameters:
    """The numbers of a robot with some values replaced; values of any kind of scalar. A payload has a mass."""
    plain = robot_parameters(robot, dynamics)
    of_casters = {name: value for name, value in values.items() if name in _OF_CASTERS}
    platform = plain.platform
    if "payload_mass" in values:
        load = [values.get(f"payload_{part}", 0.0) for part in ("mass", "x", "y", "inertia")]
        platform = with_load(platform, *load)
    return RobotParameters(platform, tuple(caster._replace(**of_casters) for caster in plain.casters))


def robot_with(robot: Robot, values: Mapping[str, float]) -> Robot:
    """The robot with some values replaced, its payload part of the platform; friction below zero becomes zero."""
    possible = {name: value if name in SIGNED else max(value, 0.0) for name, value in values.items()}
    p = parameters_with(robot, possible).platform
    platform = robot.platform.model_copy(update={"mass": p.mass, "inertia": p.inertia, "com": (p.com_x, p.com_y)})
    casters = tuple(_caster_with(caster, possible) for caster in robot.casters)
    changed = {"platform": platform, "casters": casters}
    return parse(Robot, robot.model_copy(update=changed).model_dump(), f"robot {robot.name!r} as identified")


def _caster_with(caster: Caster, values: Mapping[str, float]) -> Caster:
    motors = {
        joint: getattr(caster, joint).model_copy(
            update={kind: values[f"{joint}_{kind}"] for kind in ("viscous", "coulomb") if f"{joint}_{kind}" in values}
        )
        for joint in ("roll", "steer")
    }
    own = {name: values[name] for name in ("scrub", "trail") if name in values}
    return caster.model_copy(update={**motors, **own})


def _of_caster(caster: Caster, name: str) -> float:
    joint, _, kind = name.partition("_")
    return float(getattr(getattr(caster, joint), kind) if kind else getattr(caster, name))


def _reach(robot: Robot) -> float:
    """Distance of the farthest pivot from C. [m]"""
    return max(float(np.hypot(caster.x, caster.y)) for caster in robot.casters)


def _scales(robot: Robot) -> dict[str, float]:
    roll, steer = robot.casters[0].roll, robot.casters[0].steer
    return {
        "payload_mass": 0.1 * robot.platform.mass,
        "payload_x": 0.5 * _reach(robot),
        "payload_y": 0.5 * _reach(robot),
        "payload_inertia": 0.5 * robot.platform.inertia,
        "roll_viscous": roll.max_torque / roll.max_speed,
        "roll_coulomb": 0.1 * roll.max_torque,
        "steer_viscous": steer.max_torque / steer.max_speed,
        "steer_coulomb": 0.1 * steer.max_torque,
        "scrub": steer.max_torque / steer.max_speed,
        "trail": 0.5 * robot.casters[0].trail,
    }


def _bounds(robot: Robot) -> dict[str, tuple[float, float]]:
    reach, mass, trail = _reach(robot), robot.platform.mass, robot.casters[0].trail
    return {
        "payload_mass": (-0.9 * mass, 10.0 * mass),
        "payload_x": (-2.0 * reach, 2.0 * reach),
        "payload_y": (-2.0 * reach, 2.0 * reach),
        "payload_inertia": (-0.9 * robot.platform.inertia, 100.0 * robot.platform.inertia),
        **{name: (-10.0 * _scales(robot)[name], 10.0 * _scales(robot)[name]) for name in _OF_CASTERS[:5]},
        "trail": (0.5 * trail, 2.0 * trail),
    }
