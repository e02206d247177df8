"""The letters and signs of both papers, and today's: the one place that translates them.

    φ        a paper's steering angle                    δ   ours, from the body x-axis to the rolling direction
    θ̇        rolling rate, in chung2008 of opposite sign
    η̇        yaw rate over ground, the same everywhere; φ̇ = ω − η̇ = −δ̇ in both papers
    u̇        twist (v_x, v_y, ω) of the platform in its own frame, the same everywhere

A paper's joints of one caster come in the order η, θ, φ; joint sets are written such as (θ_1, φ_1, θ_2).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Notation(NamedTuple):
    """How a paper counts angles and rates."""

    name: str
    straight: float  # [rad] the paper's φ of a caster whose δ is zero: φ = straight − δ
    rolling: float  # sign of the paper's θ̇ relative to ours

    def steering(self, phi: ArrayLike) -> Array:
        """δ [rad] of a paper's φ [rad], and as well φ of δ: the map is its own inverse."""
        turned: Array = self.straight - np.asarray(phi, dtype=np.float64)
        return turned

    @property
    def rates(self) -> Array:
        """(3, 3): a paper's rates (η̇, θ̇, φ̇) of a caster from ours (η̇, θ̇, δ̇); its own inverse."""
        return np.diag([1.0, self.rolling, -1.0])


CHUNG2008 = Notation("chung2008", straight=np.pi, rolling=-1.0)
KIM2001 = Notation("kim2001", straight=0.5 * np.pi, rolling=1.0)

_LETTERS = {"roll": "θ", "steer": "φ"}


def in_letters(joints: Sequence[str]) -> str:
    """(θ_1, φ_1, θ_2) for [roll_1, steer_1, roll_2]."""
    return "(" + ", ".join(f"{_LETTERS[kind]}_{number}" for kind, number in (j.split("_") for j in joints)) + ")"


def in_words(letters: str) -> tuple[str, ...]:
    """("roll_1", "steer_1", "roll_2") for "θ_1 φ_1 θ_2"."""
    kinds = {letter: kind for kind, letter in _LETTERS.items()}
    return tuple(f"{kinds[joint[0]]}_{joint[2:]}" for joint in letters.split())
