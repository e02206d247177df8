"""A robot from above with the lines of action of its driven joints, and the motion that none of them feels."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.design.joint_sets import kind_and_caster
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS
from caster_gym.robot import Robot
from papers.analysis.action_lines import action_lines, meeting
from papers.notation import in_letters
from papers.robot_drawing import draw_robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE_COLOURS = {"roll": COLOURS[0], "steer": COLOURS[3]}
FREE_MOTION = COLOURS[4]
LEGEND = (
    "Solid blue: line of a driven rolling joint, through pivot and wheel centre; dashed orange: that of a driven "
    "steering joint, the axle. Green: the motion that no driven joint feels."
)


def draw_lines(axis: "Axes", robot: Robot, steering: ArrayLike, joints: Sequence[str], reach: float) -> None:
    """Draw the robot, the lines of the named joints and, where they are singular, the motion that is left to it.

    steering (N,) [rad]; reach [m]: half the width of the picture, which has C in its middle.
    """
    lines = action_lines(robot, steering, joints)
    met = meeting(lines, Model(robot).characteristic_length)
    draw_robot(axis, robot, steering)
    for joint, (u_x, u_y, moment) in zip(joints, lines, strict=True):
        kind, _ = kind_and_caster(joint)
        x, y = moment * u_y, -moment * u_x  # of the line, nearest to C
        style = "-" if kind == "roll" else (0, (5, 3))
        ends = (x, y), (x + u_x, y + u_y)
        axis.axline(*ends, color=LINE_COLOURS[kind], linestyle=style, linewidth=1.4, zorder=1)
    _name_joints(axis, robot, joints)
    if met.singular:
        _draw_free_motion(axis, met.point, met.direction, 0.14 * reach)
    axis.set(xlim=(-reach, reach), ylim=(-reach, reach))


def _name_joints(axis: "Axes", robot: Robot, joints: Sequence[str]) -> None:
    """The letters of each caster's named joints beside its pivot, towards C."""
    pivots = np.array([[caster.x, caster.y] for caster in robot.casters])
    size = np.linalg.norm(pivots, axis=-1).max()
    box: Any = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
    for i, pivot in enumerate(pivots):
        letters = in_letters([joint for joint in joints if kind_and_caster(joint)[1] == i])[1:-1].replace("_", "")
        x, y = pivot * (1.0 - 0.3 * size / max(float(np.linalg.norm(pivot)), 0.1 * size))
        axis.text(x, y, letters, ha="center", va="center", bbox=box, zorder=6)


def _draw_free_motion(axis: "Axes", point: Array, direction: Array, size: float) -> None:
    """A turning arrow about the point, or a double arrow across the direction where there is none."""
    from matplotlib.patches import Arc

    arrow: Any = {"arrowstyle": "-|>", "color": FREE_MOTION, "linewidth": 2, "shrinkA": 0, "shrinkB": 0}
    if np.isnan(point).any():
        x, y = 2.2 * size * direction[1], -2.2 * size * direction[0]
        axis.annotate("", (x, y), (-x, -y), arrowprops={**arrow, "arrowstyle": "<|-|>"}, zorder=5)
        return
    axis.plot(point[0], point[1], "o", color=FREE_MOTION, markersize=6, zorder=5)
    turn: Any = {"theta1": 20.0, "theta2": 300.0, "color": FREE_MOTION, "linewidth": 2, "zorder": 5}
    axis.add_patch(Arc((point[0], point[1]), 2.0 * size, 2.0 * size, **turn))
    start, end = ((point[0] + size * np.cos(t), point[1] + size * np.sin(t)) for t in np.radians((290.0, 318.0)))
    axis.annotate("", end, start, arrowprops=arrow, zorder=5)
