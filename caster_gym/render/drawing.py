"""Draws what moves: the robot with its casters and wheel forces, its reference, its trace and its impacts."""

import math

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.scene import Scene
from caster_gym.render import palette
from caster_gym.render.canvas import Canvas, rounded_rectangle
from caster_gym.render.history import IMPACT_LIFE, History, Impact
from caster_gym.render.view import View
from caster_gym.robot import Caster, Footprint, Robot

WHEEL_WIDTH = 0.62  # of its radius; the robot file knows none
SHOWN_ACCELERATION = 2.0  # [m/s²] the forces that give it to the robot are drawn as long as the robot reaches
LONGEST_ARROW = 1.6  # of the robot's reach
SHOWN_SPEED = 0.5  # [m/s] the impulse that gives it to the robot is drawn as long as the robot reaches
SHOWN_SLIP = 1.0  # [m/s] a wheel that slips as fast has an arrow as long as the robot reaches
LEAST_SLIP = 1e-3  # [m/s] of a wheel that is drawn as slipping
LEAST_DETAIL = 26.0  # [px] reach of the robot, at unit size, below which its forces are not drawn


def draw_motion(canvas: Canvas, view: View, scene: Scene, history: History, unit: float) -> None:
    """All of it inside the view's area. unit: size of lines, 1 in a picture of about 640 pixels."""
    canvas.clip(view.area)
    canvas.line(view.pixels(history.positions), 2.2 * unit, palette.TRACE)
    draw_reference(canvas, view, scene, unit)
    draw_robot(canvas, view, scene, unit)
    for impact in history.impacts:
        draw_impact(canvas, view, scene, impact, unit)
    canvas.clip(None)


def draw_reference(canvas: Canvas, view: View, scene: Scene, unit: float) -> None:
    """The outline of the pose that is to be reached."""
    outline = view.pixels(_to_world(_outline(scene.robot.platform.footprint), scene.reference))
    canvas.line(_closed(outline), 1.2 * unit, palette.GHOST)
    size = scene.robot.reach
    nose = view.pixels(_to_world(np.array([(0.0, 0.0), (size, 0.0)]), scene.reference))
    canvas.line(nose, 1.2 * unit, palette.GHOST)


def draw_robot(canvas: Canvas, view: View, scene: Scene, unit: float) -> None:
    """Outline with its front, casters as they are steered, slip and forces of the floor on the wheels, and C."""
    size = scene.robot.reach * view.scale
    colour = palette.FAILED if scene.failed else palette.BODY
    body = _outline(scene.robot.platform.footprint)
    outline = view.pixels(_to_world(body, scene.pose))
    canvas.polygon(outline, colour, 0.2)
    slips = np.hypot(*scene.slip.T) > LEAST_SLIP
    for caster, f, slipping in zip(scene.robot.casters, scene.directions, slips, strict=True):
        tread = palette.SLIP if slipping else palette.WHEEL
        _draw_caster(canvas, view, scene.pose, caster, f, tread, unit)
    canvas.line(_closed(outline), max(0.9, min(2.2, 0.06 * size)) * unit, colour)
    canvas.polygon(view.pixels(_to_world(_front(body), scene.pose)), colour)
    if size >= LEAST_DETAIL * unit:
        for (wheel, way), slipping in zip(_arrows(scene, scene.slip, slip_scale(scene.robot)), slips, strict=True):
            if slipping:
                canvas.arrow(view.pixels(wheel), view.pixels(wheel + way), 2.6 * unit, palette.SLIP)
        for wheel, force in _arrows(scene, scene.ground_forces, force_scale(scene.robot)):
            canvas.arrow(view.pixels(wheel), view.pixels(wheel + force), 2.6 * unit, palette.FORCE)
    centre = view.pixels(scene.pose[:2])
    radius = max(2.0, 2.4 * unit, min(0.09 * size, 5.0 * unit))  # [px] 2 of them can be seen
    canvas.disc(centre, radius + 1.2 * unit, palette.INK)
    canvas.disc(centre, radius, palette.CENTRE)


def draw_impact(canvas: Canvas, view: View, scene: Scene, impact: Impact, unit: float) -> None:
    """A burst that fades, and the impulse that the robot got."""
    age = (scene.time - impact.time) / IMPACT_LIFE
    fading = (1.0 - age) ** 1.5
    centre = view.pixels(impact.point)
    size = max(scene.robot.reach * view.scale, 14.0 * unit)
    inner, outer = size * (0.12 + 0.5 * age), size * (0.3 + 0.65 * age)
    for angle in np.arange(12) * (math.pi / 6.0):
        ray = np.array([math.cos(angle), math.sin(angle)])
        canvas.line([centre + inner * ray, centre + outer * ray], 2.0 * unit, palette.IMPACT, fading)
    impulse = impact.impulse * scene.robot.reach / (total_mass(scene.robot) * SHOWN_SPEED)
    canvas.arrow(centre, view.pixels(impact.point + _bounded(impulse, scene.robot)), 3.0 * unit, palette.IMPACT, fading)


def force_scale(robot: Robot) -> float:
    """Length at which forces are drawn. [m/N]"""
    return robot.reach * len(robot.casters) / (total_mass(robot) * SHOWN_ACCELERATION)


def slip_scale(robot: Robot) -> float:
    """Length at which speeds of slip are drawn. [s]"""
    return robot.reach / SHOWN_SLIP


def total_mass(robot: Robot) -> float:
    """Mass of platform, links and wheels. [kg]"""
    return robot.platform.mass + sum(caster.link.mass + caster.wheel.mass for caster in robot.casters)


def _draw_caster(
    canvas: Canvas, view: View, pose: Array, caster: Caster, f: Array, colour: palette.Colour, unit: float
) -> None:
    """Wheel, link and pivot; the link leads from the pivot along the trail, then across to the wheel."""
    across = np.array([-f[1], f[0]])
    pivot = np.array([caster.x, caster.y])
    wheel = pivot - caster.trail * f + caster.offset * across
    tread = rounded_rectangle(2.0 * caster.radius, WHEEL_WIDTH * caster.radius, 0.2 * caster.radius)
    tyre = wheel + tread[:, :1] * f + tread[:, 1:] * across
    canvas.polygon(view.pixels(_to_world(tyre, pose)), colour)
    thick = max(1.2 * unit, min(0.2 * caster.radius * view.scale, 3.5 * unit))
    link = view.pixels(_to_world(np.stack([pivot, pivot - caster.trail * f, wheel]), pose))
    canvas.line(link, thick, palette.LINK)
    canvas.disc(link[0], 1.25 * thick, palette.LINK)
    canvas.disc(link[0], 0.7 * thick, palette.PAPER)
    canvas.disc(link[2], 0.5 * thick, palette.LINK)


def _arrows(scene: Scene, vectors: Array, scale: float) -> list[tuple[Array, Array]]:
    """Each wheel's centre and the arrow of its vector along its rolling direction and to its left, both in W. [m]"""
    arrows = []
    for caster, f, (along, left) in zip(scene.robot.casters, scene.directions, vectors, strict=True):
        across = np.array([-f[1], f[0]])
        wheel = np.array([caster.x, caster.y]) - caster.trail * f + caster.offset * across
        arrow = _bounded(scale * (along * f + left * across), scene.robot)
        tail, tip = _to_world(np.stack([wheel, wheel + arrow]), scene.pose)
        arrows.append((tail, tip - tail))
    return arrows


def _bounded(arrow: Array, robot: Robot) -> Array:
    """An arrow [m] no longer than the longest."""
    length = float(np.hypot(*arrow))
    longest = LONGEST_ARROW * robot.reach
    return arrow if length <= longest else arrow * (longest / length)


def _outline(footprint: Footprint) -> Array:
    """Corners (n, 2) of the platform in B."""
    if footprint.polygon is not None:
        return np.array(footprint.polygon)
    angles = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    return (footprint.disc or 0.0) * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _front(body: Array) -> Array:
    """An arrowhead inside the outline's most forward point on the x-axis. In B."""
    edges = zip(body, np.roll(body, -1, axis=0), strict=True)
    crossings = [a[0] + (b[0] - a[0]) * a[1] / (a[1] - b[1]) for a, b in edges if (a[1] < 0.0) != (b[1] < 0.0)]
    tip = float(max(crossings, default=body[:, 0].max()))
    size = 0.26 * float(np.hypot(body[:, 0], body[:, 1]).max())
    return np.array([(tip, 0.0), (tip - size, 0.36 * size), (tip - 0.75 * size, 0.0), (tip - size, -0.36 * size)])


def _to_world(points: Array, pose: Array) -> Array:
    """Points (..., 2) in W from those in B."""
    x, y, c, s = pose
    return np.stack([x + c * points[..., 0] - s * points[..., 1], y + s * points[..., 0] + c * points[..., 1]], axis=-1)


def _closed(points: Array) -> Array:
    return np.concatenate([points, points[:2]])
