"""Many robots of one kind in maximal coordinates: every body on its own, held together by Lagrange's multipliers.

Made to test what is estimated from recordings: it shares no equation with the package, only a robot's numbers, and its
dry friction may follow a law that the package does not know. Newton's and Euler's laws are written for the platform,
each steering link, each wheel and each joint; joints and rolling without slip are constraints on their accelerations.

    pose      x, y, heading of C in the world              (L, 3) [m, m, rad]
    twist     vx, vy, ω at C, along the body's axes        (L, 3) [m/s, m/s, rad/s]
    steering  angles of the rolling directions in B        (L, N) [rad]
    rolling   angles that the wheels have rolled           (L, N) [rad]
    torque    roll_1, steer_1, … at the joints             (L, 2 N) [N m]

L robots move side by side. Accelerations are inertial ones, their components along the body's axes.
"""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.robot import Robot


class FrictionLaw(NamedTuple):
    """How a joint's friction grows with its rate; the defaults are the package's own law."""

    speed: float = 0.1  # [rad/s] below which dry friction fades to zero
    sharp: bool = False  # a hyperbolic tangent of rate / speed, which ends sooner than a root
    breakaway: float = 0.0  # [-] by which dry friction is greater near zero
    stribeck: float = 1.0  # [rad/s] rate by which that is gone
    bend: float = 0.0  # [-] of viscous friction, by which it has grown at `fast`
    fast: float = 20.0  # [rad/s]

    def torque(self, rate: Array, viscous: Array, coulomb: Array) -> Array:
        """Against the motion, of rates (…, joints). [N m]"""
        sign = np.tanh(rate / self.speed) if self.sharp else rate / np.hypot(rate, self.speed)
        dry = coulomb * sign * (1.0 + self.breakaway * np.exp(-((rate / self.stribeck) ** 2)))
        result: Array = dry + viscous * rate * (1.0 + self.bend * np.abs(rate) / self.fast)
        return result


class Motion(NamedTuple):
    """Where robots are and how they move."""

    pose: Array
    twist: Array
    steering: Array
    rolling: Array


_PLATFORM = 3  # coordinates: its mass centre and its yaw
_CASTER = 8  # link x, y, yaw; wheel x, y, yaw; rolling joint, steering joint
_LX, _LY, _LINK_YAW, _WX, _WY, _WHEEL_YAW, _ROLL, _STEER = range(_CASTER)


class MaximalBodies:
    """Robots of one kind, each joint with a friction law."""

    def __init__(self, robot: Robot, law: FrictionLaw | None = None) -> None:
        self.robot, self.law, self.count = robot, law or FrictionLaw(), robot.caster_count
        casters, n = robot.casters, robot.caster_count
        self.radius = np.array([one.radius for one in casters])
        self.trail, self.offset = (np.array([getattr(one, key) for one in casters]) for key in ("trail", "offset"))
        self.pivot = np.array([[one.x, one.y] for one in casters])
        self.link_com = np.array([[-one.link.com[0], one.link.com[1]] for one in casters])  # along f and f⊥
        self.viscous = np.array([[one.roll.viscous, one.steer.viscous] for one in casters])
        self.coulomb = np.array([[one.roll.coulomb, one.steer.coulomb] for one in casters])
        self.scrub = np.array([one.scrub for one in casters])
        self.com = np.array(robot.platform.com)
        self.size = _PLATFORM + _CASTER * n
        mass = np.zeros((self.size, self.size))
        mass[:3, :3] = np.diag([robot.platform.mass, robot.platform.mass, robot.platform.inertia])
        for i, one in enumerate(casters):
            wheel = [one.wheel.mass, one.wheel.mass, one.wheel.yaw_inertia, one.wheel.spin_inertia]
            own = np.diag([one.link.mass, one.link.mass, one.link.inertia, *wheel, 0.0])
            gear = np.array(one.gear)
            own[_ROLL:, _ROLL:] += np.diag([one.roll.armature, one.steer.armature])
            own[_ROLL:, _ROLL:] += gear.T @ np.diag([one.roll.rotor, one.steer.rotor]) @ gear
            place = self._at(i)
            mass[place, place] = own
        self.mass = mass

    def joint_rates(self, twist: Array, steering: Array) -> tuple[Array, Array]:
        """Rates (L, N, 2) of rolling and steering joints, and yaw rates (L, N) of the links over ground."""
        f, left = _directions(steering)
        speed = twist[:, None, :2] + twist[:, None, 2:] * _across(self.pivot)
        yaw = (speed * left).sum(axis=-1) / self.trail
        roll = ((speed * f).sum(axis=-1) - self.offset * yaw) / self.radius
        return np.stack([roll, yaw - twist[:, 2:]], axis=-1), yaw

    def accelerations(self, twist: Array, steering: Array, torque: Array) -> tuple[Array, Array]:
        """Rates of the twist (L, 3), and the multipliers: forces in joints and at contacts."""
        lanes, n, size = len(twist), self.count, self.size
        f, left = _directions(steering)
        omega = twist[:, 2]
        rates, yaw = self.joint_rates(twist, steering)
        speed = twist[:, None, :2] + omega[:, None, None] * _across(self.pivot)
        to_wheel = -self.trail[:, None] * f + self.offset[:, None] * left  # from the pivot
        wheel_speed = speed + yaw[..., None] * _across(to_wheel)
        to_com = self.link_com[:, :1] * f + self.link_com[:, 1:] * left
        rows, known = np.zeros((lanes, 8 * n, size)), np.zeros((lanes, 8 * n))
        arm = self.pivot - self.com
        for i in range(n):
            k, at = 8 * i, _PLATFORM + _CASTER * i
            # the pivot is a point of the platform and of the link
            rows[:, [k, k + 1], [0, 1]] = 1.0
            rows[:, k : k + 2, 2] = _across(arm[i])
            rows[:, [k, k + 1], [at + _LX, at + _LY]] = -1.0
            rows[:, k : k + 2, at + _LINK_YAW] = _across(to_com[:, i])  # it lies at − to_com from there
            known[:, k : k + 2] = omega[:, None] ** 2 * arm[i] + yaw[:, i, None] ** 2 * to_com[:, i]
            # the wheel's centre is a point of the link
            ahead = to_wheel[:, i] - to_com[:, i]
            rows[:, [k + 2, k + 3], [at + _LX, at + _LY]] = 1.0
            rows[:, k + 2 : k + 4, at + _LINK_YAW] = _across(ahead)
            rows[:, [k + 2, k + 3], [at + _WX, at + _WY]] = -1.0
            known[:, k + 2 : k + 4] = yaw[:, i, None] ** 2 * ahead
            # the wheel yaws with the link, and the steering joint turns the link against the platform
            rows[:, k + 4, [at + _LINK_YAW, at + _WHEEL_YAW]] = 1.0, -1.0
            rows[:, k + 5, [at + _LINK_YAW, 2, at + _STEER]] = 1.0, -1.0, -1.0
            # no slip, along f and across it
            rows[:, k + 6, at + _WX : at + _WY + 1] = f[:, i]
            rows[:, k + 6, at + _ROLL] = -self.radius[i]
            known[:, k + 6] = -yaw[:, i] * (wheel_speed[:, i] * left[:, i]).sum(axis=-1)
            rows[:, k + 7, at + _WX : at + _WY + 1] = left[:, i]
            known[:, k + 7] = yaw[:, i] * (wheel_speed[:, i] * f[:, i]).sum(axis=-1)
        force = np.zeros((lanes, size))
        acting = torque.reshape(lanes, n, 2) - self.law.torque(rates, self.viscous, self.coulomb)
        for i in range(n):
            at = _PLATFORM + _CASTER * i
            force[:, at + _ROLL], force[:, at + _STEER] = acting[:, i, 0], acting[:, i, 1]
            force[:, at + _LINK_YAW] = -self.scrub[i] * yaw[:, i]
        whole = np.zeros((lanes, size + 8 * n, size + 8 * n))
        whole[:, :size, :size] = self.mass
        whole[:, size:, :size], whole[:, :size, size:] = rows, rows.swapaxes(1, 2)
        solved = np.linalg.solve(whole, np.concatenate([force, known], axis=1)[..., None])[..., 0]
        turning = solved[:, 2]
        point = solved[:, :2] - turning[:, None] * _across(self.com) + omega[:, None] ** 2 * self.com  # of C
        rate = np.stack([point[:, 0] + omega * twist[:, 1], point[:, 1] - omega * twist[:, 0], turning], axis=1)
        return rate, solved[:, size:]

    def at_rest(self, steering: Array) -> Motion:
        """Robots (L) that stand at the origin with their casters turned."""
        zeros = np.zeros((len(steering), 3))
        return Motion(zeros, zeros, steering, np.zeros_like(steering))

    def simulate(self, motion: Motion, torque: Array, seconds: float, steps: int) -> Motion:
        """The motion after some time under held torques (L, 2 N), by as many steps of Runge and Kutta's method."""
        step = seconds / steps
        for _ in range(steps):
            a = self._rates(motion, torque)
            b = self._rates(_moved(motion, a, 0.5 * step), torque)
            c = self._rates(_moved(motion, b, 0.5 * step), torque)
            d = self._rates(_moved(motion, c, step), torque)
            mean = Motion(*((p + 2.0 * q + 2.0 * r + s) / 6.0 for p, q, r, s in zip(a, b, c, d, strict=True)))
            motion = _moved(motion, mean, step)
        return motion

    def _rates(self, motion: Motion, torque: Array) -> Motion:
        rates, _ = self.joint_rates(motion.twist, motion.steering)
        twist_rate, _ = self.accelerations(motion.twist, motion.steering, torque)
        c, s = np.cos(motion.pose[:, 2]), np.sin(motion.pose[:, 2])
        vx, vy, omega = motion.twist.T
        pose_rate = np.stack([c * vx - s * vy, s * vx + c * vy, omega], axis=1)
        return Motion(pose_rate, twist_rate, rates[..., 1], rates[..., 0])

    def _at(self, caster: int) -> slice:
        return slice(_PLATFORM + _CASTER * caster, _PLATFORM + _CASTER * (caster + 1))


def _moved(motion: Motion, rates: Motion, step: float) -> Motion:
    return Motion(*(one + step * rate for one, rate in zip(motion, rates, strict=True)))


def _across(vector: Array) -> Array:
    """Vectors (…, 2) turned left by a right angle."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def _directions(steering: Array) -> tuple[Array, Array]:
    """Rolling directions f and their left normals f⊥ (L, N, 2), along the body's axes."""
    f = np.stack([np.cos(steering), np.sin(steering)], axis=-1)
    return f, _across(f)
