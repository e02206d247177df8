"""Lets environments draw themselves, as Gymnasium asks; what is drawn, and how, is said in `caster_gym.render`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import logger
from numpy.typing import NDArray

from caster_gym.envs.task_engine import TaskEngine

if TYPE_CHECKING:
    from caster_gym.render.viewer import Viewer


def checked_mode(render_mode: str | None, metadata: dict[str, Any]) -> str | None:
    """The render mode. Raises ValueError for an unknown one."""
    if render_mode is not None and render_mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode must be None or one of {metadata['render_modes']}, got {render_mode!r}")
    return render_mode


class Easel:
    """Holds the viewer of an environment, which is made when something is drawn for the first time."""

    def __init__(self, engine: TaskEngine, render_mode: str | None, fps: int) -> None:
        self._engine, self._mode, self._fps = engine, render_mode, fps
        self._viewer: Viewer | None = None

    def show(self, robots: Sequence[int]) -> NDArray[np.uint8] | None:
        """A frame (height, width, 3) of some robots, or None if they are shown in a window or not at all."""
        if self._mode is None:
            logger.warn(
                'render() draws nothing without a render_mode; make the environment with render_mode="rgb_array" '
                'or "human"'
            )
            return None
        if self._viewer is None:
            # Gymnasium's environments draw themselves, so that this one import points up; it waits until it is needed
            from caster_gym.render.viewer import Viewer

            self._viewer = Viewer(self._mode, fps=self._fps)
        return self._viewer.show([self._engine.scene(robot) for robot in robots])

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
