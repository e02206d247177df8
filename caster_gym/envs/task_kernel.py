"""The compiled step of the tracking task: how its quantities lie in a block, and the loops over the block's robots.

Rows of a block: state, motor commands, mean motor torques, mean power, reference, preview, observation, report,
weights, robot parameters. `casters` and `preview` are any tuples with an item per caster and per previewed point:
their lengths are part of their types, so that all rows are constants of the compiled code.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from caster_gym.engines.lanes import BODY_ROWS, LANES, counting, read, read_pairs, read_robot, read_state, write
from caster_gym.engines.numba_compiler import INLINE, compiled, teach
from caster_gym.envs import randomness, tracking
from caster_gym.envs.randomness import uniform
from caster_gym.envs.tracking import (
    Reference,
    Weights,
    flat_report,
    observe,
    score,
    start,
    tracking_errors,
)
from caster_gym.mechanics.integration import pack_state
from caster_gym.mechanics.plant import driven_step
from caster_gym.mechanics.scalars import add, each, flatten

REFERENCE_ROWS = len(Reference._fields)
POINT_ROWS = 7
WEIGHT_ROWS = len(Weights._fields)
FIXED_REPORT_ROWS = 21
HEADING_SIN, HEADING_COS, FIRST_TERM, TERMS = 3, 4, 8, 5

_REFERENCE = (0.0,) * REFERENCE_ROWS
_POINT = (0.0,) * POINT_ROWS
_WEIGHTS = (0.0,) * WEIGHT_ROWS

teach(tracking)
teach(randomness)


class World(NamedTuple):
    """What a batch keeps from step to step."""

    blocks: Any  # float64 (blocks, rows · LANES)
    clocks: Any  # int64 (2, robots): control periods done, path
    seeds: Any  # uint64 (2, robots): key, episode
    slots: Any  # int64 (2 N,): which action drives each motor, −1 for none
    samples: Any  # float64 (rows of all paths, 10)
    spans: Any  # int64 (paths, 3): first and last row, control periods of an episode
    horizons: Any  # int64 (previewed points,): control periods ahead
    substeps: Any
    time_step: Any  # [s]


class Views(NamedTuple):
    """Where compiled code leaves what Python reads."""

    observations: Any  # float32 (robots, size)
    reports: Any  # float64 (quantities, robots)
    results: Any  # float64 (3, robots): reward, terminated, truncated


@register_jitable(**INLINE)
def command_row(casters: Any) -> int:
    """First row of the motor commands; those of the mean motor torques and of the power follow."""
    return BODY_ROWS + 2 * len(casters)


@register_jitable(**INLINE)
def torque_row(casters: Any) -> int:
    """First row of the mean motor torques [N m], with the mean power [W] behind them."""
    return command_row(casters) + 2 * len(casters)


@register_jitable(**INLINE)
def reference_row(casters: Any) -> int:
    """First row of the reference, with the previewed points behind it."""
    return torque_row(casters) + 2 * len(casters) + 1


@register_jitable(**INLINE)
def observation_row(casters: Any, preview: Any) -> int:
    """First row of the observation."""
    return reference_row(casters) + REFERENCE_ROWS + POINT_ROWS * len(preview)


@register_jitable(**INLINE)
def report_row(casters: Any, preview: Any) -> int:
    """First row of the report."""
    return observation_row(casters, preview) + 13 + 4 * len(casters) + POINT_ROWS * len(preview)


@register_jitable(**INLINE)
def weight_row(casters: Any, preview: Any) -> int:
    """First row of the reward's weights."""
    return report_row(casters, preview) + FIXED_REPORT_ROWS + 2 * len(casters)


@register_jitable(**INLINE)
def parameter_row(casters: Any, preview: Any) -> int:
    """First row of the robot's parameters, the last ones."""
    return weight_row(casters, preview) + WEIGHT_ROWS


@register_jitable(**INLINE)
def _scaled(factor: Any, number: Any) -> Any:
    return factor * number


@register_jitable(**INLINE)
def _drive(block: Any, lanes: Any, substeps: Any, h: Any, casters: Any, preview: Any) -> None:
    """Let the robots move for a control period under their commands."""
    rows = torque_row(casters)
    share = 1.0 / substeps
    for row in range(rows, reference_row(casters)):
        for lane in range(lanes):
            block[row * LANES + lane] = 0.0
    for _ in range(substeps):
        for lane in range(lanes):
            state = read_state(block, lane, 0, casters)
            commands = read_pairs(block, lane, command_row(casters), casters)
            robot = read_robot(block, lane, parameter_row(casters, preview), casters)
            state, drive = driven_step(state, commands, (0.0, 0.0, 0.0), h, robot)
            mean = each(_scaled, (share,), (*flatten(drive.torques), drive.power))
            write(block, lane, 0, pack_state(state))
            write(block, lane, rows, add(read(block, lane, rows, mean), mean))


@register_jitable(**INLINE)
def _read_point(block: Any, lane: Any, row: Any, index: Any) -> Any:
    return read(block, lane, row + POINT_ROWS * index, _POINT)


@register_jitable(**INLINE)
def _look(block: Any, first: Any, lanes: Any, casters: Any, preview: Any) -> None:
    """Observe and score robots whose reference has been fetched."""
    for i in range(lanes):
        lane = first + i
        state = read_state(block, lane, 0, casters)
        torques = read_pairs(block, lane, torque_row(casters), casters)
        (power,) = read(block, lane, torque_row(casters) + 2 * len(casters), (0.0,))
        reference = Reference(*read(block, lane, reference_row(casters), _REFERENCE))
        points = each(_read_point, (block, lane, reference_row(casters) + REFERENCE_ROWS), counting(preview))
        weights = Weights(*read(block, lane, weight_row(casters, preview), _WEIGHTS))
        robot = read_robot(block, lane, parameter_row(casters, preview), casters)
        errors = tracking_errors(state, reference)
        observation = observe(state, reference, errors, points, robot)
        report = score(state, reference, errors, torques, power, weights, robot)
        write(block, lane, observation_row(casters, preview), observation)
        write(block, lane, report_row(casters, preview), flat_report(report, torques))


@register_jitable(**INLINE)
def _fetch(block: Any, lane: Any, robot: Any, world: World, casters: Any) -> None:
    """Copy a robot's reference and previewed points from the table of all paths; the last row of a path stays."""
    clock, path = world.clocks[0, robot], world.clocks[1, robot]
    row = reference_row(casters)
    base, end = world.spans[path, 0], world.spans[path, 1]
    now = min(base + clock, end)
    for j in range(REFERENCE_ROWS):
        block[(row + j) * LANES + lane] = world.samples[now, j]
    row += REFERENCE_ROWS
    for p in range(len(world.horizons)):
        then = min(base + clock + world.horizons[p], end)
        for j in range(POINT_ROWS):
            block[(row + p * POINT_ROWS + j) * LANES + lane] = world.samples[then, j]


@register_jitable(**INLINE)
def _deliver(block: Any, lane: Any, robot: Any, views: Views, casters: Any, preview: Any) -> None:
    """Copy a robot's observation and report to where Python reads them."""
    row = observation_row(casters, preview)
    for j in range(views.observations.shape[1]):
        views.observations[robot, j] = block[(row + j) * LANES + lane]
    row = report_row(casters, preview)
    for j in range(views.reports.shape[0]):
        views.reports[j, robot] = block[(row + j) * LANES + lane]
    sin, cos = views.reports[HEADING_SIN, robot], views.reports[HEADING_COS, robot]
    views.reports[HEADING_SIN, robot] = math.atan2(sin, cos)


@register_jitable(**INLINE)
def _step_lanes(
    i: Any, lanes: Any, look: Any, world: World, actions: Any, views: Views, casters: Any, preview: Any
) -> None:
    """One control period of the robots of block i, of which `look` observes as many as there are lanes."""
    block = world.blocks[i]
    first = i * LANES
    here = min(lanes, len(actions) - first)
    row = command_row(casters)
    for lane in range(here):
        for j in range(len(world.slots)):
            slot = world.slots[j]
            command = 0.0 if slot < 0 else float(actions[first + lane, slot])
            block[(row + j) * LANES + lane] = min(max(command, -1.0), 1.0)
    _drive(block, lanes, world.substeps, world.time_step, casters, preview)
    for lane in range(here):
        world.clocks[0, first + lane] += 1
        _fetch(block, lane, first + lane, world, casters)
    look(block, casters, preview)
    for lane in range(here):
        robot = first + lane
        _deliver(block, lane, robot, views, casters, preview)
        reward = 0.0
        for j in range(TERMS):
            reward += views.reports[FIRST_TERM + j, robot]
        views.results[0, robot] = reward
        views.results[1, robot] = views.reports[0, robot] + views.reports[1, robot]
        views.results[2, robot] = 1.0 if world.clocks[0, robot] >= world.spans[world.clocks[1, robot], 2] else 0.0


@register_jitable(**INLINE)
def _look_at_all(block: Any, casters: Any, preview: Any) -> None:
    _look(block, 0, LANES, casters, preview)


@register_jitable(**INLINE)
def _look_at_first(block: Any, casters: Any, preview: Any) -> None:
    look_at_one(block, 0, casters, preview)


def _look_at_one(block: Any, lane: Any, casters: Any, preview: Any) -> None:
    _look(block, lane, 1, casters, preview)


def _step_block(i: Any, world: World, actions: Any, views: Views, casters: Any, preview: Any) -> None:
    _step_lanes(i, LANES, _look_at_all, world, actions, views, casters, preview)


def _step_single(world: World, actions: Any, views: Views, casters: Any, preview: Any) -> None:
    _step_lanes(0, 1, _look_at_first, world, actions, views, casters, preview)


def _step_blocks(first: Any, end: Any, world: World, actions: Any, views: Views, casters: Any, preview: Any) -> None:
    for i in range(first, end):
        step_block(i, world, actions, views, casters, preview)


@register_jitable(**INLINE)
def _random_direction(key: Any, episode: Any, index: Any) -> Any:
    angle = 2.0 * math.pi * uniform(key, episode, np.uint64(4 + index))
    return math.cos(angle), math.sin(angle)


def _restart(selected: Any, wanted: Any, world: World, spread: Any, views: Views, casters: Any, preview: Any) -> None:
    """Start new episodes of the selected robots; wanted: path of each, −1 draws one; spread: greatest offset, turn."""
    for i in range(len(selected)):
        robot = selected[i]
        block, lane = world.blocks[robot // LANES], robot % LANES
        key, episode = world.seeds[0, robot], world.seeds[1, robot]
        world.seeds[1, robot] = episode + np.uint64(1)
        world.clocks[0, robot] = 0
        drawn = int(uniform(key, episode, np.uint64(0)) * len(world.spans))
        world.clocks[1, robot] = drawn if wanted[i] < 0 else wanted[i]
        x = (2.0 * uniform(key, episode, np.uint64(1)) - 1.0) * spread[0]
        y = (2.0 * uniform(key, episode, np.uint64(2)) - 1.0) * spread[0]
        turn = (2.0 * uniform(key, episode, np.uint64(3)) - 1.0) * spread[1]
        _fetch(block, lane, robot, world, casters)
        reference = Reference(*read(block, lane, reference_row(casters), _REFERENCE))
        directions = each(_random_direction, (key, episode), counting(casters))
        state = start(reference, (x, y), (math.cos(turn), math.sin(turn)), directions)
        write(block, lane, 0, pack_state(state))
        for row in range(command_row(casters), reference_row(casters)):
            block[row * LANES + lane] = 0.0
        look_at_one(block, lane, casters, preview)
        _deliver(block, lane, robot, views, casters, preview)


look_at_one = compiled(_look_at_one)
step_block = compiled(_step_block)
step_single = compiled(_step_single)
step_blocks = compiled(_step_blocks)
restart = compiled(_restart)
