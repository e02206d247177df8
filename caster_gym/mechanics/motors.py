"""Motors: their torque at their present speed, and the gear between them and the two joints of a caster.

Joint rates turn the motors through `gear`: motor speeds = gear · (θ̇, δ̇). Power is the same on both sides, so torques
go back through its transpose: joint torques = gearᵀ · motor torques. The motors' limits hold at the motors.
"""

from caster_gym.mechanics.parameters import CasterParameters
from caster_gym.mechanics.scalars import Scalar, clip


def motor_speeds(joint_rates: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Speeds of a caster's two motors from its rolling and steering rates. [rad/s]"""
    theta, delta = joint_rates  # (M1)
    return caster.gear_rr * theta + caster.gear_rs * delta, caster.gear_sr * theta + caster.gear_ss * delta


def torque_range(speed: Scalar, max_torque: Scalar, max_speed: Scalar) -> tuple[Scalar, Scalar]:
    """Least and greatest torque that a motor gives: falling to zero at its top speed, whole when it brakes. [N m]"""
    ratio = speed / max_speed  # (M3)
    low = -max_torque * clip(1.0 + ratio, 0.0, 1.0)
    high = max_torque * clip(1.0 - ratio, 0.0, 1.0)
    return low, high


def motor_ranges(
    speeds: tuple[Scalar, Scalar], caster: CasterParameters
) -> tuple[tuple[Scalar, Scalar], tuple[Scalar, Scalar]]:
    """Torque ranges of a caster's two motors; zero where a motor is not driven. [N m]"""
    roll = torque_range(speeds[0], caster.roll_active * caster.roll_max_torque, caster.roll_max_speed)
    steer = torque_range(speeds[1], caster.steer_active * caster.steer_max_torque, caster.steer_max_speed)
    return roll, steer


def motor_torques(
    command: tuple[Scalar, Scalar], speeds: tuple[Scalar, Scalar], caster: CasterParameters
) -> tuple[Scalar, Scalar]:
    """Torques that a caster's motors give for commands in −1 … 1, as shares of their greatest torque. [N m]"""
    roll, steer = motor_ranges(speeds, caster)
    return (
        clip(command[0] * caster.roll_max_torque, roll[0], roll[1]),
        clip(command[1] * caster.steer_max_torque, steer[0], steer[1]),
    )


def joint_torques(motor: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Torques at a caster's rolling and steering joints from those of its motors. [N m]"""
    roll, steer = motor  # (M2)
    return caster.gear_rr * roll + caster.gear_sr * steer, caster.gear_rs * roll + caster.gear_ss * steer


def joint_power(rates: tuple[Scalar, Scalar], torques: tuple[Scalar, Scalar]) -> tuple[Scalar]:
    """Mechanical power of the torques at a caster's joints, which is that of its motors. [W] (M2)"""
    return (torques[0] * rates[0] + torques[1] * rates[1],)
