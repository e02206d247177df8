"""How well the driven motors can push the platform: singular values of their wrenches. docs/equations.md, section A.

Motor torques are taken as shares of their greatest, moments as forces at a characteristic length, so that the ratio of
least to greatest singular value means something: 1 pushes equally well in every direction, 0 cannot push in one.
"""

from caster_gym.mechanics.caster import rate_rows
from caster_gym.mechanics.linear import extreme_eigenvalues
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, each, maximum, sqrt, total


def motor_wrench(gear_roll: Scalar, gear_steer: Scalar, size: Scalar, theta: Vector, delta: Vector) -> Vector:
    """Wrench at C of a motor at its greatest torque."""
    return (
        size * (gear_roll * theta[0] + gear_steer * delta[0]),
        size * (gear_roll * theta[1] + gear_steer * delta[1]),
        size * (gear_roll * theta[2] + gear_steer * delta[2]),
    )


def motor_wrenches(f: Direction, caster: CasterParameters) -> tuple[Vector, Vector]:
    """Wrenches of a caster's two motors at their greatest torques; zero where a motor is not driven. [N, N, N m]"""
    _, theta, delta = rate_rows(f, caster)
    roll_size = caster.roll_active * caster.roll_max_torque
    steer_size = caster.steer_active * caster.steer_max_torque
    return (
        motor_wrench(caster.gear_rr, caster.gear_rs, roll_size, theta, delta),
        motor_wrench(caster.gear_sr, caster.gear_ss, steer_size, theta, delta),
    )


def caster_gram(length: Scalar, f: Direction, caster: CasterParameters) -> Symmetric:
    """Σ w wᵀ over a caster's motors, moments divided by the length."""
    p, q = motor_wrenches(f, caster)
    pz, qz = p[2] / length, q[2] / length
    return (
        p[0] * p[0] + q[0] * q[0],
        p[0] * p[1] + q[0] * q[1],
        p[0] * pz + q[0] * qz,
        p[1] * p[1] + q[1] * q[1],
        p[1] * pz + q[1] * qz,
        pz * pz + qz * qz,
    )


def pivot_square(caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """(1, squared distance of the pivot from C)."""
    return 1.0 + 0.0 * caster.x, caster.x * caster.x + caster.y * caster.y


def characteristic_length(robot: RobotParameters) -> Scalar:
    """Root mean square distance of the pivots from C. [m]"""
    count, squares = total(each(pivot_square, (), robot.casters))
    return sqrt(squares / count)


def conditioning(directions: tuple[Direction, ...], robot: RobotParameters) -> Scalar:
    """σ_min / σ_max of the driven motors' wrenches, 0 (singular) to 1 (isotropic). (A1)"""
    gram = total(each(caster_gram, (characteristic_length(robot),), directions, robot.casters))
    least, greatest = extreme_eigenvalues(gram)
    return sqrt(maximum(least, 0.0 * greatest) / maximum(greatest, 1e-300))
