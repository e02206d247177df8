"""Time steps of driven robots in rows of tensors, in regions that the compiler works out once however often they come.

Rows of a state, each with an entry a robot: x, y, cos β, sin β in W, twist in B, cos δ, sin δ of each caster.
"""

import torch
from torch import Tensor

import caster_gym.engines.torch_scalars  # noqa: F401 - makes tensors scalars of the mechanics
from caster_gym.mechanics.ground import floor_use
from caster_gym.mechanics.integration import State, derivative, pack_state, unit, unpack_state
from caster_gym.mechanics.motors import joint_torques, motor_torques
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.plant import all_motor_speeds, power_between
from caster_gym.mechanics.scalars import each, flatten, pairs


def driven_rows(
    bodies: Tensor, commands: Tensor, push: Tensor, h: float, robot: RobotParameters, asking: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """`caster_gym.mechanics.plant.driven_step` of states: those at the end, what motors did, what the floor was asked.

    commands (2 N, robots) in −1 … 1; push (3, robots): external wrench at C, in B [N, N, N m]. Motor torques [N m]
    with their power [W] (2 N + 1, robots); `caster_gym.mechanics.ground.FloorUse` (2, robots), or zeros unless asking.
    """
    torques, forces = _driven(bodies, commands, push, robot)
    k1 = _rate(bodies, forces, robot)
    k2 = _rate(bodies + 0.5 * h * k1, forces, robot)
    k3 = _rate(bodies + 0.5 * h * k2, forces, robot)
    k4 = _rate(bodies + h * k3, forces, robot)
    end = bodies + h / 6.0 * k1 + h / 3.0 * k2 + h / 3.0 * k3 + h / 6.0 * k4  # as in `rk4_step`, to the last rounding
    states, done = _arrived(bodies, end, torques, robot)
    asks = _asked(bodies, forces, robot) if asking else torch.zeros_like(bodies[:2])
    return states, done, asks


@torch.compiler.nested_compile_region
def _driven(bodies: Tensor, commands: Tensor, push: Tensor, robot: RobotParameters) -> tuple[Tensor, Tensor]:
    """Torques of the motors, and the forces of joints and push."""
    speeds = all_motor_speeds(unpack_state(bodies.unbind(0)), robot)
    torques = each(motor_torques, (), pairs(commands.unbind(0)), speeds, robot.casters)
    at_joints = each(joint_torques, (), torques, robot.casters)
    return torch.stack(flatten(torques)), torch.stack((*flatten(at_joints), *push.unbind(0)))


@torch.compiler.nested_compile_region
def _rate(bodies: Tensor, forces: Tensor, robot: RobotParameters) -> Tensor:
    """Time derivative of the states."""
    *torques, x, y, z = forces.unbind(0)
    state = unpack_state(bodies.unbind(0))
    return torch.stack(pack_state(derivative(state, pairs(tuple(torques)), (x, y, z), robot)))


@torch.compiler.nested_compile_region
def _arrived(before: Tensor, after: Tensor, torques: Tensor, robot: RobotParameters) -> tuple[Tensor, Tensor]:
    """States with directions of length 1, and what the motors did on the way there."""
    end = unpack_state(after.unbind(0))
    end = State(end.position, unit(end.heading), end.twist, each(unit, (), end.directions))
    speeds = all_motor_speeds(unpack_state(before.unbind(0)), robot)
    power = power_between(speeds, pairs(torques.unbind(0)), end, robot)
    return torch.stack(pack_state(end)), torch.stack((*torques.unbind(0), power))


@torch.compiler.nested_compile_region
def _asked(bodies: Tensor, forces: Tensor, robot: RobotParameters) -> Tensor:
    """What robots ask of the floor (2, robots)."""
    *torques, x, y, z = forces.unbind(0)
    state = unpack_state(bodies.unbind(0))
    return torch.stack(floor_use(state.twist, state.directions, pairs(tuple(torques)), (x, y, z), robot))
