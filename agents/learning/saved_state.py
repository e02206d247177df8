"""What a training run needs to go on after it was killed, as one file that is replaced whole. Reading it runs no code.

The file holds arrays as safetensors, and numbers, such as counters and the states of generators, as JSON beside them.
"""

import json
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors.numpy
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from caster_gym.configuration import ConfigurationError
from caster_gym.durable_files import write_file

NUMBERS, AXES = "numbers", "axes"  # of the file's metadata


class Snapshot(NamedTuple):
    """Arrays by name, whose parts are separated by "/", and what JSON can hold."""

    arrays: Mapping[str, NDArray[Any]]
    numbers: Mapping[str, Any]

    def within(self, name: str) -> dict[str, NDArray[Any]]:
        """The arrays whose names begin with "name/", without that beginning."""
        return {key.removeprefix(f"{name}/"): one for key, one in self.arrays.items() if key.startswith(f"{name}/")}

    def tensors(self, name: str) -> dict[str, torch.Tensor]:
        """The same as tensors on the CPU."""
        return {key: torch.from_numpy(np.array(one)) for key, one in self.within(name).items()}


def named(name: str, arrays: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Arrays, or tensors on any device, under names that begin with "name/"."""
    return {
        f"{name}/{key}": one.detach().cpu().numpy() if isinstance(one, torch.Tensor) else np.asarray(one)
        for key, one in arrays.items()
    }


def save_state(path: Path, state: Snapshot) -> None:
    """Write a state; at every instant the old one is there, or the new one. Numbers of NumPy become those of Python.

    The order of axes in memory is kept too: the last bits of a product of matrices depend on it.
    """
    axes = {name: _axes(one) for name, one in state.arrays.items()}
    arrays = {name: np.asarray(one.transpose(axes[name]), order="C") for name, one in state.arrays.items()}
    numbers = json.dumps(state.numbers, default=lambda number: number.item())
    changed = {name: order for name, order in axes.items() if order != sorted(order)}
    path.parent.mkdir(exist_ok=True)
    write_file(path, safetensors.numpy.save(arrays, metadata={NUMBERS: numbers, AXES: json.dumps(changed)}))


def load_state(path: Path) -> Snapshot | None:
    """The state that was saved, or None if there is none. Raises ConfigurationError for a file that holds none."""
    if not path.exists():
        return None
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            arrays = {name: np.array(file.get_tensor(name)) for name in file.keys()}  # noqa: SIM118  # cannot be iterated
            for name, order in json.loads(metadata[AXES]).items():
                arrays[name] = arrays[name].transpose(np.argsort(order))
            return Snapshot(arrays, json.loads(metadata[NUMBERS]))
    except (SafetensorError, OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigurationError(
            f"{path} holds no state from which a training can go on ({error}): delete it to begin anew"
        ) from error


def _axes(array: NDArray[Any]) -> list[int]:
    """The axes of an array, that whose neighbours are farthest apart in memory first."""
    return sorted(range(array.ndim), key=lambda axis: -array.strides[axis])


def optimizer_arrays(name: str, optimizer: torch.optim.Optimizer) -> dict[str, NDArray[Any]]:
    """What an optimiser remembers of each parameter, under names that begin with "name/"."""
    memory = optimizer.state_dict()["state"]
    return named(name, {f"{number}/{key}": one for number, each in memory.items() for key, one in each.items()})


def restore_optimizer(optimizer: torch.optim.Optimizer, state: Snapshot, name: str) -> None:
    """Give an optimiser that was made alike its memory back; how it works is as it was made."""
    content: dict[str, Any] = optimizer.state_dict()
    content["state"] = {}
    for key, one in state.tensors(name).items():
        number, _, inner = key.partition("/")
        content["state"].setdefault(int(number), {})[inner] = one
    optimizer.load_state_dict(content)


def generator_arrays(device: torch.device | str = "cpu") -> dict[str, NDArray[Any]]:
    """States of Torch's global generators."""
    states = {"cpu": torch.get_rng_state()}
    if torch.device(device).type == "cuda":
        states["cuda"] = torch.cuda.get_rng_state(device)
    return named("torch_generators", states)


def generator_numbers() -> dict[str, Any]:
    """States of the global generators of Python and NumPy."""
    numpy_state: Any = np.random.get_state(legacy=False)  # noqa: NPY002  # SB3 draws from it
    words = numpy_state["state"]
    return {
        "python": random.getstate(),
        "numpy": {**numpy_state, "state": {"key": words["key"].tolist(), "pos": words["pos"]}},
    }


def restore_generators(state: Snapshot, device: torch.device | str = "cpu") -> None:
    """Set the global generators of Python, NumPy and Torch as they were."""
    kept = state.tensors("torch_generators")
    torch.set_rng_state(kept["cpu"])
    if "cuda" in kept:
        torch.cuda.set_rng_state(kept["cuda"], device)
    generators = state.numbers["generators"]
    version, words, last = generators["python"]
    random.setstate((version, tuple(words), last))
    inner = generators["numpy"]["state"]
    key = np.array(inner["key"], dtype=np.uint32)
    np.random.set_state({**generators["numpy"], "state": {"key": key, "pos": inner["pos"]}})  # noqa: NPY002  # the same
