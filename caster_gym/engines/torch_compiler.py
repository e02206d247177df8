"""Torch's compiler, and CUDA graphs where they help."""

from collections.abc import Callable
from typing import Any

import torch
from torch.utils import _pytree as pytree

FUSED = 1_000_000  # intermediate values in one kernel of the CPU: past 64, the usual limit, they would go to memory


def compiled(function: Callable[..., Any], device: torch.device, graphs: bool = False) -> Callable[..., Any]:
    """The function fused into as few kernels as possible, for each batch size anew.

    graphs: on a CUDA device, replay its kernels as one graph, without gradients; see `replayed`.
    """
    options: dict[str, Any] = {"max_fusion_size": FUSED} if device.type == "cpu" else {"triton.cudagraphs": graphs}
    return torch.compile(function, fullgraph=True, dynamic=False, options=options)


def replayed(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of compiled parts with CUDA graphs, whose results stay valid after its next call."""

    def call(*arguments: Any) -> Any:
        torch.compiler.cudagraph_mark_step_begin()  # type: ignore[no-untyped-call]  # Torch ships it without types
        return pytree.tree_map_only(torch.Tensor, torch.clone, function(*arguments))

    return call
