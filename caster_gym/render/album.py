"""Frames of many robots, one for each: what a batch's render() returns. Needs pygame-ce."""

from collections.abc import Sequence
from typing import Any

from caster_gym.arrays import Frame
from caster_gym.envs.scene import Scene
from caster_gym.render.viewer import SIZE, Viewer


class Album:
    """Draws each robot as a viewer of its own would, all on the same two canvases, which take 80 MB."""

    def __init__(self, size: tuple[int, int] = SIZE) -> None:
        self._viewers: list[Viewer] = []
        self._size = size

    def show(self, scenes: Sequence[Scene]) -> tuple[Frame, ...]:
        """A frame (height, width, 3) of every scene, in the same order each time."""
        if len(scenes) != len(self._viewers):
            first = Viewer("rgb_array", self._size)
            self._viewers = [first, *(first.beside() for _ in scenes[1:])]
        frames: list[Any] = [viewer.show([scene]) for viewer, scene in zip(self._viewers, scenes, strict=True)]
        return tuple(frames)
