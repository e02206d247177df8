"""The same robot in MuJoCo: rigid bodies, spheres for wheels, rolling by contact friction. A peer to check against.

MuJoCo knows nothing of casters: it holds the bodies together by joints and the wheels on the floor by friction, which
its solver softens over a few time steps. So it slips a little, and less with every smaller time step; the limit is
rolling without slip, the equations of caster_gym. Run this file for a table of both.

The platform slides in x, y and z and turns about the vertical: it cannot tip, the slide in z lets its weight press the
wheels on the floor. Rotor inertias, damping and dry friction sit at the joints, as in the robot's file.
"""

import argparse
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym import Model, Robot, load_robot
from caster_gym.mechanics.parameters import GRAVITY
from caster_gym.robot import Caster, Motor

FRICTION = 5.0  # [-] more than any floor has, so that no wheel breaks away
FRICTION_STIFFNESS = 100.0  # [-] of friction over that of the normal force: less creep under load
CONTACT_STEPS = 2.0  # time constant of the contact in time steps, the stiffest that MuJoCo accepts
PLANAR = ("x", "y", "yaw")  # joints of the platform besides z


class Motion(NamedTuple):
    """Where the platform went."""

    time: NDArray[np.float64]  # (T,) [s]
    pose: NDArray[np.float64]  # (T, 3) x, y [m], β [rad] in the world


def mjcf(robot: Robot, timestep: float) -> str:
    """The robot as a MuJoCo model (MJCF) with one torque motor at each joint, in the order of `robot.joints`.

    Motors act at the joints: gears, torque and speed limits stay with the caller. timestep in s.
    """
    casters = "".join(_caster_body(number, caster) for number, caster in enumerate(robot.casters, start=1))
    scrubs = "".join(_scrub(number, caster) for number, caster in enumerate(robot.casters, start=1))
    motors = "".join(f'<motor name="{joint}" joint="{joint}"/>' for joint in robot.joints)
    p = robot.platform
    return f"""
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{timestep:.17g}" integrator="implicitfast" cone="elliptic" impratio="{FRICTION_STIFFNESS}"
          solver="Newton" tolerance="1e-14" iterations="100" gravity="0 0 {-GRAVITY}"/>
  <default>
    <geom condim="3" friction="{FRICTION} 0 0" solref="{CONTACT_STEPS * timestep:.17g} 1"/>
  </default>
  <worldbody>
    <geom type="plane" size="0 0 1" contype="1" conaffinity="2"/>
    <body>
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="yaw" type="hinge" axis="0 0 1"/>
      {_inertial(p.mass, (*p.com, 0.0), (p.inertia, p.inertia, p.inertia))}
      {casters}
    </body>
  </worldbody>
  <tendon>{scrubs}</tendon>
  <actuator>{motors}</actuator>
</mujoco>
"""


def _caster_body(number: int, caster: Caster) -> str:
    """Steering link and wheel; the link's x-axis is the rolling direction, its origin the pivot at wheel height."""
    link, wheel, (behind, left) = caster.link, caster.wheel, caster.link.com
    return f"""
      <body pos="{_numbers(caster.x, caster.y, caster.radius)}">
        {_hinge(f"steer_{number}", "0 0 1", caster.steer)}
        {_inertial(link.mass, (-behind, left, 0.0), (link.inertia, link.inertia, link.inertia))}
        <body pos="{_numbers(-caster.trail, caster.offset, 0.0)}">
          {_hinge(f"roll_{number}", "0 1 0", caster.roll)}
          {_inertial(wheel.mass, (0.0, 0.0, 0.0), (wheel.yaw_inertia, wheel.spin_inertia, wheel.yaw_inertia))}
          <geom type="sphere" size="{_numbers(caster.radius)}" contype="2" conaffinity="1"/>
        </body>
      </body>"""


def _hinge(name: str, axis: str, motor: Motor) -> str:
    friction = f'damping="{_numbers(motor.viscous)}" frictionloss="{_numbers(motor.coulomb)}"'
    return f'<joint name="{name}" type="hinge" axis="{axis}" armature="{_numbers(motor.armature)}" {friction}/>'


def _inertial(mass: float, position: Sequence[float], diagonal: Sequence[float]) -> str:
    return f'<inertial mass="{_numbers(mass)}" pos="{_numbers(*position)}" diaginertia="{_numbers(*diagonal)}"/>'


def _scrub(number: int, caster: Caster) -> str:
    """Damping of the wheel's yaw over ground, the sum of the platform's yaw and the steering."""
    joints = f'<joint joint="yaw" coef="1"/><joint joint="steer_{number}" coef="1"/>'
    return f'<fixed damping="{_numbers(caster.scrub)}">{joints}</fixed>'


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def joint_indices(robot: Robot, model: mujoco.MjModel) -> tuple[list[int], list[int]]:
    """Where the platform's x, y, yaw and the joints of `robot.joints` stand in MuJoCo's qpos and qvel.

    All joints have one degree of freedom, so the same index holds in both.
    """
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    return [index[name] for name in PLANAR], [index[name] for name in robot.joints]


def simulate(robot: Robot, state: ArrayLike, torque: ArrayLike, timestep: float, duration: float) -> Motion:
    """The motion under constant joint torques (2 N) from a state (6 + N) as in `Model.simulate`. SI units."""
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
    data.ctrl[:] = torque
    steps = round(duration / timestep)
    pose = np.empty((steps + 1, 3))
    pose[0] = start[:3]
    for step in range(1, steps + 1):
        mujoco.mj_step(model, data)
        pose[step] = data.qpos[platform]
    return Motion(timestep * np.arange(steps + 1), pose)


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
