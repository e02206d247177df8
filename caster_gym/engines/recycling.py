"""Arrays that are used again once nobody holds them any more.

Big arrays come from the operating system in fresh pages, each of which costs a fault when it is first written: as much
as a third of a step of a few thousand robots.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

_OURS = 3  # references to an array that nobody else holds: the shelf's, the loop's, the count's own argument


class Shelf:
    """Arrays of one shape and type, uninitialised, each lent to whoever takes it until no reference to it is left.

    A view, a Torch tensor or anything else on the array's memory counts as a reference.
    """

    def __init__(self, shape: tuple[int, ...], dtype: type[np.generic]) -> None:
        self._shape, self._dtype = shape, dtype
        self._arrays: list[NDArray[Any]] = []

    def take(self) -> NDArray[Any]:
        """An array that nobody else holds; a new one if there is none."""
        for array in self._arrays:
            if sys.getrefcount(array) == _OURS:
                return array
        self._arrays.append(np.empty(self._shape, self._dtype))
        return self._arrays[-1]
