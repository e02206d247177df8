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
    eta, theta, delta = rate_rows(f, caster)
    i_tt, i_te, i_ee = caster_inertias(caster)
    j = caster.steer_armature
    # (D3): column sums first, then the symmetric product
    t = (i_tt * theta[0] + i_te * eta[0], i_tt * theta[1] + i_te * eta[1], i_tt * theta[2] + i_te * eta[2])
    e = (i_te * theta[0] + i_ee * eta[0], i_te * theta[1] + i_ee * eta[1], i_te * theta[2] + i_ee * eta[2])
    return (
        t[0] * theta[0] + e[0] * eta[0] + j * delta[0] * delta[0],
        t[0] * theta[1] + e[0] * eta[1] + j * delta[0] * delta[1],
        t[0] * theta[2] + e[0] * eta[2] + j * delta[0] * delta[2],
        t[1] * theta[1] + e[1] * eta[1] + j * delta[1] * delta[1],
        t[1] * theta[2] + e[1] * eta[2] + j * delta[1] * delta[2],
        t[2] * theta[2] + e[2] * eta[2] + j * delta[2] * delta[2],
    )


def caster_bias(v: Vector, f: Direction, caster: CasterParameters) -> Vector:
    """Contribution of one caster to h."""
    row_eta, row_theta, row_delta = rate_rows(f, caster)
    eta, theta, _ = rates(v, f, caster)
    e_eta, e_theta, e_delta = rate_drifts(v, f, caster)
    i_tt, i_te, i_ee = caster_inertias(caster)
    n = caster.off_axis * caster.link_mass * caster.radius * (caster.trail - caster.link_behind)
    n_theta, n_eta = -n * eta * eta, n * theta * eta  # (D1)
    b_theta = i_tt * e_theta + i_te * e_eta + n_theta  # (D2)
    b_eta = i_te * e_theta + i_ee * e_eta + n_eta
    b_delta = caster.steer_armature * e_delta
    return combine(row_theta, b_theta, row_eta, b_eta, row_delta, b_delta)  # (D4)


def caster_resistance(v: Vector, coulomb_speed: Scalar, f: Direction, caster: CasterParameters) -> Vector:
    """Generalised force that friction in one caster's joints and contact patch takes from the platform."""
    row_eta, row_theta, row_delta = rate_rows(f, caster)
    eta, theta, delta = rates(v, f, caster)
    roll = joint_friction(theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed)
    steer = joint_friction(delta, caster.steer_viscous, caster.steer_coulomb, coulomb_speed)
    return combine(row_theta, roll, row_eta, caster.scrub * eta, row_delta, steer)


def caster_drive(f: Direction, caster: CasterParameters, torque: tuple[Scalar, Scalar]) -> Vector:
    """Generalised force of the torques at one caster's rolling and steering joints."""
    _, theta, delta = rate_rows(f, caster)
    roll, steer = torque
    return (
        theta[0] * roll + delta[0] * steer,
        theta[1] * roll + delta[1] * steer,
        theta[2] * roll + delta[2] * steer,
    )


def joint_friction(rate: Scalar, viscous: Scalar, coulomb: Scalar, coulomb_speed: Scalar) -> Scalar:
    """Torque against a joint's rate: viscous, and dry with a smooth passage through zero. [N m]"""
    return viscous * rate + coulomb * rate / sqrt(rate * rate + coulomb_speed * coulomb_speed)


def combine(g: Vector, x: Scalar, h: Vector, y: Scalar, k: Vector, z: Scalar) -> Vector:
    """g x + h y + k z."""
    return (
        g[0] * x + h[0] * y + k[0] * z,
        g[1] * x + h[1] * y + k[1] * z,
        g[2] * x + h[2] * y + k[2] * z,
    )


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


def drive_force(
    directions: tuple[Direction, ...], torques: tuple[tuple[Scalar, Scalar], ...], robot: RobotParameters
) -> Vector:
    """Generalised force Σ (g_θ τ_θ + g_δ τ_δ) of all joint torques."""
    return total(each(caster_drive, (), directions, robot.casters, torques))


def forward_dynamics(
    v: Vector,
    directions: tuple[Direction, ...],
    torques: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    robot: RobotParameters,
) -> Vector:
    """Twist rate under joint torques (rolling, steering) per caster and an external wrench at C. (D5)"""
    drive = drive_force(directions, torques, robot)
    h = bias(v, directions, robot)
    lost = resistance(v, directions, robot)
    force = (
        drive[0] + wrench[0] - h[0] - lost[0],
        drive[1] + wrench[1] - h[1] - lost[1],
        drive[2] + wrench[2] - h[2] - lost[2],
    )
    return solve(inertia(directions, robot), force)


def inverse_dynamics(v: Vector, directions: tuple[Direction, ...], v_rate: Vector, robot: RobotParameters) -> Vector:
    """Generalised force that drives and wrench must supply together for a twist rate. (D5)"""
    inertial = multiply(inertia(directions, robot), v_rate)
    return add(add(inertial, bias(v, directions, robot)), resistance(v, directions, robot))


def kinetic_energy(v: Vector, directions: tuple[Direction, ...], robot: RobotParameters) -> Scalar:
    """½ vᵀ M v. [J]"""
    return 0.5 * dot(v, multiply(inertia(directions, robot), v))
