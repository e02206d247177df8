"""A scene: everything that drawing needs of one robot at one moment."""

from dataclasses import dataclass

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.report import REPORT, torque_rows
from caster_gym.envs.rows import span
from caster_gym.floor import Floor
from caster_gym.mechanics import ground
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.floor import floor_table, wheel_frictions
from caster_gym.mechanics.free_casters import slip_velocity
from caster_gym.mechanics.integration import State, unpack_state
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import each, pairs
from caster_gym.mechanics.separation import Obstacles
from caster_gym.mechanics.slip import slip_step
from caster_gym.mechanics.slip_state import unpack_slip_state
from caster_gym.robot import Robot

_RECORD = REPORT.record
_HELD = span((_RECORD.held_x, _RECORD.held_y, _RECORD.held_moment))
_IMPULSE, _POINT = span((_RECORD.impulse_x, _RECORD.impulse_y)), span((_RECORD.point_x, _RECORD.point_y))


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
    slip: Array  # (N, 2) of each wheel over the floor, along its rolling direction and to its left [m/s]
    floor: Floor | None = None  # None: wheels roll without slip


def draw_scene(
    robot: Robot,
    time: float,
    state: Array,
    report: Array,
    terms: int,
    wrench: Array,
    path: Array,
    corridor: float,
    obstacles: Obstacles,
    floor: Floor | None,
    time_step: float,
) -> Scene:
    """The scene of a robot with a state, see `TaskEngine.states`, and the report of its last control period.

    terms: how many the reward has. wrench (3,): what pushed it from outside, beside obstacles, at C in B [N, N, N m].
    time_step [s]: of the task.
    """
    n = robot.caster_count
    now = (unpack_state if floor is None else unpack_slip_state)(tuple(state.tolist()))
    torque, push = report[torque_rows(terms, n)], wrench + report[_HELD]
    if floor is None:
        forces, slip = _ground_forces(robot, now, torque, push), np.zeros((n, 2))
    else:
        forces, slip = _slipping_forces(robot, now, torque, push, floor, time_step)
    return Scene(
        robot=robot,
        time=time,
        pose=np.array(now.position + now.heading),
        twist=np.array(now.twist),
        directions=np.array(now.directions),
        torque=torque,
        ground_forces=forces,
        path=path,
        corridor=corridor,
        reference=report[span(REPORT.reference_pose)],
        obstacles=obstacles,
        impulse=report[_IMPULSE],
        impact_point=report[_POINT] if report[_RECORD.impacts] > 0.0 else np.full(2, np.nan),
        failed=bool(report[span(REPORT.endings)].any()),
        slip=slip,
        floor=floor,
    )


def _ground_forces(robot: Robot, now: State, torque: Array, push: Array) -> Array:
    """Forces (N, 2) of the floor on each wheel along its rolling direction and to its left. [N]"""
    parameters = robot_parameters(robot)
    at_joints = each(joint_torques, (), pairs(tuple(torque.tolist())), parameters.casters)
    x, y, moment = push.tolist()
    rate = forward_dynamics(now.twist, now.directions, at_joints, (x, y, moment), parameters)
    shared = now.twist, rate, parameters.platform.coulomb_speed
    return np.array(each(ground.ground_force, shared, now.directions, parameters.casters, at_joints))


def _slipping_forces(
    robot: Robot, now: State, torque: Array, push: Array, floor: Floor, time_step: float
) -> tuple[Array, Array]:
    """The same on a floor of finite friction, mean over the coming time step; and how wheels slip now (N, 2) [m/s]."""
    parameters = robot_parameters(robot)
    at_joints = each(joint_torques, (), pairs(tuple(torque.tolist())), parameters.casters)
    x, y, moment = push.tolist()
    frictions = wheel_frictions(now.position, now.heading, now.directions, floor_table(floor).patches, parameters)
    _, footfall = slip_step(now, at_joints, (x, y, moment), time_step, frictions, parameters)
    slips = each(slip_velocity, (now.twist,), now.directions, now.rates, parameters.casters)
    return np.array(footfall.forces), np.array(slips)
