"""Types of arrays, for the signatures of all modules; shapes and units stand in docstrings."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Plane: TypeAlias = NDArray[np.complex128]  # points and vectors of the plane, x + i y
Seeds: TypeAlias = NDArray[np.uint64]  # of random numbers
Frame: TypeAlias = NDArray[np.uint8]  # a picture (height, width, 3), red, green and blue
