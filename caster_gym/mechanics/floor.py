"""Which friction the floor has under each wheel. docs/equations.md, section S."""

from typing import Any, NamedTuple

import numpy as np

from caster_gym.floor import Floor
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.caster_masses import held_inertia
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import (
    CasterParameters,
    Dynamics,
    RobotParameters,
    caster_parameters,
    robot_parameters,
)
from caster_gym.mechanics.scalars import Direction, Scalar, each, entries, where
from caster_gym.robot import Robot


class Surface(NamedTuple):
    """The floor under one robot."""

    frictions: tuple[Scalar, ...]  # [-] under each wheel
    contact_time: Scalar  # [s]


class PatchRow(NamedTuple):
    """A disc of another friction."""

    x: Scalar  # [m] its centre, in W
    y: Scalar
    square_radius: Scalar  # [m²]
    friction: Scalar


_PLACES = tuple(range(len(PatchRow._fields)))


class FloorTable(NamedTuple):
    """A floor as the engines take it; the friction away from patches is the robot's."""

    contact_time: Scalar  # [s]
    patches: Any  # (P, 4) as in `PatchRow`; None if there are none


def floor_table(floor: Floor) -> FloorTable:
    """The numbers of a floor."""
    rows = [PatchRow(patch.x, patch.y, patch.radius * patch.radius, patch.friction) for patch in floor.patches]
    return FloorTable(floor.contact_time, np.array(rows) if rows else None)


def on_floor(robot: RobotParameters, floor: Floor) -> RobotParameters:
    """A robot on a floor, whose friction takes the place of the robot's own."""
    if floor.friction is None:
        return robot
    friction = floor.friction + 0.0 * robot.platform.mass
    return robot._replace(platform=robot.platform._replace(floor_friction=friction))


def robot_on(robot: Robot, floor: Floor) -> Robot:
    """The same of a robot as it is described; a floor may have no friction at all, which is no robot's own."""
    return robot if floor.friction is None else robot.model_copy(update={"floor_friction": floor.friction})


def with_greatest_friction(robot: Robot, floor: Floor) -> Robot:
    """A robot where the floor has its greatest friction, be it that of a patch."""
    greatest = max((robot_on(robot, floor).floor_friction, *(patch.friction for patch in floor.patches)))
    return robot.model_copy(update={"floor_friction": greatest})


def check_slips(robot: Robot) -> None:
    """Refuse a robot whose casters have no inertia of their own: nothing would hold a wheel that slips."""
    for number, caster in enumerate(robot.casters, start=1):
        parameters = caster_parameters(caster, True, True)
        yaw, spin = held_inertia(parameters)
        roll, steer, cross = parameters.roll_armature, parameters.steer_armature, parameters.cross_armature
        if (yaw + steer) * (spin + roll) <= cross * cross:
            axis, key = ("axle", "spin_inertia") if spin + roll <= 0.0 else ("pivot", "yaw_inertia")
            raise ValueError(
                f"a floor of finite friction needs casters with inertia of their own, but caster {number} of robot "
                f"{robot.name!r} has none about its {axis}: give it a 'wheel.{key}', or let the floor grip"
            )


def check_floor(robot: Robot, dynamics: Dynamics) -> None:
    """Refuse what a floor of finite friction has no equations for."""
    if dynamics != "exact":
        raise ValueError(f'a floor of finite friction needs dynamics="exact", got {dynamics!r}')
    check_slips(robot)


def parameters_on(robot: Robot, dynamics: Dynamics, floor: Floor | None) -> RobotParameters:
    """The numbers of a robot on a floor, or on one that grips. Raises ValueError for robots that cannot slip."""
    if floor is None:
        return robot_parameters(robot, dynamics)
    check_floor(robot, dynamics)
    return on_floor(robot_parameters(robot), floor)


def wrong_state(shape: tuple[int, ...], count: int, casters: int, slippery: bool) -> str:
    """What to say of states whose shape no fleet of so many robots has."""
    rolling, slipping = (count, 7 + 2 * casters), (count, 9 + 4 * casters)
    if slippery:
        return f"state must have shape {slipping}, or {rolling} of wheels that start rolling, got {shape}"
    if shape == slipping:
        return (
            f"state must have shape {rolling}, got {shape}, which is that of states on a floor of finite friction, "
            "such as floor={'friction': 0.7}"
        )
    return f"state must have shape {rolling}, got {shape}"


def surface_under(state: State, robot: RobotParameters, floor: FloorTable | None) -> Surface | None:
    """The floor under a robot; None if it grips."""
    if floor is None:
        return None
    frictions = wheel_frictions(state.position, state.heading, state.directions, floor.patches, robot)
    return Surface(frictions, floor.contact_time)


def own_friction(friction: Scalar, caster: CasterParameters) -> Scalar:
    """Friction under a wheel that stands on no patch. [-]"""
    return friction + 0.0 * caster.x


def patch_at(patches: Any, k: Any) -> PatchRow:
    """One of the patches of a table."""
    return PatchRow(*entries(patches, k, _PLACES))


def patch_friction(
    position: tuple[Scalar, Scalar],
    heading: Direction,
    patch: PatchRow,
    friction: Scalar,
    f: Direction,
    caster: CasterParameters,
) -> Scalar:
    """Friction under one wheel: that of a patch if it stands on it, else as it is. [-]"""
    (c, s), (px, py) = heading, wheel_centre(f, caster)
    x = position[0] + c * px - s * py - patch.x
    y = position[1] + s * px + c * py - patch.y
    return where(x * x + y * y < patch.square_radius, patch.friction + 0.0 * friction, friction)


def wheel_frictions(
    position: tuple[Scalar, Scalar],
    heading: Direction,
    directions: tuple[Direction, ...],
    patches: Any,
    robot: RobotParameters,
) -> tuple[Scalar, ...]:
    """Friction of the floor under each wheel. [-]"""
    frictions = each(own_friction, (robot.platform.floor_friction,), robot.casters)
    if patches is None:
        return frictions
    for k in range(len(patches)):
        shared = position, heading, patch_at(patches, k)
        frictions = each(patch_friction, shared, frictions, directions, robot.casters)
    return frictions
