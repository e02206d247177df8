"""Forces between wheels and floor: they tell when rolling without slip ends. docs/equations.md, section G."""

from caster_gym.mechanics.caster import link_mass_centre, rate_drifts, rate_rows, rates, wheel_centre
from caster_gym.mechanics.dynamics import joint_friction
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.parameters import GRAVITY, CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, add, each, maximum, sqrt, total

LOAD_DAMPING = 1e-9  # [-] relative; decides the moments that two wheels cannot carry, invisible with three or more
LEAST_LOAD = 1e-3  # [-] of the mean load: a lifted wheel counts as barely loaded


def ground_force(
    v: Vector,
    v_rate: Vector,
    coulomb_speed: Scalar,
    f: Direction,
    caster: CasterParameters,
    torque: tuple[Scalar, Scalar],
) -> tuple[Scalar, Scalar]:
    """Force of the floor on one wheel along f and f⊥, given the robot's twist rate. [N]"""
    row_eta, row_theta, row_delta = rate_rows(f, caster)
    eta, theta, delta = rates(v, f, caster)
    e_eta, e_theta, e_delta = rate_drifts(v, f, caster)
    eta_rate = dot(row_eta, v_rate) + e_eta
    theta_rate = dot(row_theta, v_rate) + e_theta
    delta_rate = dot(row_delta, v_rate) + e_delta
    d, s, r, behind, left = caster.trail, caster.offset, caster.radius, caster.link_behind, caster.link_left
    sigma, p = s - left, d - behind
    roll = torque[0] - joint_friction(theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed)
    steer = torque[1] - joint_friction(delta, caster.steer_viscous, caster.steer_coulomb, coulomb_speed)
    along = (roll - (caster.spin_inertia + caster.roll_armature) * theta_rate) / r  # (G1)
    a_f = r * theta_rate + sigma * eta_rate - p * eta * eta  # (G2)
    a_p = (r * theta + sigma * eta) * eta + p * eta_rate
    h = (
        -caster.wheel_mass * (d * r * theta * eta + s * r * theta_rate)
        - caster.link_mass * (behind * a_p + left * a_f)
        + (caster.yaw_inertia + caster.link_inertia) * eta_rate
    )  # (G3)
    across = -(h - (steer - caster.steer_armature * delta_rate) + caster.scrub * eta + s * along) / d  # (G4)
    return along, across


def load_matrix(f: Direction, caster: CasterParameters) -> Symmetric:
    """(1, x, y)(1, x, y)ᵀ of one wheel's contact point."""
    x, y = wheel_centre(f, caster)
    return 1.0 + 0.0 * x, x, y, x * x, x * y, y * y


def caster_weight(f: Direction, caster: CasterParameters) -> Vector:
    """Weight of one caster and its moments about C. [N, N m, N m]"""
    x_w, y_w = wheel_centre(f, caster)
    x_l, y_l = link_mass_centre(f, caster)
    m_w, m_l = GRAVITY * caster.wheel_mass, GRAVITY * caster.link_mass
    return m_w + m_l, m_w * x_w + m_l * x_l, m_w * y_w + m_l * y_l


def wheel_load(pressure: Vector, least: Scalar, f: Direction, caster: CasterParameters) -> Scalar:
    """Normal force under one wheel of a floor that yields linearly. [N]"""
    x, y = wheel_centre(f, caster)
    return maximum(pressure[0] + pressure[1] * x + pressure[2] * y, least)


def wheel_loads(directions: tuple[Direction, ...], robot: RobotParameters) -> tuple[Scalar, ...]:
    """Normal forces of the robot at rest: the least-squares sharing that balances weight and moments. [N] (G5)"""
    platform = robot.platform
    weight = GRAVITY * platform.mass
    load = add(
        (weight, weight * platform.com_x, weight * platform.com_y),
        total(each(caster_weight, (), directions, robot.casters)),
    )
    one, x, y, xx, xy, yy = total(each(load_matrix, (), directions, robot.casters))
    damping = LOAD_DAMPING * (xx + yy)
    pressure = solve((one, x, y, xx + damping, xy, yy + damping), load)
    return each(wheel_load, (pressure, LEAST_LOAD * load[0] / one), directions, robot.casters)


def traction_use(force: tuple[Scalar, Scalar], load: Scalar, floor_friction: Scalar) -> Scalar:
    """Share of the friction that the floor can hold, above 1 the wheel would slip."""
    return sqrt(force[0] * force[0] + force[1] * force[1]) / (floor_friction * load)  # (G6)
