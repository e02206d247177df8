"""What every agent is, model-based or learned: a function from observations to actions."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Agent(Protocol):
    """Acts on what the environment shows, and on nothing else: same sensors, same preview, same limits for all."""

    @property
    def name(self) -> str:
        """Short name for tables and figures."""
        ...

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) in −1 … 1 for observations (robots, size)."""
        ...
