"""Weights of a policy from a safetensors file that a stranger may have written.

The file's header is read first, and compared with the shapes that the policy's description promises, before anything of
their size is made.
"""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load

from caster_gym.bounded_files import WEIGHTS_BYTES, read_bytes
from caster_gym.brief import brief, cut
from caster_gym.configuration import ConfigurationError

Shapes = Mapping[str, tuple[int, ...]]

_LENGTH = 8  # [bytes] of the number in front of the header, least significant first
_HEADER_BYTES = 1 << 20  # that of an actor with 30 layers has 6,000


def actor_shapes(inputs: int, hidden: Sequence[int], outputs: int) -> Shapes:
    """Shapes of the weights of an `Actor`, by their names."""
    widths = [inputs, *hidden]
    layers = {f"layers.{i}": (after, before) for i, (before, after) in enumerate(pairwise(widths))}
    layers["head"] = (outputs, widths[-1])
    return {f"{name}.{part}": shape[:n] for name, shape in layers.items() for part, n in (("weight", 2), ("bias", 1))}


def read_weights(path: Path, wanted: Shapes) -> dict[str, torch.Tensor]:
    """Finite float32 tensors of these names and shapes.

    Raises ConfigurationError that names the file, the weight and what is wrong with it.
    """
    try:
        content = read_bytes(path, WEIGHTS_BYTES)
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    found = _header(path, content)
    for name in sorted(wanted.keys() ^ found.keys()):
        raise ConfigurationError(f"{path}: weight {brief(name)} is {'missing' if name in wanted else 'not known'}")
    for name, shape in wanted.items():
        kind, given = found[name].get("dtype"), found[name].get("shape")
        if kind != "F32" or given != list(shape):
            raise ConfigurationError(
                f"{path}: weight {name!r} must be {list(shape)} of type 'F32', got {brief(given)} of {brief(kind)}"
            )
    size = 4 * sum(map(prod, wanted.values()))
    if len(content) - _LENGTH - int.from_bytes(content[:_LENGTH], "little") != size:
        raise ConfigurationError(f"{path} holds no weights: behind its header there should be {size} bytes")
    try:
        weights = load(content)
    except SafetensorError as error:
        raise ConfigurationError(f"{path} holds no weights: {cut(str(error))}") from error
    for name, tensor in weights.items():
        if not torch.isfinite(tensor).all():
            raise ConfigurationError(f"{path}: weight {name!r} holds numbers that are not finite")
    return weights


def _header(path: Path, content: bytes) -> dict[str, Mapping[str, Any]]:
    """What the file says of its tensors."""
    length = int.from_bytes(content[:_LENGTH], "little")
    if len(content) < _LENGTH or length > min(_HEADER_BYTES, len(content) - _LENGTH):
        raise ConfigurationError(f"{path} holds no weights: it does not begin with the header of a safetensors file")
    try:
        header = json.loads(content[_LENGTH : _LENGTH + length].decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} holds no weights: its header is no JSON") from error
    tensors: dict[str, Any] = {**header, "__metadata__": {}} if isinstance(header, dict) else {"": None}
    if not all(isinstance(told, dict) for told in tensors.values()):
        raise ConfigurationError(f"{path} holds no weights: its header does not describe tensors")
    del tensors["__metadata__"]
    return tensors
