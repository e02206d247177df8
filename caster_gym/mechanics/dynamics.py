"""Operational-space dynamics M v̇ + h = F of the whole robot. Derivation: docs/equations.md, section D.

The constraint forces do no work, so each body's inertia reaches the platform through the rows g of its joints alone,
and nothing is inverted that could become singular. v̇ is the derivative of the components of v in B.
"""

from caster_gym.mechanics.caster import rate_drifts, rate_rows, rates
from caster_gym.mechanics.linear import dot, multiply, solve
from caster_gym.mechanics.parameters import CasterParameters, PlatformParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, add, each, sqrt, total


def caster_inertias(caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """I_θθ, I_θη, I_ηη of wheel and link, referred to rolling and yaw. [kg m²]"""
    r, sigma, p = caster.radius, caster.offset - caster.link_left, caster.trail - caster.link_behind
    rolling = (caster.wheel_mass + caster.link_mass) * r * r + caster.spin_inertia + caster.roll_armature
    yaw = caster.yaw_inertia + caster.link_inertia + caster.link_mass * (sigma * sigma + p * p)
    return rolling, caster.link_mass * r * sigma, yaw


def caster_inertia(f: Direction, caster: CasterParameters) -> Symmetric:
    """Contribution of one caster to M."""
    eta, theta, _ = rate_rows(f, caster)
    i_tt, i_te, i_ee = caster_inertias(caster)
    j, k = caster.steer_armature, caster.cross_armature
    te, ee = i_te + k, i_ee + j  # δ̇ = η̇ − ω: armatures act on η̇ and ω
    # (D3): momenta of θ, η and ω for each unit of the twist, then the symmetric product
    t = (i_tt * theta[0] + te * eta[0], i_tt * theta[1] + te * eta[1], i_tt * theta[2] + te * eta[2] - k)
    e = (te * theta[0] + ee * eta[0], te * theta[1] + ee * eta[1], te * theta[2] + ee * eta[2] - j)
    w = (-k * theta[0] - j * eta[0], -k * theta[1] - j * eta[1], j - k * theta[2] - j * eta[2])
    return (
        t[0] * theta[0] + e[0] * eta[0],
        t[0] * theta[1] + e[0] * eta[1],
        t[0] * theta[2] + e[0] * eta[2] + w[0],
        t[1] * theta[1] + e[1] * eta[1],
        t[1] * theta[2] + e[1] * eta[2] + w[1],
        t[2] * theta[2] + e[2] * eta[2] + w[2],
    )


def bias_forces(v: Vector, f: Direction, caster: CasterParameters) -> Vector:
    """Forces b at θ, η and ω that one caster takes at constant twist. [N m]"""
    eta, theta, _ = rates(v, f, caster)
    e_eta, e_theta, _ = rate_drifts(v, f, caster)
    i_tt, i_te, i_ee = caster_inertias(caster)
    j, k = caster.steer_armature, caster.cross_armature
    te, ee = i_te + k, i_ee + j
    n = caster.off_axis * caster.link_mass * caster.radius * (caster.trail - caster.link_behind)
    n_theta, n_eta = -n * eta * eta, n * theta * eta  # (D1)
    b_theta = i_tt * e_theta + te * e_eta + n_theta  # (D2)
    b_eta = te * e_theta + ee * e_eta + n_eta
    return b_theta, b_eta, -k * e_theta - j * e_eta


def friction_forces(v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters) -> Vector:
    """Forces at θ, η and ω that overcome the friction of one caster's joints and contact patch. [N m]"""
    eta, theta, delta = rates(v, f, caster)
    roll = joint_friction(theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed)
    steer = joint_friction(delta, caster.steer_viscous, caster.steer_coulomb, coulomb_speed)
    return roll, caster.scrub * eta + steer, -steer


def joint_friction(rate: Scalar, viscous: Scalar, coulomb: Scalar, coulomb_speed: Scalar) -> Scalar:
    """Torque against a joint's rate: viscous, and dry with a smooth passage through zero. [N m]"""
    return viscous * rate + coulomb * rate / sqrt(rate * rate + coulomb_speed * coulomb_speed)


def at_platform(f: Direction, caster: CasterParameters, forces: Vector) -> Vector:
    """Generalised force at C of forces at one caster's θ and η and at ω."""
    eta, theta, _ = rate_rows(f, caster)
    x, y, z = forces
    return (
        theta[0] * x + eta[0] * y,
        theta[1] * x + eta[1] * y,
        theta[2] * x + eta[2] * y + z,
    )


def caster_bias(v: Vector, f: Direction, caster: CasterParameters) -> Vector:
    """Contribution of one caster to h."""
    return at_platform(f, caster, bias_forces(v, f, caster))  # (D4)


def caster_resistance(v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters) -> Vector:
    """Generalised force that friction in one caster's joints and contact patch takes from the platform."""
    return at_platform(f, caster, friction_forces(v, coulomb_speed, f, caster))


def caster_drive(f: Direction, caster: CasterParameters, torque: tuple[Scalar, Scalar]) -> Vector:
    """Generalised force of the torques at one caster's rolling and steering joints."""
    roll, steer = torque
    return at_platform(f, caster, (roll, steer, -steer))


def caster_force(
    v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters, torque: tuple[Scalar, Scalar]
) -> Vector:
    """What is left of one caster's drive after its friction and its contribution to h."""
    b, lost = bias_forces(v, f, caster), friction_forces(v, coulomb_speed, f, caster)
    roll, steer = torque
    return at_platform(f, caster, (roll - lost[0] - b[0], steer - lost[1] - b[1], -steer - lost[2] - b[2]))


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
    force = (push[0] + wrench[0] - h[0], push[1] + wrench[1] - h[1], push[2] + wrench[2] - h[2])
    return solve(inertia(directions, robot), force)


def inverse_dynamics(v: Vector, directions: tuple[Direction, ...], v_rate: Vector, robot: RobotParameters) -> Vector:
    """Generalised force that drives and wrench must supply together for a twist rate. (D5)"""
    inertial = multiply(inertia(directions, robot), v_rate)
    return add(add(inertial, bias(v, directions, robot)), resistance(v, directions, robot))


def kinetic_energy(v: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Scalar:
    """½ vᵀ M v. [J]"""
    return 0.5 * dot(v, multiply(inertia(directions, robot), v))
