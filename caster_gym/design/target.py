"""The target of a design: the motions that a robot must be able to make."""

from itertools import combinations
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.analysis.actuation import DEGREES_OF_FREEDOM, SINGULAR, worst_conditioning
from caster_gym.configuration import Frozen, Positive
from caster_gym.design.joint_sets import classify
from caster_gym.mechanics.parameters import robot_parameters, with_load
from caster_gym.paths.specification import PathSpecification
from caster_gym.robot import Robot


class Payload(Frozen):
    """A load that is fixed to the platform."""

    mass: NonNegativeFloat  # [kg]
    inertia: NonNegativeFloat = 0.0  # [kg m²] about a vertical axis through its mass centre
    com: tuple[float, float] = (0.0, 0.0)  # [m] mass centre in B
    height: NonNegativeFloat | None = None  # [m] of the mass centre above the floor; None: as high as the platform's


class Target(Frozen):
    """Motions that the motors must give: every one within these limits, and those of the paths.

    Speed and yaw rate may be at their greatest together, accelerations too, each in whatever direction.
    """

    speed: Positive  # [m/s] of C, in every direction
    yaw_rate: Positive  # [rad/s]
    acceleration: Positive  # [m/s²] of C over ground, in every direction
    yaw_acceleration: Positive  # [rad/s²]
    accelerating_up_to: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0  # [-] of speed and yaw rate; beyond, cruising
    flip_speed: NonNegativeFloat | None = None  # [m/s] up to which casters may stand at any angle; None: by (S2)
    payload: Payload | None = None
    paths: Annotated[tuple[PathSpecification, ...], Field(max_length=200)] = ()
    time_step: Positive = 0.02  # [s] at which paths are looked at
    actuation: Literal["all"] | tuple[str, ...] | None = None  # driven joints; None: as the robot file says
    margin: Annotated[float, Field(ge=1.0)] = 1.3  # [-] as if every torque and speed were that many times as great

    @model_validator(mode="after")
    def _flips_within_the_speed(self) -> Self:
        if self.flip_speed is not None and self.flip_speed > self.speed:
            raise ValueError(f"flip_speed must be at most the speed of {self.speed:g} m/s, got {self.flip_speed:g} m/s")
        return self


def driven_as(robot: Robot, target: Target) -> Robot:
    """The robot with the joints driven that the target names."""
    return robot if target.actuation is None else robot.with_actuation(target.actuation)


def loaded(robot: Robot, target: Target) -> Robot:
    """The robot with the target's payload on its platform."""
    load, bare = target.payload, robot.platform
    if load is None or load.mass + load.inertia == 0.0:
        return robot
    full = with_load(robot_parameters(robot).platform, load.mass, *load.com, load.inertia, load.height)
    com = full.com_x, full.com_y
    changed = {"mass": full.mass, "inertia": full.inertia, "com": com, "height": full.height}
    platform = bare.model_copy(update=changed)
    return robot.model_copy(update={"platform": platform})


def check_actuation(robot: Robot) -> None:
    """Refuse driven joints that cannot push the robot in every direction at all steering angles: no motor suffices.

    Decided exactly, by the lines of action (docs/analysis.md, L).
    """
    names = ", ".join(robot.driven)
    if len(robot.driven) < DEGREES_OF_FREEDOM:
        raise ValueError(
            f"a platform has three degrees of freedom: drive three joints or more of robot {robot.name!r}, got {names}"
        )
    found = classify(robot, robot.driven)
    if found.steering is None:
        return
    angles = ", ".join(f"{np.degrees(angle):.1f}°" for angle in found.steering)
    raise ValueError(
        f"robot {robot.name!r} driven by {names} cannot push itself in every direction at the steering angles "
        f"({angles}), so no motors are strong enough; {_remedy(robot)}"
    )


def _remedy(robot: Robot) -> str:
    """Joints to drive that can push the robot in every direction, as it is."""
    joints = [(f"roll_{i}", f"steer_{i}") for i in range(1, robot.caster_count + 1)]
    paired = sum(set(pair) <= set(robot.driven) for pair in joints)
    pairs = ((*one, *other) for one, other in combinations(joints, 2))
    able = next((some for some in (*pairs, robot.joints) if classify(robot, some).steering is None), None)
    ways = ["choose shorter trails"] if paired > 1 or able is None else []
    if able is not None:
        ways.append(f"drive {', '.join(able)}")
    elif paired < 2:
        ways.append("drive both joints of two casters")
    return " and ".join(ways) if able is None else " or ".join(ways)


def check_conditioning(robot: Robot) -> None:
    """Refuse driven motors that push so unevenly that the damping of their least effort would falsify torques."""
    value, steering = worst_conditioning(robot)
    if value < SINGULAR:
        sizes = ", ".join(
            f"{name} {1e3 * min(lengths):.3g} mm" if min(lengths) == max(lengths) else f"{name}s of the file"
            for name, lengths in (
                ("radius", [caster.radius for caster in robot.casters]),
                ("trail", [caster.trail for caster in robot.casters]),
            )
        )
        angles = ", ".join(f"{np.degrees(angle):.1f}°" for angle in steering)
        raise ValueError(
            f"with {sizes}, the motors of robot {robot.name!r} push {1.0 / value:.0f} times as strongly in one "
            f"direction as in another at the steering angles ({angles}); more than {1.0 / SINGULAR:.0f} times is too "
            "uneven for their torques to be found: bring radius and trail nearer to each other"
        )
