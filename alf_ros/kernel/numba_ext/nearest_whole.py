"""The whole number next to a number, to count turns with: an angle with its turns does not jump
where this number does, so no branch is noted there (`branch_numbers`)."""

from __future__ import annotations

import math
from typing import Any

from numba import types
from numba.extending import overload

from alf_ros.kernel.numba_ext.fused_product import OPTIONS

_REAL = (types.Float, types.Integer, types.Boolean)


def nearest_whole(x: Any) -> int:
    """The whole number next to x, the larger one of two."""
    return math.floor(x + 0.5)


@overload(nearest_whole, **OPTIONS)
def _of_number(x: Any) -> Any:
    return (lambda x: int(math.floor(x + 0.5))) if isinstance(x, _REAL) else None
