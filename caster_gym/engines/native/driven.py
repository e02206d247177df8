"""Where motor commands take robots of one kind, compiled: what a controller needs that looks ahead."""

import operator
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import INLINE, borrowed, compiled
from caster_gym.engines.native.dual_numbers import take
from caster_gym.engines.native.lanes import LANES, read_robot, to_lanes
from caster_gym.engines.native.threads import over_blocks
from caster_gym.engines.time_step import longest_time_step, substeps_for
from caster_gym.mechanics.integration import BODY_ROWS, pack_state, state_rows, unpack_state
from caster_gym.mechanics.parameters import RobotParameters, pack_parameters
from caster_gym.mechanics.plant import driven_step
from caster_gym.mechanics.scalars import each, flatten, pairs
from caster_gym.robot import Robot

TOGETHER = 16  # robots that one call moves, if there are more

_BODY = (0.0,) * BODY_ROWS
_WRENCH = (0.0, 0.0, 0.0)


@register_jitable(**INLINE)
def _two(_caster: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _drive(
    first: int,
    end: int,
    states: Any,
    commands: Any,
    wrenches: Any,
    robots: Any,
    steps: int,
    h: float,
    casters: tuple[int, ...],
) -> None:
    """Move the states (count, rows) of robots in blocks first … end − 1, in place."""
    torque_like = flatten(each(_two, (), casters))
    state_like = _BODY + torque_like  # two numbers for each caster there, too
    for i in range(first * TOGETHER, min(end * TOGETHER, len(states))):
        values = borrowed(states[i])
        robot = read_robot(robots[0], 0, 0, casters)
        given = pairs(take(borrowed(commands[i]), 0, torque_like))
        wrench = take(borrowed(wrenches[i]), 0, _WRENCH)
        for _ in range(steps):
            moved, _ = driven_step(unpack_state(take(values, 0, state_like)), given, wrench, h, robot, None)
            for row, value in enumerate(pack_state(moved)):
                values[row] = value


def _described(kinds: tuple[Any, ...]) -> Work:
    casters = kinds[-1]
    return Work(f"controllers of {len(casters)} casters that look ahead", 2.0 * (1.0 + len(casters)))


_compiled_drive = compiled(_drive, _described)


class DrivenRobots:
    """Moves robots of one kind under held motor commands and wrenches, on a floor that grips and without obstacles.

    period [s] over which they are held; its RK4 steps are at most `longest` [s], and short enough for the robot.
    parameters: numbers of the robot's mechanics, which may leave out some of its physics.
    """

    def __init__(self, robot: Robot, parameters: RobotParameters, period: float, longest: float = 0.005) -> None:
        if not period > 0.0:
            raise ValueError(f"period must be positive, got {period}")
        self._rows, self._motors = state_rows(robot.caster_count, False), 2 * robot.caster_count
        row = np.array([pack_parameters(parameters)])
        self._robots: Array = np.zeros((1, row.shape[1] * LANES))
        to_lanes(row, self._robots, 0)
        steps = substeps_for(period, min(longest, longest_time_step(robot)))
        self._period = operator.index(steps), period / steps, tuple(range(robot.caster_count))

    def after(self, states: ArrayLike, commands: ArrayLike, wrenches: ArrayLike) -> Array:
        """States (robots, 7 + 2 N) a period after the given ones, laid out as those of `Fleet`.

        commands (robots, 2 N) in −1 … 1 for roll_1, steer_1, roll_2, …, limited as motors limit them; wrenches
        (robots, 3) at C, in B [N, N, N m].
        """
        now = np.array(states, np.float64, order="C")
        given = np.ascontiguousarray(commands, np.float64)
        wrench = np.ascontiguousarray(wrenches, np.float64)
        count = len(now)
        expected = (count, self._rows), (count, self._motors), (count, 3)
        if (now.shape, given.shape, wrench.shape) != expected:
            raise ValueError(
                f"states, commands and wrenches must have shapes {expected[0]}, {expected[1]} and {expected[2]}, got "
                f"{now.shape}, {given.shape} and {wrench.shape}"
            )
        over_blocks(_compiled_drive, -(-count // TOGETHER), now, given, wrench, self._robots, *self._period)
        return now
