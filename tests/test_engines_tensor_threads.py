"""caster_gym.engines.tensor.threads: as many as are asked for, and no trace of it afterwards."""

import pytest
import torch

from caster_gym.engines.native.threads import get_threads
from caster_gym.engines.tensor.threads import DEFAULT, limit_threads


def used():
    return torch.get_num_threads(), get_threads()


@pytest.mark.parametrize("count", [DEFAULT, 3])
def test_torch_and_the_simulator_take_so_many_and_then_as_before(count):
    before = used()
    with limit_threads(count):
        assert used() == (count, count)
    assert used() == before


def test_threads_are_as_before_after_an_error():
    before = used()
    with pytest.raises(KeyboardInterrupt), limit_threads(before[0] + 1):
        raise KeyboardInterrupt
    assert used() == before


@pytest.mark.parametrize("count", [0, -2])
def test_fewer_than_one_are_refused(count):
    before = used()
    with pytest.raises(ValueError, match=f"must be 1 or more, got {count}"), limit_threads(count):
        pass
    assert used() == before
