"""The driven robot: motor commands in, motion out."""

from typing import NamedTuple

from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.integration import State, rk4_step
from caster_gym.mechanics.motors import joint_torques, motor_speeds, motor_torques
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Scalar, Vector, each, total


class Drive(NamedTuple):
    """What the motors did during a time step."""

    torques: tuple[tuple[Scalar, Scalar], ...]  # of each caster's two motors [N m]
    power: Scalar  # mechanical power of all motors at the step's start [W]


def motor_power(torques: tuple[Scalar, Scalar], speeds: tuple[Scalar, Scalar]) -> tuple[Scalar]:
    """Mechanical power of a caster's two motors. [W]"""
    return (torques[0] * speeds[0] + torques[1] * speeds[1],)


def driven_step(
    state: State, commands: tuple[tuple[Scalar, Scalar], ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[State, Drive]:
    """One RK4 step of h seconds under motor commands in −1 … 1, limited at the speeds of the step's start."""
    rates = each(joint_rates, (state.twist,), state.directions, robot.casters)
    speeds = each(motor_speeds, (), rates, robot.casters)
    torques = each(motor_torques, (), commands, speeds, robot.casters)
    power = total(each(motor_power, (), torques, speeds))
    at_joints = each(joint_torques, (), torques, robot.casters)
    return rk4_step(state, at_joints, wrench, h, robot), Drive(torques, power[0])
