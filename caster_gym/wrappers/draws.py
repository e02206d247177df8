"""Random numbers by counting for many robots at once: each is a hash of a seed and an index.

They are those of `caster_gym.envs.randomness.uniform(key ^ stream, episode, index)`, so a robot draws the same numbers
alone and in a batch. Each feature has a stream of its own, which features of other kinds in the list do not change.
"""

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from caster_gym.arrays import Array, Indices, Seeds
from caster_gym.envs.randomness import bits, episode_seed, shifted


def stream(number: int, kind: str) -> np.uint64:
    """The stream of a feature: of so many before it that are of its kind, and of that kind."""
    return np.uint64(int.from_bytes(blake2b(f"{number}:{kind}".encode(), digest_size=8).digest(), "little"))


def streams(kinds: Sequence[str]) -> list[np.uint64]:
    """The streams of features of these kinds, which no other features among them change."""
    return [stream(kinds[:place].count(kind), kind) for place, kind in enumerate(kinds)]


def seeds_of(keys: Seeds, episodes: Seeds, of: np.uint64) -> Seeds:
    """Seeds (robots,) of a stream in the episodes of robots."""
    seeds: Seeds = episode_seed(keys ^ of, episodes)
    return seeds


def normals(seeds: Seeds, indices: Indices) -> Array:
    """Standard normal numbers (robots, k), by the inverse of their distribution."""
    from scipy.special import ndtri  # late: most environments make no noise

    drawn: Seeds = shifted(bits(seeds[:, None], indices.astype(np.uint64)), 12)
    numbers: Array = ndtri((drawn.astype(np.float64) + 0.5) * 2.0**-52)
    return numbers
