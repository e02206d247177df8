"""The term (D1) that a model of casters easily lacks: how large it is, and how motion shows it. docs/analysis.md, F."""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array, Plane
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot
from papers.analysis.driven_motion import DrivenMotion

_EDGE = 2  # samples at either end where differences of fourth order cannot be centred


def missing_force(robot: Robot, steering: ArrayLike, twist: ArrayLike) -> Array:
    """What (D1) adds to the generalised force (..., 3) at C, in B, at steering (..., N) and twist (..., 3). (F5)"""
    exact, printed = (Model(robot, dynamics).bias(steering, twist) for dynamics in ("exact", "chung2008"))
    missing: Array = exact - printed
    return missing


def carried_mass(robot: Robot) -> float:
    """Mass Σ m_l p / d that (D1) puts at the pivots, by (F5). [kg]"""
    return sum(c.link.mass * (c.trail - c.link.com[0]) / c.trail for c in robot.casters)


def force_size(robot: Robot, force: Array) -> Array:
    """Size (...) of forces (..., 3), their moments divided by the root mean square distance of the pivots. [N]"""
    size: Array = np.linalg.norm(force / (1.0, 1.0, Model(robot).characteristic_length), axis=-1)
    return size


def force_by_momenta(motion: DrivenMotion, robot: Robot) -> Array:
    """The force (K − 3, 3) at C, in B, by Newton's and Euler's laws for each body, at all but two samples at each end.

    Momenta and spins of platform, links and wheels over ground are differentiated numerically, by central differences
    of fourth order, and multiplied with what a unit of the platform's twist moves the body by: (F6), D'Alembert's
    principle. No inertia matrix or Coriolis force enters. Raises ValueError for fewer than five samples or uneven ones.
    """
    steps = np.diff(motion.time)
    if len(steps) < 2 * _EDGE or np.ptp(steps) > 1e-9 * motion.time[-1]:
        raise ValueError(f"momenta need at least 5 samples at equal time steps, got {len(motion.time)} samples")
    model, inner, step = Model(robot), slice(_EDGE, -_EDGE), float(steps[0])
    eta, theta, delta = model.rates(motion.steering, motion.twist)
    rows = model.jacobian(motion.steering[inner])
    yaw_row, omega = np.array([0.0, 0.0, 1.0]), motion.twist[:, 2]
    forward = np.exp(1j * motion.pose[:, 2])  # body x-axis in W
    force = np.zeros((len(motion.time) - 2 * _EDGE, 3))

    def add(momentum: Array | Plane, ways: Array | Plane) -> None:
        """Work of the rate of a momentum or spin (K + 1,) on what a unit of each twist moves or turns (..., 3)."""
        far, near = momentum[4:] - momentum[:-4], momentum[3:-1] - momentum[1:-3]
        rate = (8.0 * near - far) / (12.0 * step)
        force[:] += (rate.conj()[:, None] * ways).real  # (F6)

    centre = forward * complex(*robot.platform.com)
    velocity = forward * (motion.twist[:, 0] + 1j * motion.twist[:, 1])
    ways = np.stack((forward, 1j * forward, 1j * centre), axis=-1)[inner]
    add(robot.platform.mass * (velocity + 1j * omega * centre), ways)
    add(robot.platform.inertia * omega, yaw_row)
    for i, caster in enumerate(robot.casters):
        roll, steer = rows[:, 2 * i], rows[:, 2 * i + 1]
        turn = steer + yaw_row  # of the link over ground
        f = forward * np.exp(1j * motion.steering[:, i])
        behind, left = caster.link.com
        link = complex(caster.trail - behind, left - caster.offset) * f  # from the wheel's centre to the link's
        rolled = caster.radius * theta[:, i] * f
        ways = caster.radius * f[inner, None] * roll
        add(caster.wheel.mass * rolled, ways)
        add(caster.link.mass * (rolled + 1j * eta[:, i] * link), ways + 1j * link[inner, None] * turn)
        add((caster.wheel.yaw_inertia + caster.link.inertia) * eta[:, i], turn)
        add((caster.wheel.spin_inertia + caster.roll.armature) * theta[:, i], roll)
        add(caster.steer.armature * delta[:, i], steer)
        for motor, (by_roll, by_steer) in zip((caster.roll, caster.steer), caster.gear, strict=True):
            add(motor.rotor * (by_roll * theta[:, i] + by_steer * delta[:, i]), by_roll * roll + by_steer * steer)
    return force
