"""Turns scenes into frames, which the environments' render() shows or returns. Needs pygame-ce."""

import copy
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from caster_gym.arrays import Frame
from caster_gym.envs.scene import Scene
from caster_gym.render import palette
from caster_gym.render.canvas import Canvas
from caster_gym.render.drawing import draw_motion
from caster_gym.render.floor import draw_floor, draw_legend, draw_scale
from caster_gym.render.history import History
from caster_gym.render.panel import draw_panel, status
from caster_gym.render.pygame_loader import pygame
from caster_gym.render.view import Area, View, extent, fit_view, grid, view_around

SIZE = (960, 640)  # [px]
UNIT = 640.0  # [px] frame height for which letters and lines are designed
MOST = 16  # robots shown at once
WIDE = 1.3  # frames at least that much wider than high have a panel beside the map
PANEL = 0.5  # width of the panel, in heights of the frame
RENDER_MODES = ("human", "rgb_array")


class Viewer:
    """Draws one robot in a full frame, or several in a grid: the first 16, each in a cell.

    render_mode "rgb_array" returns frames and never touches a display; "human" shows them in a window, at most
    `fps` a second. size: width and height of the frame [px]; where it is wide enough, a robot alone gets a panel with
    a close-up beside the map. follow: width of floor shown around the robot [m]; None shows all of its path.
    """

    def __init__(
        self, render_mode: str, size: tuple[int, int] = SIZE, fps: float = 50.0, follow: float | None = None
    ) -> None:
        if render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode must be one of {', '.join(RENDER_MODES)}, got {render_mode!r}")
        if min(size) < 64 or max(size) > 8192:
            raise ValueError(f"size must lie in 64 … 8192 pixels along both axes, got {size}")
        if not fps > 0.0:
            raise ValueError(f"fps must be positive, got {fps}")
        if follow is not None and not follow > 0.0:
            raise ValueError(f"follow must be a positive width in metres or None, got {follow}")
        self.render_mode, self.size, self.fps, self.follow = render_mode, size, fps, follow
        self.closed = False
        self._canvas = Canvas(*size)
        self._floor = _Floor(size)
        self._cells: list[_Cell] = []
        self._picture: pygame.Surface | None = None
        self._window: pygame.Surface | None = None
        self._clock = pygame.time.Clock()

    def beside(self) -> Self:
        """A viewer for other robots with the same settings, which draws on the same canvases, in turn with this one."""
        other = copy.copy(self)
        other._cells = []
        return other

    def __getstate__(self) -> dict[str, Any]:
        """A copy remembers what it has seen of its robots; pictures are drawn, and windows opened, anew."""
        return {**vars(self), "_picture": None, "_window": None, "_clock": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._clock = pygame.time.Clock()

    @property
    def most(self) -> int:
        """How many robots are shown at once."""
        return MOST

    def show(self, scenes: Sequence[Scene]) -> Frame | None:
        """Draw the scenes of one moment, in the same order each time.

        Returns the frame (height, width, 3) in rgb_array mode. In human mode it shows the frame, waits for its time and
        returns None; once the window has been closed, `closed` is True and nothing is shown any more.
        """
        shown = scenes[:MOST]
        if not shown:
            raise ValueError("there must be at least one scene to show")
        if self.closed:
            return None
        if len(shown) != len(self._cells):
            self._divide(len(shown))
        shown = [cell.drawable(scene) for cell, scene in zip(self._cells, shown, strict=True)]
        for cell, scene in zip(self._cells, shown, strict=True):
            cell.take(scene, self._floor, self.follow)
        self._canvas.copy_from(self._floor.canvas)
        for cell, scene in zip(self._cells, shown, strict=True):
            cell.draw(scene, self._canvas)
        self._picture = self._canvas.finished()
        if self.render_mode == "rgb_array":
            return self.frame()
        self._show_in_window(self._picture)
        return None

    def frame(self) -> Frame:
        """What was shown last (height, width, 3), as an array of its own. Raises ValueError if nothing was."""
        if self._picture is None:
            raise ValueError("nothing has been shown yet")
        data = np.frombuffer(pygame.image.tobytes(self._picture, "RGB"), dtype=np.uint8)
        return data.reshape(self.size[1], self.size[0], 3).copy()

    def view(self, robot: int = 0) -> View:
        """How the map of a shown robot lies in the last frame. Raises ValueError if it was not shown."""
        if not 0 <= robot < len(self._cells) or (view := self._cells[robot].view) is None:
            raise ValueError(f"robot {robot} has not been shown; {len(self._cells)} robots have been")
        return view

    def close(self) -> None:
        """Close the window, if there is one. May be called twice."""
        if self._window is not None:
            pygame.display.quit()
            self._window = None
        self.closed = True

    def _divide(self, count: int) -> None:
        """Give each of so many robots its cell."""
        width, height = self.size
        self._floor.clear()
        if count == 1 and width >= WIDE * height:
            panel = min(PANEL * height, 0.5 * width)
            whole = Area(0.0, 0.0, width - panel, height)
            self._cells = [_Cell(whole, Area(width - panel, 0.0, panel, height), height / UNIT, "")]
            return
        cells = grid(count, Area(0.0, 0.0, width, height))
        gap = 0.0 if count == 1 else 1.5 * min(width, height) / UNIT
        unit = max(min(cells[0].width, cells[0].height) / UNIT, 0.6 * min(1.0, min(self.size) / UNIT))
        names = ["" if count == 1 else f"robot {i}" for i in range(count)]
        self._cells = [_Cell(area.inset(gap), None, unit, name) for area, name in zip(cells, names, strict=True)]

    def _show_in_window(self, picture: pygame.Surface) -> None:
        # any other environment may have quit pygame since, which closes all windows
        if self._window is None or pygame.display.get_surface() is not self._window:
            if not has_display():
                os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # a window that nobody sees, instead of an error
            pygame.display.init()
            pygame.display.set_caption("caster_gym")
            self._window = pygame.display.set_mode(self.size)
        self._window.blit(picture, (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):  # all are taken, so that none pile up
            self.close()
        self._clock.tick(self.fps)


class _Floor:
    """What stands still, which is drawn when it has changed. Viewers that share it draw in the same areas."""

    def __init__(self, size: tuple[int, int]) -> None:
        self.canvas = Canvas(*size)
        self._shown: dict[Area, tuple[Scene, View]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {"canvas": self.canvas, "_shown": {}}

    def clear(self) -> None:
        """Leave nothing but paper."""
        self.canvas.fill(palette.PAPER)
        self._shown = {}

    def view(self, scene: Scene, cell: "_Cell", follow: float | None) -> View:
        """How a scene lies in a cell, where its floor has been drawn."""
        if follow is None and cell.area in self._shown and same_floor(scene, self._shown[cell.area][0]):
            return self._shown[cell.area][1]
        if follow is not None:
            view = view_around(scene.pose[:2], follow, cell.area)
        else:
            view = fit_view(*extent(scene), cell.area.inset(14.0 * cell.unit)).in_area(cell.area)
        draw_floor(self.canvas, view, scene, cell.unit)
        draw_scale(self.canvas, view, cell.unit)
        if cell.panel is not None:
            draw_legend(self.canvas, view, cell.unit)
        self._shown[cell.area] = scene, view
        return view


class _Cell:
    """One robot's place in the frame, and its past."""

    def __init__(self, area: Area, panel: Area | None, unit: float, name: str) -> None:
        self.area, self.panel, self.unit, self.name = area, panel, unit, name
        self.view: View | None = None
        self._history = History()
        self._last: Scene | None = None

    def drawable(self, scene: Scene) -> Scene:
        """The scene, or the last one, failed, if this one holds numbers that are not finite."""
        numbers = (scene.pose, scene.twist, scene.directions, scene.torque, scene.ground_forces, scene.impulse)
        if self._last is None or all(np.isfinite(part).all() for part in numbers):
            return scene
        return replace(self._last, time=scene.time, failed=True)

    def take(self, scene: Scene, floor: _Floor, follow: float | None) -> None:
        """Take in a scene, and draw the floor where it has changed."""
        self._history.add(scene)
        self._last = scene
        self.view = floor.view(scene, self, follow)

    def draw(self, scene: Scene, canvas: Canvas) -> None:
        """Draw what moves."""
        assert self.view is not None  # take() comes first
        draw_motion(canvas, self.view, scene, self._history, self.unit)
        if self.panel is not None:
            draw_panel(canvas, self.panel, scene, self._history, self.unit)
            return
        right, bottom = self.area.left + self.area.width, self.area.top + self.area.height
        place = (right - 14.0 * self.unit, bottom - 16.0 * self.unit)
        canvas.text(status(scene, self._history), place, 19.0 * self.unit, palette.INK, 1.0)
        if self.name:
            corner = (self.area.left + 10.0 * self.unit, self.area.top + 14.0 * self.unit)
            canvas.text(self.name, corner, 19.0 * self.unit, palette.FAINT_INK)


def same_floor(one: Scene, other: Scene) -> bool:
    """Whether two scenes have the same path, corridor, obstacles and robot."""
    return (
        one.robot is other.robot
        and one.corridor == other.corridor
        and np.array_equal(one.path, other.path)
        and all(np.array_equal(a, b) for a, b in zip(one.obstacles, other.obstacles, strict=True))
    )


def has_display() -> bool:
    """Whether a window would be seen by somebody."""
    if os.environ.get("SDL_VIDEODRIVER"):
        return os.environ["SDL_VIDEODRIVER"] not in ("dummy", "offscreen")
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
