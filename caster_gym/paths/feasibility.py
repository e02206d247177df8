"""Checks whether the motors of a robot can drive a trajectory.

The robot rolls without slip, its casters trail, and its motors share the work with the least effort.

    psi      rolling direction of a caster in W, unit complex number         [-]
    use      torque over what the motor has left at its speed, or speed over top speed: 1 is the limit
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from caster_gym.arrays import Array, Indices
from caster_gym.mechanics.actuation import caster_gram, characteristic_length, motor_wrenches
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import inverse_dynamics
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.motors import motor_ranges, motor_speeds
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, each, flatten, total
from caster_gym.paths.moments import (
    Block,
    Moments,
    Motion,
    Spans,
    hard_spans,
    join_spans,
    moments_within,
    motion_at,
    sample_paths,
)
from caster_gym.paths.trajectory import COLUMNS, LEAST_STEPS, Trajectory
from caster_gym.robot import Robot

DAMPING = 1e-6  # [-] of the mean square push of the motors: bounds torques where the driven motors lose a direction
LACKING = 0.05  # [-] of that push: a force that the motors leave undone counts as a use of 1 from here on
_SLOW, _FALLS = 64.0, 0.9  # [-] factor of ease, from which on the use of motors must fall so much as it doubles
_SLOWEST = 256.0  # [-] that is tried: below, dry friction fades, so that robots which are stuck would seem to creep
SURE = 0.999  # [-] use of what is said to do: it does at any time step, whatever that makes of the path
_SHORT = 0.02  # [s] longer steps do not show all of a path
_MANY = 20_000  # of them show any path well enough
_WHOLE = 1e-6  # [-] of a time step
_PRECISION = 1.02  # [-] of the factor that is found


@dataclass(frozen=True)
class MotorUse:
    """The hardest moment of each of P trajectories; joint 2 N stands for force that the driven motors cannot give."""

    use: Array  # (P,) 1 is the limit
    joint: Indices  # (P,) index into the robot's joints of the motor that is coupled first to that joint
    time: Array  # (P,) [s]
    torque: Array  # (P,) [N m] asked of that motor; the force missing [N] for joint 2 N
    left: Array  # (P,) [N m] torque that it has at its speed
    speed: Array  # (P,) [rad/s] of the motor


class Easable(Protocol):
    """A path that knows slower versions of itself."""

    @property
    def duration(self) -> float: ...
    @property
    def remedy(self) -> str: ...
    def ease(self, factor: float) -> Self: ...
    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]: ...


def motor_use(trajectories: Sequence[Trajectory], robot: Robot) -> MotorUse:
    """The hardest moment of each trajectory for the robot's driven motors, at its samples or between them.

    Of all torques that give the wrench of the inverse dynamics, those with the least sum of squares count, each as a
    share of its motor's greatest torque.
    """
    numbers = robot_parameters(robot)

    hardest = _Hardest(len(trajectories), robot.caster_count)
    spans: list[Spans] = []
    for block in sample_paths(trajectories, robot):
        found = motor_uses_at(block.motion, numbers)
        hardest.note_samples(block, found)
        spans.append(hard_spans(block, found, hardest.use, robot))
    for moments in moments_within(
        join_spans(spans), hardest.use.copy(), lambda motion: motor_uses_at(motion, numbers), robot
    ):
        hardest.note(moments)
    return hardest.motor_use(numbers)


def motor_uses_at(motion: Motion, robot: RobotParameters) -> Array:
    """Uses (2 N + 1, ...) of all motors in a motion, and of the force that the driven ones lack."""
    return _motors(motion, robot)[0]


class _Hardest:
    """The hardest moment that is known of each of P trajectories."""

    def __init__(self, count: int, casters: int) -> None:
        self.use = np.zeros(count)
        self._joint = np.zeros(count, dtype=np.int64)
        self._time = np.zeros(count)
        self._rows = np.zeros((count, len(COLUMNS)))
        self._psi = np.zeros((count, casters), dtype=np.complex128)

    def note_samples(self, block: Block, uses: Array) -> None:
        """Uses (J, P, K + 1) at all samples of some trajectories."""
        count, points = block.rows.shape[:2]
        joint, moment = np.divmod(uses.swapaxes(0, 1).reshape(count, -1).argmax(axis=1), points)
        every = np.arange(count)
        self._keep(block.path, uses[joint, every, moment], joint, moment * block.time_step)
        self._rows[block.path], self._psi[block.path] = block.rows[every, moment], block.psi[every, moment]

    def note(self, moments: Moments) -> None:
        """Moments between samples."""
        joint = moments.values.argmax(axis=0)
        use = moments.values[joint, np.arange(len(joint))]
        rising = np.argsort(use, kind="stable")
        last = np.zeros(len(self.use), dtype=np.int64)
        last[moments.path[rising]] = rising  # the greatest comes last
        here = np.unique(moments.path)
        i = last[here]
        more = use[i] > self.use[here]
        here, i = here[more], i[more]
        self._keep(here, use[i], joint[i], moments.time[i])
        self._rows[here], self._psi[here] = moments.rows[i], moments.psi[i]

    def _keep(self, path: Indices, use: Array, joint: Indices, time: Array) -> None:
        self.use[path], self._joint[path], self._time[path] = use, joint, time

    def motor_use(self, robot: RobotParameters) -> MotorUse:
        """What the motors do at these moments."""
        _, *states = _motors(motion_at(self._rows, self._psi), robot)
        torque, left, speed = (state[self._joint, np.arange(len(self.use))] for state in states)
        return MotorUse(self.use, self._joint, self._time, torque, left, speed)


def check_feasible(path: Easable, trajectories: Sequence[Trajectory], robot: Robot) -> None:
    """Refuse trajectories of a path that need more than the robot's motors have; the message says what suffices.

    Raises ValueError with the path, joint, time and torques, and gentler limits that were tried and found to do.
    """
    driven = [*trajectories, *_as_written(path, trajectories[0].time_step)]
    hardest = motor_use(driven, robot)
    k = int(hardest.use.argmax())
    if hardest.use[k] <= 1.0:
        return
    remedy = _remedy(path, trajectories[0].time_step, robot)
    raise ValueError(f"path {driven[k].name!r} {_complaint(hardest, k, robot)}; {remedy}")


def greatest_use(path: Easable, time_step: float, robot: Robot) -> float:
    """The greatest use of any motor on a path, as it is driven at a time step [s] and as it is written."""
    driven = [*path.trajectories(time_step), *_as_written(path, time_step)]
    return float(motor_use(driven, robot).use.max())


def _as_written(path: Easable, time_step: float) -> tuple[Trajectory, ...]:
    """A path in exactly its duration, at short steps; none where that is what a time step [s] makes of it."""
    steps = path.duration / time_step
    if abs(steps - round(steps)) < _WHOLE and (time_step <= _SHORT or steps >= _MANY):
        return ()
    short = min(max(np.ceil(path.duration / _SHORT), LEAST_STEPS), _MANY)
    return path.trajectories(path.duration / max(np.ceil(steps), short))


def _complaint(hardest: MotorUse, k: int, robot: Robot) -> str:
    """What trajectory k asks too much."""
    when, torque = f"at {hardest.time[k]:.2f} s", abs(hardest.torque[k])
    if hardest.joint[k] == 2 * robot.caster_count:
        return f"needs {torque:.2g} N {when} where the driven joints, {', '.join(robot.driven)}, cannot push"
    joint = robot.joints[hardest.joint[k]]
    top = robot.motors[hardest.joint[k]].max_speed
    if abs(hardest.speed[k]) >= top:
        return f"turns the motor of {joint} at {abs(hardest.speed[k]):.3g} rad/s {when}, beyond its {top:g} rad/s"
    return f"asks {torque:.2g} N m of {joint} {when}, where its motor has {hardest.left[k]:.2g} N m left"


def _remedy(path: Easable, time_step: float, robot: Robot) -> str:
    """What going slower does: by little more than the path must, if it may last as long as that."""

    steps = max(np.ceil(path.duration / time_step), LEAST_STEPS)

    def use(factor: float) -> float:
        slower = path.ease(factor)
        return float(motor_use(slower.trajectories(slower.duration / steps), robot).use.max())  # as many are quicker

    high, asked = 1.0, np.inf
    while asked > SURE:
        high, before = 2.0 * high, asked
        asked = use(high)
        if asked > SURE and (high >= _SLOWEST or (high >= _SLOW and asked > _FALLS * before)):
            return f"going slower does not help, not even {high:g} times"
    low = max(1.0, 0.5 * high)
    while high > _PRECISION * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if use(middle) <= SURE else (middle, high)
    try:
        while greatest_use(path.ease(high), time_step, robot) > SURE:  # the duration is one of whole steps
            high *= _PRECISION
    except ValueError:
        return f"it must be driven {high:.3g} times as slowly, which takes more time steps than a path may have"
    return f"{path.ease(high).remedy} would suffice"


def _motors(motion: Motion, robot: RobotParameters) -> tuple[Array, Array, Array, Array]:
    """Use, torque, torque left and speed (J, ...) of all motors, and of the force that they lack."""
    force = inverse_dynamics(motion.v, motion.directions, motion.rate, robot)
    effort, lack = least_effort(force, motion.directions, robot)
    states = flatten(each(_motor_states, (motion.v, effort), motion.directions, robot.casters))
    use, torque, left, speed = (np.stack(column) for column in zip(*states, lack, strict=True))
    return use, torque, left, speed


def least_effort(
    force: Vector, directions: tuple[Direction, ...], robot: RobotParameters
) -> tuple[Vector, tuple[Array, ...]]:
    """Vector y whose product with a motor's greatest wrench is the share of its torque to give; what is left undone.

    The latter as (use, force missing, 0, 0), like the state of a motor.
    """
    length = characteristic_length(robot)
    xx, xy, xz, yy, yz, zz = total(each(caster_gram, (length,), directions, robot.casters))
    damping = DAMPING * (xx + yy + zz) / 3.0
    y = solve((xx + damping, xy, xz, yy + damping, yz, zz + damping), (force[0], force[1], force[2] / length))
    missing = damping * np.sqrt(dot(y, y))  # F − W Wᵀ y
    none = np.zeros_like(missing)
    return (y[0], y[1], y[2] / length), (missing / (LACKING * np.sqrt(damping / DAMPING)), missing, none, none)


def _motor_states(v: Vector, effort: Vector, f: Direction, caster: CasterParameters) -> tuple[tuple[Array, ...], ...]:
    """Use, torque, torque left and speed of a caster's two motors."""
    speeds = motor_speeds(joint_rates(v, f, caster), caster)
    sizes = (caster.roll_max_torque, caster.steer_max_torque)
    tops = (caster.roll_active / caster.roll_max_speed, caster.steer_active / caster.steer_max_speed)
    states = []
    for w, speed, size, top, span in zip(
        motor_wrenches(f, caster), speeds, sizes, tops, motor_ranges(speeds, caster), strict=True
    ):
        torque = size * dot(w, effort)
        left = np.where(torque > 0.0, span[1], -span[0])
        use = np.maximum(np.abs(torque) / np.maximum(left, 1e-300), top * np.abs(speed))
        states.append((use, torque, left, speed))
    return tuple(states)
