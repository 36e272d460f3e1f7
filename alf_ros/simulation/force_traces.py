"""Traces of all forces, for the derivatives of a run (`kernel/force_tracing`)."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Addresses, Integers
from alf_ros.kernel import ForceTrace
from alf_ros.model.compile import Model
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.slope_products import SlopeProducts
from alf_ros.simulation.tangent_following import forces_for

OPERATIONS = 4096  # of a trace, at first


def traced_forces(applied: Applied) -> Addresses:
    """(effects,) the address of each force for traced numbers, in the order of the kernel.

    Raises InputError for an effect without a derivative.
    """
    # it teaches numba new types: only where somebody asks
    from alf_ros.effects.contract.traced_force import traced_force

    return forces_for(applied, traced_force)


def leaves_of(model: Model, applied: Applied, products: SlopeProducts | None) -> Integers:
    """(leaves,) the numbers in a trace of q, q̇ and the data of the effects: -1 of what no number
    of the scene changes, and of q̇ of blocks that stand. products: of the numbers that count;
    without them all arrays do."""
    n, whole = model.n, model.q.size
    leaves = 2 * whole + applied.assembled.effects.params.size
    numbers = np.arange(leaves, dtype=np.int64)
    if products is not None or not model.system.prescribed.program.size:
        numbers[whole + n : 2 * whole] = -1
    if products is not None:
        if not products.changes_fixed(n):
            numbers[n:whole] = -1
        if products.changes('prescribed'):
            numbers[n:whole] = np.arange(n, whole)
            numbers[whole + n : 2 * whole] = np.arange(whole + n, 2 * whole)
        changed = 2 * whole + products.changed_params(applied.inputs)
        numbers[2 * whole :] = -1
        numbers[changed] = changed
    return numbers


def empty_trace(
    model: Model, force: Addresses, numbers: Integers, operations: int = OPERATIONS
) -> ForceTrace:
    """Memory for a trace of so many operations. force, numbers: as above."""
    words = np.zeros(3 + 2 * operations, dtype=np.int64)
    words[1:3] = operations, numbers.size
    whole = model.q.size
    return ForceTrace(
        force=force,
        numbers=numbers,
        words=words,
        slopes=np.zeros(2 * operations),
        Q=np.zeros(whole),
        made=np.zeros(whole, dtype=np.int64),
        along=np.zeros(whole),
    )
