"""The description of a robot on powered casters, checked and with units. SI throughout; B is the body frame."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, NonNegativeFloat, field_validator, model_validator

from caster_gym.arrays import Array
from caster_gym.bounded_files import expanded
from caster_gym.configuration import ConfigurationError, Frozen, Positive, is_yaml, parse, read_yaml
from caster_gym.floor import GREATEST
from caster_gym.outlines import Corners, Outline, convex, polygon_fault
from caster_gym.plausibility import warn_if_implausible
from caster_gym.shipped_files import find, names_of, own_file

Pair: TypeAlias = tuple[float, float]

MOST_CASTERS = 200


class Motor(Frozen):
    """The motor of one joint, seen at that joint."""

    max_torque: Positive  # [N m]
    max_speed: Positive  # [rad/s] at which no torque is left
    rotor: NonNegativeFloat = 0.0  # [kg m²] inertia of what turns with the motor, at the motor's side of `gear`
    armature: NonNegativeFloat = 0.0  # [kg m²] inertia of gears that turn with the joint alone, referred to it
    viscous: NonNegativeFloat = 0.0  # [N m s/rad]
    coulomb: NonNegativeFloat = 0.0  # [N m]


class Wheel(Frozen):
    """A wheel; its mass centre is its centre."""

    mass: NonNegativeFloat  # [kg]
    spin_inertia: NonNegativeFloat  # [kg m²] about the axle
    yaw_inertia: NonNegativeFloat  # [kg m²] about a diameter


class Link(Frozen):
    """The steering link, from its axis to the axle."""

    mass: NonNegativeFloat  # [kg]
    inertia: NonNegativeFloat  # [kg m²] about a vertical axis through its mass centre
    com: Pair = (0.0, 0.0)  # [m] (l, q): behind and left of the steering axis


class Caster(Frozen):
    """One powered caster, described in the body frame."""

    x: float  # [m] pivot, forward of C
    y: float  # [m] pivot, left of C
    trail: Positive  # [m] steering axis to wheel centre, opposite to the rolling direction
    offset: float = 0.0  # [m] wheel centre left of the steering axis
    radius: Positive  # [m]
    wheel: Wheel
    link: Link
    roll: Motor
    steer: Motor
    scrub: NonNegativeFloat = 0.0  # [N m s/rad] of the contact patch against yaw over ground
    gear: tuple[Pair, Pair] = ((1.0, 0.0), (0.0, 1.0))  # motor speeds = gear · joint rates

    @field_validator("trail", mode="before")
    @classmethod
    def _wheel_trails(cls, trail: Any) -> Any:
        if trail == 0 and not isinstance(trail, bool):
            raise ValueError(
                f"must be greater than 0, got {trail}: a wheel without trail, as in a swerve module, is another "
                "mechanism, which rolling cannot steer and which holds its pivot from moving sideways, so that its "
                "robot has other degrees of freedom; if the wheel of your module does stand behind its steering axis, "
                "as it does on many, give that distance, else this package has no model of it"
            )
        return trail

    @field_validator("gear")
    @classmethod
    def _gear_is_invertible(cls, gear: tuple[Pair, Pair]) -> tuple[Pair, Pair]:
        (a, b), (c, d) = gear
        if abs(a * d - b * c) < 1e-9 * max(abs(a * d), abs(b * c), 1e-9):
            raise ValueError("must be invertible: two motors that turn together cannot drive two joints")
        return gear

    @property
    def top_speed(self) -> float:
        """Speed of the wheel that rolls straight ahead at the top speed of the slower of the motors it turns. [m/s]"""
        ratios = [ratio for ratio, _ in self.gear]
        turned = zip(self.motors, ratios, strict=True)
        return self.radius * min(motor.max_speed / abs(ratio) for motor, ratio in turned if ratio != 0.0)

    @property
    def motors(self) -> tuple[Motor, Motor]:
        """The motors of the rolling and of the steering joint."""
        return self.roll, self.steer


class Footprint(Frozen):
    """Outline of the platform in B: a disc of a radius around C, or a convex polygon."""

    disc: Positive | None = None  # [m]
    polygon: Annotated[tuple[Pair, ...], Field(min_length=3)] | None = None  # [m] counter-clockwise

    @field_validator("polygon")
    @classmethod
    def _convex_and_counter_clockwise(cls, polygon: Corners | None) -> Corners | None:
        if polygon is not None and (fault := polygon_fault(polygon)):
            raise ValueError(fault)
        return polygon

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if (self.disc is None) == (self.polygon is None):
            raise ValueError("give exactly one of 'disc' (a radius) and 'polygon' (its corners)")
        return self

    @property
    def outline(self) -> Outline:
        """The shape, in B."""
        return convex(self.polygon) if self.polygon else Outline((), ((0.0, 0.0),), self.disc or 0.0)

    @property
    def area(self) -> float:
        """Area inside the outline. [m²]"""
        if self.disc is not None:
            return float(np.pi * self.disc**2)
        x, y = np.asarray(self.polygon).T
        return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


class Platform(Frozen):
    """The platform without its casters."""

    usual_names: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("z", "com_height", "height_of_com", "com_z"), "height"),
        **dict.fromkeys(("centre_of_mass", "center_of_mass"), "com"),
    }

    mass: Positive  # [kg]
    inertia: Positive  # [kg m²] about a vertical axis through its mass centre
    com: Pair = (0.0, 0.0)  # [m] mass centre in B
    height: NonNegativeFloat = 0.0  # [m] of the mass centre above the floor; 0 leaves loads on wheels as at rest
    footprint: Footprint


class Robot(Frozen):
    """An omnidirectional robot on two or more powered casters.

    >>> import caster_gym
    >>> robot = caster_gym.load_robot("chung2008")
    >>> robot.caster_count, robot.platform.mass, robot.joints[:2]
    (3, 5.0, ('roll_1', 'steer_1'))
    >>> robot.with_actuation(["roll_1", "steer_1", "roll_2"]).driven
    ('roll_1', 'steer_1', 'roll_2')
    """

    usual_names: ClassVar[Mapping[str, str]] = {
        "mu": "floor_friction",
        "friction": "floor_friction",
        **dict.fromkeys(("height", "z", "com_height"), "it belongs to the 'platform', as {height: 0.1}"),
    }

    name: str
    platform: Platform
    casters: Annotated[tuple[Caster, ...], Field(min_length=2, max_length=MOST_CASTERS)]
    actuation: Literal["all"] | tuple[str, ...] = "all"  # which joints are driven, e.g. (roll_1, steer_1, roll_2)
    # [-] between wheels and floor; tells how much of it is used
    floor_friction: Annotated[float, Field(gt=0.0, le=GREATEST)] = 0.7
    coulomb_speed: Positive = 0.1  # [rad/s] rate of a joint below which its dry friction fades to zero

    @field_validator("actuation", mode="before")
    @classmethod
    def _all_or_a_list_of_joints(cls, actuation: Any) -> Any:
        listed = isinstance(actuation, list | tuple) and all(isinstance(joint, str) for joint in actuation)
        if actuation != "all" and not listed:
            raise ValueError("must be 'all' or a list of joints such as [roll_1, steer_1, roll_2]")
        return actuation

    @model_validator(mode="after")
    def _joints_exist(self) -> Self:
        if self.actuation != "all":
            check_joints(self.actuation, len(self.casters))
        places = {(caster.x, caster.y) for caster in self.casters}
        if len(places) < 2:
            raise ValueError("at least two casters must stand at different places")
        warn_if_implausible(self)
        return self

    @property
    def caster_count(self) -> int:
        """Number N of casters."""
        return len(self.casters)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all 2 N joints: roll_1, steer_1, roll_2, steer_2, …"""
        return joint_names(self.caster_count)

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the driven joints, in the order of `joints`."""
        return self.joints if self.actuation == "all" else tuple(j for j in self.joints if j in self.actuation)

    @property
    def driven_indices(self) -> list[int]:
        """Places of the driven joints among all `joints`."""
        return [self.joints.index(joint) for joint in self.driven]

    @property
    def motors(self) -> tuple[Motor, ...]:
        """The motors of all joints, in the order of `joints`."""
        return tuple(motor for caster in self.casters for motor in caster.motors)

    @property
    def max_torques(self) -> Array:
        """Greatest torques (2 N,) of the motors. [N m]"""
        return np.array([motor.max_torque for motor in self.motors])

    @property
    def max_speeds(self) -> Array:
        """Speeds (2 N,) of the motors at which no torque is left. [rad/s]"""
        return np.array([motor.max_speed for motor in self.motors])

    @property
    def reach(self) -> float:
        """Greatest distance of the outline and of the wheels from C, however they are steered. [m]"""
        wheels = [np.hypot(one.x, one.y) + np.hypot(one.trail, one.offset) + one.radius for one in self.casters]
        return float(max(self.platform.footprint.outline.reach, *wheels))

    @property
    def pivot_reach(self) -> float:
        """Distance of the farthest pivot from C. [m]"""
        return max(float(np.hypot(caster.x, caster.y)) for caster in self.casters)

    @property
    def top_speed(self) -> float:
        """Speed of the fastest wheel at its motor's top speed. [m/s]"""
        return max(caster.top_speed for caster in self.casters)

    def with_actuation(self, actuation: str | tuple[str, ...] | list[str]) -> "Robot":
        """The same robot with other joints driven: "all" or their names."""
        chosen = actuation if isinstance(actuation, str) else tuple(actuation)
        return parse(Robot, {**self.model_dump(), "actuation": chosen}, f"actuation of robot {self.name!r}")

    def without_wheels(self) -> "Robot":
        """The same robot with massless wheels, links and rotors: the "incomplete model" of chung2008."""
        parts = {"wheel": Wheel(mass=0.0, spin_inertia=0.0, yaw_inertia=0.0), "link": Link(mass=0.0, inertia=0.0)}
        casters = []
        for caster in self.casters:
            roll, steer = (motor.model_copy(update={"rotor": 0.0, "armature": 0.0}) for motor in caster.motors)
            casters.append(caster.model_copy(update={**parts, "roll": roll, "steer": steer}))
        return self.model_copy(update={"casters": tuple(casters)})


def joint_names(caster_count: int) -> tuple[str, ...]:
    """roll_1, steer_1, roll_2, steer_2, …"""
    return tuple(f"{kind}_{i}" for i in range(1, caster_count + 1) for kind in ("roll", "steer"))


def check_joints(joints: tuple[str, ...] | list[str], caster_count: int) -> tuple[str, ...]:
    """The named joints, each known and named once."""
    known = joint_names(caster_count)
    unknown = [joint for joint in joints if joint not in known]
    if unknown:
        raise ValueError(f"unknown joint {unknown[0]!r}; the joints are {', '.join(known)}")
    if len(set(joints)) != len(joints):
        raise ValueError(f"a joint is named twice in {list(joints)}")
    if not joints:
        raise ValueError("at least one joint must be named")
    return tuple(joints)


def load_robot(name: str | Path | Robot | Mapping[str, Any]) -> Robot:
    """The robot of a name, such as "tidybot2", of a YAML file of your own, or of a mapping with the same content.

    >>> import caster_gym
    >>> caster_gym.load_robot("tidybot2").caster_count
    4
    >>> changed = {**caster_gym.load_robot("chung2008").model_dump(), "name": "slippery", "floor_friction": 0.2}
    >>> caster_gym.load_robot(changed).floor_friction
    0.2
    """
    if isinstance(name, Robot):
        return name
    if isinstance(name, Mapping):
        return parse(Robot, name, "the robot")
    if not isinstance(name, str | os.PathLike):
        raise ConfigurationError(
            f"a robot is a name, the path of a YAML file, a mapping with its content, or a Robot, got {name!r}"
        )
    path = expanded(name)
    if not is_yaml(path) and str(name) not in names_of("robots"):
        own = own_file(str(name))
        known = f"known are {', '.join(names_of('robots'))}, or give the path of a YAML file"
        if path.is_dir():
            raise ConfigurationError(f"{str(name)!r} is a folder, not a robot; {known}")
        raise ConfigurationError(f"unknown robot {str(name)!r}; {f'did you mean the file {own!r}?' if own else known}")
    path = find("robots", path)
    return parse(Robot, read_yaml(path), str(path))
