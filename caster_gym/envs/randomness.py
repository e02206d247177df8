"""Random numbers by counting: each is a hash of a key, an episode and an index, so that any lane can draw alone.

The mixing is SplitMix64 (Steele, Lea and Flood, OOPSLA 2014). An environment takes its key from its Gymnasium generator
when it is seeded; the same key gives the same episodes, in a batch and alone.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from caster_gym.arrays import Array, Indices, Seeds


class Words(NamedTuple):
    """The constants of SplitMix64, and 1, in one kind of 64-bit integers."""

    golden: Any = 0x9E3779B97F4A7C15
    first: Any = 0xBF58476D1CE4E5B9
    second: Any = 0x94D049BB133111EB
    one: Any = 1


_UNSIGNED = Words(*map(np.uint64, Words()))
UNIT = 2.0**-53  # what the highest 53 of 64 random bits count, of a number in [0, 1)


def mix_words(x: Any, shift: Callable[..., Any], words: Words) -> Any:
    """A 64-bit number hashed to another, one to one. shift(x, places): to the right, zeros coming in."""
    x = (x ^ shift(x, 30)) * words.first
    x = (x ^ shift(x, 27)) * words.second
    return x ^ shift(x, 31)


def seed_words(key: Any, episode: Any, shift: Callable[..., Any], words: Words) -> Any:
    """What all numbers of an episode start from."""
    return mix_words(mix_words(key + words.golden, shift, words) + (episode + words.one) * words.golden, shift, words)


def shifted(x: Any, places: Any) -> Any:
    """Unsigned bits moved to the right."""
    return x >> np.uint64(places)


def episode_seed(key: Any, episode: Any) -> Any:
    """What all numbers of an episode start from, for unsigned 64-bit key and episode."""
    return seed_words(key, episode, shifted, _UNSIGNED)


def bits(seed: Any, index: Any) -> Any:
    """64 random bits for a seed and an unsigned 64-bit index."""
    return mix_words(seed + (index + _UNSIGNED.one) * _UNSIGNED.golden, shifted, _UNSIGNED)


def uniform(key: Any, episode: Any, index: Any) -> Any:
    """A number in [0, 1) for unsigned 64-bit key, episode and index."""
    return float(shifted(bits(episode_seed(key, episode), index), 11)) * UNIT


def uniforms(seeds: Seeds, indices: Indices) -> Array:
    """Numbers (robots, k) in [0, 1) for seeds (robots,) and indices (k,) or (robots, k)."""
    drawn: Seeds = shifted(bits(seeds[:, None], indices.astype(np.uint64)), 11)
    return drawn.astype(np.float64) * UNIT
