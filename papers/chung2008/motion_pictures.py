"""chung2008, Figs. 5–9: the circle, the joints along it, kinetic energy and operational forces."""

from collections.abc import Sequence

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.robot import Robot
from papers.analysis.driven_motion import DrivenMotion
from papers.notation import CHUNG2008
from papers.page import Picture
from papers.robot_drawing import draw_robot

FORCE_AXES = ("F_x [N]", "F_y [N]", "M_z [N m]")


def draw_path(motion: DrivenMotion, robot: Robot) -> Picture:
    """Fig. 5, and the robot as it stands on the circle."""
    figure = new_figure(1, 3, size=(4.0, 3.6))
    place, turn, body = figure.axes
    radius = float(motion.pose[0, 0])
    place.plot(motion.pose[:, 0], motion.pose[:, 1], color=COLOURS[0])
    beta = 0.25 * np.pi * np.arange(8)
    for angle, length, colour in ((beta, 0.3, COLOURS[3]), (beta + 0.5 * np.pi, 0.3, COLOURS[4])):
        place.quiver(
            radius * np.cos(beta),
            radius * np.sin(beta),
            length * np.cos(angle),
            length * np.sin(angle),
            color=colour,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.008,
            zorder=3,
            label="body x" if colour == COLOURS[3] else "body y",
        )
    place.plot(radius, 0.0, "o", color=COLOURS[7], markersize=4, zorder=4)
    place.annotate("start and end", (radius, 0.0), (-62, -14), textcoords="offset points", fontsize=8)
    place.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal", xlim=(-1.5, 1.5), ylim=(-1.5, 1.5))
    place.legend(loc="center", bbox_to_anchor=(0.5, 0.6), fontsize=8)
    turn.plot(motion.time, np.degrees(motion.pose[:, 2]), color=COLOURS[0])
    turn.set(xlabel="time [s]", ylabel="β [°]", yticks=range(0, 361, 90))
    draw_robot(body, robot, motion.steering[0])
    body.annotate("", (0.0, 0.19), (0.0, 0.14), arrowprops={"arrowstyle": "->", "color": COLOURS[3], "linewidth": 2.0})
    body.set(xlabel="x [m]", ylabel="y [m]", ylim=(-0.19, 0.2))
    for axis, title in zip(figure.axes, ("(a) path", "(b) heading", "casters on the circle"), strict=True):
        axis.set_title(title, fontsize=10)
    caption = (
        "Fig. 5: the path of C with the body axes at eight moments, the heading (61), and the robot as it is led: the "
        "casters trail behind the motion along y (arrow)."
    )
    return Picture("fig5", "Path, heading and casters, Fig. 5", caption, figure)


def draw_joints(motion: DrivenMotion, robot: Robot) -> Picture:
    """Fig. 6."""
    eta, theta, _ = Model(robot).rates(motion.steering, motion.twist)
    figure = new_figure(2, 2, size=(4.6, 2.9), sharex=True)
    series = (
        ("(a) driving angles, integrated", "θ [rad]", CHUNG2008.rolling * motion.rolling),
        ("(b) steering angles, integrated", "φ [°]", np.degrees(CHUNG2008.steering(motion.steering))),
        ("(c) driving rates, by inverse kinematics", "dθ/dt [rad/s]", CHUNG2008.rolling * theta),
    )
    styles = (("-", COLOURS[0], 1.6), ("--", COLOURS[3], 1.6), ("-.", COLOURS[4], 1.6))
    for axis, (title, label, values) in zip(figure.axes, series, strict=False):
        for i, (line, colour, width) in enumerate(styles):
            axis.plot(motion.time, values[:, i], line, color=colour, linewidth=width, label=f"caster {i + 1}")
        axis.set(ylabel=label)
        axis.set_title(title, fontsize=10)
    last = figure.axes[3]
    last.plot(motion.time, motion.twist[:, 2], color=COLOURS[7], linewidth=3.0, alpha=0.35, label="platform, ω")
    for i, (line, colour, width) in enumerate(styles):
        last.plot(motion.time, eta[:, i], line, color=colour, linewidth=width)
    last.set(ylabel="ω, dη/dt [rad/s]")
    last.set_title("(d) yaw rates of platform and casters", fontsize=10)
    figure.axes[0].legend(fontsize=8)
    last.legend(fontsize=8)
    for axis in figure.axes[2:]:
        axis.set_xlabel("time [s]")
    caption = (
        "Fig. 6: joints on the circle, in the paper's signs (trailing wheels roll at a negative rate). The casters "
        "keep their steering angles, so all of them yaw at the platform's rate."
    )
    return Picture("fig6", "Joints on the circle, Fig. 6", caption, figure)


def draw_energy(motion: DrivenMotion, robot: Robot) -> Picture:
    """Fig. 7."""
    figure = new_figure(size=(6.0, 3.2))
    axis = figure.axes[0]
    for r, label, style, colour in (
        (robot, "with wheel dynamics", "-", COLOURS[0]),
        (robot.without_wheels(), "without", "--", COLOURS[3]),
    ):
        energy = Model(r).kinetic_energy(motion.steering, motion.twist)
        axis.plot(motion.time, energy * 1e3, style, color=colour, label=label)
    axis.set(xlabel="time [s]", ylabel="kinetic energy [mJ]")
    axis.legend()
    caption = "Fig. 7: kinetic energy along the circle, with and without wheels."
    return Picture("fig7", "Kinetic energy, Fig. 7", caption, figure)


def draw_forces(motion: DrivenMotion, lines: Sequence[tuple[str, Array]]) -> Picture:
    """Figs. 8 and 9: forces (K + 1, 3) with a name each: with wheels as printed, exact, and without wheels."""
    figure = new_figure(1, 3, size=(4.0, 3.2))
    styles = (("-", COLOURS[1], 4.0), ("-", COLOURS[7], 1.4), ("--", COLOURS[3], 1.6))
    for k, axis in enumerate(figure.axes):
        for (label, force), (style, colour, width) in zip(lines, styles, strict=True):
            axis.plot(motion.time, force[:, k], style, color=colour, label=label, linewidth=width)
        axis.set(xlabel="time [s]", ylabel=FORCE_AXES[k])
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncol=3, fontsize=9)
    caption = (
        "Figs. 8 and 9: operational forces and moment along the circle, in the body frame. Wheels are felt along the "
        "path (F_y) and in turning (M_z), and hardly across it (F_x)."
    )
    return Picture("fig8_9", "Operational forces, Figs. 8 and 9", caption, figure)
