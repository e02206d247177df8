"""What there is to see of one robot at one moment: all that drawing needs, and nothing of how it is computed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.block_layout import (
    ENDINGS,
    FIRST_POSE,
    FIRST_RECORD,
    FIXED_REPORT_ROWS,
)
from caster_gym.mechanics import ground
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import each, pairs
from caster_gym.mechanics.separation import Obstacles
from caster_gym.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """One robot on its path, in the world frame W unless said otherwise."""

    robot: Robot
    time: float  # [s] since the episode began
    pose: Array  # (4,) x, y [m], cos β, sin β
    twist: Array  # (3,) vx, vy, ω in B [m/s, rad/s]
    directions: Array  # (N, 2) cos δ, sin δ of each rolling direction, in B
    torque: Array  # (2 N,) mean torques of the motors over the last control period [N m]
    ground_forces: Array  # (N, 2) of the floor on each wheel, along its rolling direction and to its left [N]
    path: Array  # (K, 2) [m]
    corridor: float  # [m] half width
    reference: Array  # (4,) pose that is to be reached
    obstacles: Obstacles
    impulse: Array  # (2,) of obstacles on the robot during the last control period [N s]
    impact_point: Array  # (2,) where the last of them acted [m]; NaN if there was none
    failed: bool  # the episode has terminated


def draw_scene(
    robot: Robot,
    time: float,
    state: Array,
    report: Array,
    wrench: Array,
    path: Array,
    corridor: float,
    obstacles: Obstacles,
) -> Scene:
    """The scene of a robot with a state (7 + 2 N,) and the report of its last control period, see `tracking.report`.

    wrench (3,): what pushed it from outside, beside obstacles, at C in B [N, N, N m].
    """
    torque, record = report[FIXED_REPORT_ROWS:], report[FIRST_RECORD:]
    return Scene(
        robot=robot,
        time=time,
        pose=state[:4],
        twist=state[4:7],
        directions=state[7:].reshape(-1, 2),
        torque=torque,
        ground_forces=_ground_forces(robot, state, torque, wrench, record[9:12]),
        path=path,
        corridor=corridor,
        reference=report[FIRST_POSE + 4 : FIRST_POSE + 8],
        obstacles=obstacles,
        impulse=record[1:3],
        impact_point=record[4:6] if record[6] > 0.0 else np.full(2, np.nan),
        failed=bool(report[:ENDINGS].any()),
    )


def _ground_forces(robot: Robot, state: Array, torque: Array, wrench: Array, held: Array) -> Array:
    """Forces (N, 2) of the floor on each wheel along its rolling direction and to its left. [N]"""
    parameters, now = robot_parameters(robot), unpack_state(tuple(state.tolist()))
    at_joints = each(joint_torques, (), pairs(tuple(torque.tolist())), parameters.casters)
    x, y, moment = (wrench + held).tolist()
    rate = forward_dynamics(now.twist, now.directions, at_joints, (x, y, moment), parameters)
    shared = now.twist, rate, parameters.platform.coulomb_speed
    return np.array(each(ground.ground_force, shared, now.directions, parameters.casters, at_joints))
