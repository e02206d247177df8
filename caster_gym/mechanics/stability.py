"""The fastest rates of a robot's state, which bound the time step. docs/equations.md, section I.

Friction and motors pull at the platform like dampers: −D ν is the force that they add for a twist ν, and the greatest
eigenvalue of D beside the inertia matrix is a rate [1/s].
"""

from caster_gym.mechanics.caster import rate_rows
from caster_gym.mechanics.motors import motor_speeds
from caster_gym.mechanics.parameters import CasterParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, absolute, add, minimum, where

UNBOUNDED = 1e300  # stands for a speed that no motor limits


def outer_square(row: Vector, weight: Scalar) -> Symmetric:
    """weight · rowᵀ row."""
    x, y, z = row
    return weight * x * x, weight * x * y, weight * x * z, weight * y * y, weight * y * z, weight * z * z


def caster_damping(coulomb_speed: Scalar, f: Direction, caster: CasterParameters) -> Symmetric:
    """Share of one caster's friction in D, at rest, where dry friction rises fastest with the rate."""
    eta, theta, delta = rate_rows(f, caster)
    roll = caster.roll_viscous + caster.roll_coulomb / coulomb_speed
    steer = caster.steer_viscous + caster.steer_coulomb / coulomb_speed
    return add(add(outer_square(theta, roll), outer_square(delta, steer)), outer_square(eta, caster.scrub))  # (I3)


def caster_falloff(f: Direction, caster: CasterParameters) -> Symmetric:
    """Share of one caster's motors in D, as their torques fall with their speeds."""
    _, theta, delta = rate_rows(f, caster)
    by_x = motor_speeds((theta[0], delta[0]), caster)
    by_y = motor_speeds((theta[1], delta[1]), caster)
    by_omega = motor_speeds((theta[2], delta[2]), caster)
    roll = caster.roll_active * caster.roll_max_torque / caster.roll_max_speed
    steer = caster.steer_active * caster.steer_max_torque / caster.steer_max_speed
    return add(
        outer_square((by_x[0], by_y[0], by_omega[0]), roll), outer_square((by_x[1], by_y[1], by_omega[1]), steer)
    )  # (I4)


def geared_speed(motor_speed: Scalar, ratio: Scalar) -> Scalar:
    """Rate of a joint that turns a motor by a ratio, when the motor has a given speed. [rad/s]"""
    unconnected = ratio == 0.0
    held = motor_speed / where(unconnected, 1.0 + 0.0 * ratio, absolute(ratio))
    return where(unconnected, UNBOUNDED + 0.0 * held, held)


def caster_top_speed(caster: CasterParameters) -> Scalar:
    """Speed of a wheel that rolls straight ahead at the top speed of the slower of the motors it turns. [m/s]"""
    roll = geared_speed(caster.roll_max_speed, caster.gear_rr)
    return caster.radius * minimum(roll, geared_speed(caster.steer_max_speed, caster.gear_sr))


def caster_turning(top_speed: Scalar, caster: CasterParameters) -> Scalar:
    """Rate at which a caster's link can turn, trailing at the robot's top speed or by its own motor. [1/s]"""
    by_steer = geared_speed(caster.steer_max_speed, caster.steer_active * caster.gear_ss)
    by_roll = geared_speed(caster.roll_max_speed, caster.roll_active * caster.gear_rs)
    driven = where(caster.gear_ss == 0.0, by_roll, by_steer)
    trailing = top_speed / caster.trail  # (I5)
    return where((driven > trailing) & (driven < UNBOUNDED), driven, trailing)
