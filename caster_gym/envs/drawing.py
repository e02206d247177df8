"""Lets environments draw themselves, as Gymnasium asks; `caster_gym.render` draws."""

from typing import TYPE_CHECKING, Any

from gymnasium import logger

from caster_gym.arrays import Frame
from caster_gym.envs.native.engine import TaskEngine

if TYPE_CHECKING:
    from caster_gym.render.album import Album
    from caster_gym.render.viewer import Viewer


def checked_mode(render_mode: str | None, metadata: dict[str, Any]) -> str | None:
    """The render mode. Raises ValueError for an unknown one."""
    if render_mode is not None and render_mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode must be None or one of {metadata['render_modes']}, got {render_mode!r}")
    return render_mode


class Renderer:
    """Holds the viewer of an environment, which is made when something is drawn for the first time."""

    def __init__(self, engine: TaskEngine, render_mode: str | None, fps: int) -> None:
        self._engine, self._mode, self._fps = engine, render_mode, fps
        self._viewer: Viewer | None = None
        self._album: Album | None = None
        if render_mode is not None:
            engine.keep_reports()

    def show(self) -> Frame | None:
        """A frame (height, width, 3) of the only robot, or None if it is shown in a window or not at all."""
        return None if self._warned() else self._open_viewer().show([self._engine.scene(0)])

    def show_batch(self) -> tuple[Frame, ...] | Frame | None:
        """A frame of each robot, one of a grid of the first, or None if they are shown in a window or not at all."""
        if self._warned():
            return None
        if self._mode == "rgb_array":
            return self._open_album().show([self._engine.scene(robot) for robot in range(self._engine.count)])
        viewer = self._open_viewer()
        return viewer.show([self._engine.scene(robot) for robot in range(min(self._engine.count, viewer.most))])

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
        self._viewer = self._album = None

    def _warned(self) -> bool:
        if self._mode is None:
            logger.warn(
                'render() draws nothing without a render_mode; make the environment with render_mode="rgb_array" '
                'or "human"'
            )
        return self._mode is None

    # Gymnasium's environments draw themselves, so that these two import from above; they wait until it is needed

    def _open_viewer(self) -> "Viewer":
        from caster_gym.render.viewer import Viewer

        if self._viewer is None:
            self._viewer = Viewer("human" if self._mode == "human" else "rgb_array", fps=self._fps)
        return self._viewer

    def _open_album(self) -> "Album":
        from caster_gym.render.album import Album

        if self._album is None:
            self._album = Album()
        return self._album
