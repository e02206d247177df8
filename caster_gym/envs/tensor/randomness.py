"""The random numbers of `caster_gym.envs.randomness` on tensors: the same bits, for all robots of a batch at once.

Torch has no arithmetic on unsigned 64-bit numbers, so that they are signed ones with the same bits; products and sums
wrap around alike, and a shift to the right must clear what the sign drags in.
"""

import torch
from torch import Tensor


def _signed(number: int) -> int:
    """The signed number with the bits of an unsigned one."""
    return number - 2**64 if number >= 2**63 else number


_GOLDEN = _signed(0x9E3779B97F4A7C15)
_MIX_1 = _signed(0xBF58476D1CE4E5B9)
_MIX_2 = _signed(0x94D049BB133111EB)


def _shifted(x: Tensor, places: int) -> Tensor:
    kept: int = 2 ** (64 - places) - 1
    return (x >> places) & kept


def mix(x: Tensor) -> Tensor:
    """A 64-bit number hashed to another, one to one."""
    x = (x ^ _shifted(x, 30)) * _MIX_1
    x = (x ^ _shifted(x, 27)) * _MIX_2
    return x ^ _shifted(x, 31)


def episode_seed(key: Tensor, episode: Tensor) -> Tensor:
    """What all numbers of an episode start from."""
    return mix(mix(key + _GOLDEN) + (episode + 1) * _GOLDEN)


def uniform(seed: Tensor, index: int) -> Tensor:
    """Numbers in [0, 1), in double precision, for an episode's seed and an index."""
    bits = mix(seed + _signed((index + 1) * 0x9E3779B97F4A7C15 % 2**64))
    return _shifted(bits, 11).to(torch.float64) * 2.0**-53
