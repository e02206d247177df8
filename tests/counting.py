"""An agent with memory, which shows in its actions."""

from typing import Any

import numpy as np


class Counting:
    """Gives every robot's first joint a hundredth for each action of its episode, and notes all actions."""

    name = "counting"

    def __init__(self) -> None:
        self.done: Any = np.zeros(0, dtype=np.int64)
        self.given: list[np.ndarray] = []

    def reset(self, mask):
        self.done = np.where(mask, 0, self.done if len(self.done) else 0)

    def act(self, observations):
        self.done += 1
        actions = np.zeros((len(observations), 6), dtype=np.float32)
        actions[:, 0] = 0.01 * self.done
        self.given.append(actions[:, 0].copy())
        return actions
