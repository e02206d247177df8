"""caster_gym.engines.tensor.threads: as many as are asked for, and no trace of it afterwards."""

import os
import subprocess
import sys

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


@pytest.mark.parametrize(("given", "count"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_the_environment_sets_the_default(given, count):
    """Of functions and of --threads."""
    code = (
        "from caster_gym.engines.tensor.threads import DEFAULT, limit_threads\n"
        "from caster_gym.agents.commands.command_line import DEFAULT_THREADS\n"
        "print(DEFAULT, DEFAULT_THREADS)"
    )
    free = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", code], env=free | given, check=True, capture_output=True, text=True)
    assert done.stdout.split() == [count, count]
