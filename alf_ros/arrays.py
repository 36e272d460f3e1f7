"""Names for the array types that pass between packages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.uint32]  # unsigned: spares the kernel the test for negative ones
Addresses = NDArray[np.uint64]
Unit = tuple[float, ...]  # as long as space has dimensions
