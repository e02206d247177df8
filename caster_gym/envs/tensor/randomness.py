"""The random numbers of `caster_gym.envs.randomness` on tensors: the same bits, for all robots of a batch at once.

Torch has no arithmetic on unsigned 64-bit numbers, so that they are signed ones with the same bits; products and sums
wrap around alike, and a shift to the right must clear what the sign drags in.
"""

import torch
from torch import Tensor

from caster_gym.envs.randomness import UNIT, Words, mix_words, seed_words


def _signed(number: int) -> int:
    """The signed number with the bits of an unsigned one."""
    return number - 2**64 if number >= 2**63 else number


_SIGNED = Words(*map(_signed, Words()))


def _shifted(x: Tensor, places: int) -> Tensor:
    kept: int = 2 ** (64 - places) - 1
    return (x >> places) & kept


def episode_seed(key: Tensor, episode: Tensor) -> Tensor:
    """What all numbers of an episode start from."""
    seed: Tensor = seed_words(key, episode, _shifted, _SIGNED)
    return seed


def uniform(seed: Tensor, index: int) -> Tensor:
    """Numbers in [0, 1), in double precision, for an episode's seed and an index."""
    bits = mix_words(seed + _signed((index + 1) * Words().golden % 2**64), _shifted, _SIGNED)
    return _shifted(bits, 11).to(torch.float64) * UNIT
