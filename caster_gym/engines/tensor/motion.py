"""Time steps of driven robots in rows of tensors, in regions that Torch compiles once and uses often.

Rows of a state, each with an entry a robot: x, y, cos β, sin β in W, twist in B, cos δ, sin δ of each caster.
"""

import torch
from torch import Tensor

import caster_gym.engines.tensor.scalars  # noqa: F401 - makes tensors scalars of the mechanics
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import FloorTable, Surface, floor_table, wheel_frictions
from caster_gym.mechanics.ground import floor_use
from caster_gym.mechanics.integration import State, derivative, pack_state, runge_kutta, unit, unpack_state
from caster_gym.mechanics.motors import joint_torques, motor_torques
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.plant import all_motor_speeds, driven_step, power_between, slip_speeds
from caster_gym.mechanics.scalars import each, flatten, pairs
from caster_gym.mechanics.slip_state import unpack_slip_state


def driven_rows(
    bodies: Tensor, commands: Tensor, push: Tensor, h: float, robot: RobotParameters, asking: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """`caster_gym.mechanics.plant.driven_step` of states: those at the end, what motors did, what the floor was asked.

    commands (2 N, robots) in −1 … 1; push (3, robots): external wrench at C, in B [N, N, N m]. Motor torques [N m]
    with their power [W] (2 N + 1, robots); `caster_gym.mechanics.ground.FloorUse` (2, robots), or zeros unless asking.
    """
    torques, forces = _driven(bodies, commands, push, robot)
    end = runge_kutta(_rate, _moved, bodies, h, (forces, robot))
    states, done = _arrived(bodies, end, torques, robot)
    asks = _asked(bodies, forces, robot) if asking else torch.zeros_like(bodies[:2])
    return states, done, asks


def slipping_rows(
    bodies: Tensor, commands: Tensor, push: Tensor, h: float, frictions: Tensor, robot: RobotParameters
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The same of wheels that may slip, on a floor of a friction under each (N, robots); then slips (N, robots) [m/s].

    Rows of these states go on with yaw rate over ground and rolling rate of each caster, and the tilt.
    """
    states, done, asks, slips = _slipped(bodies, torch.cat((commands, push, frictions)), h, robot)
    return states, done, asks, slips


def torch_floor(floor: Floor) -> FloorTable:
    """A floor whose patches are plain numbers, which the compiler folds."""
    table = floor_table(floor)
    return table._replace(patches=None if table.patches is None else table.patches.tolist())


def state_of(bodies: Tensor, floor: FloorTable | None) -> State:
    """The state whose rows these are (rows, robots); on a floor of finite friction each caster has rates of its own."""
    rows = bodies.unbind(0)
    return unpack_state(rows) if floor is None else unpack_slip_state(rows)


def surface_below(state: State, robot: RobotParameters, floor: FloorTable) -> Surface:
    """The floor under each robot, whose frictions are tensors (robots,)."""
    friction = robot.platform.floor_friction + 0.0 * state.position[0]  # Torch chooses between numbers in float32
    on_it = robot._replace(platform=robot.platform._replace(floor_friction=friction))
    frictions = wheel_frictions(state.position, state.heading, state.directions, floor.patches, on_it)
    return Surface(frictions, floor.contact_time)


@torch.compiler.nested_compile_region
def _slipped(bodies: Tensor, given: Tensor, h: float, robot: RobotParameters) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    n = len(robot.casters)
    rows = given.unbind(0)
    x, y, z = rows[2 * n : 2 * n + 3]
    surface = Surface(rows[2 * n + 3 :], 0.0)  # without an impact, no contact time
    end, drive = driven_step(unpack_slip_state(bodies.unbind(0)), pairs(rows[: 2 * n]), (x, y, z), h, robot, surface)
    done = torch.stack((*flatten(drive.torques), drive.power))
    return torch.stack(pack_state(end)), done, torch.stack(tuple(drive.asks)), torch.stack(slip_speeds(end, robot))


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


def _moved(bodies: Tensor, h: float, rate: Tensor) -> Tensor:
    return bodies + h * rate


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
