"""What goes between blocks, the workspace and the arrays that Python reads, in compiled code."""

import math
from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE
from caster_gym.engines.native.lanes import LANES
from caster_gym.envs.native.layout import Sizes, Views, World, rows_of
from caster_gym.envs.report import REPORT, RESULT


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
        periods = world.guide.spans[world.clocks[1, i], 2]
        views.results[RESULT.late, i] = 1.0 if world.clocks[0, i] >= periods else 0.0
