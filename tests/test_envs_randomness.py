"""caster_gym.envs.randomness: SplitMix64 as its authors published it, and uniform numbers from it."""

import itertools

import numba
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.envs.native import step as task_kernel  # noqa: F401  # teaches Numba the functions of randomness
from caster_gym.envs.randomness import Words, mix_words, shifted, uniform

GOLDEN = 0x9E3779B97F4A7C15
DRAWS = 200_000


@numba.njit
def compiled_draws(keys, episodes, indices):
    numbers = np.empty(len(keys))
    for i in range(len(keys)):
        numbers[i] = uniform(keys[i], episodes[i], indices[i])
    return numbers


def draws(key, episode, index):
    """Compiled numbers; arguments may be arrays."""
    columns = np.broadcast_arrays(*(np.asarray(part, dtype=np.uint64) for part in (key, episode, index)))
    return compiled_draws(*(np.ascontiguousarray(np.atleast_1d(column)) for column in columns))


def test_mixing_gives_the_published_sequence():
    """SplitMix64 with the seed 1234567: the state grows by the golden gamma, and its hash is the output."""
    published = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    states = np.array([(1234567 + k * GOLDEN) % 2**64 for k in range(1, 6)], dtype=np.uint64)
    words = Words(*map(np.uint64, Words()))
    assert [int(x) for x in mix_words(states, shifted, words)] == published


def test_compiled_and_interpreted_numbers_are_the_same():
    big = np.uint64(2**64 - 1)
    numbers = (np.uint64(0), np.uint64(1), np.uint64(2**63), big)
    triples = list(itertools.product(numbers, repeat=3))
    with np.errstate(over="ignore"):  # 64-bit numbers wrap on purpose
        interpreted = [uniform(*triple) for triple in triples]
    keys, episodes, indices = np.array(triples, dtype=np.uint64).T
    assert_array_equal(compiled_draws(keys.copy(), episodes.copy(), indices.copy()), interpreted)


def samples():
    """Numbers along each of the three arguments."""
    count = np.arange(DRAWS)
    return {"keys": draws(count, 0, 0), "episodes": draws(3, count, 1), "indices": draws(4, 5, count)}


ALONG = ("keys", "episodes", "indices")


@pytest.mark.parametrize("along", ALONG)
def test_numbers_are_uniform_and_independent(along):
    """Each tolerance is five standard deviations of the estimate from so many independent uniform numbers."""
    u = samples()[along]
    assert u.min() >= 0.0
    assert u.max() < 1.0
    assert abs(u.mean() - 0.5) < 5.0 / np.sqrt(12.0 * DRAWS)
    assert abs(u.var() - 1.0 / 12.0) < 5.0 / np.sqrt(180.0 * DRAWS)
    for lag in (1, 2, 7):
        assert abs(np.corrcoef(u[:-lag], u[lag:])[0, 1]) < 5.0 / np.sqrt(DRAWS)
    counts = np.bincount((64 * u).astype(int), minlength=64)
    chi = ((counts - DRAWS / 64) ** 2).sum() / (DRAWS / 64)  # 63 degrees of freedom
    assert abs(chi - 63.0) < 5.0 * np.sqrt(2.0 * 63.0)


def test_the_arguments_do_not_stand_for_each_other():
    """Robots with neighbouring keys, and neighbouring episodes and indices of one robot, share no number."""
    grid = np.meshgrid(*[np.arange(30)] * 3)
    numbers = draws(*(axis.ravel() for axis in grid))
    assert len(np.unique(numbers)) == 30**3  # two of 27,000 53-bit numbers agree by chance once in 2e7 tries


def test_the_last_bits_are_random_too():
    """Whole 53-bit numbers, not a coarser grid."""
    lowest = (draws(np.arange(DRAWS), 1, 2) * 2.0**53).astype(np.uint64) & np.uint64(1)
    assert abs(lowest.mean() - 0.5) < 5.0 * 0.5 / np.sqrt(DRAWS)
