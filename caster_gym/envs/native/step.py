"""The compiled step of every task: the loops over the robots of a block, see `caster_gym.envs.native.layout`.

Blocks are what is kept of the robots; a desk is where one after the other is worked out.
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
from caster_gym.envs.native.layout import (
    NEIGHBOUR_ROWS,
    RECORD_ROWS,
    SITUATION_ROWS,
    Sizes,
    Views,
    World,
    command_row,
    desk_rows,
    nearest_row,
    observation_row,
    parameter_row,
    parameter_rows,
    progress_row,
    record_row,
    reference_row,
    report_row,
    room_row,
    situation_row,
    torque_row,
    wrench_row,
)
from caster_gym.envs.native.reference import POINT_ROWS, REFERENCE_ROWS, borrowed_guide, guide_robot, judge, weights_of
from caster_gym.envs.native.slipping import begun, feel_floor, note_slips, slips_of, state_of, surface_of
from caster_gym.envs.randomness import uniform
from caster_gym.envs.tracking import (
    ASKS,
    GAP_LIMIT,
    Record,
    Reference,
    Situation,
    flat_report,
    observe,
    record_of,
    report,
    start,
)
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.plant import driven_step, guarded_driven_step
from caster_gym.mechanics.room import should_measure, step_within_room
from caster_gym.mechanics.scalars import add, clip, each, flatten, maximum
from caster_gym.mechanics.separation import Hull, Obstacles, clearance, separation

_REFERENCE = (0.0,) * REFERENCE_ROWS
_POINT = (0.0,) * POINT_ROWS
_RECORD = (0.0,) * RECORD_ROWS
_SITUATION = (0.0,) * SITUATION_ROWS
_NEIGHBOUR = (0.0,) * NEIGHBOUR_ROWS

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
def _neighbourhood(robot: Any, world: World) -> Any:
    """First and end of the obstacles that a robot may meet."""
    path = world.clocks[1, robot]
    return world.arenas[path, 0], world.arenas[path, 1]


@register_jitable(**INLINE)
def _measure(desk: Any, first: Any, here: Any, obstacles: Any, world: World, sizes: Sizes) -> None:
    """Measure the room of robots that may soon need to know it."""
    if obstacles is None:
        return
    row = room_row(sizes)
    for lane in range(here):
        state = read_state(desk, lane, 0, sizes.casters)
        if should_measure(desk[row * LANES + lane], state.twist, world.time_step, world.hull.reach):
            near, end = _neighbourhood(first + lane, world)
            gap = clearance(state.position, state.heading, world.hull, obstacles, near, end)
            desk[row * LANES + lane] = gap


@register_jitable(**INLINE)
def _take_care(desk: Any, first: Any, here: Any, share: Any, obstacles: Any, world: World, sizes: Sizes) -> None:
    """Step the robots that may touch something."""
    if obstacles is None:
        return
    for lane in range(here):
        if desk[room_row(sizes) * LANES + lane] < 0.0:
            near, end = _neighbourhood(first + lane, world)
            careful_step(desk, lane, share, near, end, world.hull, obstacles, world.floor, world.time_step, sizes)


@register_jitable(**INLINE)
def _look_around(desk: Any, lane: Any, robot: Any, state: Any, obstacles: Any, world: World, sizes: Sizes) -> Any:
    """Write the nearest obstacles; returns the gap to the nearest one. [m]"""
    gap = math.inf
    if obstacles is None:
        return gap
    near, end = _neighbourhood(robot, world)
    for k in range(near, end):
        apart = separation(state.position, state.heading, world.hull, obstacles, k)
        gap = min(apart.gap, gap)
        _insert(desk, lane, nearest_row(sizes), apart.gap, apart.nx, apart.ny, sizes)
    return gap


@register_jitable(**INLINE)
def _drive(desk: Any, first: Any, lanes: Any, here: Any, world: World, sizes: Sizes) -> None:
    """Let robots, the first of the batch's in this block being `first`, move for a control period."""
    rows, room_at, h, reach = torque_row(sizes), room_row(sizes), world.time_step, reach_of(world.hull)
    share, asks_row = 1.0 / world.substeps, record_row(sizes) + ASKS
    for row in range(rows, reference_row(sizes)):
        for lane in range(lanes):
            desk[row * LANES + lane] = 0.0
    for _ in range(world.substeps):
        _measure(desk, first, here, world.obstacles, world, sizes)
        feel_floor(desk, lanes, world.floor, sizes)
        for lane in range(lanes):
            state = state_of(desk, lane, world.floor, sizes)
            commands = read_pairs(desk, lane, command_row(sizes), sizes.casters)
            wrench = read(desk, lane, wrench_row(sizes), (0.0, 0.0, 0.0))
            robot = read_robot(desk, lane, parameter_row(sizes), sizes.casters)
            surface = surface_of(desk, lane, world.floor, sizes)
            target, drive = driven_step(state, commands, wrench, h, robot, surface)
            room = desk[room_at * LANES + lane]
            end, room, went = step_within_room(world.obstacles, room, state, target, h, reach)
            mean = each(_scaled, (share * went,), (*flatten(drive.torques), drive.power))
            write(desk, lane, 0, end)
            write(desk, lane, rows, add(read(desk, lane, rows, mean), mean))
            asked = went * drive.asks.traction, went * drive.asks.lifted
            write(desk, lane, asks_row, each(maximum, (), asked, read(desk, lane, asks_row, asked)))
            note_slips(desk, lane, went, target, robot, world.floor, sizes)
            desk[room_at * LANES + lane] = room
        _take_care(desk, first, here, share, world.obstacles, world, sizes)


def _careful_step(
    desk: Any,
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
    hull, obstacles = borrowed_hull(hull), borrowed_obstacles(obstacles)
    state = state_of(desk, lane, floor, sizes)
    commands = read_pairs(desk, lane, command_row(sizes), sizes.casters)
    wrench = read(desk, lane, wrench_row(sizes), (0.0, 0.0, 0.0))
    robot = read_robot(desk, lane, parameter_row(sizes), sizes.casters)
    surface = surface_of(desk, lane, floor, sizes)
    state, drive, touch = guarded_driven_step(state, commands, wrench, h, robot, hull, obstacles, near, end, surface)
    mean = each(_scaled, (share,), flatten(drive.torques))
    write(desk, lane, 0, pack_state(state))
    rows = torque_row(sizes)
    write(desk, lane, rows, add(read(desk, lane, rows, mean), mean))
    done = Record(*read(desk, lane, record_row(sizes), _RECORD))
    write(desk, lane, record_row(sizes), record_of(done, drive, touch, share)[:])
    note_slips(desk, lane, 1.0, state, robot, floor, sizes)
    desk[room_row(sizes) * LANES + lane] = clearance(state.position, state.heading, hull, obstacles, near, end)


@register_jitable(**INLINE)
def _read_point(desk: Any, lane: Any, row: Any, index: Any) -> Any:
    return read(desk, lane, row + POINT_ROWS * index, _POINT)


@register_jitable(**INLINE)
def _read_neighbour(desk: Any, lane: Any, row: Any, index: Any) -> Any:
    return read(desk, lane, row + NEIGHBOUR_ROWS * index, _NEIGHBOUR)


@register_jitable(**INLINE)
def _look(desk: Any, first: Any, lanes: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    """Observe and score robots whose reference has been fetched."""
    weights = weights_of(guide)
    for i in range(lanes):
        lane = first + i
        state = state_of(desk, lane, floor, sizes)
        torques = read_pairs(desk, lane, torque_row(sizes), sizes.casters)
        record = Record(*read(desk, lane, record_row(sizes), _RECORD))
        reference = Reference(*read(desk, lane, reference_row(sizes), _REFERENCE))
        points = each(_read_point, (desk, lane, reference_row(sizes) + REFERENCE_ROWS), counting(sizes.preview))
        situation = Situation(*read(desk, lane, situation_row(sizes), _SITUATION))
        nearest = each(_read_neighbour, (desk, lane, nearest_row(sizes)), counting(sizes.nearest))
        robot = read_robot(desk, lane, parameter_row(sizes), sizes.casters)
        errors, ended, terms = judge(state, reference, torques, record, situation, robot, weights)
        told = report(state, reference, errors, record, situation, ended, terms, robot)
        rates = all_joint_rates(state, robot, floor)
        write(desk, lane, observation_row(sizes), observe(state, reference, errors, points, nearest, rates, robot))
        write(desk, lane, report_row(sizes), flat_report(told, torques, slips_of(desk, lane, floor, sizes)))


@register_jitable(**INLINE)
def _fetch(desk: Any, lane: Any, robot: Any, world: World, sizes: Sizes) -> None:
    """Fetch what the robot is to do, and what is near it."""
    state = read_state(desk, lane, 0, sizes.casters)
    clock, path = world.clocks[0, robot], world.clocks[1, robot]
    before = desk[progress_row(sizes) * LANES + lane]
    progress, share = guide_robot(desk, lane, reference_row(sizes), state, clock, path, before, world.guide)
    desk[progress_row(sizes) * LANES + lane] = progress
    row = nearest_row(sizes)
    for k in range(len(sizes.nearest)):
        desk[(row + NEIGHBOUR_ROWS * k) * LANES + lane] = GAP_LIMIT
        desk[(row + NEIGHBOUR_ROWS * k + 1) * LANES + lane] = 0.0
        desk[(row + NEIGHBOUR_ROWS * k + 2) * LANES + lane] = 0.0
    gap = _look_around(desk, lane, robot, state, world.obstacles, world, sizes)
    write(desk, lane, situation_row(sizes), (progress, share, gap))


@register_jitable(**INLINE)
def _insert(desk: Any, lane: Any, row: Any, gap: Any, nx: Any, ny: Any, sizes: Sizes) -> None:
    """Put an obstacle among the nearest ones, which stay in order."""
    for k in range(len(sizes.nearest)):
        at = (row + NEIGHBOUR_ROWS * k) * LANES + lane
        if gap < desk[at]:
            gap, desk[at] = desk[at], gap
            nx, desk[at + LANES] = desk[at + LANES], nx
            ny, desk[at + 2 * LANES] = desk[at + 2 * LANES], ny


@register_jitable(**INLINE)
def _step_lanes(
    first: Any, lanes: Any, look: Any, world: World, actions: Any, views: Views, desk: Any, sizes: Sizes
) -> None:
    """One control period of the robots on the desk, `first` the first; `look` observes as many as there are lanes."""
    here = min(lanes, len(actions) - first)
    row = command_row(sizes)
    for j in range(2 * len(sizes.casters)):
        slot = world.slots[j]
        for lane in range(here if slot >= 0 else 0):
            desk[(row + j) * LANES + lane] = clip(float(actions[first + lane, slot]), -1.0, 1.0)
    _drive(desk, first, lanes, here, world, sizes)
    for lane in range(here):
        world.clocks[0, first + lane] += 1
        _fetch(desk, lane, first + lane, world, sizes)
    look(desk, world.guide, world.floor, sizes)
    deliver(desk, 0, here, first, views, sizes)
    give_results(desk, here, first, world, views, sizes)


@register_jitable(**INLINE)
def _look_at_all(desk: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    _look(desk, 0, LANES, guide, floor, sizes)


@register_jitable(**INLINE)
def _look_at_first(desk: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    look_at_one(desk, np.int64(0), guide, floor, sizes)  # a literal 0 would be compiled anew


def _look_at_one(desk: Any, lane: Any, guide: Any, floor: Any, sizes: Sizes) -> None:
    _look(desk, lane, 1, guide, floor, sizes)


@register_jitable(**INLINE)
def _take_parameters(block: Any, lane: Any, lanes: Any, desk: Any, world: World, sizes: Sizes) -> None:
    """Put the parameters of a block's robots, of all lanes or one, on the desk."""
    shared = len(world.parameters) == 1
    source = world.parameters[0 if shared else block]
    copy_rows(source, desk, lane, lanes, parameter_rows(sizes), parameter_row(sizes))


def _step_block(i: Any, world: World, actions: Any, views: Views, desk: Any, sizes: Sizes) -> None:
    world, views, desk = _borrowed_world(world), _borrowed_views(views), borrowed(desk)
    copy_rows(world.blocks[i], desk, 0, LANES, parameter_row(sizes), 0)
    if len(world.parameters) > 1:
        _take_parameters(i, 0, LANES, desk, world, sizes)
    _step_lanes(i * LANES, LANES, _look_at_all, world, actions, views, desk, sizes)
    copy_rows(desk, world.blocks[i], 0, LANES, parameter_row(sizes), 0)


@register_jitable(**INLINE)
def _one_row(numbers: Any) -> Any:
    return borrowed(numbers).reshape((1, len(numbers)))


@register_jitable(**INLINE)
def _one_column(numbers: Any) -> Any:
    return borrowed(numbers).reshape((len(numbers), 1))


def _step_single(held: Any, action: Any, observation: Any, report: Any) -> bool:
    """One control period of a robot that lives on its desk; if the action is not a number, False and nothing else."""
    for i in range(len(action)):
        if action[i] != action[i]:
            return False
    world, desk, results, sizes = held.content
    world, desk = _borrowed_world(world), borrowed(desk)
    views = Views(_one_row(observation), _one_column(report), _one_column(results))
    _step_lanes(0, 1, _look_at_first, world, _one_row(action), views, desk, sizes)
    return True


def _step_blocks(first: Any, end: Any, world: World, actions: Any, views: Views, sizes: Sizes) -> None:
    desk = np.zeros(desk_rows(sizes) * LANES)  # of this thread; lanes without a robot hold numbers too
    _take_parameters(0, 0, LANES, desk, _borrowed_world(world), sizes)  # for good, if all blocks share them
    for i in range(first, end):
        step_block(i, world, actions, views, desk, sizes)


@register_jitable(**INLINE)
def _random_direction(key: Any, episode: Any, index: Any) -> Any:
    angle = 2.0 * math.pi * uniform(key, episode, np.uint64(4 + index))
    return math.cos(angle), math.sin(angle)


def _restart(selected: Any, wanted: Any, world: World, spread: Any, views: Views, desk: Any, sizes: Sizes) -> None:
    """Start new episodes of the selected robots; wanted: path of each, −1 draws one; spread: greatest offset, turn."""
    world, views, desk = _borrowed_world(world), _borrowed_views(views), borrowed(desk)
    for i in range(len(selected)):
        robot = selected[i]
        block, lane = world.blocks[robot // LANES], robot % LANES
        copy_rows(block, desk, lane, 1, parameter_row(sizes), 0)
        _take_parameters(robot // LANES, lane, 1, desk, world, sizes)
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
        guide_robot(desk, lane, reference_row(sizes), nowhere, 0, path, -1.0, world.guide)
        reference = Reference(*read(desk, lane, reference_row(sizes), _REFERENCE))
        state = start(reference, (x, y), (math.cos(turn), math.sin(turn)), directions)
        write(desk, lane, 0, begun(desk, lane, state, world.floor, sizes))
        for row in range(room_row(sizes), progress_row(sizes)):
            desk[row * LANES + lane] = 0.0
        desk[progress_row(sizes) * LANES + lane] = -1.0
        for row in range(command_row(sizes), reference_row(sizes)):
            desk[row * LANES + lane] = 0.0
        _fetch(desk, lane, robot, world, sizes)
        copy_rows(desk, block, lane, 1, parameter_row(sizes), 0)
        look_at_one(desk, lane, world.guide, world.floor, sizes)
        deliver(desk, lane, 1, robot, views, sizes)


careful_step = compiled(_careful_step)
look_at_one = compiled(_look_at_one)
step_block = compiled(_step_block)
step_single = compiled(_step_single, compilation.of_single_step)
step_blocks = compiled(_step_blocks, compilation.of_batch_step)
restart = compiled(_restart, compilation.of_restart)
