"""Vectors and directions of the plane, one for each robot."""

import numpy as np

from caster_gym.arrays import Array


def turned(vector: Array, cos: Array, sin: Array) -> Array:
    """Vectors (robots, 3) turned counter-clockwise by angles whose cos and sin (robots,) are given; ω stays."""
    x, y, z = vector.T
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)


def turned_direction(direction: Array, angle: Array) -> Array:
    """Unit vectors (..., 2) turned counter-clockwise by angles (...)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = direction[..., 0], direction[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def angle_between(start: Array, end: Array) -> Array:
    """Angles (...) from directions (..., 2) to others, the short way."""
    across = start[..., 0] * end[..., 1] - start[..., 1] * end[..., 0]
    along = start[..., 0] * end[..., 0] + start[..., 1] * end[..., 1]
    return np.arctan2(across, along)


def short_way(angle: Array) -> Array:
    """Angles within −π … π."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi
