"""How figures of the papers are drawn: one style, and the robot from above."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.render.palette import SERIES as COLOURS
from caster_gym.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "draw_robot", "new_figure"]

OUTLINE, LINK, WHEEL = "#345C8C", "#707C8B", "#262B33"


def new_figure(rows: int = 1, columns: int = 1, size: tuple[float, float] = (4.6, 3.4), **options: Any) -> "Figure":
    """A figure with a grid of axes, each of a size [in]; options as for matplotlib's `subplots`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(columns * size[0], rows * size[1]), layout="constrained")
    figure.subplots(rows, columns, squeeze=False, **options)
    for axis in figure.axes:
        axis.grid(alpha=0.3)
    return figure


def draw_robot(axis: "Axes", robot: Robot, steering: ArrayLike) -> None:
    """The robot from above, in its body frame [m]: platform, steering links from pivot to wheel, wheels with axles.

    steering (N,) [rad]. The x-axis points to the right.
    """
    from matplotlib.patches import Circle, Polygon

    footprint = robot.platform.footprint
    if footprint.disc is not None:
        axis.add_patch(Circle((0.0, 0.0), footprint.disc, fill=False, edgecolor=OUTLINE, linewidth=1.5))
    else:
        axis.add_patch(Polygon(np.array(footprint.polygon), fill=False, edgecolor=OUTLINE, linewidth=1.5))
    for caster, angle in zip(robot.casters, np.asarray(steering, dtype=np.float64), strict=True):
        f = np.array([np.cos(angle), np.sin(angle)])
        left = np.array([-f[1], f[0]])
        pivot = np.array([caster.x, caster.y])
        wheel = pivot - caster.trail * f + caster.offset * left
        axis.plot(*np.array([pivot, wheel]).T, color=LINK, linewidth=2.5, solid_capstyle="round", zorder=2)
        half = caster.radius
        corners = [wheel + a * half * f + b * 0.3 * half * left for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        axis.add_patch(Polygon(corners, facecolor=WHEEL, edgecolor=WHEEL, zorder=3))
        axis.plot(*pivot, "o", color=OUTLINE, markersize=4, zorder=4)
    axis.plot(0.0, 0.0, "+", color=OUTLINE, markersize=8)
    axis.set_aspect("equal")
    axis.autoscale_view()
