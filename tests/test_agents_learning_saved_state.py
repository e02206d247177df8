"""caster_gym.agents.learning.saved_state: what was saved comes back to the last bit, generators and optimisers too."""

import random

import numpy as np
import pytest
import torch

from caster_gym.agents.learning.saved_state import (
    Snapshot,
    generator_arrays,
    generator_numbers,
    load_state,
    named,
    optimizer_arrays,
    restore_generators,
    restore_optimizer,
    save_state,
)
from caster_gym.configuration import ConfigurationError


def through_disk(state, folder):
    save_state(folder / "state" / "state.safetensors", state)
    loaded = load_state(folder / "state" / "state.safetensors")
    assert loaded is not None
    return loaded


@pytest.mark.parametrize(
    "array",
    [
        np.array([0.1, np.nan, -0.0], dtype=np.float32),
        np.array(3.5),
        np.zeros((0, 4)),
        np.array([True, False]),
        np.array([2**64 - 1], dtype=np.uint64),
        np.arange(6, dtype=np.int64).reshape(2, 3),
        np.arange(6.0).reshape(2, 3).T,
        np.arange(24.0).reshape(2, 3, 4).transpose(2, 0, 1),
        np.arange(24.0)[::2],
    ],
)
def test_arrays_come_back_with_their_bits_and_their_order_in_memory(tmp_path, array):
    back = through_disk(Snapshot({"one": array}, {}), tmp_path).arrays["one"]
    assert (back.dtype, back.shape, back.tobytes()) == (array.dtype, array.shape, array.tobytes())
    order = sorted(range(array.ndim), key=lambda axis: -array.strides[axis])
    assert back.transpose(order).flags.c_contiguous


def test_numbers_come_back_as_python_has_them(tmp_path):
    numbers = {"rate": 0.1, "count": np.int64(3), "words": [2**127, None, True, np.float32(0.5)], "nested": {"a": "b"}}
    back = through_disk(Snapshot({}, numbers), tmp_path).numbers
    assert back == {"rate": 0.1, "count": 3, "words": [2**127, None, True, 0.5], "nested": {"a": "b"}}


def draws():
    old = np.random.random(), np.random.standard_normal()  # noqa: NPY002  # what SB3 draws from
    return random.random(), *old, torch.rand(3).tolist()


def test_global_generators_go_on_as_they_were(tmp_path):
    """Also with half of a pair of normal numbers drawn."""
    draws()
    state = through_disk(Snapshot(generator_arrays(), {"generators": generator_numbers()}), tmp_path)
    first = draws()
    torch.manual_seed(7)
    np.random.seed(7)  # noqa: NPY002
    random.seed(7)
    restore_generators(state)
    assert draws() == first


@pytest.mark.parametrize("fused", [False, True])
def test_an_optimiser_goes_on_as_it_was(tmp_path, fused):
    def network():
        torch.manual_seed(0)
        net = torch.nn.Linear(3, 2)
        return net, torch.optim.Adam(net.parameters(), lr=0.1, fused=fused)

    def step(net, optimizer):
        optimizer.zero_grad()
        torch.autograd.backward(net(torch.ones(3)).square().sum())
        optimizer.step()

    net, optimizer = network()
    step(net, optimizer)
    arrays = {**optimizer_arrays("adam", optimizer), **named("net", net.state_dict())}
    state = through_disk(Snapshot(arrays, {}), tmp_path)
    other, fresh = network()
    other.load_state_dict(state.tensors("net"))
    restore_optimizer(fresh, state, "adam")
    for _ in range(3):
        step(net, optimizer)
        step(other, fresh)
    assert all(torch.equal(a, b) for a, b in zip(net.parameters(), other.parameters(), strict=True))
    assert fresh.defaults["fused"] is fused


def test_no_file_is_no_state(tmp_path):
    assert load_state(tmp_path / "state.safetensors") is None


def test_a_file_of_something_else_says_so(tmp_path):
    path = tmp_path / "state.safetensors"
    for content in (b"", b"nothing at all", b"\x02\x00\x00\x00\x00\x00\x00\x00{}"):
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match="holds no state from which a training can go on"):
            load_state(path)
