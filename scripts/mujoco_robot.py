"""The same robot in MuJoCo, as `caster_gym.export.mjcf` writes it, under the same torques.

MuJoCo knows rigid bodies, joints and friction between spheres and a plane, and nothing of casters.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym import Model, Robot
from caster_gym.engines.native.fleet import Fleet
from caster_gym.export.mjcf import mjcf
from caster_gym.mechanics.parameters import GRAVITY, Dynamics

PLANAR = ("x", "y", "yaw")  # joints of the platform besides z
DURATION = 4.0  # [s] of a drive
LOOKS = 200  # at its motion
OUR_STEP = 2e-3  # [s] RK4 is then off by less than a thousandth of what MuJoCo is at an eighth of a millisecond
STRONG = 0.1  # of the weight on a wheel: greatest push of each of its joints on the floor


class Motion(NamedTuple):
    """Where the platform went."""

    time: NDArray[np.float64]  # (T,) [s]
    pose: NDArray[np.float64]  # (T, 3) x, y [m], β [rad] in the world


class Drive(NamedTuple):
    """One of many draws of a motion."""

    draw: int
    state: NDArray[np.float64]  # (6 + N)
    torque: NDArray[np.float64]  # (2 N,) [N m]


def joint_indices(robot: Robot, model: mujoco.MjModel) -> tuple[list[int], list[int]]:
    """Where the platform's x, y, yaw and the joints of `robot.joints` stand in MuJoCo's qpos and qvel.

    All joints have one degree of freedom, so the same index holds in both.
    """
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    return [index[name] for name in PLANAR], [index[name] for name in robot.joints]


def placed(robot: Robot, state: ArrayLike, torque: ArrayLike, timestep: float) -> tuple[Any, Any]:
    """MuJoCo's model and data in a state (6 + N) as in `Model.simulate`, under joint torques (2 N). SI units.

    All joints must be driven, and the torques within what the motors have.
    """
    start = np.asarray(state, dtype=np.float64)
    beta, steering = start[2], start[6:]
    model: Any = mujoco.MjModel.from_xml_string(mjcf(robot, timestep))
    data: Any = mujoco.MjData(model)
    platform, joints = joint_indices(robot, model)
    _, rolling, turning = Model(robot).rates(steering, start[3:6])
    c, s = np.cos(beta), np.sin(beta)
    data.qpos[platform] = start[:3]
    data.qpos[joints[1::2]] = steering
    data.qvel[platform] = c * start[3] - s * start[4], s * start[3] + c * start[4], start[5]
    data.qvel[joints] = np.stack((rolling, turning), axis=-1).ravel()
    data.ctrl[:] = motor_torques(robot, torque)
    return model, data


def simulate(robot: Robot, state: ArrayLike, torque: ArrayLike, timestep: float, duration: float) -> Motion:
    """The motion under constant joint torques, from a state, both as for `placed`."""
    model, data = placed(robot, state, torque, timestep)
    platform, _ = joint_indices(robot, model)
    steps = round(duration / timestep)
    pose: NDArray[np.float64] = np.empty((steps + 1, 3))
    pose[0] = data.qpos[platform]
    for step in range(1, steps + 1):
        mujoco.mj_step(model, data)
        pose[step] = data.qpos[platform]
    return Motion(timestep * np.arange(steps + 1, dtype=np.float64), pose)


def slip(robot: Robot, state: ArrayLike, torque: ArrayLike, timestep: float, duration: float) -> float:
    """Way that the wheels' ground points slide over the floor, as a share of the way of the wheels' centres. [-]"""
    model, data = placed(robot, state, torque, timestep)
    wheels = [(model.body(f"wheel_{i}").id, caster.radius) for i, caster in enumerate(robot.casters, start=1)]
    velocity, slid, rolled = np.zeros(6), 0.0, 0.0
    for _ in range(round(duration / timestep)):
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        for body, radius in wheels:
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            turning, moving = velocity[:3], velocity[3:]
            at_floor = moving + np.cross(turning, (0.0, 0.0, -radius))
            slid += float(np.hypot(*at_floor[:2]))
            rolled += float(np.hypot(*moving[:2]))
    return slid / rolled


def motor_torques(robot: Robot, torque: ArrayLike) -> NDArray[np.float64]:
    """Torques of all motors that give torques at the joints (2 N). [N m]"""
    at_joints = np.asarray(torque, dtype=np.float64).reshape(robot.caster_count, 2)
    casters = zip(robot.casters, at_joints, strict=True)
    return np.concatenate([np.linalg.solve(np.transpose(caster.gear), pair) for caster, pair in casters])


def strong_driving(robot: Robot, draw: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A state (6 + N) at rest, wheels askew, and torques (2 N) [N m] of a robot that is driven hard; one of many draws.

    Each joint pushes its wheel along or across with up to a tenth of the weight on it, so far below any floor's
    friction; the lever is the wheel's radius for rolling and the trail for steering.
    """
    rng = np.random.default_rng(draw)
    casters = robot.casters
    mass = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in casters)
    push = STRONG * GRAVITY * mass / len(casters)
    levers = np.array([(caster.radius, caster.trail) for caster in casters]).ravel()
    steering = rng.uniform(-np.pi, np.pi, len(casters))
    return np.concatenate((np.zeros(6), steering)), push * levers * rng.uniform(-1.0, 1.0, levers.shape)


def strong_drives(robot: Robot, count: int) -> list[Drive]:
    """The first so many draws of `strong_driving` in which no motor outruns its top speed."""
    gears = np.array([caster.gear for caster in robot.casters])
    fastest = [(caster.roll.max_speed, caster.steer.max_speed) for caster in robot.casters]
    chosen: list[Drive] = []
    first = 0
    while len(chosen) < count:
        drawn = [Drive(draw, *strong_driving(robot, draw)) for draw in range(first, first + count)]
        states = driven(robot, drawn, OUR_STEP)
        steering = np.arctan2(states[..., 8::2], states[..., 7::2])
        _, rolling, turning = Model(robot).rates(steering, states[..., 4:7])
        speeds = np.einsum("cmj,...cj->...cm", gears, np.stack((rolling, turning), axis=-1))
        allowed = (np.abs(speeds) < fastest).all(axis=(0, -2, -1))
        chosen += [one for one, good in zip(drawn, allowed, strict=True) if good]
        first += count
    return chosen[:count]


def driven(robot: Robot, drives: Sequence[Drive], step: float, dynamics: Dynamics = "exact") -> NDArray[np.float64]:
    """Our motions under drives from rest: states (LOOKS + 1, drives, 7 + 2 N) as of `Fleet`, at equal intervals."""
    fleet = Fleet(robot, len(drives), dynamics)
    start, steering = fleet.state, np.array([drive.state[6:] for drive in drives])
    start[:, 7::2], start[:, 8::2] = np.cos(steering), np.sin(steering)
    fleet.state = start
    states, torques = [start], np.array([drive.torque for drive in drives])
    for _ in range(LOOKS):
        fleet.step(torques, step, round(DURATION / LOOKS / step))
        states.append(fleet.state)
    return np.array(states)


def path_length(pose: NDArray[np.float64]) -> float:
    """Length of the way of C. [m]"""
    return float(np.hypot(*np.diff(pose[:, :2], axis=0).T).sum())


def without_dry_friction(robot: Robot) -> Robot:
    """The robot without Coulomb friction: MuJoCo has it with its jump at rest, caster_gym with a smooth passage."""
    casters = tuple(
        caster.model_copy(
            update={
                "roll": caster.roll.model_copy(update={"coulomb": 0.0}),
                "steer": caster.steer.model_copy(update={"coulomb": 0.0}),
            }
        )
        for caster in robot.casters
    )
    return robot.model_copy(update={"casters": casters})
