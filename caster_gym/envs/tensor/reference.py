"""The protocol of reference sources on tensors, which `on_tensors` makes."""

from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor

from caster_gym.envs.tracking import Point, Reference
from caster_gym.mechanics.integration import State


class Guidance(NamedTuple):
    """What the robots are to do next."""

    reference: Reference
    preview: tuple[Point, ...]
    progress: Tensor  # [m]
    share: Tensor  # of the progress that the period allows


class TorchSource(Protocol):
    """A reference source for a batch of tensors."""

    spans: Tensor  # int64 (paths, 3), as in the source

    def reference_at(self, path: Tensor, place: Tensor, state: State) -> Reference:
        """Reference of robots at places (robots,): their clocks [control periods], or their progress [m]."""
        ...

    def fetch(self, state: State, clock: Tensor, path: Tensor, before: Tensor) -> Guidance:
        """What `fetch_reference` writes; before (robots,): progress [m] so far, negative at the start of an episode."""
        ...


def torch_source(source: Any, task: str, dtype: torch.dtype, device: torch.device) -> TorchSource:
    """The reference source of a task, by name, for a batch of tensors. Raises ValueError where there is none."""
    if not hasattr(source, "on_tensors"):
        raise ValueError(f"task {task!r} does not run on tensors: its {type(source).__name__} has no on_tensors")
    made: TorchSource = source.on_tensors(dtype, device)
    return made


def torch_weights(numbers: Any, dtype: torch.dtype, device: torch.device) -> tuple[Tensor, ...]:
    """Tensors (1,): a Python number times a flag of 0 or 1 would have Torch's default precision."""
    return torch.as_tensor(numbers, dtype=dtype, device=device)[:, None].unbind(0)
