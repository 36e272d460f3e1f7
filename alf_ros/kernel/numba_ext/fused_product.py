"""total + factor x as one operation: sums of products are most of what forces do.

Of plain numbers and dual numbers it is the product and the sum. A traced number would ask at both
which number of the trace it follows from; here it asks once (`traced_numbers`).
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import overload

_REAL = (types.Float, types.Integer, types.Boolean)
OPTIONS: dict[str, Any] = {'strict': False, 'jit_options': {'error_model': 'numpy'}}


def plus_product(total: Any, factor: Any, x: Any) -> Any:
    """total + factor x."""
    return total + factor * x


@overload(plus_product, **OPTIONS)
def _of_numbers(total: Any, factor: Any, x: Any) -> Any:
    if all(isinstance(kind, _REAL) for kind in (total, factor, x)):
        return lambda total, factor, x: total + factor * x
    return None
