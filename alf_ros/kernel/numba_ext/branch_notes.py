"""Words to branch numbers (`branch_numbers`): which steps of a law are no branches, and which are.

Compiled code for other numbers does not contain them.
"""

from __future__ import annotations

import math
from typing import Any

from alf_ros.kernel.numba_ext.number_types import PLAIN, called_for


def nearest_whole(x: Any) -> int:
    """The whole number next to x, the larger one of two, to count turns with: an angle with its
    turns does not jump where this number does."""
    return math.floor(x + 0.5)


def plain_value(x: Any) -> float:
    """The value of a number, whose comparisons then are no branches."""
    return float(x)


def note_branch(x: Any, number: int) -> None:
    """Say that x lies on the branch of this number."""


@called_for(nearest_whole)
def _nearest_whole(x: Any) -> Any:
    return (lambda x: int(math.floor(x + 0.5))) if isinstance(x, PLAIN) else None


@called_for(plain_value)
def _plain_value(x: Any) -> Any:
    return (lambda x: float(x)) if isinstance(x, PLAIN) else None


@called_for(note_branch)
def _note_branch(x: Any, number: Any) -> Any:
    if getattr(x, 'notes_branches', False):
        return None

    def nothing(x: Any, number: Any) -> None:
        pass

    return nothing
