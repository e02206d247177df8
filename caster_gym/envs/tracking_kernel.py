"""The compiled step of the tracking task: how its quantities lie in a block, and the loops over the block's robots.

Rows of a block: state, motor commands, mean motor torques, mean power, reference, preview, observation, report, weights,
robot parameters. `casters` and `preview` are any tuples with an item per caster and per previewed point: their lengths
are part of their types, so that all rows are constants of the compiled code.
"""

import math
from typing import Any

import numba
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
def _fetch(block: Any, lane: Any, clock: Any, path: Any, samples: Any, spans: Any, horizons: Any, casters: Any) -> None:
    """Copy a robot's reference and previewed points from the table of all paths; the last row of a path stays."""
    row = reference_row(casters)
    base, end = spans[path, 0], spans[path, 1]
    now = min(base + clock, end)
    for j in range(REFERENCE_ROWS):
        block[(row + j) * LANES + lane] = samples[now, j]
    row += REFERENCE_ROWS
    for p in range(len(horizons)):
        then = min(base + clock + horizons[p], end)
        for j in range(POINT_ROWS):
            block[(row + p * POINT_ROWS + j) * LANES + lane] = samples[then, j]


@register_jitable(**INLINE)
def _deliver(block: Any, lane: Any, robot: Any, observations: Any, reports: Any, casters: Any, preview: Any) -> None:
    """Copy a robot's observation and report to where Python reads them."""
    row = observation_row(casters, preview)
    for j in range(observations.shape[1]):
        observations[robot, j] = block[(row + j) * LANES + lane]
    row = report_row(casters, preview)
    for j in range(reports.shape[0]):
        reports[j, robot] = block[(row + j) * LANES + lane]
    reports[HEADING_SIN, robot] = math.atan2(reports[HEADING_SIN, robot], reports[HEADING_COS, robot])


@register_jitable(**INLINE)
def _step_lanes(
    i: Any, lanes: Any, blocks: Any, clocks: Any, actions: Any, slots: Any, samples: Any, spans: Any, horizons: Any,
    substeps: Any, h: Any, observations: Any, reports: Any, results: Any, casters: Any, preview: Any,
) -> None:  # fmt: skip
    """One control period of the robots of block i. clocks (2, robots): steps done, path; results (3, robots)."""
    block = blocks[i]
    first = i * LANES
    here = min(lanes, len(actions) - first)
    row = command_row(casters)
    for lane in range(here):
        for j in range(len(slots)):
            command = 0.0 if slots[j] < 0 else float(actions[first + lane, slots[j]])
            block[(row + j) * LANES + lane] = min(max(command, -1.0), 1.0)
    _drive(block, lanes, substeps, h, casters, preview)
    for lane in range(here):
        clocks[0, first + lane] += 1
        _fetch(block, lane, clocks[0, first + lane], clocks[1, first + lane], samples, spans, horizons, casters)
    _look(block, 0, lanes, casters, preview)
    for lane in range(here):
        robot = first + lane
        _deliver(block, lane, robot, observations, reports, casters, preview)
        reward = 0.0
        for j in range(TERMS):
            reward += reports[FIRST_TERM + j, robot]
        path = clocks[1, robot]
        results[0, robot] = reward
        results[1, robot] = reports[0, robot] + reports[1, robot]
        results[2, robot] = 1.0 if clocks[0, robot] >= spans[path, 2] else 0.0


def _step_block(
    i, blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports, results,
    casters, preview,
):  # type: ignore[no-untyped-def]  # fmt: skip
    _step_lanes(
        i, LANES, blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports,
        results, casters, preview,
    )  # fmt: skip


def _step_single(
    blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports, results,
    casters, preview,
):  # type: ignore[no-untyped-def]  # fmt: skip
    _step_lanes(
        0, 1, blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports,
        results, casters, preview,
    )  # fmt: skip


def _step_all(
    blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports, results,
    casters, preview,
):  # type: ignore[no-untyped-def]  # fmt: skip
    for i in numba.prange(len(blocks)):
        step_block(
            i, blocks, clocks, actions, slots, samples, spans, horizons, substeps, h, observations, reports, results,
            casters, preview,
        )  # fmt: skip


@register_jitable(**INLINE)
def _random_direction(key: Any, episode: Any, index: Any) -> Any:
    angle = 2.0 * math.pi * uniform(key, episode, np.uint64(4 + index))
    return math.cos(angle), math.sin(angle)


def _restart(
    selected, blocks, clocks, seeds, samples, spans, horizons, spread, observations, reports, casters, preview
):  # type: ignore[no-untyped-def]
    """Start new episodes of the selected robots. seeds (2, robots): key, episode; spread: greatest offset, turn."""
    for robot in selected:
        block, lane = blocks[robot // LANES], robot % LANES
        key, episode = seeds[0, robot], seeds[1, robot]
        seeds[1, robot] = episode + np.uint64(1)
        path = int(uniform(key, episode, np.uint64(0)) * len(spans))
        clocks[0, robot], clocks[1, robot] = 0, path
        x = (2.0 * uniform(key, episode, np.uint64(1)) - 1.0) * spread[0]
        y = (2.0 * uniform(key, episode, np.uint64(2)) - 1.0) * spread[0]
        turn = (2.0 * uniform(key, episode, np.uint64(3)) - 1.0) * spread[1]
        _fetch(block, lane, 0, path, samples, spans, horizons, casters)
        reference = Reference(*read(block, lane, reference_row(casters), _REFERENCE))
        directions = each(_random_direction, (key, episode), counting(casters))
        state = start(reference, (x, y), (math.cos(turn), math.sin(turn)), directions)
        write(block, lane, 0, pack_state(state))
        for row in range(command_row(casters), reference_row(casters)):
            block[row * LANES + lane] = 0.0
        _look(block, lane, 1, casters, preview)
        _deliver(block, lane, robot, observations, reports, casters, preview)


step_block = compiled(_step_block)
step_single = compiled(_step_single)
step_serial = compiled(_step_all)
step_parallel = compiled(_step_all, parallel=True)
restart = compiled(_restart)
