"""A drawn robot has its parts where the conventions of docs/equations.md put them."""

import numpy as np
import pytest

from caster_gym.report.figures import new_figure
from caster_gym.robot import load_robot
from papers.robot_drawing import draw_robot


@pytest.mark.parametrize("name", ["chung2008", "tidybot2"])
def test_a_drawn_wheel_stands_behind_its_pivot(name):
    """The link's line goes from the pivot by the trail against the rolling direction, here along −x."""
    robot = load_robot(name)
    axis = new_figure().axes[0]
    draw_robot(axis, robot, [0.0] * robot.caster_count)
    lines = [np.asarray(line.get_xydata()) for line in axis.lines]
    links = [line for line in lines if len(line) == 2]
    for caster, ((x, y), (wheel_x, wheel_y)) in zip(robot.casters, links, strict=True):
        assert (x, y) == (caster.x, caster.y)
        assert (wheel_x, wheel_y) == pytest.approx((caster.x - caster.trail, caster.y + caster.offset), abs=1e-15)
