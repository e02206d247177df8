"""The compiled step of every task: the loops over the robots of a block, see `caster_gym.envs.native.layout`.

Blocks are what is kept of the robots; a workspace is where one after the other is worked out.
"""

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed, compiled, teach
from caster_gym.engines.native.lanes import LANES, counting, read_pairs, read_robot, read_state, write
from caster_gym.envs import randomness
from caster_gym.envs.native import compilation
from caster_gym.envs.native.drive import begun, drive, neighbourhood, slips_of, state_of
from caster_gym.envs.native.layout import (
    CLOCKS,
    NO_NEIGHBOUR,
    SEEDS,
    Sizes,
    Views,
    World,
    as_many,
    borrowed_views,
    borrowed_world,
    copy_rows,
    read_neighbour,
    read_neighbours,
    read_points,
    read_record,
    read_reference,
    read_situation,
    rows_of,
    write_neighbour,
    write_situation,
)
from caster_gym.envs.native.reference import evaluate, fetch_reference, weights_of
from caster_gym.envs.observation import Neighbour, View, observe
from caster_gym.envs.plan import SPAN
from caster_gym.envs.randomness import uniform
from caster_gym.envs.report import REPORT, RESULT, Situation, flat_report
from caster_gym.envs.tracking import report, start
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import clip, each
from caster_gym.mechanics.separation import separation

teach(randomness)


@register_jitable(**INLINE)
def _look_around(workspace: Any, lane: Any, robot: Any, state: Any, obstacles: Any, world: World, sizes: Sizes) -> Any:
    """Write the nearest obstacles; returns the gap to the nearest one. [m]"""
    gap = math.inf
    if obstacles is None:
        return gap
    near, end = neighbourhood(robot, world)
    for k in range(near, end):
        apart = separation(state.position, state.heading, world.hull, obstacles, k)
        gap = min(apart.gap, gap)
        _insert(workspace, lane, Neighbour(apart.gap, apart.nx, apart.ny), sizes)
    return gap


@register_jitable(**INLINE)
def look(workspace: Any, first: Any, lanes: Any, source: Any, floor: Any, sizes: Sizes) -> None:
    """Evaluate, observe and report robots whose reference has been fetched, in one loop, which makes it fast."""
    rows = rows_of(sizes)
    weights = weights_of(source)
    for i in range(lanes):
        lane = first + i
        state = state_of(workspace, lane, floor, sizes)
        torques = read_pairs(workspace, lane, rows.torques, sizes.casters)
        record = read_record(workspace, lane, sizes)
        reference, points = read_reference(workspace, lane, sizes), read_points(workspace, lane, sizes)
        situation, nearest = read_situation(workspace, lane, sizes), read_neighbours(workspace, lane, sizes)
        robot = read_robot(workspace, lane, rows.parameters, sizes.casters)
        errors, endings, terms = evaluate(state, reference, torques, record, situation, robot, weights)
        view = View(state, reference, errors, points, nearest, all_joint_rates(state, robot, floor), robot)
        write(workspace, lane, rows.observation, observe(view))
        reported = report(state, reference, errors, record, situation, endings, robot)
        slips = slips_of(workspace, lane, floor, sizes)
        write(workspace, lane, rows.report, flat_report(reported, as_many(terms, sizes.terms), torques, slips))


@register_jitable(**INLINE)
def fetch(workspace: Any, lane: Any, robot: Any, world: World, sizes: Sizes) -> None:
    """Fetch what the robot is to do, and what is near it."""
    rows = rows_of(sizes)
    state = read_state(workspace, lane, rows.state, sizes.casters)
    clock, path = world.clocks[CLOCKS.done, robot], world.clocks[CLOCKS.path, robot]
    before = workspace[rows.progress * LANES + lane]
    progress, share = fetch_reference(workspace, lane, rows.reference, state, clock, path, before, world.source)
    workspace[rows.progress * LANES + lane] = progress
    for k in range(len(sizes.nearest)):
        write_neighbour(workspace, lane, sizes, k, NO_NEIGHBOUR)
    gap = _look_around(workspace, lane, robot, state, world.obstacles, world, sizes)
    write_situation(workspace, lane, Situation(progress, share, gap), sizes)


@register_jitable(**INLINE)
def _insert(workspace: Any, lane: Any, obstacle: Neighbour, sizes: Sizes) -> None:
    """Put an obstacle among the nearest ones, which stay in order."""
    for k in range(len(sizes.nearest)):
        there = read_neighbour(workspace, lane, sizes, k)
        if obstacle.gap < there.gap:
            write_neighbour(workspace, lane, sizes, k, obstacle)
            obstacle = there


@register_jitable(**INLINE)
def deliver(workspace: Any, lane: Any, count: Any, robot: Any, views: Views, sizes: Sizes) -> None:
    """Copy observations and reports of so many robots, from a lane and a robot on, to where Python reads them."""
    row = rows_of(sizes).observation
    for i in range(count):
        for j in range(views.observations.shape[1]):
            views.observations[robot + i, j] = workspace[(row + j) * LANES + lane + i]
    row = rows_of(sizes).report
    for j in range(views.reports.shape[0]):
        for i in range(count):
            views.reports[j, robot + i] = workspace[(row + j) * LANES + lane + i]
    sin, cos = REPORT.deviation.heading_sin, REPORT.deviation.heading_cos
    for i in range(robot, robot + count):
        views.reports[sin, i] = math.atan2(views.reports[sin, i], views.reports[cos, i])


@register_jitable(**INLINE)
def give_results(workspace: Any, here: Any, robot: Any, world: World, views: Views, sizes: Sizes) -> None:
    """Rewards, and which episodes have ended, of so many robots, from a robot on."""
    rows = rows_of(sizes)
    for i in range(here):
        reward, failed = 0.0, 0.0
        for row in range(rows.terms, rows.motors):
            reward += workspace[row * LANES + i]
        for row in REPORT.endings:
            failed += workspace[(rows.report + row) * LANES + i]
        views.results[RESULT.reward, robot + i] = reward
        views.results[RESULT.failed, robot + i] = failed
    for i in range(robot, robot + here):
        periods = world.source.spans[world.clocks[CLOCKS.path, i], SPAN.periods]
        views.results[RESULT.late, i] = 1.0 if world.clocks[CLOCKS.done, i] >= periods else 0.0


@register_jitable(**INLINE)
def _step_lanes(
    first: Any, lanes: Any, look_at: Any, world: World, actions: Any, views: Views, workspace: Any, sizes: Sizes
) -> None:
    """One control period of the robots in the workspace, `first` the first; `look_at` evaluates all lanes."""
    rows = rows_of(sizes)
    here = min(lanes, len(actions) - first)
    row = rows.commands
    for j in range(2 * len(sizes.casters)):
        slot = world.slots[j]
        for lane in range(here if slot >= 0 else 0):
            workspace[(row + j) * LANES + lane] = clip(float(actions[first + lane, slot]), -1.0, 1.0)
    drive(workspace, first, lanes, here, world, sizes)
    for lane in range(here):
        world.clocks[CLOCKS.done, first + lane] += 1
        fetch(workspace, lane, first + lane, world, sizes)
    look_at(workspace, world.source, world.floor, sizes)
    deliver(workspace, 0, here, first, views, sizes)
    give_results(workspace, here, first, world, views, sizes)


@register_jitable(**INLINE)
def _look_at_all(workspace: Any, source: Any, floor: Any, sizes: Sizes) -> None:
    look(workspace, 0, LANES, source, floor, sizes)


@register_jitable(**INLINE)
def _look_at_first(workspace: Any, source: Any, floor: Any, sizes: Sizes) -> None:
    look_at_one(workspace, np.int64(0), source, floor, sizes)  # a literal 0 would be compiled anew


def _look_at_one(workspace: Any, lane: Any, source: Any, floor: Any, sizes: Sizes) -> None:
    look(workspace, lane, 1, source, floor, sizes)


@register_jitable(**INLINE)
def _take_parameters(block: Any, lane: Any, lanes: Any, workspace: Any, world: World, sizes: Sizes) -> None:
    """Put the parameters of a block's robots, of all lanes or one, on the workspace."""
    rows = rows_of(sizes)
    shared = len(world.parameters) == 1
    parameters = world.parameters[0 if shared else block]
    copy_rows(parameters, workspace, lane, lanes, rows.commands - rows.parameters, rows.parameters)


def _step_block(i: Any, world: World, actions: Any, views: Views, workspace: Any, sizes: Sizes) -> None:
    rows = rows_of(sizes)
    world, views, workspace = borrowed_world(world), borrowed_views(views), borrowed(workspace)
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
    world, workspace = borrowed_world(world), borrowed(workspace)
    views = Views(_one_row(observation), _one_column(report), _one_column(results))
    _step_lanes(0, 1, _look_at_first, world, _one_row(action), views, workspace, sizes)
    return True


def _step_blocks(first: Any, end: Any, world: World, actions: Any, views: Views, sizes: Sizes) -> None:
    rows = rows_of(sizes)
    workspace = np.zeros(rows.end * LANES)  # of this thread; lanes without a robot hold numbers too
    _take_parameters(0, 0, LANES, workspace, borrowed_world(world), sizes)  # for good, if all blocks share them
    for i in range(first, end):
        step_block(i, world, actions, views, workspace, sizes)


@register_jitable(**INLINE)
def _random_direction(key: Any, episode: Any, index: Any) -> Any:
    angle = 2.0 * math.pi * uniform(key, episode, np.uint64(4 + index))
    return math.cos(angle), math.sin(angle)


def _restart(selected: Any, wanted: Any, world: World, spread: Any, views: Views, workspace: Any, sizes: Sizes) -> None:
    """Start new episodes of the selected robots; wanted: path of each, −1 draws one; spread: greatest offset, turn."""
    rows = rows_of(sizes)
    world, views, workspace = borrowed_world(world), borrowed_views(views), borrowed(workspace)
    for i in range(len(selected)):
        robot = selected[i]
        block, lane = world.blocks[robot // LANES], robot % LANES
        copy_rows(block, workspace, lane, 1, rows.parameters, 0)
        _take_parameters(robot // LANES, lane, 1, workspace, world, sizes)
        key, episode = world.seeds[SEEDS.key, robot], world.seeds[SEEDS.episode, robot]
        world.seeds[SEEDS.episode, robot] = episode + np.uint64(1)
        world.clocks[CLOCKS.done, robot] = 0
        drawn = int(uniform(key, episode, np.uint64(0)) * len(world.source.spans))
        path = drawn if wanted[i] < 0 else wanted[i]
        world.clocks[CLOCKS.path, robot] = path
        x = (2.0 * uniform(key, episode, np.uint64(1)) - 1.0) * spread[0]
        y = (2.0 * uniform(key, episode, np.uint64(2)) - 1.0) * spread[0]
        turn = (2.0 * uniform(key, episode, np.uint64(3)) - 1.0) * spread[1]
        directions = each(_random_direction, (key, episode), counting(sizes.casters))
        nowhere = State((0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), directions, (), ())
        fetch_reference(workspace, lane, rows.reference, nowhere, 0, path, -1.0, world.source)
        reference = read_reference(workspace, lane, sizes)
        state = start(reference, (x, y), (math.cos(turn), math.sin(turn)), directions)
        write(workspace, lane, rows.state, begun(workspace, lane, state, world.floor, sizes))
        for row in range(rows.room, rows.progress):
            workspace[row * LANES + lane] = 0.0
        workspace[rows.progress * LANES + lane] = -1.0
        for row in range(rows.commands, rows.reference):
            workspace[row * LANES + lane] = 0.0
        fetch(workspace, lane, robot, world, sizes)
        copy_rows(workspace, block, lane, 1, rows.parameters, 0)
        look_at_one(workspace, lane, world.source, world.floor, sizes)
        deliver(workspace, lane, 1, robot, views, sizes)


look_at_one = compiled(_look_at_one)
step_block = compiled(_step_block)
step_single = compiled(_step_single, compilation.of_single_step)
step_blocks = compiled(_step_blocks, compilation.of_batch_step)
restart = compiled(_restart, compilation.of_restart)
