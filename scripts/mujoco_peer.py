"""The same robot in MuJoCo, `caster_gym.export.mjcf`: a peer to check against. Run this file for a table of both."""

import argparse
from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym import Model, Robot, load_robot
from caster_gym.export.mjcf import mjcf

PLANAR = ("x", "y", "yaw")  # joints of the platform besides z


class Motion(NamedTuple):
    """Where the platform went."""

    time: NDArray[np.float64]  # (T,) [s]
    pose: NDArray[np.float64]  # (T, 3) x, y [m], β [rad] in the world


def joint_indices(robot: Robot, model: mujoco.MjModel) -> tuple[list[int], list[int]]:
    """Where the platform's x, y, yaw and the joints of `robot.joints` stand in MuJoCo's qpos and qvel.

    All joints have one degree of freedom, so the same index holds in both.
    """
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    return [index[name] for name in PLANAR], [index[name] for name in robot.joints]


def simulate(robot: Robot, state: ArrayLike, torque: ArrayLike, timestep: float, duration: float) -> Motion:
    """The motion under constant joint torques (2 N) from a state (6 + N) as in `Model.simulate`. SI units.

    All joints must be driven, and the torques within what the motors have.
    """
    start = np.asarray(state, dtype=np.float64)
    beta, steering = start[2], start[6:]
    model = mujoco.MjModel.from_xml_string(mjcf(robot, timestep))
    data = mujoco.MjData(model)
    platform, joints = joint_indices(robot, model)
    _, rolling, turning = Model(robot).rates(steering, start[3:6])
    c, s = np.cos(beta), np.sin(beta)
    data.qpos[platform] = start[:3]
    data.qpos[joints[1::2]] = steering
    data.qvel[platform] = c * start[3] - s * start[4], s * start[3] + c * start[4], start[5]
    data.qvel[joints] = np.stack((rolling, turning), axis=-1).ravel()
    data.ctrl[:] = motor_torques(robot, torque)
    steps = round(duration / timestep)
    pose = np.empty((steps + 1, 3))
    pose[0] = start[:3]
    for step in range(1, steps + 1):
        mujoco.mj_step(model, data)
        pose[step] = data.qpos[platform]
    return Motion(timestep * np.arange(steps + 1), pose)


def motor_torques(robot: Robot, torque: ArrayLike) -> NDArray[np.float64]:
    """Torques of all motors that give torques at the joints (2 N). [N m]"""
    at_joints = np.asarray(torque, dtype=np.float64).reshape(robot.caster_count, 2)
    casters = zip(robot.casters, at_joints, strict=True)
    return np.concatenate([np.linalg.solve(np.transpose(caster.gear), pair) for caster, pair in casters])


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


def main() -> None:
    """Where MuJoCo ends after the same torques, seen from the equations with and without (D1); no dry friction."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--robot", default="chung2008", help="name of a robot or path of its file")
    parser.add_argument("--duration", type=float, default=4.0, help="[s]")
    parser.add_argument("--share", type=float, default=0.1, help="torques drawn up to this share of the greatest")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    robot = without_dry_friction(load_robot(arguments.robot))
    rng = np.random.default_rng(arguments.seed)
    limits = np.array([[c.roll.max_torque, c.steer.max_torque] for c in robot.casters]).ravel()
    torque = arguments.share * limits * rng.uniform(-1.0, 1.0, limits.shape)
    state = np.concatenate((np.zeros(6), rng.uniform(-np.pi, np.pi, robot.caster_count)))
    fine = 1e-3
    steps = round(arguments.duration / fine)
    exact, printed = (
        Model(robot, dynamics).simulate(state, torque, fine, steps)[:, :3] for dynamics in ("exact", "chung2008")
    )
    print(f"{robot.name}: {path_length(exact):.2f} m of path in {arguments.duration:g} s")
    print(f"{'MuJoCo step':>12} {'from exact':>12} {'without (D1)':>12}")
    errors = []
    for timestep in (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4):
        end = simulate(robot, state, torque, timestep, arguments.duration).pose[-1]
        errors.append([1e3 * float(np.hypot(*(end - model[-1])[:2])) for model in (exact, printed)])
        print(f"{1e3 * timestep:>9.3f} ms {errors[-1][0]:>9.2f} mm {errors[-1][1]:>9.2f} mm")
    print("ratios of the errors:", ", ".join(f"{a[0] / b[0]:.2f}" for a, b in pairwise(errors)))


if __name__ == "__main__":
    main()
