"""Draws the column beside the map: the robot close up, its numbers, its error over time and its motors' torques."""

import math

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.envs.scene import Scene
from caster_gym.render import palette
from caster_gym.render.canvas import Canvas
from caster_gym.render.drawing import draw_motion, force_scale
from caster_gym.render.floor import BACKING, draw_obstacles, draw_patches
from caster_gym.render.history import History
from caster_gym.render.view import Area, round_length, view_around

SPAN = 10.0  # [s] of the chart of errors
LOWEST, HIGHEST = -4, 0  # powers of ten [m] at the ends of its axis
CLOSE = 3.0  # close-up's width, in reaches of the robot


def draw_panel(canvas: Canvas, area: Area, scene: Scene, history: History, unit: float) -> None:
    """All of it. unit: size of lines and letters, 1 in a frame 640 pixels high."""
    canvas.clip(area)
    canvas.fill(palette.PAPER)
    canvas.clip(None)
    edge = area.left
    canvas.line([(edge, area.top), (edge, area.top + area.height)], 1.5 * unit, palette.RULE)
    inner = area.inset(18.0 * unit)
    side = min(inner.width, 0.47 * area.height)
    gap, top = 12.0 * unit, inner.top + 26.0 * unit
    canvas.text(scene.robot.name, (inner.left, inner.top + 6.0 * unit), 24.0 * unit, palette.INK)
    _right(canvas, f"{scene.time:.2f} s", (inner.left + inner.width, inner.top + 6.0 * unit), 24.0 * unit)
    draw_close_up(canvas, Area(inner.left, top, inner.width, side), scene, history, unit)
    top = _draw_numbers(canvas, inner, top + side + gap, scene, history, unit)
    rest = inner.top + inner.height - top
    draw_errors(canvas, Area(inner.left, top, inner.width, 0.5 * rest - gap), history, unit)
    draw_torques(canvas, Area(inner.left, top + 0.5 * rest, inner.width, 0.5 * rest), scene, unit)


def draw_close_up(canvas: Canvas, area: Area, scene: Scene, history: History, unit: float) -> None:
    """The robot large enough to see its casters and the forces on its wheels."""
    view = view_around(scene.pose[:2], CLOSE * scene.robot.reach, area)
    canvas.clip(area)
    canvas.fill(palette.GROUND)
    draw_patches(canvas, view, scene, unit)
    canvas.line(view.pixels(scene.path), 2.0 * unit, palette.PATH)
    draw_obstacles(canvas, view, scene.obstacles, unit)
    draw_motion(canvas, view, scene, history, 1.25 * unit)
    canvas.clip(None)
    canvas.line(np.concatenate([area.corners, area.corners[:2]]), unit, palette.RULE)
    scale = force_scale(scene.robot) * view.scale
    force = round_length(0.22 * area.width / scale)
    x, y = area.left + 10.0 * unit, area.top + area.height - 13.0 * unit
    backing = Area(x, y, force * scale + 38.0 * unit, 0.0).inset(-9.0 * unit)
    canvas.rectangle(backing, palette.PAPER, BACKING)
    canvas.arrow((x, y), (x + force * scale, y), 2.6 * unit, palette.FORCE)
    canvas.text(f"{force:g} N", (x + force * scale + 6.0 * unit, y), 17.0 * unit, palette.FORCE)


def draw_errors(canvas: Canvas, area: Area, history: History, unit: float) -> None:
    """Position error over the last seconds, on a logarithmic axis."""
    recent = history.times >= history.times[-1] - SPAN
    times, errors = history.times[recent], history.errors[recent]
    canvas.text("position error", (area.left, area.top + 5.0 * unit), 17.0 * unit, palette.FAINT_INK)
    _right(canvas, f"last {SPAN:g} s", (area.left + area.width, area.top + 5.0 * unit), 17.0 * unit, palette.FAINT_INK)
    margin = 48.0 * unit
    plot = Area(area.left + margin, area.top + 18.0 * unit, area.width - margin, area.height - 24.0 * unit)
    bottom, decade = plot.top + plot.height, plot.height / (HIGHEST - LOWEST)
    for power in range(LOWEST, HIGHEST + 1):
        y = bottom - (power - LOWEST) * decade
        canvas.line(
            [(plot.left, y), (plot.left + plot.width, y)], unit, palette.GRID if power > LOWEST else palette.RULE
        )
        label = f"{10.0 ** (power + 3):g} mm" if power < 0 else "1 m"
        canvas.text(label, (plot.left - 6.0 * unit, y), 14.0 * unit, palette.FAINT_INK, 1.0)
    start = max(times[-1] - SPAN, history.times[0])
    heights = np.clip(np.log10(np.maximum(errors, 1e-12)), LOWEST, HIGHEST) - LOWEST
    curve = np.stack([plot.left + (times - start) / SPAN * plot.width, bottom - heights * decade], axis=1)
    if len(curve) > 1:
        canvas.polygon([*curve, (curve[-1, 0], bottom), (curve[0, 0], bottom)], palette.TRACE, 0.1)
        canvas.line(curve, 1.6 * unit, palette.TRACE)
    canvas.disc(curve[-1], 2.6 * unit, palette.TRACE)


def draw_torques(canvas: Canvas, area: Area, scene: Scene, unit: float) -> None:
    """Each motor's torque as a share of its greatest: rolling and steering of each caster."""
    right, title = area.left + area.width, area.top + 5.0 * unit
    canvas.text("motor torques", (area.left, title), 17.0 * unit, palette.FAINT_INK)
    _right(canvas, "steering", (right, title), 17.0 * unit, palette.LINK)
    _right(canvas, "rolling", (right - 58.0 * unit, title), 17.0 * unit, palette.BODY)
    plot = Area(area.left, area.top + 16.0 * unit, area.width, area.height - 16.0 * unit)
    middle, half = plot.centre[1], 0.5 * plot.height
    slot = plot.width / len(scene.robot.casters)
    bar = min(0.34 * slot, 30.0 * unit)
    for i, (motor, torque) in enumerate(zip(scene.robot.motors, scene.torque, strict=True)):
        left = plot.left + (i // 2 + 0.5) * slot + (i % 2 - 1) * (bar + unit) + unit
        canvas.rectangle(Area(left, plot.top, bar, plot.height), palette.GROUND)
        height = float(np.clip(torque / motor.max_torque, -1.0, 1.0)) * half
        colour = palette.BODY if i % 2 == 0 else palette.LINK
        canvas.rectangle(Area(left, middle - max(height, 0.0), bar, abs(height)), colour)
    canvas.line([(plot.left, middle), (right, middle)], unit, palette.RULE)


def status(scene: Scene, history: History) -> str:
    """Time, speed and error in a line."""
    ending = "   failed" if scene.failed else ""
    speed = math.hypot(scene.twist[0], scene.twist[1])
    return f"{scene.time:.2f} s   {speed:.2f} m/s   {length_text(history.errors[-1])} off{ending}"


def length_text(metres: float) -> str:
    """A short length in the unit that suits it."""
    millimetres = 1e3 * metres
    return (
        f"{millimetres:.1f} mm"
        if millimetres < 9.95
        else f"{millimetres:.0f} mm"
        if metres < 1.0
        else f"{metres:.2f} m"
    )


def _draw_numbers(canvas: Canvas, inner: Area, top: float, scene: Scene, history: History, unit: float) -> float:
    """Rows of names and values; returns where they end."""
    turn = math.atan2(
        scene.reference[3] * scene.pose[2] - scene.reference[2] * scene.pose[3],
        scene.reference[2] * scene.pose[2] + scene.reference[3] * scene.pose[3],
    )
    rows = [
        ("speed", f"{math.hypot(scene.twist[0], scene.twist[1]):.2f} m/s"),
        ("position error", length_text(history.errors[-1])),
        ("heading error", f"{round(math.degrees(turn), 1) + 0.0:.1f}°"),
    ]
    for i, (name, value) in enumerate(rows):
        y = top + (i + 0.5) * 18.0 * unit
        canvas.text(name, (inner.left, y), 19.0 * unit, palette.FAINT_INK)
        _right(canvas, value, (inner.left + inner.width, y), 19.0 * unit)
    if scene.failed:
        canvas.text("failed", (inner.left + 0.5 * inner.width, top + 9.0 * unit), 22.0 * unit, palette.FAILED, 0.5)
    return top + len(rows) * 18.0 * unit + 14.0 * unit


def _right(canvas: Canvas, string: str, place: ArrayLike, size: float, colour: palette.Colour = palette.INK) -> None:
    canvas.text(string, place, size, colour, across=1.0)
