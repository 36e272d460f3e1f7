"""Anderson's mixing for the fixed point N = |R(N)|: trial loads from past passes.

Anderson (1965), Journal of the ACM 12. Of the last `MEMORY` passes it combines the differences of
trial and answer such that the combined gap is least.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Bearings
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy

MEMORY = 5  # passes that are mixed, at most
_INDEPENDENT = 1e-14  # part of a pivot of the normal equations, below which a pass is left out


@inner
def mix(cut: Bearings, count: int) -> None:
    """Store pass number `count`, and take the next trial loads."""
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    if count > 1:  # differences to the last pass, in the place of the oldest
        at = ((count - 2) % room) * loads
        for n in range(loads):
            cut.past_trial[at + n] += cut.trial[n]
            cut.past_gap[at + n] += cut.answer[n] - cut.trial[n]
    _combine(cut, count)
    at = ((count - 1) % room) * loads
    for n in range(loads):
        cut.past_trial[at + n] = -cut.trial[n]
        cut.past_gap[at + n] = -(cut.answer[n] - cut.trial[n])
    copy(cut.next, cut.trial)


@inner
def _combine(cut: Bearings, count: int) -> None:
    """The next trial loads, into `next`, from `count` passes."""
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    memory = count - 1 if count - 1 < room else room
    for i in range(memory):  # normal equations: few unknowns, low accuracy suffices
        for j in range(i + 1):
            total = 0.0
            for n in range(loads):
                total += cut.past_gap[i * loads + n] * cut.past_gap[j * loads + n]
            cut.gram[i * room + j] = total
        total = 0.0
        for n in range(loads):
            total += cut.past_gap[i * loads + n] * (cut.answer[n] - cut.trial[n])
        cut.mix[i] = total
    for i in range(memory):  # Cholesky; dependent passes are left out
        for j in range(i + 1):
            total = cut.gram[i * room + j]
            for m in range(j):
                total -= cut.gram[i * room + m] * cut.gram[j * room + m]
            if i > j:
                pivot = cut.gram[j * room + j]
                cut.gram[i * room + j] = total / pivot if pivot > 0.0 else 0.0
            else:
                whole = cut.gram[i * room + i]
                good = total > _INDEPENDENT * whole
                cut.gram[i * room + i] = np.sqrt(total) if good else 0.0
        pivot = cut.gram[i * room + i]
        total = cut.mix[i]
        for m in range(i):
            total -= cut.gram[i * room + m] * cut.mix[m]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for back in range(memory):
        i = memory - 1 - back
        total = cut.mix[i]
        for m in range(i + 1, memory):
            total -= cut.gram[m * room + i] * cut.mix[m]
        pivot = cut.gram[i * room + i]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for n in range(loads):
        value = cut.answer[n]
        for i in range(memory):
            past = cut.past_trial[i * loads + n] + cut.past_gap[i * loads + n]
            value -= cut.mix[i] * past
        cut.next[n] = max(value, 0.0)
