"""A robot led along a timed motion of its platform: what its casters do, and what force it takes. docs/analysis.md, F.

The motors are left out: whatever drives the robot, its platform follows the motion exactly and its wheels do not slip.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.analysis.checked import finite
from caster_gym.analysis.frames import motion_in_body, turn_planar
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

_STILL = 1e-12  # [m/s, rad/s] slower twists do not tell where a robot starts to


@dataclass(frozen=True, eq=False)
class DrivenMotion:
    """What platform and casters do, at K + 1 moments."""

    time: Array  # (K + 1,) [s]
    pose: Array  # (K + 1, 3) x, y, β in W, β continuous [m, m, rad]
    twist: Array  # (K + 1, 3) vx, vy, ω at C, in B [m/s, m/s, rad/s]
    twist_rate: Array  # (K + 1, 3) derivatives of these components [m/s², m/s², rad/s²]
    steering: Array  # (K + 1, N) angles δ, continuous [rad]
    rolling: Array  # (K + 1, N) angles θ since the start [rad]

    def in_world(self, force: Array) -> Array:
        """Forces (K + 1, 3) at C with components in W instead of B."""
        return turn_planar(force, np.exp(1j * self.pose[:, 2]))


def steady_steering(robot: Robot, twist: ArrayLike) -> Array:
    """Steering angles (..., N) [rad] at which the casters trail and steer no more while the twist (..., 3) lasts.

    Raises ValueError where a pivot is slower than its trail times the yaw rate: its caster never comes to rest there.
    """
    vx, vy, omega = np.moveaxis(finite("twist", twist, 3), -1, 0)[..., None]
    x, y, trail = (np.array([getattr(caster, name) for caster in robot.casters]) for name in ("x", "y", "trail"))
    ax, ay = vx - omega * y, vy + omega * x
    speed, needed = np.hypot(ax, ay), trail * np.abs(omega)
    slow = (speed < needed) | (speed == 0.0)
    if slow.any():
        where = tuple(np.argwhere(slow)[0])
        raise ValueError(
            f"caster {where[-1] + 1} of robot {robot.name!r} has no steady steering angle: its pivot moves at "
            f"{speed[where]:.3g} m/s and must be faster than its trail times the yaw rate, {needed[where]:.3g} m/s"
        )
    angle: Array = np.arctan2(ay, ax) - np.arcsin(trail * omega / speed)  # (F1)
    return angle


def lead(
    trajectory: Trajectory, robot: Robot, steering: ArrayLike | None = None, tolerance: float = 1e-10
) -> DrivenMotion:
    """The robot led along a trajectory, its casters starting at steering angles (N) [rad].

    If none are given they trail from the start, as they would had the first motion gone on for long. The angles are
    integrated by LSODA with a tolerance [rad, and relative] on the error of each step. Its backward differences suit
    casters that trail steadily, where an explicit method only follows the limit of its own stability. Between samples
    the twist is the cubic through its values and slopes.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicHermiteSpline

    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance must lie between 0 and 1, got {tolerance:g}")
    samples = trajectory.samples
    time = trajectory.time_step * np.arange(len(samples), dtype=np.float64)
    heading = np.unwrap(np.angle(samples[:, 2] + 1j * samples[:, 3]))
    pose = np.column_stack((samples[:, :2], heading))
    twist, twist_rate = motion_in_body(samples)
    count = robot.caster_count
    if steering is None:
        moving = np.abs(twist).max(axis=1) > _STILL
        if not moving.any():
            raise ValueError(f"path {trajectory.name!r} never moves: give the steering angles of the casters")
        start = steady_steering(robot, twist[moving.argmax()])
    else:
        start = finite("steering", steering, count)
        if start.shape != (count,):
            raise ValueError(f"steering must have shape ({count},), got {start.shape}")
    model, twist_at = Model(robot), CubicHermiteSpline(time, twist, twist_rate)

    def angle_rates(t: float, angles: Array) -> Any:
        _, theta, delta = model.rates(angles[:count], twist_at(t))
        return np.concatenate((delta, theta))  # (F2)

    solution = solve_ivp(
        angle_rates,
        (time[0], time[-1]),
        np.concatenate((start, np.zeros(count))),
        method="LSODA",
        t_eval=time,
        rtol=tolerance,
        atol=tolerance,
    )
    if not solution.success:
        raise ValueError(f"the casters cannot be followed along path {trajectory.name!r}: {solution.message}")
    return DrivenMotion(time, pose, twist, twist_rate, solution.y[:count].T, solution.y[count:].T)


def inertial_force(motion: DrivenMotion, model: Model) -> Array:
    """Generalised force (K + 1, 3) at C, in B, that the motion takes, without friction. [N, N, N m]

    The model may have other masses than the robot that was led, or leave (D1) out, but must have its geometry.
    """
    inertial = np.einsum("kij,kj->ki", model.inertia(motion.steering), motion.twist_rate)
    force: Array = inertial + model.bias(motion.steering, motion.twist)  # (F3)
    return force


def work(motion: DrivenMotion, force: Array) -> Array:
    """Work (K + 1,) of forces (K + 1, 3) in B since the start. [J] It is what the kinetic energy has grown by. (F4)

    Integrated through a cubic spline of the power; the error falls with the fourth power of the time step.
    """
    from scipy.interpolate import CubicSpline

    power = np.einsum("ki,ki->k", force, motion.twist)
    done: Array = CubicSpline(motion.time, power).antiderivative()(motion.time)
    return done
