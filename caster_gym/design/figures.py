"""The picture of a design: the objective over radius and trail, and the motors asked for beside those there are."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.design.region import DesignTarget, wheel_room
from caster_gym.design.search import Design
from caster_gym.design.sizing import MotorRequirement, Requirement
from caster_gym.report.figures import COLOURS, empty_figure, legend_below, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WORST_SHOWN = 4.0  # [-] times the best torque or use: beyond, a design is too bad to tell apart
_TITLES = {
    "isotropy": "global isotropy, mean σmin/σmax [–]",
    "torque": "largest motor torque, share of the file's [–]",
    "use": "largest motor use [–], 1 (white line) is the limit",
}


def write_design_figure(path: Path, target: DesignTarget, design: Design, requirement: Requirement) -> None:
    """The objective as colours, and bars of torque, speed and power, as a PNG file."""
    figure = empty_figure((12.5, 5.6))
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.15, 1.0))[0]
    axis = left.subplots()
    draw_objective(axis, target, design)
    legend_below(left, axis, 4, fontsize="small")
    motors = requirement.motors
    torques, speeds, powers = right.subplots(3, 1, sharex=True)
    draw_bars(torques, "torque [N m]", [m.torque for m in motors], [m.has_torque for m in motors])
    draw_needed_at_standstill(torques, motors)
    draw_bars(speeds, "speed [rad/s]", [m.speed for m in motors], [m.has_speed for m in motors])
    draw_bars(powers, "power [W]", [m.power for m in motors], [m.has_power for m in motors])
    powers.set_xticks(range(len(motors)), [m.joint for m in motors], rotation=30, ha="right")
    right.suptitle(f"motors of the best design, margin {target.margin:g} included", fontsize="medium")
    legend_below(right, torques, 3, fontsize="small")
    save_figure(figure, path)


def draw_objective(axis: "Axes", target: DesignTarget, design: Design) -> None:
    """The objective over radius and trail [mm], the robot as it was, the best design, and the bounds."""
    from matplotlib.patches import Rectangle

    radii, trails, values = design.grid
    worst = np.inf if target.objective == "isotropy" else _WORST_SHOWN * design.value
    shown = np.minimum(values, worst)
    picture = axis.pcolormesh(1e3 * radii, 1e3 * trails, shown, shading="gouraud", cmap="cividis", rasterized=True)
    clipped = f", cut off at {worst:.2g}" if (values > worst).any() else ""
    axis.figure.colorbar(picture, ax=axis, label=_TITLES[target.objective] + clipped, format="%.3g")
    if target.objective == "use" and shown.min() < 1.0 < shown.max():
        axis.contour(1e3 * radii, 1e3 * trails, shown, levels=[1.0], colors="white", linewidths=1.5)
    (r0, r1), (d0, d1) = (tuple(1e3 * x for x in bounds) for bounds in (target.radius, target.trail))
    axis.add_patch(Rectangle((r0, d0), r1 - r0, d1 - d0, fill=False, edgecolor="black", linewidth=1.2, label="bounds"))
    room = 1e3 * wheel_room(design.robot)
    line = np.array([max(r0, room - d1), min(r1, room - d0)])
    if line[0] < line[1]:
        axis.plot(line, room - line, "--", color=COLOURS[3], label="wheels could touch beyond")
    radius, trail, value = design.own
    axis.plot(1e3 * radius, 1e3 * trail, "o", color="white", markeredgecolor="black", markersize=9, clip_on=False,
              label="as it was: " + (f"{value:.3f}" if np.isfinite(value) else "too fast"))  # fmt: skip
    axis.plot(1e3 * design.radius, 1e3 * design.trail, "*", color=COLOURS[2], markeredgecolor="black", markersize=17,
              clip_on=False, label=f"best: {design.value:.3f}")  # fmt: skip
    axis.set_xlabel("wheel radius [mm]")
    axis.set_ylabel("trail [mm]")
    axis.set_title(f"{design.robot.name}: {target.objective} over radius and trail", fontsize="medium", pad=12)


def draw_bars(axis: "Axes", label: str, needed: Sequence[float], there: Sequence[float]) -> None:
    """Pairs of bars, one for each motor."""
    places = np.arange(len(needed))
    axis.bar(places - 0.2, needed, 0.4, color=COLOURS[0], label="asked for", zorder=3)
    axis.bar(places + 0.2, there, 0.4, color="0.75", label="in the robot file", zorder=3)
    axis.set_ylabel(label)
    axis.grid(axis="y", alpha=0.3)


def draw_needed_at_standstill(axis: "Axes", motors: Sequence[MotorRequirement]) -> None:
    """What a motor with the file's top speed must have at standstill to give what is asked at its speed."""
    finite = [(j, motor.use * motor.has_torque) for j, motor in enumerate(motors) if np.isfinite(motor.use)]
    for j, torque in finite:
        axis.plot([j - 0.4, j], [torque, torque], color=COLOURS[3], linewidth=2.0, zorder=4,
                  label="at standstill, to have it at speed" if j == finite[0][0] else None)  # fmt: skip
