"""What goes between blocks, the desk and the arrays that Python reads, in compiled code."""

import math
from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE
from caster_gym.engines.native.lanes import LANES
from caster_gym.envs.native.layout import (
    ENDINGS,
    FIRST_TERM,
    HEADING_COS,
    HEADING_SIN,
    TERMS,
    Sizes,
    Views,
    World,
    observation_row,
    report_row,
)


@register_jitable(**INLINE)
def copy_rows(source: Any, target: Any, lane: Any, lanes: Any, rows: Any, first: Any) -> None:
    """Copy the first rows of all lanes, or of one, to the rows from `first` on."""
    if lanes == LANES:
        for i in range(rows * LANES):
            target[first * LANES + i] = source[i]
    else:
        for row in range(rows):
            target[(first + row) * LANES + lane] = source[row * LANES + lane]


@register_jitable(**INLINE)
def deliver(desk: Any, lane: Any, count: Any, robot: Any, views: Views, sizes: Sizes) -> None:
    """Copy observations and reports of so many robots, from a lane and a robot on, to where Python reads them."""
    row = observation_row(sizes)
    for i in range(count):
        for j in range(views.observations.shape[1]):
            views.observations[robot + i, j] = desk[(row + j) * LANES + lane + i]
    row = report_row(sizes)
    for j in range(views.reports.shape[0]):
        for i in range(count):
            views.reports[j, robot + i] = desk[(row + j) * LANES + lane + i]
    for i in range(robot, robot + count):
        views.reports[HEADING_SIN, i] = math.atan2(views.reports[HEADING_SIN, i], views.reports[HEADING_COS, i])


@register_jitable(**INLINE)
def give_results(desk: Any, here: Any, robot: Any, world: World, views: Views, sizes: Sizes) -> None:
    """Rewards, and which episodes have ended, of so many robots, from a robot on."""
    row = report_row(sizes)
    for i in range(here):
        reward, failed = 0.0, 0.0
        for j in range(TERMS):
            reward += desk[(row + FIRST_TERM + j) * LANES + i]
        for j in range(ENDINGS):
            failed += desk[(row + j) * LANES + i]
        views.results[0, robot + i] = reward
        views.results[1, robot + i] = failed
    for i in range(robot, robot + here):
        periods = world.guide.spans[world.clocks[1, i], 2]
        views.results[2, i] = 1.0 if world.clocks[0, i] >= periods else 0.0
