"""Twists, accelerations and forces of the platform (…, 3) converted between B and W.

A heading is the complex number e^{iβ}, as points of the plane are in `caster_gym.paths`.
"""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array, Plane


def turn_planar(vector: Array, by: complex | Plane) -> Array:
    """Vectors (..., 3) turned in the plane by unit numbers (...): by a heading from B to W, by its conjugate back."""
    plane = (vector[..., 0] + 1j * vector[..., 1]) * by
    return np.stack((plane.real, plane.imag, np.broadcast_to(vector[..., 2], plane.shape)), axis=-1)


def rate_in_body(acceleration: Array, twist: Array) -> Array:
    """Derivatives (..., 3) of the components of a twist in B, from accelerations over ground; all in B."""
    across = np.stack((twist[..., 1], -twist[..., 0], np.zeros_like(twist[..., 2])), axis=-1)  # −ẑ × v
    rate: Array = acceleration + twist[..., 2:] * across
    return rate


def wrap_angle(angle: ArrayLike) -> Array:
    """Angles brought into (−π, π]. [rad]"""
    return np.asarray(np.pi - np.mod(np.pi - np.asarray(angle), 2.0 * np.pi))


def motion_in_body(samples: Array) -> tuple[Array, Array]:
    """Twists in B and the derivatives of their components, (..., 3) each, of a trajectory's samples (..., 10)."""
    back = samples[..., 2] - 1j * samples[..., 3]
    twist = turn_planar(samples[..., 4:7], back)
    return twist, rate_in_body(turn_planar(samples[..., 7:10], back), twist)
