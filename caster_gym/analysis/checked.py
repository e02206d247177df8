"""Arrays that callers give, checked: the right last axis, and numbers that are finite."""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array


def finite(name: str, value: ArrayLike, last: int) -> Array:
    """The value as an array of finite numbers whose last axis has a length. Raises ValueError that names it."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != last:
        raise ValueError(f"{name} must have a last axis of {last}, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
    return array
