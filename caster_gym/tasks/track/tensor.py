"""Trajectories run by the clock, for a batch of tensors."""

import torch
from torch import Tensor

from caster_gym.envs.plan import SPAN
from caster_gym.envs.tensor.reference import Guidance
from caster_gym.envs.tracking import POINT_ROWS, Point, Reference
from caster_gym.mechanics.integration import State
from caster_gym.tasks.track.reference import Timetable


class TorchTimetable:
    """Trajectories run by the clock."""

    def __init__(self, source: Timetable, dtype: torch.dtype, device: torch.device) -> None:
        self.samples = torch.as_tensor(source.samples, dtype=dtype, device=device).T.contiguous()  # (10, rows)
        self.spans = torch.as_tensor(source.spans, device=device)
        self._horizons = tuple(source.horizons.tolist())

    def reference_at(self, path: Tensor, clock: Tensor, _state: State) -> Reference:
        """Reference at clocks (robots,) [control periods]."""
        first, last = self.spans[path, SPAN.first], self.spans[path, SPAN.last]
        return Reference(*self.samples[:, torch.minimum(first + clock, last)].unbind(0))

    def fetch(self, state: State, clock: Tensor, path: Tensor, before: Tensor) -> Guidance:
        """Reference and preview at the robots' clocks."""
        first, last = self.spans[path, SPAN.first], self.spans[path, SPAN.last]
        reference = self.reference_at(path, clock, state)
        rows = [self.samples[:POINT_ROWS, torch.minimum(first + clock + ahead, last)] for ahead in self._horizons]
        none = torch.zeros_like(before)
        return Guidance(reference, tuple(Point(*row.unbind(0)) for row in rows), none, none)
