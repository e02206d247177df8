"""The compiled step where it depends on the floor: wheels that roll without slip, or that may slip.

Which of the two it is shows in the type of the floor while compiling, None or a `FloorTable`, so that a task pays for
nothing that only the other floor needs.
"""

from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE
from caster_gym.engines.native.lanes import read, read_robot, read_slip_state, read_state, write
from caster_gym.envs.native.layout import Sizes, rows_of
from caster_gym.mechanics.floor import FloorTable, Surface, own_friction, patch_friction
from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.plant import slip_speeds
from caster_gym.mechanics.scalars import each, either, maximum
from caster_gym.mechanics.slip_state import rolling_state


@register_jitable(**INLINE)
def state_of(workspace: Any, lane: Any, floor: Any, sizes: Sizes) -> Any:
    """State of one robot; one whose wheels may slip has rates of its own for each caster."""
    return either(floor, read_state, _slip_state, (workspace, lane, 0, sizes.casters))


@register_jitable(**INLINE)
def _slip_state(_floor: FloorTable, workspace: Any, lane: Any, row: Any, casters: Any) -> State:
    return read_slip_state(workspace, lane, row, casters)


@register_jitable(**INLINE)
def begun(workspace: Any, lane: Any, state: State, floor: Any, sizes: Sizes) -> Any:
    """The numbers of a state in which no wheel slips."""
    return either(floor, _rolling, _rolling_wheels, (workspace, lane, state, sizes))


@register_jitable(**INLINE)
def _rolling(_workspace: Any, _lane: Any, state: State, _sizes: Sizes) -> Any:
    return pack_state(state)


@register_jitable(**INLINE)
def _rolling_wheels(_floor: FloorTable, workspace: Any, lane: Any, state: State, sizes: Sizes) -> Any:
    return pack_state(rolling_state(state, read_robot(workspace, lane, rows_of(sizes).parameters, sizes.casters)))


@register_jitable(**INLINE)
def surface_of(workspace: Any, lane: Any, floor: Any, sizes: Sizes) -> Any:
    """The floor under one robot, once `feel_floor` has looked it up; None if it grips."""
    return either(floor, _grip, _finite_friction, (workspace, lane, sizes))


@register_jitable(**INLINE)
def _grip(_workspace: Any, _lane: Any, _sizes: Sizes) -> None:
    return


@register_jitable(**INLINE)
def _finite_friction(floor: FloorTable, workspace: Any, lane: Any, sizes: Sizes) -> Surface:
    return Surface(read(workspace, lane, rows_of(sizes).friction, sizes.casters), floor.contact_time)


@register_jitable(**INLINE)
def slips_of(workspace: Any, lane: Any, floor: Any, sizes: Sizes) -> Any:
    """Greatest slip of each wheel in the control period [m/s]; empty where none may slip."""
    return either(floor, _no_slips, _greatest_slips, (workspace, lane, sizes))


@register_jitable(**INLINE)
def _no_slips(_workspace: Any, _lane: Any, _sizes: Sizes) -> Any:
    return ()


@register_jitable(**INLINE)
def _greatest_slips(_floor: FloorTable, workspace: Any, lane: Any, sizes: Sizes) -> Any:
    return read(workspace, lane, rows_of(sizes).slips, sizes.casters)


@register_jitable(**INLINE)
def note_slips(workspace: Any, lane: Any, went: Any, end: State, robot: Any, floor: Any, sizes: Sizes) -> None:
    """Keep the greatest slip of each wheel; went: 1 if the robot has made a step to that end, else 0."""
    if floor is None:
        return
    slips, row = each(_counted, (went,), slip_speeds(end, robot)), rows_of(sizes).slips
    write(workspace, lane, row, each(maximum, (), slips, read(workspace, lane, row, sizes.casters)))


@register_jitable(**INLINE)
def _counted(went: Any, slip: Any) -> Any:
    return went * slip


@register_jitable(**INLINE)
def feel_floor(workspace: Any, lanes: Any, floor: Any, sizes: Sizes) -> None:
    """Look up the floor's friction under each wheel, patch by patch, so that the loops over lanes stay SIMD."""
    if floor is None:
        return
    row = rows_of(sizes).friction
    for lane in range(lanes):
        robot = read_robot(workspace, lane, rows_of(sizes).parameters, sizes.casters)
        write(workspace, lane, row, each(own_friction, (robot.platform.floor_friction,), robot.casters))
    for k in range(len(floor.patches)):
        patch = floor.patches[k, 0], floor.patches[k, 1], floor.patches[k, 2], floor.patches[k, 3]
        for lane in range(lanes):
            state = read_state(workspace, lane, 0, sizes.casters)
            robot = read_robot(workspace, lane, rows_of(sizes).parameters, sizes.casters)
            before, shared = read(workspace, lane, row, sizes.casters), (state.position, state.heading, patch)
            write(workspace, lane, row, each(patch_friction, shared, before, state.directions, robot.casters))
