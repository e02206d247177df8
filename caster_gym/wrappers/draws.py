"""Random numbers by counting for many robots at once: each is a hash of a seed and an index.

They are those of `caster_gym.envs.randomness.uniform(key ^ stream, episode, index)`, so a robot draws the same numbers
alone and in a batch; each feature has a stream of its own.
"""

from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array, Indices
from caster_gym.envs.randomness import bits, episode_seed

Seeds = NDArray[np.uint64]

_SHIFT_11, _SHIFT_12 = np.uint64(11), np.uint64(12)


def stream(place: int, kind: str) -> np.uint64:
    """The stream of the feature of a kind that stands at a place of the list."""
    return np.uint64(int.from_bytes(blake2b(f"{place}:{kind}".encode(), digest_size=8).digest(), "little"))


def seeds_of(keys: Seeds, episodes: Seeds, of: np.uint64) -> Seeds:
    """Seeds (robots,) of a stream in the episodes of robots."""
    seeds: Seeds = episode_seed(keys ^ of, episodes)
    return seeds


def uniforms(seeds: Seeds, indices: Indices) -> Array:
    """Numbers (robots, k) in [0, 1) for seeds (robots,) and indices (k,) or (robots, k)."""
    drawn: Seeds = bits(seeds[:, None], indices.astype(np.uint64)) >> _SHIFT_11
    return drawn.astype(np.float64) * 2.0**-53


def normals(seeds: Seeds, indices: Indices) -> Array:
    """Standard normal numbers (robots, k), by the inverse of their distribution."""
    from scipy.special import ndtri  # late: most environments make no noise

    numbers: Array = ndtri(
        ((bits(seeds[:, None], indices.astype(np.uint64)) >> _SHIFT_12).astype(np.float64) + 0.5) * 2.0**-52
    )
    return numbers
