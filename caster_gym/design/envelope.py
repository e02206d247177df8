"""The torques and speeds that the motions of a target need from each motor. docs/analysis.md, section S.

    stage      at rest and while casters flip they stand at any angle; faster, they trail
    share      steering of a caster that stands at any angle, as a share −1 … 1 of π        (N, S) [-]
    course     direction of the velocity of C in B                                          (S,) [rad]
    push       direction of the acceleration of C in B, of trailing casters                 (S,) [rad]
    pace       0 … 1: speed between those at which casters flip and the greatest            (S,) [-]
    spin       −1, 0 or 1: yaw rate as a share of that at the pace                          (S,) [-]
    yawing     −1, 0 or 1: yaw acceleration as a share of the greatest                      (S,) [-]
    along      greatest torque in the sense in which the motor turns, however it accelerates (J, S) [N m]
    against    greatest torque against it                                                   (J, S) [N m]
    speed      of the motor, without sign                                                   (J, S) [rad/s]

S motions, N casters, J driven motors. Motors share the work with the least effort, as `caster_gym.paths.feasibility`
has it: torques are shares of each motor's greatest, and the sum of their squares is least.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from caster_gym.analysis.frames import rate_in_body
from caster_gym.arrays import Array
from caster_gym.design.target import Target
from caster_gym.mechanics.actuation import motor_wrenches
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import inertia, inverse_dynamics
from caster_gym.mechanics.linear import dot
from caster_gym.mechanics.motors import motor_speeds, torque_range
from caster_gym.mechanics.parameters import RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, each, flatten
from caster_gym.paths.feasibility import least_effort
from caster_gym.paths.moments import Motion, hard_spans, join_spans, moments_within, motion_at, sample_paths
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

SAMPLES = 1024  # motions of each stage; a power of two, as Sobol's sequence likes it
REST, FLIP, FULL, TOP = range(4)
LOOSE = (REST, FLIP)  # stages in which casters stand at any angle
_PARALLEL = 1e-9  # [-] sine of the angle between two wrenches below which they span no face


class Motions(NamedTuple):
    """Motions in coordinates that mean the same for every radius and trail."""

    share: Array
    course: Array
    push: Array
    pace: Array
    spin: Array
    yawing: Array
    stage: Array


class Loads(NamedTuple):
    """What motions ask of each motor."""

    along: Array
    against: Array
    speed: Array


class Forces(NamedTuple):
    """Generalised force at the accelerations of a motion, and what each unit of acceleration adds to it."""

    steady: Vector
    per_x: Vector
    per_y: Vector
    per_yaw: Vector


def sampled_motions(caster_count: int, count: int = SAMPLES) -> Motions:
    """The same number of motions of each stage, spread evenly by Sobol's sequence."""
    from scipy.stats.qmc import Sobol

    points = Sobol(caster_count + 5, seed=0).random(4 * count).T
    course, push, pace, spin, yawing = points[caster_count:]
    return Motions(
        share=2.0 * points[:caster_count] - 1.0,
        course=2.0 * np.pi * course,
        push=2.0 * np.pi * push,
        pace=np.minimum(1.5 * pace, 1.0),  # a third of them at the greatest
        spin=np.floor(3.0 * spin) - 1.0,
        yawing=np.floor(3.0 * yawing) - 1.0,
        stage=np.repeat(np.arange(4.0), count),
    )


def joined(*parts: Motions) -> Motions:
    """All motions of several sets."""
    return Motions(*(np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)))


def flip_speed(robot: Robot, target: Target) -> float:
    """Speed up to which casters may stand at any angle. [m/s]

    Unless the target says it: what a start from rest reaches on a way of one trail, during which casters turn. (S2)
    """
    longest = max(caster.trail for caster in robot.casters)
    speed = (2.0 * target.acceleration * longest) ** 0.5 if target.flip_speed is None else target.flip_speed  # (S2)
    return min(speed, target.speed)


def envelope_loads(motions: Motions, robot: Robot, target: Target) -> Loads:
    """What the motions ask of the robot's driven motors, each at the accelerations that are worst for it."""
    parameters = robot_parameters(robot)
    v, f, held, spread = placed(motions, robot, target)
    forces = force_per_acceleration(v, f, held, parameters)
    steady, x, y, yaw = (_motor_torques(force, f, robot, parameters) for force in forces)
    reach = spread[0] * np.hypot(x, y) + spread[1] * np.abs(yaw)  # (S3)
    return _loads(steady, reach, _speeds(v, f, robot, parameters))


def path_loads(trajectories: Sequence[Trajectory], robot: Robot, margin: float = 1.0) -> Loads:
    """What trajectories ask of the driven motors at each of their samples, casters trailing, and between samples.

    There it looks at moments at which a measure of some motor may be greater than at all samples.
    """
    parameters = robot_parameters(robot)
    blocks = list(sample_paths(trajectories, robot))
    values = [measures(_motion_loads(block.motion, robot, parameters), robot, margin) for block in blocks]
    greatest = np.maximum.reduce([found.max(axis=(1, 2), keepdims=True) for found in values])
    scale = 1.0 / np.where(greatest > 0.0, greatest, 1.0)
    best = np.ones(len(trajectories))
    spans = [hard_spans(block, scale * found, best, robot) for block, found in zip(blocks, values, strict=True)]
    motions = [block.motion for block in blocks]
    closer = moments_within(
        join_spans(spans), best, lambda m: scale * measures(_motion_loads(m, robot, parameters), robot, margin), robot
    )
    motions += [motion_at(moments.rows, moments.psi) for moments in closer]
    loads = [_motion_loads(motion, robot, parameters) for motion in motions]
    return together([Loads(*(part.reshape(len(part), -1) for part in one)) for one in loads])


def _motion_loads(motion: Motion, robot: Robot, parameters: RobotParameters) -> Loads:
    """Loads (J, ...) of a motion."""
    v, rate, f = motion
    torques = _motor_torques(inverse_dynamics(v, f, rate, parameters), f, robot, parameters)
    return _loads(torques, np.zeros_like(torques), _speeds(v, f, robot, parameters))


def measures(loads: Loads, robot: Robot, margin: float) -> Array:
    """Use, torque, speed and power of every motor (4 J, ...)."""
    uses = np.nan_to_num(motor_uses(loads, robot, margin), posinf=0.0)
    torque = np.maximum(loads.along, loads.against)
    return np.concatenate([uses, torque, loads.speed, loads.along * loads.speed])


def motor_uses(loads: Loads, robot: Robot, margin: float) -> Array:
    """Use (J, ...) of each driven motor with a margin: 1 is the limit, infinite at and beyond its top speed. (S5)"""
    driven, shape = robot.driven_indices, (-1, *(1,) * (loads.speed.ndim - 1))
    sizes, tops = robot.max_torques[driven].reshape(shape), robot.max_speeds[driven].reshape(shape)
    low, high = torque_range(margin * loads.speed, sizes, tops)
    with np.errstate(divide="ignore"):
        along = np.where(high > 0.0, margin * loads.along / np.where(high > 0.0, high, 1.0), np.inf)
    uses: Array = np.maximum(along, margin * loads.against / -low)
    return uses


def together(parts: Sequence[Loads]) -> Loads:
    """All loads of several sets of motions."""
    return Loads(*(np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)))


def placed(
    motions: Motions, robot: Robot, target: Target
) -> tuple[Vector, tuple[Direction, ...], Vector, tuple[Array, Array]]:
    """Twist, rolling directions, accelerations over ground, and by how much these may change, of each motion, in B.

    Trailing casters follow a held acceleration; those that stand at any angle meet any acceleration, (A, Α) at most.
    """
    slow = flip_speed(robot, target) / target.speed
    full = max(target.accelerating_up_to, slow)
    pace = np.array([0.0, slow, slow, 1.0])[motions.stage.astype(np.int64)]
    pace = np.where(motions.stage == FULL, slow + motions.pace * (full - slow), pace)
    omega = motions.spin * pace * target.yaw_rate
    velocity = pace * target.speed * np.exp(1j * motions.course)
    held = np.where(motions.stage == FULL, 1.0, 0.0)
    acceleration = held * target.acceleration * np.exp(1j * motions.push)
    alpha = held * motions.yawing * target.yaw_acceleration
    loose = np.isin(motions.stage, LOOSE)
    directions = []
    for caster, share in zip(robot.casters, motions.share, strict=True):
        pivot = complex(caster.x, caster.y)
        way = velocity + 1j * omega * pivot
        bend = (np.conj(way) * (acceleration + (1j * alpha - omega**2) * pivot)).imag  # |way|³ times its curvature
        lag = np.arcsin(np.clip(caster.trail * bend / np.maximum(np.abs(way) ** 3, 1e-12), -1.0, 1.0))  # (S1)
        angle = np.where(loose, np.pi * share, np.angle(way) - lag)
        directions.append((np.cos(angle), np.sin(angle)))
    anything = np.where(loose, 1.0, 0.0)
    spread = (anything * target.acceleration, anything * target.yaw_acceleration)
    return (
        (velocity.real, velocity.imag, omega),
        tuple(directions),
        (acceleration.real, acceleration.imag, alpha),
        spread,
    )


def force_per_acceleration(v: Vector, f: tuple[Direction, ...], held: Vector, parameters: RobotParameters) -> Forces:
    """The generalised force of the inverse dynamics as an affine function of the accelerations over ground."""
    rate = rate_in_body(np.stack(held, axis=-1), np.stack(v, axis=-1))
    steady = inverse_dynamics(v, f, _columns(rate), parameters)
    xx, xy, xz, yy, yz, zz = inertia(f, parameters)
    return Forces(steady, (xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def least_possible_share(motions: Motions, robot: Robot, target: Target) -> float:
    """Greatest share of its torque that some motor must give in some motion, however the motors share the work. [-]

    The wrenches that motors give with shares of at most 1 fill a zonotope, of which each face is spanned by two of
    them: a wrench needs the share by which the zonotope must be scaled until the wrench lies in it.
    """
    parameters = robot_parameters(robot)
    v, f, held, spread = placed(motions, robot, target)
    forces = [np.stack(np.broadcast_arrays(*force)) for force in force_per_acceleration(v, f, held, parameters)]
    pairs = flatten(each(motor_wrenches, (), f, parameters.casters))
    wrenches = [np.stack(np.broadcast_arrays(*pairs[j])) for j in robot.driven_indices]
    worst = 0.0
    for p, q in combinations(wrenches, 2):
        normal = np.cross(p, q, axis=0)
        span = np.linalg.norm(p, axis=0) * np.linalg.norm(q, axis=0)
        steady, x, y, yaw = ((normal * force).sum(axis=0) for force in forces)
        push = np.abs(steady) + spread[0] * np.hypot(x, y) + spread[1] * np.abs(yaw)
        room = sum(np.abs((normal * w).sum(axis=0)) for w in wrenches)
        faces = np.linalg.norm(normal, axis=0) > _PARALLEL * span
        worst = max(worst, float((push[faces] / np.maximum(room, 1e-300)[faces]).max(initial=0.0)))  # (S4)
    return worst


def _columns(vectors: Array) -> Vector:
    """The components of vectors (S, 3)."""
    return vectors[:, 0], vectors[:, 1], vectors[:, 2]


def _motor_torques(force: Vector, f: tuple[Direction, ...], robot: Robot, parameters: RobotParameters) -> Array:
    """Torques (J, S) of the driven motors that give a force with the least effort. [N m]"""
    effort, _ = least_effort(force, f, parameters)
    wrenches = flatten(each(motor_wrenches, (), f, parameters.casters))
    sizes = robot.max_torques
    return np.stack([sizes[j] * dot(wrenches[j], effort) for j in robot.driven_indices])


def _speeds(v: Vector, f: tuple[Direction, ...], robot: Robot, parameters: RobotParameters) -> Array:
    """Speeds (J, S) of the driven motors. [rad/s]"""
    speeds = flatten(
        tuple(
            motor_speeds(joint_rates(v, one, caster), caster) for one, caster in zip(f, parameters.casters, strict=True)
        )
    )
    return np.stack([speeds[j] for j in robot.driven_indices])


def _loads(torque: Array, reach: Array, speed: Array) -> Loads:
    """Loads of motors that give a torque, more or less by `reach`, at a speed."""
    torque = np.where(speed < 0.0, -torque, torque)
    return Loads(np.maximum(reach + torque, 0.0), np.maximum(reach - torque, 0.0), np.abs(speed))
