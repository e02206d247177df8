"""Can the motors of a robot drive a trajectory?

The robot rolls without slip, its casters trail, and its motors share the work with the least effort.

    psi      rolling direction of a caster in W, unit complex number         [-]
    use      torque over what the motor has left at its speed, or speed over top speed: 1 is the limit
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from caster_gym.mechanics.actuation import caster_gram, characteristic_length, motor_wrenches
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import inverse_dynamics
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.motors import motor_ranges, motor_speeds
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, each, flatten, total
from caster_gym.paths.trailing import trailing_directions
from caster_gym.paths.trajectory import Array, Plane, Trajectory
from caster_gym.robot import Robot

DAMPING = 1e-6  # [-] of the mean square push of the motors: bounds torques where the driven motors lose a direction
LACKING = 0.05  # [-] of that push: a force that the motors leave undone counts as a use of 1 from here on
_SLOW, _FALLS = 64.0, 0.9  # [-] factor of ease, from which on the use of motors must fall so much as it doubles
_SLOWEST = 256.0  # [-] that is tried: below, dry friction fades, so that robots which are stuck would seem to creep
_PRECISION = 1.02  # [-] of the factor that is found
_BLOCK = 8192  # samples that are worked on at once, so that their arrays stay in the processor's cache


@dataclass(frozen=True)
class MotorUse:
    """The hardest moment of each of P trajectories; joint 2 N stands for force that the driven motors cannot give."""

    use: Array  # (P,) 1 is the limit
    joint: NDArray[np.int64]  # (P,) index into the robot's joints of the motor that is coupled first to that joint
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
    def eased(self, factor: float) -> Self: ...
    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]: ...


def motor_use(trajectories: Sequence[Trajectory], robot: Robot) -> MotorUse:
    """The hardest moment of each trajectory for the robot's driven motors.

    Of all torques that give the wrench of the inverse dynamics, those with the least sum of squares count, each as a
    share of its motor's greatest torque.
    """
    parts: list[tuple[Array, ...]] = []
    for (steps, time_step), group in groupby(trajectories, key=lambda t: (len(t.samples) - 1, t.time_step)):
        samples = np.stack([trajectory.samples for trajectory in group])
        psi = trailing_directions(samples, robot)
        rows = max(1, _BLOCK // (steps + 1))
        blocks = [slice(i, i + rows) for i in range(0, len(samples), rows)]
        parts.extend(_hardest(samples[b], psi[b], time_step, robot_parameters(robot)) for b in blocks)
    use, joint, time, torque, left, speed = (np.concatenate(column) for column in zip(*parts, strict=True))
    return MotorUse(use, joint.astype(np.int64), time, torque, left, speed)


def check_feasible(path: Easable, trajectories: Sequence[Trajectory], robot: Robot) -> None:
    """Refuse trajectories of a path that ask more of the robot's motors than they have; say what would do.

    Raises ValueError with the path, joint, time and torques, and gentler limits that were tried and found to do.
    """
    hardest = motor_use(trajectories, robot)
    k = int(hardest.use.argmax())
    if hardest.use[k] <= 1.0:
        return
    remedy = _remedy(path, trajectories[k].time_step, robot)
    raise ValueError(f"path {trajectories[k].name!r} {_complaint(hardest, k, robot)}; {remedy}")


def _complaint(hardest: MotorUse, k: int, robot: Robot) -> str:
    """What trajectory k asks too much."""
    when, torque = f"at {hardest.time[k]:.2f} s", abs(hardest.torque[k])
    if hardest.joint[k] == 2 * robot.caster_count:
        return f"needs {torque:.2g} N {when} where the driven joints, {', '.join(robot.driven)}, cannot push"
    joint = robot.joints[hardest.joint[k]]
    caster = robot.casters[hardest.joint[k] // 2]
    top = (caster.roll if joint.startswith("roll") else caster.steer).max_speed
    if abs(hardest.speed[k]) >= top:
        return f"turns the motor of {joint} at {abs(hardest.speed[k]):.3g} rad/s {when}, beyond its {top:g} rad/s"
    return f"asks {torque:.2g} N m of {joint} {when}, where its motor has {hardest.left[k]:.2g} N m left"


def _remedy(path: Easable, time_step: float, robot: Robot) -> str:
    """What going slower does: by little more than the path must, if it may last as long as that."""

    def use(factor: float, whole: bool = False) -> float:
        slower = path.eased(factor)
        step = time_step if whole else time_step * slower.duration / path.duration  # as many samples are quicker
        return float(motor_use(slower.trajectories(step), robot).use.max())

    high, asked = 1.0, np.inf
    while asked > 1.0:
        high, before = 2.0 * high, asked
        asked = use(high)
        if asked > 1.0 and (high >= _SLOWEST or (high >= _SLOW and asked > _FALLS * before)):
            return f"going slower does not help, not even {high:g} times"
    low = max(1.0, 0.5 * high)
    while high > _PRECISION * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if use(middle) <= 1.0 else (middle, high)
    try:
        while use(high, whole=True) > 1.0:  # more samples may see a little more
            high *= _PRECISION
    except ValueError:
        return f"it must be driven {high:.3g} times as slowly, which takes more time steps than a path may have"
    return f"{path.eased(high).remedy} would do"


def _hardest(samples: Array, psi: Plane, time_step: float, robot: RobotParameters) -> tuple[Array, ...]:
    """Use, joint, time, torque, torque left and speed (P,) at the hardest moment of samples (P, K + 1, 10)."""
    back = samples[..., 2] - 1j * samples[..., 3]
    velocity, acceleration = (back * (samples[..., i] + 1j * samples[..., i + 1]) for i in (4, 7))
    omega, alpha = samples[..., 6].copy(), samples[..., 9].copy()
    turning = acceleration - 1j * omega * velocity  # derivative of the components of the velocity in B
    v = (velocity.real.copy(), velocity.imag.copy(), omega)
    v_rate = (turning.real.copy(), turning.imag.copy(), alpha)
    directions = tuple((f.real.copy(), f.imag.copy()) for f in np.moveaxis(psi * back[..., None], -1, 0))
    force = inverse_dynamics(v, directions, v_rate, robot)
    effort, lack = least_effort(force, directions, robot)
    states = flatten(each(_motor_states, (v, effort), directions, robot.casters))
    use, torque, left, speed = (np.stack(column) for column in zip(*states, lack, strict=True))
    joint, moment = np.divmod(np.moveaxis(use, 0, 1).reshape(len(samples), -1).argmax(axis=1), samples.shape[1])
    here = joint, np.arange(len(samples)), moment
    return use[here], joint, moment * time_step, torque[here], left[here], speed[here]


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
