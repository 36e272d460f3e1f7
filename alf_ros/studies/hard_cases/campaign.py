"""The adaptive campaign: thirty starting states, tolerances, penalties, and what they cost.

The bound on the ratio of evaluations is on the median of a row. A single ratio says less: how
lucky the two runs are in their errors, of which either may be ten times below its neighbours'.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.studies.exact.starting_states import GRID, StartingState, starting_states
from alf_ros.studies.hard_cases.trial import RunSpec, TableRow

FACTOR = 100.0  # error over tolerance
FINEST = 1e-10  # tolerance down to which evaluations count; below is rounding
ROUNDING = FACTOR * FINEST  # m, that it may leave below
MOST = 1.5  # times the evaluations of the one freedom alone, down to FINEST
PENALTIES = (1e7, 1e9, 1e11)


def rows(quick: bool) -> Iterator[TableRow]:
    """A row for each tolerance."""
    for name in ('slider_crank', 'double_four_bar'):
        starts = starting_states(name)[:: 5 if quick else 1]
        for tolerance in 10.0 ** -np.arange(3, 13, 3 if quick else 1):
            runs = tuple(
                _run(start, float(tolerance), float(penalty))
                for start in starts
                for penalty in PENALTIES
            )
            counts = tolerance > 0.5 * FINEST
            yield TableRow('campaign', name, runs, ratio=MOST if counts else None)


def _run(start: StartingState, tolerance: float, penalty: float) -> RunSpec:
    bound = max(FACTOR * tolerance, ROUNDING)
    return RunSpec(
        start.motion, 'dop853_adaptive', GRID, bound, tolerance, penalty, lambda: start.costs
    )
