"""Drawn lines of action: as many as joints, where they should be."""

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.design.joint_sets import turned_parallel, turned_towards
from caster_gym.report.figures import new_figure
from papers.line_drawing import FREE_MOTION, draw_lines

ROBOT = load_robot("chung2008")
JOINTS = ("roll_1", "steer_2", "roll_3")


def drawn(steering):
    figure = new_figure()
    draw_lines(figure.axes[0], ROBOT, steering, JOINTS, reach=0.3)
    figure.canvas.draw()
    return figure.axes[0]


def test_every_line_passes_through_the_point_that_is_marked():
    point = np.array([0.02, 0.05])
    axis = drawn(turned_towards(ROBOT, JOINTS, point))
    lines = [line for line in axis.lines if hasattr(line, "get_xy1")]
    assert len(lines) == len(JOINTS)
    for line in lines:
        (x_1, y_1), (x_2, y_2) = line.get_xy1(), line.get_xy2()
        assert (x_2 - x_1) * (point[1] - y_1) == pytest.approx((y_2 - y_1) * (point[0] - x_1), abs=1e-12)  # rounding
    (mark,) = [line for line in axis.lines if line.get_color() == FREE_MOTION]
    np.testing.assert_allclose(np.ravel(mark.get_data()), point, atol=1e-12)


def test_no_point_is_marked_where_lines_are_parallel_or_do_not_meet():
    for steering in (turned_parallel(ROBOT, JOINTS, 0.4), (0.1, 0.2, 0.3)):
        assert not [line for line in drawn(steering).lines if line.get_color() == FREE_MOTION]


def test_casters_are_named_by_their_joints():
    assert [text.get_text() for text in drawn((0.1, 0.2, 0.3)).texts] == ["θ1", "φ2", "θ3"]
