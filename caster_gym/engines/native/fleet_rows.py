"""The layout of a block of bare robots, for floors that grip and floors that wheels slip on."""

from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE
from caster_gym.engines.native.lanes import read, read_robot, read_slip_state, read_state, write
from caster_gym.mechanics.floor import Surface, own_friction, patch_at, patch_friction
from caster_gym.mechanics.integration import State, state_rows
from caster_gym.mechanics.scalars import each, either


@register_jitable(**INLINE)
def torque_row(casters: Any, floor: Any) -> int:
    """First row of the joint torques, behind the state."""
    if floor is None:
        return state_rows(len(casters), False)
    return state_rows(len(casters), True)


@register_jitable(**INLINE)
def room_row(casters: Any, floor: Any) -> int:
    """Row of the room; negative while the coming step is to be taken with care."""
    return torque_row(casters, floor) + 2 * len(casters)


@register_jitable(**INLINE)
def friction_row(casters: Any, floor: Any) -> int:
    """First row of the floor's friction under each wheel, if wheels may slip. Parameters follow."""
    return room_row(casters, floor) + 1


@register_jitable(**INLINE)
def parameter_row(casters: Any, floor: Any) -> int:
    """First row of the robot's parameters."""
    if floor is None:
        return friction_row(casters, floor)
    return friction_row(casters, floor) + len(casters)


@register_jitable(**INLINE)
def state_of(block: Any, lane: Any, casters: Any, floor: Any) -> Any:
    """State of one robot."""
    return either(floor, read_state, _slip_state, (block, lane, 0, casters))


@register_jitable(**INLINE)
def _slip_state(_floor: Any, block: Any, lane: Any, row: Any, casters: Any) -> State:
    return read_slip_state(block, lane, row, casters)


@register_jitable(**INLINE)
def surface_of(block: Any, lane: Any, casters: Any, floor: Any) -> Any:
    """The floor under one robot; None if it grips."""
    return either(floor, _grip, _finite_friction, (block, lane, casters))


@register_jitable(**INLINE)
def _grip(_block: Any, _lane: Any, _casters: Any) -> None:
    return


@register_jitable(**INLINE)
def _finite_friction(floor: Any, block: Any, lane: Any, casters: Any) -> Surface:
    return Surface(read(block, lane, friction_row(casters, floor), casters), floor.contact_time)


@register_jitable(**INLINE)
def find_frictions(block: Any, lanes: Any, casters: Any, floor: Any) -> None:
    """Find the friction under the wheels of all robots."""
    if floor is None:
        return
    _look_at_patches(block, lanes, casters, floor, floor.patches)


@register_jitable(**INLINE)
def _look_at_patches(block: Any, lanes: Any, casters: Any, floor: Any, patches: Any) -> None:
    """Where there are patches; else every wheel keeps its friction."""
    if patches is None:
        return
    row, parameters = friction_row(casters, floor), parameter_row(casters, floor)
    for lane in range(lanes):
        robot = read_robot(block, lane, parameters, casters)
        write(block, lane, row, each(own_friction, (robot.platform.floor_friction,), robot.casters))
    for k in range(len(patches)):
        patch = patch_at(patches, k)
        for lane in range(lanes):  # neighbours side by side, a patch at a time
            state = read_slip_state(block, lane, 0, casters)
            robot = read_robot(block, lane, parameters, casters)
            before = read(block, lane, row, casters)
            shared = state.position, state.heading, patch
            write(block, lane, row, each(patch_friction, shared, before, state.directions, robot.casters))
