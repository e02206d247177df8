"""caster_gym.envs.tensor.randomness: the bits of the compiled generator."""

import numpy as np
import torch
from numpy.testing import assert_array_equal

from caster_gym.envs import randomness
from caster_gym.envs.tensor.randomness import episode_seed, uniform


def test_the_numbers_are_those_of_the_compiled_environments():
    """To the last bit, for keys over the whole range, where signed products wrap around."""
    keys = np.random.default_rng(1).integers(2**63, size=50)
    for episode in (0, 1, 12345):
        seed = episode_seed(torch.tensor(keys), torch.full((50,), episode))
        for index in (0, 1, 7):
            ours = uniform(seed, index).numpy()
            with np.errstate(over="ignore"):
                theirs = [randomness.uniform(np.uint64(key), np.uint64(episode), np.uint64(index)) for key in keys]
            assert_array_equal(ours, theirs)
