"""total + factor x as one operation: sums of products are most of what forces do.

Of plain numbers and dual numbers it is the product and the sum. A traced number would ask at both
which number of the trace it follows from; here it asks once (`traced_numbers`).
"""

from __future__ import annotations

from typing import Any

from alf_ros.kernel.numba_ext.number_types import PLAIN, called_for


def plus_product(total: Any, factor: Any, x: Any) -> Any:
    """total + factor x."""
    return total + factor * x


@called_for(plus_product)
def _of_numbers(total: Any, factor: Any, x: Any) -> Any:
    if all(isinstance(kind, PLAIN) for kind in (total, factor, x)):
        return lambda total, factor, x: total + factor * x
    return None
