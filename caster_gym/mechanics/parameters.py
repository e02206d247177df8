"""The numbers that the equations need of a robot, flat: one scalar per field, so that a batch can hold a robot a lane.

Meaning and signs: docs/equations.md, section P. SI units throughout.
"""

from typing import Literal, NamedTuple, TypeAlias

from caster_gym.mechanics.scalars import Scalar
from caster_gym.robot import Caster, Robot

Dynamics: TypeAlias = Literal["exact", "chung2008"]

GRAVITY = 9.81  # [m/s²]


class PlatformParameters(NamedTuple):
    """Platform without casters; mass centre in B, inertia about it."""

    mass: Scalar  # [kg]
    inertia: Scalar  # [kg m²]
    com_x: Scalar  # [m]
    com_y: Scalar  # [m]
    height: Scalar  # [m] of the mass centre above the floor
    floor_friction: Scalar  # [-] between the wheels and the floor
    coulomb_speed: Scalar  # [rad/s] rate of a joint below which its dry friction fades to zero


class CasterParameters(NamedTuple):
    """One powered caster."""

    x: Scalar  # [m] pivot, in B
    y: Scalar
    trail: Scalar  # d [m]
    offset: Scalar  # s [m]
    radius: Scalar  # r [m]
    wheel_mass: Scalar  # m_w [kg]
    spin_inertia: Scalar  # I_s [kg m²]
    yaw_inertia: Scalar  # I_d [kg m²]
    link_mass: Scalar  # m_l [kg]
    link_inertia: Scalar  # I_l [kg m²]
    link_behind: Scalar  # l [m] mass centre behind the steering axis
    link_left: Scalar  # q [m] and to its left
    roll_armature: Scalar  # J_θ [kg m²] of rotors and gears, seen at the rolling joint
    steer_armature: Scalar  # J_δ [kg m²] seen at the steering joint
    cross_armature: Scalar  # J_θδ [kg m²] through which rotors couple both joints
    roll_viscous: Scalar  # [N m s/rad]
    roll_coulomb: Scalar  # [N m]
    steer_viscous: Scalar
    steer_coulomb: Scalar
    scrub: Scalar  # [N m s/rad] of the contact patch against η̇
    roll_max_torque: Scalar  # [N m] of the motor that `gear` couples first to rolling
    roll_max_speed: Scalar  # [rad/s]
    steer_max_torque: Scalar
    steer_max_speed: Scalar
    gear_rr: Scalar  # motor speeds = gear · (θ̇, δ̇)
    gear_rs: Scalar
    gear_sr: Scalar
    gear_ss: Scalar
    roll_active: Scalar  # 1 if driven, else 0
    steer_active: Scalar
    off_axis: Scalar  # 1; 0 leaves (D1) out, as chung2008 prints the model


class RobotParameters(NamedTuple):
    """A robot of any number of casters."""

    platform: PlatformParameters
    casters: tuple[CasterParameters, ...]


PLATFORM_FIELDS = len(PlatformParameters._fields)
CASTER_FIELDS = len(CasterParameters._fields)


def robot_parameters(robot: Robot, dynamics: Dynamics = "exact") -> RobotParameters:
    """The numbers of a robot; "chung2008" leaves the term (D1) out, as that paper prints the model."""
    if dynamics not in ("exact", "chung2008"):
        raise ValueError(f'dynamics must be "exact" or "chung2008", got {dynamics!r}')
    p = robot.platform
    platform = PlatformParameters(
        p.mass, p.inertia, p.com[0], p.com[1], p.height, robot.floor_friction, robot.coulomb_speed
    )
    casters = tuple(
        caster_parameters(caster, f"roll_{i}" in robot.driven, f"steer_{i}" in robot.driven, dynamics)
        for i, caster in enumerate(robot.casters, start=1)
    )
    return RobotParameters(platform, casters)


def caster_parameters(caster: Caster, roll: bool, steer: bool, dynamics: Dynamics = "exact") -> CasterParameters:
    """The numbers of one caster whose rolling and steering joints are driven or not."""
    wheel, link, (gear_roll, gear_steer) = caster.wheel, caster.link, caster.gear
    rotors = caster.roll.rotor, caster.steer.rotor
    return CasterParameters(
        x=caster.x,
        y=caster.y,
        trail=caster.trail,
        offset=caster.offset,
        radius=caster.radius,
        wheel_mass=wheel.mass,
        spin_inertia=wheel.spin_inertia,
        yaw_inertia=wheel.yaw_inertia,
        link_mass=link.mass,
        link_inertia=link.inertia,
        link_behind=link.com[0],
        link_left=link.com[1],
        roll_armature=caster.roll.armature + rotors[0] * gear_roll[0] ** 2 + rotors[1] * gear_steer[0] ** 2,  # (M4)
        steer_armature=caster.steer.armature + rotors[0] * gear_roll[1] ** 2 + rotors[1] * gear_steer[1] ** 2,
        cross_armature=rotors[0] * gear_roll[0] * gear_roll[1] + rotors[1] * gear_steer[0] * gear_steer[1],
        roll_viscous=caster.roll.viscous,
        roll_coulomb=caster.roll.coulomb,
        steer_viscous=caster.steer.viscous,
        steer_coulomb=caster.steer.coulomb,
        scrub=caster.scrub,
        roll_max_torque=caster.roll.max_torque,
        roll_max_speed=caster.roll.max_speed,
        steer_max_torque=caster.steer.max_torque,
        steer_max_speed=caster.steer.max_speed,
        gear_rr=gear_roll[0],
        gear_rs=gear_roll[1],
        gear_sr=gear_steer[0],
        gear_ss=gear_steer[1],
        roll_active=float(roll),
        steer_active=float(steer),
        off_axis=1.0 if dynamics == "exact" else 0.0,
    )


def with_load(
    platform: PlatformParameters,
    mass: Scalar,
    x: Scalar,
    y: Scalar,
    inertia: Scalar = 0.0,
    height: Scalar | None = None,
) -> PlatformParameters:
    """A platform and a load of a mass [kg] at (x, y) in B [m], with an inertia about its own mass centre [kg m²].

    height: of the load's mass centre above the floor [m]; None: as high as the platform's.
    """
    together = platform.mass + mass
    away_x, away_y = x - platform.com_x, y - platform.com_y
    apart = platform.mass * mass / together * (away_x * away_x + away_y * away_y)  # about their common mass centre
    return platform._replace(
        mass=together,
        inertia=platform.inertia + inertia + apart,
        com_x=platform.com_x + mass / together * away_x,
        com_y=platform.com_y + mass / together * away_y,
        height=platform.height if height is None else platform.height + mass / together * (height - platform.height),
    )


def pack_parameters(robot: RobotParameters) -> tuple[Scalar, ...]:
    """All numbers in one row: the platform's, then each caster's, in the order of their fields."""
    flat = tuple(robot.platform)
    for caster in robot.casters:
        flat = flat + tuple(caster)
    return flat


def parameter_names(casters: int) -> tuple[str, ...]:
    """What the numbers of such a row are called: `mass`, …, `x_1`, …, with the number of the caster."""
    return PlatformParameters._fields + tuple(
        f"{field}_{number}" for number in range(1, casters + 1) for field in CasterParameters._fields
    )


def unpack_parameters(flat: tuple[Scalar, ...]) -> RobotParameters:
    """Inverse of `pack_parameters`; columns of a table make a robot of arrays."""
    casters = flat[PLATFORM_FIELDS:]
    return RobotParameters(
        PlatformParameters(*flat[:PLATFORM_FIELDS]),
        tuple(CasterParameters(*casters[i : i + CASTER_FIELDS]) for i in range(0, len(casters), CASTER_FIELDS)),
    )
