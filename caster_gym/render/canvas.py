"""Smooth shapes on a pygame surface: everything is drawn SAMPLES times larger and averaged once at the end.

Coordinates and lengths are continuous pixels of the finished frame; `pygame.draw` knows whole pixels only.
"""

import math
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.render.palette import PAPER, Colour
from caster_gym.render.pygame_loader import pygame
from caster_gym.render.view import Area

SAMPLES = 4  # along each axis of a finished pixel; a power of two, for which pygame averages without error
PIECE = 2.0  # [px] of a line through dense points; its arc is 0.03 px from its chord at a radius of 20 px
SHARP = 0.2  # [rad] turn of a line above which its corner is rounded off


class Canvas:
    """A frame in the making."""

    def __init__(self, width: int, height: int) -> None:
        self.size = (width, height)

    def __getstate__(self) -> dict[str, Any]:
        """A copy is blank: surfaces cannot be pickled, and every picture is drawn anew."""
        return {"size": self.size}

    @cached_property
    def _surface(self) -> pygame.Surface:
        """40 MB for a frame of the usual size, which copies that draw nothing do without."""
        surface = pygame.Surface((self.size[0] * SAMPLES, self.size[1] * SAMPLES), depth=32)
        surface.fill(PAPER)
        return surface

    def copy_from(self, other: "Canvas") -> None:
        """Take over another canvas of the same size."""
        self._surface.blit(other._surface, (0, 0))

    def finished(self) -> pygame.Surface:
        """The frame, each pixel the mean of its samples."""
        return pygame.transform.smoothscale(self._surface, self.size)

    def clip(self, area: Area | None) -> None:
        """Draw inside an area only, or everywhere."""
        if area is None:
            self._surface.set_clip(None)
            return
        left, top = round(area.left * SAMPLES), round(area.top * SAMPLES)
        right, bottom = round((area.left + area.width) * SAMPLES), round((area.top + area.height) * SAMPLES)
        self._surface.set_clip(pygame.Rect(left, top, right - left, bottom - top))

    def fill(self, colour: Colour) -> None:
        """One colour for all that is not clipped off."""
        self._surface.fill(colour)

    def polygon(self, points: ArrayLike, colour: Colour, opacity: float = 1.0) -> None:
        """A filled polygon with corners (n, 2)."""
        corners = np.floor(np.asarray(points) * SAMPLES)
        if len(corners) < 3 or not np.isfinite(corners).all():
            return
        low, high = corners.min(axis=0), corners.max(axis=0)
        self._paint(
            low,
            high,
            colour,
            opacity,
            lambda on, corner, ink: pygame.draw.polygon(on, ink, (corners - corner).tolist()),
        )

    def rectangle(self, area: Area, colour: Colour, opacity: float = 1.0) -> None:
        """A filled rectangle."""
        self.polygon(area.corners, colour, opacity)

    def disc(self, centre: ArrayLike, radius: float, colour: Colour, opacity: float = 1.0) -> None:
        """A filled circle."""
        self._circle(centre, radius, colour, 0, opacity)

    def ring(self, centre: ArrayLike, radius: float, width: float, colour: Colour, opacity: float = 1.0) -> None:
        """A circle's line, its middle at the radius."""
        self._circle(centre, radius + 0.5 * width, colour, max(1, round(width * SAMPLES)), opacity)

    def _circle(self, centre: ArrayLike, radius: float, colour: Colour, width: int, opacity: float) -> None:
        middle, size = np.asarray(centre) * SAMPLES, radius * SAMPLES
        if not np.isfinite(middle).all():
            return
        self._paint(
            np.floor(middle - size) - 1.0,
            np.ceil(middle + size) + 1.0,
            colour,
            opacity,
            lambda on, first, ink: pygame.draw.circle(on, ink, (middle - first).tolist(), size, width),
        )

    def line(self, points: ArrayLike, width: float, colour: Colour, opacity: float = 1.0) -> None:
        """A line through points (n, 2) with round corners and flat ends; of dense points it leaves some out."""
        track = thin_out(np.asarray(points, dtype=np.float64), PIECE)
        if len(track) < 2 or not np.isfinite(track).all():
            return
        low, high = (track.min(axis=0) - width) * SAMPLES, (track.max(axis=0) + width) * SAMPLES
        self._paint(
            np.floor(low),
            np.ceil(high),
            colour,
            opacity,
            lambda on, corner, ink: _stroke(on, track, corner, width, ink),
        )

    def arrow(self, tail: ArrayLike, tip: ArrayLike, width: float, colour: Colour, opacity: float = 1.0) -> None:
        """An arrow; one shorter than its width is left out."""
        start, end = np.asarray(tail, dtype=np.float64), np.asarray(tip, dtype=np.float64)
        length = float(np.hypot(*(end - start)))
        if not length > width:
            return
        along = (end - start) / length
        left = np.array([along[1], -along[0]])
        head = min(4.2 * width, 0.7 * length)
        neck, half, wing = end - head * along, 0.5 * width * left, 0.42 * head * left
        outline = [start + half, neck + half, neck + wing, end, neck - wing, neck - half, start - half]
        self.polygon(outline, colour, opacity)

    def text(
        self, string: str, place: ArrayLike, size: float, colour: Colour, across: float = 0.0, down: float = 0.5
    ) -> None:
        """Text of a height [px]; across, down: which point of it, in 0 … 1, is at the place."""
        picture = _text(string, round(size * SAMPLES), colour)
        x, y = np.asarray(place) * SAMPLES
        self._surface.blit(picture, (round(x - across * picture.get_width()), round(y - down * picture.get_height())))

    def _paint(
        self,
        low: Array,
        high: Array,
        colour: Colour,
        opacity: float,
        draw: Callable[[pygame.Surface, Array, pygame.Color], object],
    ) -> None:
        """Let `draw` paint between two corners, on a layer of its own where it is translucent."""
        inside = self._surface.get_clip()
        box = pygame.Rect(*low.tolist(), *(high - low + 1.0).tolist()).clip(inside)
        if box.width == 0 or box.height == 0:
            return
        if opacity >= 1.0:
            draw(self._surface, np.zeros(2), pygame.Color(*colour))
            return
        layer = pygame.Surface(box.size, pygame.SRCALPHA, depth=32)
        ink = pygame.Color(*colour, round(255.0 * max(opacity, 0.0)))
        draw(layer, np.array(box.topleft, dtype=np.float64), ink)
        self._surface.blit(layer, box)


def _stroke(on: pygame.Surface, track: Array, corner: Array, width: float, colour: pygame.Color) -> None:
    """A quadrilateral for each piece of a line, and discs where it turns sharply."""
    points = track * SAMPLES - corner
    pieces = np.diff(points, axis=0)
    length = np.hypot(pieces[:, 0], pieces[:, 1])
    points, pieces, length = points[np.append(length > 0.0, True)], pieces[length > 0.0], length[length > 0.0]
    half = 0.5 * (width * SAMPLES - 1.0)  # a polygon covers the pixels of its border too, half of one on each side
    side = half * np.stack([-pieces[:, 1], pieces[:, 0]], axis=1) / length[:, None]
    first, last = points[:-1], points[1:]
    inside = on.get_clip()
    low, high = np.array(inside.topleft) - half, np.array(inside.bottomright) + half
    seen = ((np.maximum(first, last) > low) & (np.minimum(first, last) < high)).all(axis=1)
    outlines = np.floor(np.stack([first + side, last + side, last - side, first - side], axis=1))
    for outline in outlines[seen].tolist():
        pygame.draw.polygon(on, colour, outline)
    turns = np.abs(pieces[:-1, 0] * pieces[1:, 1] - pieces[:-1, 1] * pieces[1:, 0])
    straight = (pieces[:-1] * pieces[1:]).sum(axis=1)
    for joint in points[1:-1][np.arctan2(turns, straight) > SHARP].tolist():
        pygame.draw.circle(on, colour, joint, half)


def thin_out(points: Array, spacing: float) -> Array:
    """Points (n, 2) of a line without those that follow another more closely than about a spacing; ends stay."""
    if len(points) < 3:
        return points
    steps = np.diff(points, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    _, kept = np.unique(np.floor(along / spacing), return_index=True)
    rest: Array = points[np.unique(np.append(kept, len(points) - 1))]
    return rest


def rounded_rectangle(length: float, width: float, rounding: float) -> Array:
    """Outline (n, 2) of a rectangle about the origin, its length along x, with rounded corners."""
    r = min(rounding, 0.5 * length, 0.5 * width)
    angles = np.linspace(0.0, 0.5 * math.pi, 5)
    quarter = r * np.stack([np.cos(angles), np.sin(angles)], axis=1) + (0.5 * length - r, 0.5 * width - r)
    mirrored = quarter[::-1] * (-1.0, 1.0)
    return np.concatenate([quarter, mirrored, -quarter, -mirrored])


@lru_cache(maxsize=256)
def _text(string: str, height: int, colour: Colour) -> pygame.Surface:
    try:
        return _font(height).render(string, True, colour)
    except pygame.error:  # fonts end with pygame.quit(), which other environments call when they are closed
        _font.cache_clear()
        return _font(height).render(string, True, colour)


@lru_cache(maxsize=16)
def _font(height: int) -> pygame.font.Font:
    """The font that comes with pygame, the same on every machine."""
    if not pygame.font.get_init():
        pygame.font.init()
    return pygame.font.Font(None, height)
