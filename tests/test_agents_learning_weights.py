"""agents.learning.weights: what a header promises is compared with what is wanted before anything is made of it."""

import json

import pytest
import torch
from safetensors.torch import save_file

from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.weights import actor_shapes, read_weights
from caster_gym.configuration import ConfigurationError

SHAPES = actor_shapes(3, (5, 4), 2)


@pytest.mark.parametrize("hidden", [(), (5,), (5, 4)])
def test_the_shapes_are_those_of_an_actor(hidden):
    actor = Actor(3, hidden, 2, "clip")
    assert actor_shapes(3, hidden, 2) == {name: tuple(tensor.shape) for name, tensor in actor.state_dict().items()}


def test_weights_are_read_as_they_were_written(tmp_path):
    weights = {name: torch.randn(shape) for name, shape in SHAPES.items()}
    save_file(weights, tmp_path / "w", metadata={"by": "somebody"})
    read = read_weights(tmp_path / "w", SHAPES)
    assert all(torch.equal(read[name], weights[name]) for name in SHAPES)


def test_a_network_larger_than_the_memory_is_refused_by_the_header_alone(tmp_path):
    save_file({name: torch.zeros(shape) for name, shape in SHAPES.items()}, tmp_path / "w")
    with pytest.raises(ConfigurationError, match=r"weight' must be \[1000000000, 3\] of type 'F32', got \[5, 3"):
        read_weights(tmp_path / "w", actor_shapes(3, (10**9, 10**9), 2))


def header_only(tmp_path, header, data=b""):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    (tmp_path / "w").write_bytes(len(text).to_bytes(8, "little") + text + data)
    return tmp_path / "w"


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"{", "its header is no JSON"),
        (b"\xff\xfe", "its header is no JSON"),
        ([], "does not describe tensors"),
        ({"head.bias": 3}, "does not describe tensors"),
        ({"x" * 200: {}}, "weight .* is (missing|not known)"),
        ({name: {"dtype": "F32", "shape": list(shape)} for name, shape in SHAPES.items()}, "there should be .* bytes"),
        ({name: {"dtype": "F16", "shape": list(shape)} for name, shape in SHAPES.items()}, "of type 'F32', got"),
        ({name: {"shape": [1] * 99} for name in SHAPES}, "of type 'F32', got"),
    ],
)
def test_headers_that_do_not_describe_these_weights_are_told(tmp_path, header, said):
    with pytest.raises(ConfigurationError, match=said):
        read_weights(header_only(tmp_path, header), SHAPES)


def test_offsets_that_lie_are_told(tmp_path):
    size = 4 * sum(torch.Size(shape).numel() for shape in SHAPES.values())
    told = {name: {"dtype": "F32", "shape": list(shape), "data_offsets": [0, 4]} for name, shape in SHAPES.items()}
    with pytest.raises(ConfigurationError, match="w holds no weights: "):
        read_weights(header_only(tmp_path, told, bytes(size)), SHAPES)


@pytest.mark.parametrize("content", [b"", b"\0" * 7, b"\xff" * 8, b"\xff" * 100])
def test_a_file_without_a_header_is_told(tmp_path, content):
    (tmp_path / "w").write_bytes(content)
    with pytest.raises(ConfigurationError, match="does not begin with the header"):
        read_weights(tmp_path / "w", SHAPES)
