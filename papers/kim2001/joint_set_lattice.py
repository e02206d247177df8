"""All sets of a robot's driven joints at a glance: small robots in rows, coloured by where the set is singular."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.design.joint_sets import Class, JointSet, kind_and_caster
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.robot import Robot
from papers.analysis.joint_sets import set_types

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASSES: tuple[Class, ...] = ("always", "somewhere", "never")
CLASS_COLOURS = {"always": COLOURS[7], "somewhere": COLOURS[2], "never": COLOURS[0]}
PLACE = (0.62, 0.78)  # [in] of one robot
CELL = 0.14  # side of a joint's square, of a robot whose pivots reach REACH to each side, in a place 1 wide
REACH = 0.3


def joint_set_lattice(robot: Robot, sets: Sequence[JointSet]) -> "Figure":
    """One small robot for each type of sets under the robot's symmetry; rows by the number of driven joints."""
    from matplotlib.patches import Patch

    kinds = sorted(set_types(robot, sets), key=lambda kind: CLASSES.index(kind[0].singular))
    rows = {count: [kind for kind in kinds if len(kind[0].joints) == count] for count in _counts(kinds)}
    width, aspect = max(map(len, rows.values())), PLACE[1] / PLACE[0]
    figure = new_figure(size=(PLACE[0] * (width + 1.0), PLACE[1] * len(rows) + 0.3))
    (axis,) = figure.axes
    for row, of_row in enumerate(rows.values()):
        for column, kind in enumerate(of_row):
            _draw_set(axis, robot, kind[0], np.array([column, -aspect * row]))
            axis.text(column, -aspect * (row + 0.43), f"×{len(kind)}", ha="center", va="center", fontsize=7)
    axis.set(xlim=(-0.6, width - 0.4), ylim=(-aspect * (len(rows) - 0.4), 0.6 * aspect), xticks=[])
    axis.set_yticks([-aspect * row for row in range(len(rows))], [str(count) for count in rows])
    axis.set_ylabel("driven joints")
    axis.grid(False)
    axis.set_aspect("equal")
    legend = [Patch(color=CLASS_COLOURS[kind], label=f"{kind} singular") for kind in CLASSES]
    axis.legend(handles=legend, loc="lower right", fontsize=8)
    return figure


def _counts(kinds: Sequence[tuple[JointSet, ...]]) -> list[int]:
    return sorted({len(kind[0].joints) for kind in kinds})


def _draw_set(axis: "Axes", robot: Robot, one: JointSet, middle: np.ndarray) -> None:
    """The outline of the pivots, and at each the squares of rolling (left) and steering (right), filled if driven."""
    from matplotlib.patches import Rectangle

    pivots = np.array([[caster.x, caster.y] for caster in robot.casters])
    places = middle + REACH * pivots / np.abs(pivots).max()
    outline = np.concatenate([places, places[:1]])
    axis.plot(outline[:, 0], outline[:, 1], color="0.75", linewidth=0.8, zorder=1)
    driven = {kind_and_caster(joint) for joint in one.joints}
    for i, (x, y) in enumerate(places):
        for kind, left in (("roll", x - CELL), ("steer", x)):
            colour = CLASS_COLOURS[one.singular] if (kind, i) in driven else "white"
            axis.add_patch(
                Rectangle((left, y - 0.5 * CELL), CELL, CELL, facecolor=colour, edgecolor="0.35", linewidth=0.6)
            )
