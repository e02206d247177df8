"""Quantities that a recording can determine, by name: of payload, casters, motors and sensors.

A payload is a load that is fixed to the platform, as `caster_gym.wrappers.Payload` fixes it; a negative mass is
something that the robot lacks. Names of `OF_CASTERS` stand for one number that all casters share, or, with a caster's
number behind them as in radius_2, for that caster's own. "radii", "trails" and "steering_zeros" stand for one unknown
of each caster.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from caster_gym.configuration import did_you_mean, parse
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, robot_parameters, with_load
from caster_gym.mechanics.scalars import Scalar
from caster_gym.robot import Caster, Robot

WINDOW = 1.0  # [s] over which motions are predicted
CONFIDENCE = 0.95

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
    "radius": "m",
    "steering_zero": "rad",  # shown minus true angle, as `caster_gym.wrappers.SteeringOffset` has it
    "roll_strength": "-",  # torque of the rolling motor that acts, of what the recording says
    "steer_strength": "-",
    "torque_delay": "s",  # by which torques act later than the recording says
    "motor_lag": "s",  # time constant with which torques follow what the recording says
    "heading_zero": "rad",  # shown minus true angle of the body's x-axis
    "vx_bias": "m/s",  # shown minus true
    "vy_bias": "m/s",
    "yaw_rate_bias": "rad/s",
}
OF_CASTERS = tuple(UNITS)[4:14]
PARAMETERS = tuple(UNITS)[:11]  # of the dynamics
_IN_CASTERS = PARAMETERS[4:]
ACTING = ("roll_strength", "steer_strength", "torque_delay", "motor_lag")  # between recorded and true torques
SHOWN = {"heading_zero": 2, "vx_bias": 3, "vy_bias": 4, "yaw_rate_bias": 5}  # between true and recorded, by component
EACH = {"radii": "radius", "trails": "trail", "steering_zeros": "steering_zero"}
SIGNED = ("payload_mass", "payload_x", "payload_y", "steering_zero", "torque_delay", *SHOWN)  # may be negative

_UNTELLABLE = {
    "floor_friction": "wheels that roll without slip move alike on any floor",
    "height": "it shifts the loads on the wheels, which wheels that roll without slip do not feel",
    "position_bias": "a robot moves alike wherever it stands",
    "rate": "pushes are no property of the robot; leave the rows with pushes out",
    "noise": "noise is estimated in any case, see the table of errors",
}  # what else wrappers disturb or one might look for
_ALSO_CALLED = {
    "floor": "floor_friction", "mu": "floor_friction", "pushes": "rate", "force": "rate", "moment": "rate",
    "duration": "rate", "sensor_noise": "noise", "position": "noise", "heading": "noise", "speed": "noise",
    "steering": "noise", "joint_rate": "noise", "friction": "roll_coulomb", "viscous": "roll_viscous",
    "viscous_scale": "roll_viscous", "added_viscous": "roll_viscous", "coulomb": "roll_coulomb",
    "coulomb_scale": "roll_coulomb", "added_coulomb": "roll_coulomb", "wheel_radius": "radius", "wheel_errors": "radii",
    "steering_offset": "steering_zeros", "steering_offsets": "steering_zeros", "zeros": "steering_zeros",
    "offset": "steering_zero", "zero": "steering_zero", "angle": "steering_zero", "action_delay": "torque_delay",
    "periods": "torque_delay", "delay": "torque_delay", "latency": "torque_delay", "lag": "motor_lag",
    "time_constant": "motor_lag", "strength": "roll_strength", "motor_strength": "roll_strength",
    "torque_scale": "roll_strength", "torque_constant": "roll_strength", "heading_bias": "heading_zero",
    "speed_bias": "vx_bias", "payload": "payload_mass", "mass": "payload_mass",
    "com": "payload_x", "inertia": "payload_inertia", "x": "payload_x", "y": "payload_y",
}  # fmt: skip


class Unknown(NamedTuple):
    """What is known of an unknown before the recording is looked at. All in its unit."""

    name: str
    start: float
    scale: float  # a large difference for this robot
    bounds: tuple[float, float]

    @property
    def unit(self) -> str:
        """Its unit."""
        return UNITS[kind_of(self.name)]


def kind_of(name: str) -> str:
    """The name without a caster's number: radius of radius_2."""
    return _split(name)[0]


def caster_of(name: str) -> int | None:
    """The caster (from 0) that a name speaks of; none if of all."""
    return _split(name)[1]


def each_named(robot: Robot, names: Sequence[str]) -> tuple[str, ...]:
    """Names, "radii" and the like replaced by one name for each caster."""
    count = range(1, robot.caster_count + 1)
    groups = [[f"{EACH[name]}_{i}" for i in count] if name in EACH else [name] for name in names]
    return tuple(name for group in groups for name in group)


def unknowns(
    robot: Robot,
    names: Sequence[str],
    starts: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[Unknown, ...]:
    """The named unknowns of a robot, the file's numbers at first. Raises ValueError for a name that is not known.

    Friction may come out negative, within its interval of zero; other bounds keep the robot possible.
    """
    names = each_named(robot, names)
    if not names:
        raise ValueError(f"at least one unknown must be named; known are {', '.join(UNITS)}")
    if len(set(names)) < len(names):
        raise ValueError(f"an unknown is named twice in {list(names)}")
    check_names([*names, *(starts or {}), *(bounds or {})], robot)
    shared = [name for name in names if caster_of(name) is not None and kind_of(name) in names]
    if shared:
        raise ValueError(
            f"{kind_of(shared[0])!r} is one number that all casters share and {shared[0]!r} is that of one: "
            "name either of them"
        )
    found = tuple(_unknown(robot, name, starts or {}, bounds or {}) for name in names)
    for one in found:
        if not one.bounds[0] <= one.start <= one.bounds[1] or one.bounds[0] == one.bounds[1]:
            raise ValueError(
                f"{one.name} must start between its bounds {one.bounds[0]:g} and {one.bounds[1]:g} {one.unit}, "
                f"got {one.start:g} {one.unit}; both can be changed, with 'start' and 'bounds'"
            )
        if kind_of(one.name) in ("trail", "radius") and one.bounds[0] <= 0.0:
            raise ValueError(f"the lower bound of the {one.name} must be positive, got {one.bounds[0]:g} m")
        if one.name == "motor_lag" and one.bounds[0] < 0.0:
            raise ValueError(f"the lower bound of motor_lag must not be negative, got {one.bounds[0]:g} s")
    return found


def check_names(names: Sequence[str], robot: Robot) -> None:
    """Refuse a name that is not that of an unknown of a robot, and say why if it is that of something else."""
    for name in names:
        kind, caster = _split(name)
        if kind in UNITS and (caster is None or (kind in OF_CASTERS and 0 <= caster < robot.caster_count)):
            continue
        if kind in OF_CASTERS:
            raise ValueError(
                f"there is no {name!r} to identify: robot {robot.name!r} has {robot.caster_count} casters, from "
                f"{kind}_1 to {kind}_{robot.caster_count}"
            )
        meant = _ALSO_CALLED.get(name, name)
        if meant in _UNTELLABLE and name not in UNITS:
            raise ValueError(f"no recording determines {name!r}: {_UNTELLABLE[meant]}")
        advice = f"did you mean {meant!r}?" if meant != name else did_you_mean(name, [*UNITS, *EACH])
        raise ValueError(f"unknown quantity {name!r} to identify; {advice}")


def value_of(robot: Robot, name: str) -> float:
    """What the robot file says, of the first caster for what all casters share; there is no payload yet."""
    kind, caster = _split(name)
    if kind in _IN_CASTERS:
        return _of_caster(robot.casters[caster or 0], kind)
    return 1.0 if kind.endswith("strength") else 0.0


def check_alike(robot: Robot, names: Sequence[str]) -> None:
    """Refuse unknowns that all casters are to share but that differ from caster to caster."""
    for name in names:
        if name in _IN_CASTERS:
            values = sorted({_of_caster(caster, name) for caster in robot.casters})
            if len(values) > 1:
                raise ValueError(
                    f"all casters of robot {robot.name!r} must have the same {name} for it to be identified as one "
                    f"number, got {values[0]:g} … {values[-1]:g} {UNITS[name]}; name {name}_1 and the like instead"
                )


def parameters_with(robot: Robot, values: Mapping[str, Scalar], dynamics: Dynamics = "exact") -> RobotParameters:
    """The numbers of a robot with some values replaced; values of any kind of scalar. A payload has a mass."""
    plain = robot_parameters(robot, dynamics)
    platform = plain.platform
    if "payload_mass" in values:
        load = [values.get(f"payload_{part}", 0.0) for part in ("mass", "x", "y", "inertia")]
        platform = with_load(platform, *load)
    casters = tuple(
        caster._replace(**{kind: value for kind, value in of_caster(values, i).items() if kind in _IN_CASTERS})
        for i, caster in enumerate(plain.casters)
    )
    return RobotParameters(platform, casters)


def of_caster(values: Mapping[str, Scalar], caster: int) -> dict[str, Scalar]:
    """Values by kind that one caster (from 0) has: what all share, and its own."""
    parts = [(*_split(name), value) for name, value in values.items()]
    shared = {kind: value for kind, of, value in parts if kind in OF_CASTERS and of is None}
    return {**shared, **{kind: value for kind, of, value in parts if of == caster}}


def robot_with(robot: Robot, values: Mapping[str, float]) -> Robot:
    """The robot with some values replaced, its payload part of the platform; friction below zero becomes zero.

    A motor of another strength has another greatest torque. Zeros, biases, delay and lag have no place in a robot.
    """
    possible = {name: value if kind_of(name) in SIGNED else max(value, 0.0) for name, value in values.items()}
    p = parameters_with(robot, possible).platform
    platform = robot.platform.model_copy(update={"mass": p.mass, "inertia": p.inertia, "com": (p.com_x, p.com_y)})
    casters = tuple(_caster_with(caster, of_caster(possible, i)) for i, caster in enumerate(robot.casters))
    changed = {"platform": platform, "casters": casters}
    return parse(Robot, robot.model_copy(update=changed).model_dump(), f"robot {robot.name!r} as identified")


def _split(name: str) -> tuple[str, int | None]:
    """The kind of a name and the caster (from 0) that it speaks of."""
    match = re.fullmatch(r"(\w+?)_(\d+)", name)
    return (match[1], int(match[2]) - 1) if match else (name, None)


def _unknown(
    robot: Robot, name: str, starts: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> Unknown:
    kind = kind_of(name)
    scale, limits = _scale(robot, name), _bounds(robot, name)
    at_first = scale if name == "payload_mass" else value_of(robot, name)  # without a load its place does not show
    start = starts.get(name, starts.get(kind, at_first))
    return Unknown(name, float(start), scale, bounds.get(name, bounds.get(kind, limits)))


def _caster_with(caster: Caster, values: Mapping[str, Scalar]) -> Caster:
    motors = {}
    for joint in ("roll", "steer"):
        motor = getattr(caster, joint)
        update = {kind: values[f"{joint}_{kind}"] for kind in ("viscous", "coulomb") if f"{joint}_{kind}" in values}
        strength = values.get(f"{joint}_strength", 1.0)
        motors[joint] = motor.model_copy(update={**update, "max_torque": strength * motor.max_torque})
    own = {name: values[name] for name in ("scrub", "trail", "radius") if name in values}
    return caster.model_copy(update={**motors, **own})


def _of_caster(caster: Caster, name: str) -> float:
    joint, _, kind = name.partition("_")
    return float(getattr(getattr(caster, joint), kind) if kind else getattr(caster, name))


def _scale(robot: Robot, name: str) -> float:
    caster = robot.casters[caster_of(name) or 0]
    roll, steer = caster.roll, caster.steer
    return {
        "payload_mass": 0.1 * robot.platform.mass,
        "payload_x": 0.5 * robot.pivot_reach,
        "payload_y": 0.5 * robot.pivot_reach,
        "payload_inertia": 0.5 * robot.platform.inertia,
        "roll_viscous": roll.max_torque / roll.max_speed,
        "roll_coulomb": 0.1 * roll.max_torque,
        "steer_viscous": steer.max_torque / steer.max_speed,
        "steer_coulomb": 0.1 * steer.max_torque,
        "scrub": steer.max_torque / steer.max_speed,
        "trail": 0.5 * caster.trail,
        "radius": 0.5 * caster.radius,
        "steering_zero": 0.2,
        "roll_strength": 0.5,
        "steer_strength": 0.5,
        "torque_delay": 0.02,
        "motor_lag": 0.02,
        "heading_zero": 0.2,
        "vx_bias": 0.1 * robot.top_speed,
        "vy_bias": 0.1 * robot.top_speed,
        "yaw_rate_bias": 0.1 * robot.top_speed / robot.pivot_reach,
    }[kind_of(name)]


def _bounds(robot: Robot, name: str) -> tuple[float, float]:
    kind, scale, value = kind_of(name), _scale(robot, name), value_of(robot, name)
    mass, inertia = robot.platform.mass, robot.platform.inertia
    own = {
        "payload_mass": (-0.9 * mass, 10.0 * mass),
        "payload_x": (-4.0 * scale, 4.0 * scale),
        "payload_y": (-4.0 * scale, 4.0 * scale),
        "payload_inertia": (-0.9 * inertia, 100.0 * inertia),
        "trail": (0.5 * value, 2.0 * value),
        "radius": (0.5 * value, 2.0 * value),
        "steering_zero": (-0.6, 0.6),
        "heading_zero": (-0.6, 0.6),
        "roll_strength": (0.1, 10.0),
        "steer_strength": (0.1, 10.0),
        "motor_lag": (0.0, 10.0 * scale),
    }
    return own.get(kind, (-10.0 * scale, 10.0 * scale))
