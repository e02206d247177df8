"""A pool of arrays, each used again as soon as no reference to it is left.

Big arrays come from the operating system in fresh pages, each of which costs a fault when it is first written: as much
as a third of a step of a few thousand robots.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

KEPT = 4  # arrays of a pool; whoever holds more gets ones that go back to the operating system


class BufferPool:
    """Arrays of one shape and type, uninitialised, each lent to whoever takes it until no reference to it is left.

    Views, Torch tensors and buffers refer to their array; a bare address does not.
    """

    def __init__(self, shape: tuple[int, ...], dtype: type[np.generic]) -> None:
        self._shape, self._dtype = shape, dtype
        self._arrays: list[NDArray[Any]] = []

    def take(self) -> NDArray[Any]:
        """An array that nobody else holds; a new one if there is none."""
        holders = _holders(self._arrays)
        if _NOBODY in holders:
            return self._arrays[holders.index(_NOBODY)]
        array = np.empty(self._shape, self._dtype)
        if len(self._arrays) < KEPT:
            self._arrays.append(array)
        return array


def _holders(arrays: list[NDArray[Any]]) -> list[int]:
    """How many references there are to each array, those of the list and of this function included."""
    return [sys.getrefcount(array) for array in arrays]


_NOBODY = _holders([np.empty(0)])[0]  # versions of Python count differently
