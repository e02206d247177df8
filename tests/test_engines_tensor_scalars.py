"""caster_gym.engines.tensor.scalars: where tensors can live, of which precision, and what is refused."""

import re

import pytest
import torch

from caster_gym.engines.tensor.scalars import check_memory, checked_device, checked_dtype
from caster_gym.mechanics.scalars import sqrt


@pytest.mark.parametrize("device", ["nonsense", "cuda:99", "vulkan", "hpu", ""])
def test_a_device_that_torch_does_not_find_is_refused(device):
    """Each of these makes Torch raise an error of another type; the reason is its own first line."""
    with pytest.raises(ValueError, match=f"device must be one that Torch finds on this machine, got '{device}': \\w"):
        checked_device(device)
    assert checked_device("cpu") == checked_device(torch.device("cpu")) == torch.device("cpu")


def test_half_precision_is_refused():
    assert checked_dtype(torch.float32) is torch.float32
    assert checked_dtype(torch.float64) is torch.float64
    with pytest.raises(ValueError, match=r"dtype must be torch\.float32 or torch\.float64, got torch\.float16"):
        checked_dtype(torch.float16)


def test_robots_need_memory_by_their_numbers_and_the_precision():
    """4 and 8 bytes a number: 10¹² robots of 100 numbers need 400 and 800 TB, of 2³⁰ B a GiB."""
    for dtype, needed in ((torch.float32, "3.73e+05"), (torch.float64, "7.45e+05")):
        with pytest.raises(ValueError, match=re.escape(f"at least {needed} GiB of memory, and device 'cpu' has")):
            check_memory(10**12, 100, dtype, torch.device("cpu"))
    check_memory(1, 100, torch.float64, torch.device("cpu"))
    with pytest.raises(ValueError, match="a batch needs 1 robot or more, got 0"):
        check_memory(0, 100, torch.float32, torch.device("cpu"))


def test_the_length_of_nothing_has_a_slope_of_zero():
    """√(x²) at 0, where the root's own slope is infinite."""
    x = torch.tensor([0.0, -2.0], requires_grad=True)
    (slope,) = torch.autograd.grad(sqrt(x * x).sum(), x)
    assert slope.tolist() == [0.0, -1.0]
