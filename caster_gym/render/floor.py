"""Draws what stands still: the floor with its patches, the path with its corridor, and the obstacles."""

import math

import numpy as np

from caster_gym.arrays import Array
from caster_gym.envs.scene import Scene
from caster_gym.mechanics.separation import Obstacles
from caster_gym.render import palette
from caster_gym.render.canvas import Canvas, thin_out
from caster_gym.render.view import Area, View, round_length

BACKING = 0.75  # opacity of the paper behind letters
LEGEND = 136.0  # [px] its width, at unit size
THIN = 2.0  # [px] a wall without thickness, at unit size


def draw_floor(canvas: Canvas, view: View, scene: Scene, unit: float) -> None:
    """All of it inside the view's area. unit: size of lines and letters, 1 in a picture of about 640 pixels."""
    canvas.clip(view.area)
    canvas.fill(palette.GROUND)
    _draw_corridor(canvas, view, scene, unit)
    draw_patches(canvas, view, scene, unit)
    _draw_grid(canvas, view, unit)
    canvas.line(view.pixels(scene.path), 1.6 * unit, palette.PATH)
    draw_obstacles(canvas, view, scene.obstacles, unit)
    canvas.clip(None)


def draw_patches(canvas: Canvas, view: View, scene: Scene, unit: float) -> None:
    """Where the floor has a friction of its own: less than around it, or more."""
    for patch in () if scene.floor is None else scene.floor.patches:
        ice = patch.friction < scene.robot.floor_friction
        colour, edge = (palette.ICE, palette.ICE_EDGE) if ice else (palette.ROUGH, palette.ROUGH_EDGE)
        centre, radius = view.pixels((patch.x, patch.y)), patch.radius * view.scale
        canvas.disc(centre, radius, edge)
        canvas.disc(centre, max(radius - 1.5 * unit, 0.0), colour)


def draw_scale(canvas: Canvas, view: View, unit: float) -> None:
    """A bar of round length in the lower left corner."""
    length = round_length(0.22 * view.area.width / view.scale)
    x, y = view.area.left + 16.0 * unit, view.area.top + view.area.height - 16.0 * unit
    end = x + length * view.scale
    canvas.rectangle(Area(x, y - 15.0 * unit, end - x, 15.0 * unit).inset(-8.0 * unit), palette.PAPER, BACKING)
    canvas.line([(x, y - 4.0 * unit), (x, y), (end, y), (end, y - 4.0 * unit)], 1.4 * unit, palette.INK)
    canvas.text(f"{length:g} m", ((x + end) / 2.0, y - 5.0 * unit), 17.0 * unit, palette.INK, 0.5, 1.0)


def draw_legend(canvas: Canvas, view: View, unit: float) -> None:
    """What the lines are, in the lower right corner."""
    right, y = view.area.left + view.area.width - 16.0 * unit, view.area.top + view.area.height - 16.0 * unit
    x = right - LEGEND * unit
    canvas.rectangle(Area(x, y - 15.0 * unit, right - x, 15.0 * unit).inset(-8.0 * unit), palette.PAPER, BACKING)
    y -= 6.0 * unit
    for name, width, colour in (("path", 1.6, palette.PATH), ("driven", 2.2, palette.TRACE)):
        canvas.line([(x, y), (x + 20.0 * unit, y)], width * unit, colour)
        canvas.text(name, (x + 27.0 * unit, y), 17.0 * unit, palette.FAINT_INK)
        x += 70.0 * unit


def _draw_corridor(canvas: Canvas, view: View, scene: Scene, unit: float) -> None:
    """The points nearer to the path than the corridor's half width."""
    width = scene.corridor * view.scale
    track = thin_out(view.pixels(scene.path), max(1.0, 0.05 * width))
    for radius, colour in ((width + unit, palette.CORRIDOR_EDGE), (width, palette.CORRIDOR)):
        canvas.line(track, 2.0 * radius, colour)
        for point in track:
            canvas.disc(point, radius, colour)


def _draw_grid(canvas: Canvas, view: View, unit: float) -> None:
    area = view.area
    spacing = round_length(0.22 * area.width / view.scale)
    left, bottom = view.metres((area.left, area.top + area.height))
    right, top = view.metres((area.left + area.width, area.top))
    for x in np.arange(math.ceil(left / spacing), math.floor(right / spacing) + 1) * spacing:
        canvas.line(view.pixels([(x, bottom), (x, top)]), unit, palette.GRID)
    for y in np.arange(math.ceil(bottom / spacing), math.floor(top / spacing) + 1) * spacing:
        canvas.line(view.pixels([(left, y), (right, y)]), unit, palette.GRID)


def draw_obstacles(canvas: Canvas, view: View, obstacles: Obstacles, unit: float) -> None:
    """Half-planes hatched behind their edge; pillars, walls and polygons filled."""
    half_planes = np.array([obstacles.faces[face] for face, _, first, end in obstacles.spans if first == end])
    for face in half_planes:
        frame = view.metres(view.area.inset(-8.0 * unit).corners)
        canvas.polygon(view.pixels(_behind(frame, face[:2], float(face[2]))), palette.SOLID)
    for i, face in enumerate(half_planes):
        _draw_edge(canvas, view, face, np.delete(half_planes, i, axis=0), unit)
    for colour, grown in ((palette.SOLID_EDGE, 0.0), (palette.SOLID, -1.5 * unit)):  # so that they join
        for radius, (_, _, first, end) in zip(obstacles.radii, obstacles.spans, strict=True):
            if end > first:
                _draw_body(canvas, view.pixels(obstacles.corners[first:end]), radius * view.scale, grown, colour, unit)


def _draw_body(
    canvas: Canvas, corners: Array, rounding: float, grown: float, colour: palette.Colour, unit: float
) -> None:
    """All points nearer to a polygon than a radius, with its edge moved outwards by `grown`. [px]"""
    radius = rounding + grown
    if len(corners) <= 2:
        least = 0.5 * THIN * unit if grown == 0.0 and len(corners) == 2 else 0.0
        radius = max(radius, least)
        if radius > 0.0:
            canvas.line(corners, 2.0 * radius, colour)
    elif radius >= 0.0:
        canvas.polygon(corners, colour)
        canvas.line(np.concatenate([corners, corners[:1]]), 2.0 * radius, colour)
    else:
        canvas.polygon(_shrunk(corners, -radius), colour)
    if radius > 0.0:
        for corner in corners:
            canvas.disc(corner, radius, colour)


def _shrunk(corners: Array, by: float) -> Array:
    """A convex polygon with every edge moved inwards."""
    shape = corners
    middle = corners.mean(axis=0)
    for first, last in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (last - first) / np.hypot(*(last - first))
        normal = np.array([along[1], -along[0]])
        normal = normal if normal @ (first - middle) > 0.0 else -normal
        shape = _behind(shape, normal, float(normal @ first) - by)
    return shape


def _draw_edge(canvas: Canvas, view: View, face: Array, others: Array, unit: float) -> None:
    """The edge of a half-plane n · p >= offset, hatched behind, as far as it lies in the free part of all others."""
    normal, along = face[:2], np.array([-face[1], face[0]])
    middle = view.metres(view.area.centre)
    away = float(normal @ middle - face[2])
    half = 0.6 * math.hypot(view.area.width, view.area.height) / view.scale
    if abs(away) > half:
        return
    foot, first, last = middle - away * normal, -half, half
    for other in others:
        slope, height = float(along @ other[:2]), float(foot @ other[:2] - other[2])
        if slope > 1e-9:
            first = max(first, -height / slope)
        elif slope < -1e-9:
            last = min(last, -height / slope)
        elif height < 0.0:
            return
    if first >= last:
        return
    spacing = 11.0 * unit / view.scale
    for step in np.arange(math.ceil(first / spacing), last / spacing) * spacing:
        start = foot + step * along
        canvas.line(view.pixels([start, start + 0.9 * spacing * (along - normal)]), unit, palette.SOLID_EDGE)
    canvas.line(view.pixels([foot + first * along, foot + last * along]), 2.0 * unit, palette.SOLID_EDGE)


def _behind(polygon: Array, normal: Array, offset: float) -> Array:
    """The part (n, 2) of a convex polygon with normal · p <= offset (Sutherland and Hodgman)."""
    kept = []
    heights = polygon @ normal - offset
    for i, (point, height) in enumerate(zip(polygon, heights, strict=True)):
        before, height_before = polygon[i - 1], heights[i - 1]
        if (height <= 0.0) != (height_before <= 0.0):
            kept.append(before + (point - before) * height_before / (height_before - height))
        if height <= 0.0:
            kept.append(point)
    return np.array(kept).reshape(-1, 2)
