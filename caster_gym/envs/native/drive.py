"""How robots move for a control period, in compiled code: motors, floor, obstacles.

Where it depends on the floor, wheels roll without slip or may slip. Which of the two it is shows in the type of the
floor while compiling, None or a `FloorTable`, so that a task pays for nothing that only the other floor needs; nor does
it for obstacles where there are none.
"""

from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE, compiled
from caster_gym.engines.native.guarding import borrowed_hull, borrowed_obstacles, reach_of
from caster_gym.engines.native.lanes import LANES, read, read_pairs, read_robot, read_slip_state, read_state, write
from caster_gym.envs.native.layout import CLOCKS, NO_WRENCH, Sizes, World, read_record, rows_of, write_record
from caster_gym.envs.plan import BESIDE
from caster_gym.envs.report import RECORD, record_of
from caster_gym.mechanics.floor import FloorTable, Surface, own_friction, patch_at, patch_friction
from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.plant import driven_step, guarded_driven_step, slip_speeds
from caster_gym.mechanics.room import should_measure, step_within_room
from caster_gym.mechanics.scalars import add, each, either, flatten, maximum
from caster_gym.mechanics.separation import Hull, Obstacles, clearance
from caster_gym.mechanics.slip_state import rolling_state


@register_jitable(**INLINE)
def _scaled(factor: Any, number: Any) -> Any:
    return factor * number


@register_jitable(**INLINE)
def _add_up(workspace: Any, lane: Any, row: Any, more: Any) -> None:
    """Add numbers to those from a row on."""
    write(workspace, lane, row, add(read(workspace, lane, row, more), more))


@register_jitable(**INLINE)
def neighbourhood(robot: Any, world: World) -> Any:
    """First and end of the obstacles that a robot may meet."""
    path = world.clocks[CLOCKS.path, robot]
    return world.arenas[path, BESIDE.first], world.arenas[path, BESIDE.end]


@register_jitable(**INLINE)
def _measure(workspace: Any, first: Any, here: Any, obstacles: Any, world: World, sizes: Sizes) -> None:
    """Measure the room of robots that may soon need to know it."""
    rows = rows_of(sizes)
    if obstacles is None:
        return
    row = rows.room
    for lane in range(here):
        state = read_state(workspace, lane, rows.state, sizes.casters)
        if should_measure(workspace[row * LANES + lane], state.twist, world.time_step, world.hull.reach):
            near, end = neighbourhood(first + lane, world)
            gap = clearance(state.position, state.heading, world.hull, obstacles, near, end)
            workspace[row * LANES + lane] = gap


@register_jitable(**INLINE)
def _take_care(workspace: Any, first: Any, here: Any, share: Any, obstacles: Any, world: World, sizes: Sizes) -> None:
    """Step the robots that may touch something."""
    rows = rows_of(sizes)
    if obstacles is None:
        return
    for lane in range(here):
        if workspace[rows.room * LANES + lane] < 0.0:
            near, end = neighbourhood(first + lane, world)
            careful_step(workspace, lane, share, near, end, world.hull, obstacles, world.floor, world.time_step, sizes)


@register_jitable(**INLINE)
def drive(workspace: Any, first: Any, lanes: Any, here: Any, world: World, sizes: Sizes) -> None:
    """Let robots, the first of the batch's in this block being `first`, move for a control period."""
    rows = rows_of(sizes)
    power_at, traction_at = (rows.record + RECORD.power) * LANES, (rows.record + RECORD.traction) * LANES
    lifted_at = (rows.record + RECORD.lifted) * LANES
    h, reach, share = world.time_step, reach_of(world.hull), 1.0 / world.substeps
    for row in range(rows.torques, rows.reference):
        for lane in range(lanes):
            workspace[row * LANES + lane] = 0.0
    for _ in range(world.substeps):
        _measure(workspace, first, here, world.obstacles, world, sizes)
        feel_floor(workspace, lanes, world.floor, sizes)
        for lane in range(lanes):
            state = state_of(workspace, lane, world.floor, sizes)
            commands = read_pairs(workspace, lane, rows.commands, sizes.casters)
            wrench = read(workspace, lane, rows.wrench, NO_WRENCH)
            robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
            surface = surface_of(workspace, lane, world.floor, sizes)
            target, done = driven_step(state, commands, wrench, h, robot, surface)
            room = workspace[rows.room * LANES + lane]
            end, room, went = step_within_room(world.obstacles, room, state, target, h, reach)
            write(workspace, lane, rows.state, end)
            _add_up(workspace, lane, rows.torques, each(_scaled, (share * went,), flatten(done.torques)))
            workspace[power_at + lane] += share * went * done.power
            workspace[traction_at + lane] = maximum(went * done.asks.traction, workspace[traction_at + lane])
            workspace[lifted_at + lane] = maximum(went * done.asks.lifted, workspace[lifted_at + lane])
            note_slips(workspace, lane, went, target, robot, world.floor, sizes)
            workspace[rows.room * LANES + lane] = room
        _take_care(workspace, first, here, share, world.obstacles, world, sizes)


def _careful_step(
    workspace: Any,
    lane: Any,
    share: Any,
    near: Any,
    end: Any,
    hull: Hull,
    obstacles: Obstacles,
    floor: Any,
    h: Any,
    sizes: Sizes,
) -> None:
    """One substep of a robot that may touch something."""
    rows = rows_of(sizes)
    hull, obstacles = borrowed_hull(hull), borrowed_obstacles(obstacles)
    state = state_of(workspace, lane, floor, sizes)
    commands = read_pairs(workspace, lane, rows.commands, sizes.casters)
    wrench = read(workspace, lane, rows.wrench, NO_WRENCH)
    robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
    surface = surface_of(workspace, lane, floor, sizes)
    state, drive, touch = guarded_driven_step(state, commands, wrench, h, robot, hull, obstacles, near, end, surface)
    write(workspace, lane, rows.state, pack_state(state))
    _add_up(workspace, lane, rows.torques, each(_scaled, (share,), flatten(drive.torques)))
    record = record_of(read_record(workspace, lane, sizes), drive, touch, share)
    write_record(workspace, lane, record, sizes)
    note_slips(workspace, lane, 1.0, state, robot, floor, sizes)
    workspace[rows.room * LANES + lane] = clearance(state.position, state.heading, hull, obstacles, near, end)


@register_jitable(**INLINE)
def state_of(workspace: Any, lane: Any, floor: Any, sizes: Sizes) -> Any:
    """State of one robot; one whose wheels may slip has rates of its own for each caster."""
    return either(floor, read_state, _slip_state, (workspace, lane, rows_of(sizes).state, sizes.casters))


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
        patch = patch_at(floor.patches, k)
        for lane in range(lanes):
            state = read_state(workspace, lane, rows_of(sizes).state, sizes.casters)
            robot = read_robot(workspace, lane, rows_of(sizes).parameters, sizes.casters)
            before, shared = read(workspace, lane, row, sizes.casters), (state.position, state.heading, patch)
            write(workspace, lane, row, each(patch_friction, shared, before, state.directions, robot.casters))


careful_step = compiled(_careful_step)
