"""The deterministic part of a learned policy: a small network from observation to action."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

Squash = Literal["clip", "tanh"]  # how actions stay in −1 … 1: PPO clips, SAC squashes


class Actor(nn.Module):
    """ReLU layers and a bounded output. Input (robots, observation size), output (robots, actions), float32."""

    def __init__(self, inputs: int, hidden: Sequence[int], outputs: int, squash: Squash) -> None:
        super().__init__()
        widths = [inputs, *hidden]
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(widths))
        self.head = nn.Linear(widths[-1], outputs)
        self.squash = squash

    @property
    def hidden(self) -> tuple[int, ...]:
        """Units of each hidden layer."""
        return tuple(len(layer.bias) for layer in self.layers if isinstance(layer, nn.Linear))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Actions in −1 … 1."""
        for layer in self.layers:
            observations = torch.relu(layer(observations))
        actions: torch.Tensor = self.head(observations)
        return torch.tanh(actions) if self.squash == "tanh" else actions.clamp(-1.0, 1.0)


class LearnedAgent:
    """An agent that acts as a trained network says, without exploration."""

    def __init__(self, actor: Actor, name: str) -> None:
        self.actor = actor.eval()
        self.name = name  # of the algorithm, or what the bundle says

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) for observations (robots, size)."""
        with torch.no_grad():
            actions: NDArray[np.float32] = self.actor(torch.from_numpy(observations)).numpy()
        return actions
