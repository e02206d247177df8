"""A robot seen from above, drawn into the axes of a figure."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTLINE, LINK, WHEEL = "#345C8C", "#707C8B", "#262B33"


def draw_robot(axis: "Axes", robot: Robot, steering: ArrayLike) -> None:
    """Draw a robot in its body frame [m]: outline of the platform, steering links from pivot to wheel, and wheels.

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
