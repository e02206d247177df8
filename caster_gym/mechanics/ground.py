"""Forces between wheels and floor, which show when rolling without slip ends. docs/equations.md, section G."""

from typing import NamedTuple

from caster_gym.mechanics.caster import link_mass_centre, pivot_velocity, rates, wheel_centre
from caster_gym.mechanics.dynamics import forward_dynamics, joint_friction
from caster_gym.mechanics.linear import solve
from caster_gym.mechanics.parameters import GRAVITY, CasterParameters, PlatformParameters, RobotParameters
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Symmetric,
    Vector,
    add,
    each,
    greatest,
    maximum,
    sqrt,
    total,
    where,
)

LOAD_DAMPING = 1e-9  # [-] relative; decides the moments that two wheels cannot carry, invisible with three or more
LEAST_LOAD = 1e-3  # [-] of the mean load: a lifted wheel counts as barely loaded
CONTACT_TIME = 0.01  # [s] that an impact is taken to last


class JointMotion(NamedTuple):
    """Rates [rad/s] and accelerations [rad/s²] of one caster's joints."""

    eta: Scalar
    theta: Scalar
    delta: Scalar
    eta_rate: Scalar
    theta_rate: Scalar
    delta_rate: Scalar


class FloorUse(NamedTuple):
    """What a robot asks of the floor."""

    traction: Scalar  # [-] greatest share of the floor's friction that a wheel uses; above 1 it would slip
    lifted: Scalar  # how many wheels leave the floor


def joint_motion(v: Vector, v_rate: Vector, f: Direction, caster: CasterParameters) -> JointMotion:
    """How one caster moves with the robot."""
    a, b = pivot_velocity(v, f, caster)
    eta, theta, delta = rates(v, f, caster)
    along, across = pivot_velocity(v_rate, f, caster)  # the components of an acceleration are found like a velocity's
    eta_rate = (across - a * delta) / caster.trail  # (K4)
    theta_rate = (along + b * delta - caster.offset * eta_rate) / caster.radius
    return JointMotion(eta, theta, delta, eta_rate, theta_rate, eta_rate - v_rate[2])


def link_acceleration(moves: JointMotion, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Acceleration of the link's mass centre along f and f⊥. [m/s²]"""
    sigma, p, r = caster.offset - caster.link_left, caster.trail - caster.link_behind, caster.radius
    a_f = r * moves.theta_rate + sigma * moves.eta_rate - p * moves.eta * moves.eta  # (G2)
    a_p = (r * moves.theta + sigma * moves.eta) * moves.eta + p * moves.eta_rate
    return a_f, a_p


def ground_force(
    v: Vector,
    v_rate: Vector,
    coulomb_speed: Scalar,
    f: Direction,
    caster: CasterParameters,
    torque: tuple[Scalar, Scalar],
) -> tuple[Scalar, Scalar]:
    """Force of the floor on one wheel along f and f⊥, given the robot's twist rate. [N]

    Whatever pushes the robot, motors, walls or loads, is felt through the twist rate.
    """
    moves = joint_motion(v, v_rate, f, caster)
    d, s, r, behind, left = caster.trail, caster.offset, caster.radius, caster.link_behind, caster.link_left
    roll = torque[0] - joint_friction(moves.theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed)
    steer = torque[1] - joint_friction(moves.delta, caster.steer_viscous, caster.steer_coulomb, coulomb_speed)
    roll = roll - caster.roll_armature * moves.theta_rate - caster.cross_armature * moves.delta_rate
    steer = steer - caster.steer_armature * moves.delta_rate - caster.cross_armature * moves.theta_rate
    along = (roll - caster.spin_inertia * moves.theta_rate) / r  # (G1)
    a_f, a_p = link_acceleration(moves, caster)
    h = (
        -caster.wheel_mass * (d * r * moves.theta * moves.eta + s * r * moves.theta_rate)
        - caster.link_mass * (behind * a_p + left * a_f)
        + (caster.yaw_inertia + caster.link_inertia) * moves.eta_rate
    )  # (G3)
    across = -(h - steer + caster.scrub * moves.eta + s * along) / d  # (G4)
    return along, across


def floor_impulse(change: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Impulse of the floor on one wheel along f and f⊥ in an impact that changes the robot's twist. [N s]

    What does not grow beyond bounds in an impact, torques, friction, and all that depends on the twist, leaves none.
    """
    nothing = 0.0 * change[0]
    still = (nothing, nothing, nothing)
    return ground_force(still, change, 1.0, f, caster, (nothing, nothing))  # (G8)


def caster_tilt(v: Vector, v_rate: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Moment, as height times force along x and y of B, by which one caster's inertia tilts the robot. [N m]"""
    moves = joint_motion(v, v_rate, f, caster)
    a_f, a_p = link_acceleration(moves, caster)
    r = caster.radius
    wheel = caster.wheel_mass * r * r + caster.spin_inertia  # the axle lies at r, and so does the link
    along = wheel * moves.theta_rate + caster.link_mass * r * a_f  # (G7)
    across = wheel * moves.theta * moves.eta + caster.link_mass * r * a_p
    return along * f[0] - across * f[1], along * f[1] + across * f[0]


def platform_tilt(v: Vector, v_rate: Vector, wrench: Vector, platform: PlatformParameters) -> tuple[Scalar, Scalar]:
    """The same for the platform and for a wrench that acts at the height of its mass centre. [N m]"""
    vx, vy, omega = v
    ax = v_rate[0] - omega * vy - v_rate[2] * platform.com_y - omega * omega * platform.com_x
    ay = v_rate[1] + omega * vx + v_rate[2] * platform.com_x - omega * omega * platform.com_y
    return (
        platform.height * (platform.mass * ax - wrench[0]),
        platform.height * (platform.mass * ay - wrench[1]),
    )  # (G7)


def tilt(
    v: Vector, v_rate: Vector, directions: tuple[Direction, ...], wrench: Vector, robot: RobotParameters
) -> tuple[Scalar, Scalar]:
    """Moment, as height times force along x and y of B, by which a moving robot presses on its rear wheels. [N m]"""
    casters = total(each(caster_tilt, (v, v_rate), directions, robot.casters))
    platform = platform_tilt(v, v_rate, wrench, robot.platform)
    return add(platform, casters)


def load_matrix(f: Direction, caster: CasterParameters, carries: Scalar) -> Symmetric:
    """(1, x, y)(1, x, y)ᵀ of one wheel's contact point, if it carries."""
    x, y = wheel_centre(f, caster)
    return carries, carries * x, carries * y, carries * x * x, carries * x * y, carries * y * y


def caster_weight(f: Direction, caster: CasterParameters) -> Vector:
    """Weight of one caster and its moments about C. [N, N m, N m]"""
    x_w, y_w = wheel_centre(f, caster)
    x_l, y_l = link_mass_centre(f, caster)
    m_w, m_l = GRAVITY * caster.wheel_mass, GRAVITY * caster.link_mass
    return m_w + m_l, m_w * x_w + m_l * x_l, m_w * y_w + m_l * y_l


def wheel_load(pressure: Vector, f: Direction, caster: CasterParameters, carries: Scalar) -> Scalar:
    """Normal force under one wheel of a floor that yields linearly. [N]"""
    x, y = wheel_centre(f, caster)
    return carries * (pressure[0] + pressure[1] * x + pressure[2] * y)


def all_carry(caster: CasterParameters) -> Scalar:
    """1: every wheel is taken to stand on the floor at first."""
    return 1.0 + 0.0 * caster.x


def stays_down(carries: Scalar, load: Scalar) -> Scalar:
    """Whether a wheel that is pressed by a load still carries: 1 or 0."""
    nothing = 0.0 * load
    return carries * where(load > 0.0, 1.0 + nothing, nothing)


def wheel_loads(
    directions: tuple[Direction, ...], tilted: tuple[Scalar, Scalar], robot: RobotParameters
) -> tuple[Scalar, ...]:
    """Normal forces: the least-squares sharing that balances weight and moments. [N] (G5)

    tilted: from `tilt`; zero at rest. A wheel that would be pulled down does not carry, as long as three others do;
    a negative load is that of a robot that tips over.
    """
    platform = robot.platform
    weight = GRAVITY * platform.mass
    whole, x, y = add(
        (weight, weight * platform.com_x, weight * platform.com_y),
        total(each(caster_weight, (), directions, robot.casters)),
    )
    load = (whole, x - tilted[0], y - tilted[1])
    carrying = each(all_carry, (), robot.casters)
    loads = shared_loads(directions, load, carrying, robot)
    for _ in range(len(robot.casters) - 3):
        carrying = each(stays_down, (), carrying, loads)
        loads = shared_loads(directions, load, carrying, robot)
    return loads


def shared_loads(
    directions: tuple[Direction, ...], load: Vector, carrying: tuple[Scalar, ...], robot: RobotParameters
) -> tuple[Scalar, ...]:
    """Loads [N] of the wheels that carry a weight and its moments about C."""
    one, x, y, xx, xy, yy = total(each(load_matrix, (), directions, robot.casters, carrying))
    damping = LOAD_DAMPING * (xx + yy)
    pressure = solve((one, x, y, xx + damping, xy, yy + damping), load)
    return each(wheel_load, (pressure,), directions, robot.casters, carrying)


def traction_use(force: tuple[Scalar, Scalar], load: Scalar, least: Scalar, floor_friction: Scalar) -> Scalar:
    """Share of the friction that the floor can hold, above 1 the wheel would slip; least: load of a lifted wheel."""
    return sqrt(force[0] * force[0] + force[1] * force[1]) / (floor_friction * maximum(load, least))  # (G6)


def lifts(load: Scalar) -> tuple[Scalar]:
    """1 for a wheel without load."""
    return (where(load > 0.0, 0.0 * load, 1.0 + 0.0 * load),)


def single(load: Scalar) -> tuple[Scalar]:
    """A load as a tuple, to be summed."""
    return (load,)


def floor_use(
    v: Vector,
    directions: tuple[Direction, ...],
    torques: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    robot: RobotParameters,
) -> FloorUse:
    """What a robot asks of the floor under torques at its joints and an external wrench at C, in B."""
    v_rate = forward_dynamics(v, directions, torques, wrench, robot)
    forces = each(ground_force, (v, v_rate, robot.platform.coulomb_speed), directions, robot.casters, torques)
    loads = wheel_loads(directions, tilt(v, v_rate, directions, wrench, robot), robot)
    (whole,) = total(each(single, (), loads))
    least = LEAST_LOAD * whole / len(loads)
    uses = each(wheel_use, (least, robot.platform.floor_friction), forces, loads)
    (lifted,) = total(each(lifts, (), loads))
    return FloorUse(greatest(uses), lifted)


def impact_traction(change: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Scalar:
    """Greatest share of the floor's friction that a wheel uses in an impact that changes the robot's twist. [-]

    Over the contact time, with loads at rest.
    """
    impulses = each(floor_impulse, (change,), directions, robot.casters)
    loads = wheel_loads(directions, (0.0, 0.0), robot)
    (whole,) = total(each(single, (), loads))
    shared = LEAST_LOAD * whole / len(loads), robot.platform.floor_friction * CONTACT_TIME
    return greatest(each(wheel_use, shared, impulses, loads))  # (G9)


def wheel_use(least: Scalar, floor_friction: Scalar, force: tuple[Scalar, Scalar], load: Scalar) -> Scalar:
    """`traction_use` of one wheel."""
    return traction_use(force, load, least, floor_friction)
