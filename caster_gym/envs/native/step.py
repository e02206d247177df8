"""The compiled step of every task: the loops over the robots of a block, see `caster_gym.envs.native.layout`.

Blocks are what is kept of the robots; a workspace is where one after the other is worked out.
"""

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed, compiled, teach
from caster_gym.engines.native.guarding import (
    borrowed_floor,
    borrowed_hull,
    borrowed_obstacles,
    reach_of,
)
from caster_gym.engines.native.lanes import LANES, counting, read, read_pairs, read_robot, read_state, write
from caster_gym.envs import randomness
from caster_gym.envs.native import compilation
from caster_gym.envs.native.delivery import copy_rows, deliver, give_results
from caster_gym.envs.native.layout import Sizes, Views, World, as_many, rows_of
from caster_gym.envs.native.reference import borrowed_guide, evaluate, guide_robot, weights_of
from caster_gym.envs.native.slipping import begun, feel_floor, note_slips, slips_of, state_of, surface_of
from caster_gym.envs.observation import GAP_LIMIT, Neighbour, View, observe
from caster_gym.envs.randomness import uniform
from caster_gym.envs.report import RECORD, Record, Situation, flat_report, record_of
from caster_gym.envs.rows import numbered
from caster_gym.envs.tracking import POINT_ROWS, Point, Reference, report, start
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.plant import driven_step, guarded_driven_step
from caster_gym.mechanics.room import should_measure, step_within_room
from caster_gym.mechanics.scalars import add, clip, each, flatten, maximum
from caster_gym.mechanics.separation import Hull, Obstacles, clearance, separation

NEIGHBOUR = numbered(Neighbour)
NEIGHBOUR_ROWS = len(NEIGHBOUR)

_REFERENCE = (0.0,) * len(Reference._fields)
_POINT = (0.0,) * POINT_ROWS
_RECORD = (0.0,) * len(RECORD)
_SITUATION = (0.0,) * len(Situation._fields)
_NOBODY = Neighbour(GAP_LIMIT, 0.0, 0.0)

teach(randomness)


@register_jitable(**INLINE)
def _borrowed_arenas(arenas: Any) -> Any:
    if arenas is None:
        return None
    return borrowed(arenas)


@register_jitable(**INLINE)
def _borrowed_world(w: World) -> World:
    return World(
        borrowed(w.blocks),
        borrowed(w.parameters),
        borrowed(w.clocks),
        borrowed(w.seeds),
        borrowed(w.slots),
        borrowed_guide(w.guide),
        borrowed_hull(w.hull),
        borrowed_obstacles(w.obstacles),
        _borrowed_arenas(w.arenas),
        borrowed_floor(w.floor),
        w.substeps,
        w.time_step,
    )


@register_jitable(**INLINE)
def _borrowed_views(v: Views) -> Views:
    return Views(borrowed(v.observations), borrowed(v.reports), borrowed(v.results))


@register_jitable(**INLINE)
def _scaled(factor: Any, number: Any) -> Any:
    return factor * number


@register_jitable(**INLINE)
def _add_up(workspace: Any, lane: Any, row: Any, more: Any) -> None:
    """Add numbers to those from a row on."""
    write(workspace, lane, row, add(read(workspace, lane, row, more), more))


@register_jitable(**INLINE)
def _neighbourhood(robot: Any, world: World) -> Any:
    """First and end of the obstacles that a robot may meet."""
    path = world.clocks[1, robot]
    return world.arenas[path, 0], world.arenas[path, 1]


@register_jitable(**INLINE)
def _measure(workspace: Any, first: Any, here: Any, obstacles: Any, world: World, sizes: Sizes) -> None:
    """Measure the room of robots that may soon need to know it."""
    rows = rows_of(sizes)
    if obstacles is None:
        return
    row = rows.room
    for lane in range(here):
        state = read_state(workspace, lane, 0, sizes.casters)
        if should_measure(workspace[row * LANES + lane], state.twist, world.time_step, world.hull.reach):
            near, end = _neighbourhood(first + lane, world)
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
            near, end = _neighbourhood(first + lane, world)
            careful_step(workspace, lane, share, near, end, world.hull, obstacles, world.floor, world.time_step, sizes)


@register_jitable(**INLINE)
def _look_around(workspace: Any, lane: Any, robot: Any, state: Any, obstacles: Any, world: World, sizes: Sizes) -> Any:
    """Write the nearest obstacles; returns the gap to the nearest one. [m]"""
    rows = rows_of(sizes)
    gap = math.inf
    if obstacles is None:
        return gap
    near, end = _neighbourhood(robot, world)
    for k in range(near, end):
        apart = separation(state.position, state.heading, world.hull, obstacles, k)
        gap = min(apart.gap, gap)
        _insert(workspace, lane, rows.nearest, apart.gap, apart.nx, apart.ny, sizes)
    return gap


@register_jitable(**INLINE)
def _drive(workspace: Any, first: Any, lanes: Any, here: Any, world: World, sizes: Sizes) -> None:
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
            wrench = read(workspace, lane, rows.wrench, (0.0, 0.0, 0.0))
            robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
            surface = surface_of(workspace, lane, world.floor, sizes)
            target, drive = driven_step(state, commands, wrench, h, robot, surface)
            room = workspace[rows.room * LANES + lane]
            end, room, went = step_within_room(world.obstacles, room, state, target, h, reach)
            write(workspace, lane, rows.state, end)
            _add_up(workspace, lane, rows.torques, each(_scaled, (share * went,), flatten(drive.torques)))
            workspace[power_at + lane] += share * went * drive.power
            workspace[traction_at + lane] = maximum(went * drive.asks.traction, workspace[traction_at + lane])
            workspace[lifted_at + lane] = maximum(went * drive.asks.lifted, workspace[lifted_at + lane])
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
    wrench = read(workspace, lane, rows.wrench, (0.0, 0.0, 0.0))
    robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
    surface = surface_of(workspace, lane, floor, sizes)
    state, drive, touch = guarded_driven_step(state, commands, wrench, h, robot, hull, obstacles, near, end, surface)
    write(workspace, lane, rows.state, pack_state(state))
    _add_up(workspace, lane, rows.torques, each(_scaled, (share,), flatten(drive.torques)))
    done = Record(*read(workspace, lane, rows.record, _RECORD))
    write(workspace, lane, rows.record, record_of(done, drive, touch, share)[:])
    note_slips(workspace, lane, 1.0, state, robot, floor, sizes)
    workspace[rows.room * LANES + lane] = clearance(state.position, state.heading, hull, obstacles, near, end)


@register_jitable(**INLINE)
def _read_point(workspace: Any, lane: Any, row: Any, index: Any) -> Any:
    return Point(*read(workspace, lane, row + POINT_ROWS * index, _POINT))


@register_jitable(**INLINE)
def _read_neighbour(workspace: Any, lane: Any, row: Any, index: Any) -> Any:
    return Neighbour(*read(workspace, lane, row + NEIGHBOUR_ROWS * index, _NOBODY[:]))


@register_jitable(**INLINE)
def _look(workspace: Any, first: Any, lanes: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    """Observe and evaluate robots whose reference has been fetched."""
    rows = rows_of(sizes)
    weights = weights_of(guide)
    for i in range(lanes):
        lane = first + i
        state = state_of(workspace, lane, floor, sizes)
        torques = read_pairs(workspace, lane, rows.torques, sizes.casters)
        record = Record(*read(workspace, lane, rows.record, _RECORD))
        reference = Reference(*read(workspace, lane, rows.reference, _REFERENCE))
        points = each(_read_point, (workspace, lane, rows.preview), counting(sizes.preview))
        situation = Situation(*read(workspace, lane, rows.situation, _SITUATION))
        nearest = each(_read_neighbour, (workspace, lane, rows.nearest), counting(sizes.nearest))
        robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
        errors, endings, terms = evaluate(state, reference, torques, record, situation, robot, weights)
        reported = report(state, reference, errors, record, situation, endings, robot)
        view = View(state, reference, errors, points, nearest, all_joint_rates(state, robot, floor), robot)
        write(workspace, lane, rows.observation, observe(view))
        slips = slips_of(workspace, lane, floor, sizes)
        write(workspace, lane, rows.report, flat_report(reported, as_many(terms, sizes.terms), torques, slips))


@register_jitable(**INLINE)
def _fetch(workspace: Any, lane: Any, robot: Any, world: World, sizes: Sizes) -> None:
    """Fetch what the robot is to do, and what is near it."""
    rows = rows_of(sizes)
    state = read_state(workspace, lane, 0, sizes.casters)
    clock, path = world.clocks[0, robot], world.clocks[1, robot]
    before = workspace[rows.progress * LANES + lane]
    progress, share = guide_robot(workspace, lane, rows.reference, state, clock, path, before, world.guide)
    workspace[rows.progress * LANES + lane] = progress
    for k in range(len(sizes.nearest)):
        write(workspace, lane, rows.nearest + NEIGHBOUR_ROWS * k, _NOBODY[:])
    gap = _look_around(workspace, lane, robot, state, world.obstacles, world, sizes)
    write(workspace, lane, rows.situation, (progress, share, gap))


@register_jitable(**INLINE)
def _insert(workspace: Any, lane: Any, row: Any, gap: Any, nx: Any, ny: Any, sizes: Sizes) -> None:
    """Put an obstacle among the nearest ones, which stay in order."""
    for k in range(len(sizes.nearest)):
        at = row + NEIGHBOUR_ROWS * k
        if gap < workspace[(at + NEIGHBOUR.gap) * LANES + lane]:
            nearer = gap, nx, ny
            gap, nx, ny = read(workspace, lane, at, nearer)
            write(workspace, lane, at, nearer)


@register_jitable(**INLINE)
def _step_lanes(
    first: Any, lanes: Any, look: Any, world: World, actions: Any, views: Views, workspace: Any, sizes: Sizes
) -> None:
    """One control period of the robots in the workspace, `first` the first; `look` observes all lanes."""
    rows = rows_of(sizes)
    here = min(lanes, len(actions) - first)
    row = rows.commands
    for j in range(2 * len(sizes.casters)):
        slot = world.slots[j]
        for lane in range(here if slot >= 0 else 0):
            workspace[(row + j) * LANES + lane] = clip(float(actions[first + lane, slot]), -1.0, 1.0)
    _drive(workspace, first, lanes, here, world, sizes)
    for lane in range(here):
        world.clocks[0, first + lane] += 1
        _fetch(workspace, lane, first + lane, world, sizes)
    look(workspace, world.guide, world.floor, sizes)
    deliver(workspace, 0, here, first, views, sizes)
    give_results(workspace, here, first, world, views, sizes)


@register_jitable(**INLINE)
def _look_at_all(workspace: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    _look(workspace, 0, LANES, guide, floor, sizes)


@register_jitable(**INLINE)
def _look_at_first(workspace: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    look_at_one(workspace, np.int64(0), guide, floor, sizes)  # a literal 0 would be compiled anew


def _look_at_one(workspace: Any, lane: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    _look(workspace, lane, 1, guide, floor, sizes)


@register_jitable(**INLINE)
def _take_parameters(block: Any, lane: Any, lanes: Any, workspace: Any, world: World, sizes: Sizes) -> None:
    """Put the parameters of a block's robots, of all lanes or one, on the workspace."""
    rows = rows_of(sizes)
    shared = len(world.parameters) == 1
    source = world.parameters[0 if shared else block]
    copy_rows(source, workspace, lane, lanes, rows.commands - rows.parameters, rows.parameters)


def _step_block(i: Any, world: World, actions: Any, views: Views, workspace: Any, sizes: Sizes) -> None:
    rows = rows_of(sizes)
    world, views, workspace = _borrowed_world(world), _borrowed_views(views), borrowed(workspace)
    copy_rows(world.blocks[i], workspace, 0, LANES, rows.parameters, 0)
    if len(world.parameters) > 1:
        _take_parameters(i, 0, LANES, workspace, world, sizes)
    _step_lanes(i * LANES, LANES, _look_at_all, world, actions, views, workspace, sizes)
    copy_rows(workspace, world.blocks[i], 0, LANES, rows.parameters, 0)


@register_jitable(**INLINE)
def _one_row(numbers: Any) -> Any:
    return borrowed(numbers).reshape((1, len(numbers)))


@register_jitable(**INLINE)
def _one_column(numbers: Any) -> Any:
    return borrowed(numbers).reshape((len(numbers), 1))


def _step_single(held: Any, action: Any, observation: Any, report: Any) -> bool:
    """One control period of a robot alone, in its workspace; False, and nothing else, if the action is no number."""
    for i in range(len(action)):
        if action[i] != action[i]:
            return False
    world, workspace, results, sizes = held.content
    world, workspace = _borrowed_world(world), borrowed(workspace)
    views = Views(_one_row(observation), _one_column(report), _one_column(results))
    _step_lanes(0, 1, _look_at_first, world, _one_row(action), views, workspace, sizes)
    return True


def _step_blocks(first: Any, end: Any, world: World, actions: Any, views: Views, sizes: Sizes) -> None:
    rows = rows_of(sizes)
    workspace = np.zeros(rows.end * LANES)  # of this thread; lanes without a robot hold numbers too
    _take_parameters(0, 0, LANES, workspace, _borrowed_world(world), sizes)  # for good, if all blocks share them
    for i in range(first, end):
        step_block(i, world, actions, views, workspace, sizes)


@register_jitable(**INLINE)
def _random_direction(key: Any, episode: Any, index: Any) -> Any:
    angle = 2.0 * math.pi * uniform(key, episode, np.uint64(4 + index))
    return math.cos(angle), math.sin(angle)


def _restart(selected: Any, wanted: Any, world: World, spread: Any, views: Views, workspace: Any, sizes: Sizes) -> None:
    """Start new episodes of the selected robots; wanted: path of each, −1 draws one; spread: greatest offset, turn."""
    rows = rows_of(sizes)
    world, views, workspace = _borrowed_world(world), _borrowed_views(views), borrowed(workspace)
    for i in range(len(selected)):
        robot = selected[i]
        block, lane = world.blocks[robot // LANES], robot % LANES
        copy_rows(block, workspace, lane, 1, rows.parameters, 0)
        _take_parameters(robot // LANES, lane, 1, workspace, world, sizes)
        key, episode = world.seeds[0, robot], world.seeds[1, robot]
        world.seeds[1, robot] = episode + np.uint64(1)
        world.clocks[0, robot] = 0
        drawn = int(uniform(key, episode, np.uint64(0)) * len(world.guide.spans))
        world.clocks[1, robot] = drawn if wanted[i] < 0 else wanted[i]
        x = (2.0 * uniform(key, episode, np.uint64(1)) - 1.0) * spread[0]
        y = (2.0 * uniform(key, episode, np.uint64(2)) - 1.0) * spread[0]
        turn = (2.0 * uniform(key, episode, np.uint64(3)) - 1.0) * spread[1]
        directions = each(_random_direction, (key, episode), counting(sizes.casters))
        nowhere = State((0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), directions, (), ())
        path = world.clocks[1, robot]
        guide_robot(workspace, lane, rows.reference, nowhere, 0, path, -1.0, world.guide)
        reference = Reference(*read(workspace, lane, rows.reference, _REFERENCE))
        state = start(reference, (x, y), (math.cos(turn), math.sin(turn)), directions)
        write(workspace, lane, 0, begun(workspace, lane, state, world.floor, sizes))
        for row in range(rows.room, rows.progress):
            workspace[row * LANES + lane] = 0.0
        workspace[rows.progress * LANES + lane] = -1.0
        for row in range(rows.commands, rows.reference):
            workspace[row * LANES + lane] = 0.0
        _fetch(workspace, lane, robot, world, sizes)
        copy_rows(workspace, block, lane, 1, rows.parameters, 0)
        look_at_one(workspace, lane, world.guide, world.floor, sizes)
        deliver(workspace, lane, 1, robot, views, sizes)


careful_step = compiled(_careful_step)
look_at_one = compiled(_look_at_one)
step_block = compiled(_step_block)
step_single = compiled(_step_single, compilation.of_single_step)
step_blocks = compiled(_step_blocks, compilation.of_batch_step)
restart = compiled(_restart, compilation.of_restart)
