"""A bound on the part of further random starts that would find something new.

Since its last find a search starts from one and the same distribution of places. If a part p of
them leads to something new, n starts in a row find nothing with probability (1 - p)^n at most.
So p is at most 1 - α^(1/n), with confidence 1 - α. A search has a chance to end too early after
each of its finds. The k-th of these runs gets α/(k (k + 1)), so that all runs together get α.

Counts of how often each position was found say less. Many starts begin at known positions, so
these positions are found again and again, even if starts from elsewhere would find others.
"""

from __future__ import annotations

import math

from alf_ros.studies.atlas.random_places import KINDS

CONFIDENCE = 0.95


def most_missing(vain: int, run: int, searches: int = 1) -> float:
    """The largest part of further starts that would find something new, at `CONFIDENCE`.

    vain: starts since the last find, which found nothing new; run: which run of such starts this
    is, from 1; searches: how many searches the statement holds for, all at once.
    """
    if run < 1 or searches < 1:
        raise ValueError(f'run {run} of {searches} searches')
    whole = vain - vain % KINDS  # kinds of places take turns: whole rounds are alike
    if whole <= 0:
        return 1.0
    alpha = (1.0 - CONFIDENCE) / searches / (run * (run + 1))
    return -math.expm1(math.log(alpha) / whole)


def in_words(part: float) -> str:
    """The bound as a sentence; rounded up."""
    digits = 0 if part > 0.1 else 1 if part > 0.01 else 2
    percent = math.ceil(100.0 * part * 10**digits) / 10**digits
    return (
        f'at most {percent:g} % of further starts would find more '
        f'({100.0 * CONFIDENCE:g} % confidence)'
    )
