"""Limits the energy gain of a step to that of motors, wrench and the step's order. docs/equations.md, section S."""

from caster_gym.mechanics.floor_friction import TINY
from caster_gym.mechanics.free_casters import Pair, slip_energy
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector, add, clip, each, maximum, sqrt, total

TURN_ERROR = 0.0625  # [-] energy that a step may gain, of that of the robot, for the cube of the angle it turns by


def work_and_turn(omega: Scalar, before: Pair, after: Pair, torque: Pair) -> tuple[Scalar, Scalar]:
    """Twice the power of a caster's motors over a step [W], and the square of its yaw rates. [rad²/s²]"""
    eta, theta = before[0] + after[0], before[1] + after[1]
    return torque[0] * theta + torque[1] * (eta - omega), before[0] * before[0] + after[0] * after[0]


def explained_share(
    h: Scalar,
    start: State,
    change: Vector,
    rates: tuple[Pair, ...],
    ahead: tuple[Direction, ...],
    torques: tuple[Pair, ...],
    wrench: Vector,
    robot: RobotParameters,
) -> Scalar:
    """Share of all velocities at a step's end with which the robot has the energy that work and order explain at most.

    1 in every step whose error is that of its order. (S11)
    """
    v = add(start.twist, change)
    before = slip_energy(start.twist, start.directions, start.rates, robot)
    after = slip_energy(v, ahead, rates, robot)
    mean = add(start.twist, v)
    power, turns = total(each(work_and_turn, (mean[2],), start.rates, rates, torques))
    work = 0.5 * h * (power + dot(wrench, mean))
    turn = h * sqrt(turns + mean[2] * mean[2])
    size = before + sqrt(work * work)
    allowed = before + work + turn * (turn * turn * size * TURN_ERROR + work * work / maximum(size, TINY + 0.0 * size))
    one = 1.0 + 0.0 * size
    return sqrt(clip(allowed / maximum(after, TINY + 0.0 * size), 0.0 * size, one))  # (S11)
