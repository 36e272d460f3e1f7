"""Names for the array types that pass between the rooms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[Any]  # unsigned: spares the kernel the test for negative ones
Integers = NDArray[np.int64]
Unit = tuple[float, ...]  # as long as space has dimensions
