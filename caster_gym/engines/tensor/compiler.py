"""Torch's compiler, and CUDA graphs where they help."""

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch
from torch.utils import _pytree as pytree

from caster_gym.engines.cache_folders import cache_folders, fault_of, say_once

FUSED = 1_000_000  # intermediate values in one kernel of the CPU: past 64, the usual limit, they would go to memory
READS = 1  # arrays behind a value that is worked out anew for each use: the usual 4 take the compiler twice as long
_KEPT = {"inplace_buffers": False, "allow_buffer_reuse": False}  # else gradients come out wrong (Torch 2.13)
_CACHE_VARIABLE = "TORCHINDUCTOR_CACHE_DIR"
_said: list[str] = []  # by this process


def compiled(function: Callable[..., Any], device: torch.device, graphs: bool = False) -> Callable[..., Any]:
    """The function fused into as few kernels as possible, for each batch size anew.

    Regions marked with `torch.compiler.nested_compile_region` are compiled once, however often they are called.
    graphs: on a CUDA device, replay its kernels as one graph, without gradients; see `replayed`.
    """
    from caster_gym.engines.tensor.folding import Folding  # whose import takes a second

    options: dict[str, Any] = {"guard_filter_fn": _own_guards, "pre_grad_custom_pass": Folding(), **_KEPT}
    if device.type == "cpu":
        options |= {"max_fusion_size": FUSED, "realize_reads_threshold": READS}
    else:
        options["triton.cudagraphs"] = graphs
    choose_cache()
    announce_compilation()
    compile_: Any = torch.compile  # whose declared types lack the last argument
    made: Callable[..., Any] = compile_(
        function, fullgraph=True, dynamic=False, options=options, isolate_recompiles=True
    )
    return made


def choose_cache() -> None:
    """Let Torch keep compiled code where nobody else can put code for us to run, unless the user says where.

    Left alone, Torch takes whatever lies in a folder of a known name in /tmp. Where there is no trusted folder, it gets
    a new one that goes with this process. What Triton compiles lies beneath it too.
    """
    chosen = Path(os.environ.get(_CACHE_VARIABLE, ""))
    of_torch = chosen.name.startswith("torchinductor_") and chosen.parent == Path(tempfile.gettempdir())
    if chosen.name and not of_torch:  # which Torch puts there itself when it is first used
        _warn_of(chosen)
        return
    root = next(cache_folders(os.environ.get("NUMBA_CACHE_DIR")), None)
    if root is None:
        folder = Path(tempfile.mkdtemp(prefix="caster_gym-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    else:
        folder = root / "torch"
    os.environ[_CACHE_VARIABLE] = str(folder)


def _warn_of(chosen: Path) -> None:
    """Say it if others can put code into the folder that the user has named."""
    folder = chosen.resolve()
    fault = fault_of(next(place for place in (folder, *folder.parents) if place.exists()))
    if fault is not None:
        say_once(f"Torch runs code that it finds in {_CACHE_VARIABLE}={chosen}: {fault}")


def announce_compilation() -> None:
    """Say once on stderr that compiling is ahead; whether Torch has it on disk shows only half-way."""
    if not _said:
        _said.append(
            "caster_gym has Torch compile the robots' motion at its first use: 30 to 60 s for each batch size, or "
            "some 10 s where Torch's cache on disk has it"
        )
        print(_said[0], file=sys.stderr)


def replayed(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of compiled parts with CUDA graphs, whose results stay valid after its next call."""

    def call(*arguments: Any) -> Any:
        torch.compiler.cudagraph_mark_step_begin()  # type: ignore[no-untyped-call]  # Torch ships it without types
        return pytree.tree_map_only(torch.Tensor, torch.clone, function(*arguments))

    return call


def _own_guards(guards: Sequence[Any]) -> list[bool]:
    """What is looked up before each call: the arguments, not whether anybody has replaced functions of a module."""
    return [not guard.is_global and not guard.name.startswith("__import__") for guard in guards]
