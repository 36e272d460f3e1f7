"""Names for the array types that pass between the rooms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.unsignedinteger[Any]]
Integers = NDArray[np.int64]
Unit = tuple[float, ...]  # as long as space has dimensions
