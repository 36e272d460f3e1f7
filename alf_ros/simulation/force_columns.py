"""Columns of the derivatives of forces, for the adjoint of small mechanisms."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Effects, ForceColumns
from alf_ros.kernel.numba_ext.lane_structs import aligned
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.tangent_following import dual_forces

COLUMNS = 16  # of an effect, at most: with more of them forces are traced


def fit_columns(effects: Effects, whole: int, numbers: Integers) -> bool:
    """Whether the numbers that count fit, for each effect; numbers: as `leaves_of` has them;
    whole: size of q."""
    state = np.count_nonzero(numbers[: 2 * whole] >= 0)
    own = (each.size for each in _numbers_of_effects(effects, whole, numbers))
    return state + max(own, default=0) <= COLUMNS


def columns_of(applied: Applied, whole: int, numbers: Integers) -> ForceColumns:
    """The columns of all effects. Raises InputError for an effect without a derivative."""
    effects = applied.assembled.effects
    state = numbers[: 2 * whole]
    state = state[state >= 0]
    dq, dqd = aligned(whole, COLUMNS), aligned(whole, COLUMNS)
    for m, number in enumerate(state):
        (dq if number < whole else dqd)[number % whole, m] = 1.0
    dparams = aligned(effects.params.size, COLUMNS)
    for own in _numbers_of_effects(effects, whole, numbers):
        dparams[own - 2 * whole, state.size + np.arange(own.size)] = 1.0
    return ForceColumns(
        force=dual_forces(applied, COLUMNS),
        number=state.copy(),
        dq=dq,
        dqd=dqd,
        dparams=dparams,
        Q=np.zeros(whole),
        dQ=aligned(whole, COLUMNS),
        own=aligned(effects.force.size, COLUMNS),
        sum=aligned(1, COLUMNS),
    )


def no_columns() -> ForceColumns:
    """Where forces are traced."""
    none = aligned(0, COLUMNS)
    return ForceColumns(
        force=np.zeros(0, dtype=np.uint64),
        number=np.zeros(0, dtype=np.int64),
        Q=np.zeros(0),
        **dict.fromkeys(('dq', 'dqd', 'dparams', 'dQ', 'own', 'sum'), none),
    )


def by_params(columns: ForceColumns, effects: Effects) -> Floats:
    """∂J/∂ the numbers of the effects (params,), as summed up in the columns."""
    found = np.zeros(effects.params.size)
    ends = [*effects.params_at[1:].tolist(), effects.params.size]
    for first, end, own in zip(effects.params_at.tolist(), ends, columns.own, strict=True):
        found[first:end] = columns.dparams[first:end] @ own
    return found


def _numbers_of_effects(effects: Effects, whole: int, numbers: Integers) -> list[Integers]:
    """The numbers of each effect that count, among all numbers."""
    params = numbers[2 * whole :]
    parts = np.split(params, effects.params_at[1:].astype(np.int64)) if effects.force.size else []
    return [part[part >= 0] for part in parts]
