"""The driven robot: motor commands in, motion out."""

from typing import Any, NamedTuple

from caster_gym.mechanics.contact import Touch, guarded_step
from caster_gym.mechanics.grip_or_slip import all_joint_rates, step_with_use
from caster_gym.mechanics.ground import FloorUse
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import length
from caster_gym.mechanics.motors import joint_torques, motor_speeds, motor_torques
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Scalar, Vector, each, total
from caster_gym.mechanics.separation import Hull, Obstacles
from caster_gym.mechanics.slip_state import slips_of


class Drive(NamedTuple):
    """What the motors did during a time step."""

    torques: tuple[tuple[Scalar, Scalar], ...]  # of each caster's two motors [N m]
    power: Scalar  # mean mechanical power of all motors [W]
    asks: FloorUse  # of the floor, at the start


def motor_power(
    torques: tuple[Scalar, Scalar], before: tuple[Scalar, Scalar], after: tuple[Scalar, Scalar]
) -> tuple[Scalar]:
    """Mean mechanical power of a caster's two motors between their speeds before and after a step. [W]"""
    return (0.5 * (torques[0] * (before[0] + after[0]) + torques[1] * (before[1] + after[1])),)


def all_motor_speeds(state: State, robot: RobotParameters, surface: Any = None) -> tuple[tuple[Scalar, Scalar], ...]:
    """Speeds of each caster's two motors. [rad/s]"""
    return each(motor_speeds, (), all_joint_rates(state, robot, surface), robot.casters)


def power_between(
    before: tuple[tuple[Scalar, Scalar], ...],
    torques: tuple[tuple[Scalar, Scalar], ...],
    end: State,
    robot: RobotParameters,
    surface: Any = None,
) -> Scalar:
    """Mean mechanical power of all motors in a step from its torques and the motor speeds at its start. [W]"""
    (power,) = total(each(motor_power, (), torques, before, all_motor_speeds(end, robot, surface)))
    return power


def driven_step(
    state: State,
    commands: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    h: Scalar,
    robot: RobotParameters,
    surface: Any = None,
) -> tuple[State, Drive]:
    """One step of h seconds under motor commands in −1 … 1, limited at the speeds of the step's start.

    surface: the floor under the robot, None if it grips.
    """
    before = all_motor_speeds(state, robot, surface)
    torques = each(motor_torques, (), commands, before, robot.casters)
    at_joints = each(joint_torques, (), torques, robot.casters)
    end, asks = step_with_use(state, at_joints, wrench, h, robot, surface)
    return end, Drive(torques, power_between(before, torques, end, robot, surface), asks)


def slip_speeds(state: State, robot: RobotParameters) -> tuple[Scalar, ...]:
    """How fast each wheel that may slip does. [m/s]"""
    return each(length, (), slips_of(state, robot))


def guarded_driven_step(
    state: State,
    commands: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    h: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    last: Any,
    surface: Any = None,
) -> tuple[State, Drive, Touch]:
    """The same among the obstacles first … last − 1."""
    before = all_motor_speeds(state, robot, surface)
    torques = each(motor_torques, (), commands, before, robot.casters)
    at_joints = each(joint_torques, (), torques, robot.casters)
    end, touch = guarded_step(state, at_joints, wrench, h, robot, hull, obstacles, first, last, surface)
    return end, Drive(torques, touch.work / h, touch.asks), touch
