"""Operational-space dynamics M v̇ + h = F of the whole robot. Derivation: docs/equations.md, section D.

The constraint forces do no work, so that each caster reaches the platform through its pivot alone, where it is felt as
a mass that differs along and across its wheel; nothing is inverted that could become singular. v̇ is the derivative of
the components of v in B. Along and across mean along f and f⊥.
"""

from typing import NamedTuple

from caster_gym.mechanics.caster import pivot_velocity, rates
from caster_gym.mechanics.linear import dot, multiply, rotate, solve, subtract
from caster_gym.mechanics.parameters import CasterParameters, PlatformParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, add, each, sqrt, total


class PivotInertia(NamedTuple):
    """Inertia of one caster as felt at its pivot, for the velocity of the pivot and the platform's yaw rate."""

    along: Scalar  # [kg]
    cross: Scalar  # [kg]
    across: Scalar  # [kg]
    along_turn: Scalar  # [kg m] with the yaw rate, through the rotors
    across_turn: Scalar  # [kg m]
    turn: Scalar  # [kg m²]


def caster_inertias(caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """I_θθ, I_θη, I_ηη of wheel and link, referred to rolling and yaw. [kg m²]"""
    r, sigma, p = caster.radius, caster.offset - caster.link_left, caster.trail - caster.link_behind
    rolling = (caster.wheel_mass + caster.link_mass) * r * r + caster.spin_inertia + caster.roll_armature
    yaw = caster.yaw_inertia + caster.link_inertia + caster.link_mass * (sigma * sigma + p * p)
    return rolling, caster.link_mass * r * sigma, yaw


def pivot_inertia(caster: CasterParameters) -> PivotInertia:
    """What one caster adds to the platform at its pivot; the same for every δ."""
    i_tt, i_te, i_ee = caster_inertias(caster)
    j, k = caster.steer_armature, caster.cross_armature
    r, d = caster.radius, caster.trail
    aside = caster.offset / d
    along, both = i_tt / (r * r), (i_te + k) / (r * d)  # (D6)
    cross = both - aside * along
    along_turn = -k / r
    return PivotInertia(
        along, cross, (i_ee + j) / (d * d) - aside * (both + cross), along_turn, -j / d - aside * along_turn, j
    )


def caster_inertia(f: Direction, caster: CasterParameters) -> Symmetric:
    """Contribution of one caster to M."""
    c, s = f
    x, y = caster.x, caster.y
    p = pivot_inertia(caster)
    cc, ss, cs = c * c, s * s, c * s
    skew = 2.0 * p.cross * cs
    xx = p.along * cc - skew + p.across * ss  # (D3)
    xy = (p.along - p.across) * cs + p.cross * (cc - ss)
    yy = p.along * ss + skew + p.across * cc
    turn_x, turn_y = p.along_turn * c - p.across_turn * s, p.along_turn * s + p.across_turn * c
    xz = x * xy - y * xx + turn_x
    yz = x * yy - y * xy + turn_y
    return xx, xy, xz, yy, yz, x * (yz + turn_y) - y * (xz + turn_x) + p.turn


def off_axis_forces(eta: Scalar, theta: Scalar, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Forces n at θ and η of a link whose mass centre lies off the axle. [N m]"""
    n = caster.off_axis * caster.link_mass * caster.radius * (caster.trail - caster.link_behind)
    return -n * eta * eta, n * theta * eta  # (D1)


def turning_forces(v: Vector, f: Direction, caster: CasterParameters) -> Vector:
    """Forces along, across [N] and at ω [N m] that turn one caster's momentum at constant twist."""
    a, b = pivot_velocity(v, f, caster)
    _, _, delta = rates(v, f, caster)
    p, a_rate, b_rate = pivot_inertia(caster), b * delta, -a * delta
    return (
        p.along * a_rate + p.cross * b_rate,  # (D2)
        p.cross * a_rate + p.across * b_rate,
        p.along_turn * a_rate + p.across_turn * b_rate,
    )


def friction_torques(
    v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters
) -> tuple[Scalar, Scalar, Scalar]:
    """Torques that overcome friction at one caster's rolling and steering joints, and under its wheel. [N m]"""
    eta, theta, delta = rates(v, f, caster)
    return (
        joint_friction(theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed),
        joint_friction(delta, caster.steer_viscous, caster.steer_coulomb, coulomb_speed),
        caster.scrub * eta,
    )


def joint_friction(rate: Scalar, viscous: Scalar, coulomb: Scalar, coulomb_speed: Scalar) -> Scalar:
    """Torque against a joint's rate: viscous, and dry with a smooth passage through zero. [N m]"""
    return viscous * rate + coulomb * rate / sqrt(rate * rate + coulomb_speed * coulomb_speed)


def at_pivot(theta: Scalar, eta: Scalar, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Force along and across at the pivot of forces at one caster's θ and η. [N]"""
    along = theta / caster.radius
    return along, (eta - caster.offset * along) / caster.trail


def at_platform(along: Scalar, across: Scalar, turn: Scalar, f: Direction, caster: CasterParameters) -> Vector:
    """Generalised force at C of a force at one caster's pivot and a moment at ω."""
    x, y = rotate(f, (along, across))
    return x, y, caster.x * y - caster.y * x + turn


def caster_bias(v: Vector, f: Direction, caster: CasterParameters) -> Vector:
    """Contribution of one caster to h."""
    eta, theta, _ = rates(v, f, caster)
    n_theta, n_eta = off_axis_forces(eta, theta, caster)
    along, across = at_pivot(n_theta, n_eta, caster)
    turning = turning_forces(v, f, caster)
    return at_platform(along + turning[0], across + turning[1], turning[2], f, caster)  # (D4)


def caster_resistance(v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters) -> Vector:
    """Generalised force that friction in one caster's joints and contact patch takes from the platform."""
    roll, steer, scrub = friction_torques(v, coulomb_speed, f, caster)
    along, across = at_pivot(roll, steer + scrub, caster)
    return at_platform(along, across, -steer, f, caster)


def caster_drive(f: Direction, caster: CasterParameters, torque: tuple[Scalar, Scalar]) -> Vector:
    """Generalised force of the torques at one caster's rolling and steering joints."""
    along, across = at_pivot(torque[0], torque[1], caster)
    return at_platform(along, across, -torque[1], f, caster)


def caster_force(
    v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters, torque: tuple[Scalar, Scalar]
) -> Vector:
    """What is left of one caster's drive after its friction and its contribution to h."""
    eta, theta, _ = rates(v, f, caster)
    roll, steer, scrub = friction_torques(v, coulomb_speed, f, caster)
    n_theta, n_eta = off_axis_forces(eta, theta, caster)
    drive = torque[1] - steer
    along, across = at_pivot(torque[0] - roll - n_theta, drive - scrub - n_eta, caster)
    turning = turning_forces(v, f, caster)
    return at_platform(along - turning[0], across - turning[1], -drive - turning[2], f, caster)


def platform_inertia(platform: PlatformParameters) -> Symmetric:
    """M_p of (D3)."""
    m, cx, cy = platform.mass, platform.com_x, platform.com_y
    return m, 0.0 * m, -m * cy, m, m * cx, platform.inertia + m * (cx * cx + cy * cy)


def platform_bias(v: Vector, platform: PlatformParameters) -> Vector:
    """h_p of (D4)."""
    vx, vy, omega = v
    m, cx, cy = platform.mass, platform.com_x, platform.com_y
    return m * omega * (-vy - omega * cx), m * omega * (vx - omega * cy), m * omega * (cx * vx + cy * vy)


def inertia(directions: tuple[Direction, ...], robot: RobotParameters) -> Symmetric:
    """M(δ), symmetric positive definite. (D3)"""
    return add(platform_inertia(robot.platform), total(each(caster_inertia, (), directions, robot.casters)))


def bias(v: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Vector:
    """h(δ, v): Coriolis and centrifugal force. (D4)"""
    return add(platform_bias(v, robot.platform), total(each(caster_bias, (v,), directions, robot.casters)))


def resistance(v: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Vector:
    """Friction of all joints and contact patches, as the force that overcomes it."""
    return total(each(caster_resistance, (v, robot.platform.coulomb_speed), directions, robot.casters))


def forward_dynamics(
    v: Vector,
    directions: tuple[Direction, ...],
    torques: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    robot: RobotParameters,
) -> Vector:
    """Twist rate under joint torques (rolling, steering) per caster and an external wrench at C. (D5)"""
    push = total(each(caster_force, (v, robot.platform.coulomb_speed), directions, robot.casters, torques))
    h = platform_bias(v, robot.platform)
    return solve(inertia(directions, robot), subtract(add(push, wrench), h))


def inverse_dynamics(v: Vector, directions: tuple[Direction, ...], v_rate: Vector, robot: RobotParameters) -> Vector:
    """Generalised force that drives and wrench must supply together for a twist rate. (D5)"""
    inertial = multiply(inertia(directions, robot), v_rate)
    return add(add(inertial, bias(v, directions, robot)), resistance(v, directions, robot))


def kinetic_energy(v: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Scalar:
    """½ vᵀ M v. [J]"""
    return 0.5 * dot(v, multiply(inertia(directions, robot), v))
