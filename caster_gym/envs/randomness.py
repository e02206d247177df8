"""Random numbers by counting: each is a hash of a key, an episode and an index, so that any lane can draw alone.

The mixing is SplitMix64 (Steele, Lea and Flood, OOPSLA 2014). An environment takes its key from its Gymnasium generator
when it is seeded; the same key gives the same episodes, in a batch and alone.
"""

from typing import Any

import numpy as np

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_SHIFT_30, _SHIFT_27, _SHIFT_31, _SHIFT_11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


def mix(x: Any) -> Any:
    """A 64-bit number hashed to another, one to one."""
    x = (x ^ (x >> _SHIFT_30)) * _MIX_1
    x = (x ^ (x >> _SHIFT_27)) * _MIX_2
    return x ^ (x >> _SHIFT_31)


def episode_seed(key: Any, episode: Any) -> Any:
    """What all numbers of an episode start from, for unsigned 64-bit key and episode."""
    return mix(mix(key + _GOLDEN) + (episode + np.uint64(1)) * _GOLDEN)


def bits(seed: Any, index: Any) -> Any:
    """64 random bits for a seed and an unsigned 64-bit index."""
    return mix(seed + (index + np.uint64(1)) * _GOLDEN)


def uniform(key: Any, episode: Any, index: Any) -> Any:
    """A number in [0, 1) for unsigned 64-bit key, episode and index."""
    return float(bits(episode_seed(key, episode), index) >> _SHIFT_11) * 1.1102230246251565e-16
