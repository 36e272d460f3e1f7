"""Data of the kernel for the work of each effect, made on request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.errors import InputError
from alf_ros.kernel import Effects, Ledger
from alf_ros.model.compile import Model
from alf_ros.model.constraints.packing import indices
from alf_ros.scene.scene import Solver

INPUTS, DRIVES = 'inputs', 'drives'


def accounts(labels: Sequence[str]) -> tuple[str, ...]:
    """The names of all accounts, of a scene whose effects are called so."""
    return (*labels, INPUTS, DRIVES)


def named_accounts(effects: Sequence[Effect], solver: Solver) -> tuple[str, ...]:
    """The same of effects. Raises InputError where two would be one, and without alf2."""
    if solver.formulation != 'alf2':
        raise InputError('only alf2 keeps a ledger', key='formulation', value=solver.formulation)
    labels = [effect.label for effect in effects]
    for label in labels:
        if labels.count(label) > 1 or label in (INPUTS, DRIVES):
            raise InputError('two accounts of this name in the ledger', value=label)
    return accounts(labels)


def ledger(
    model: Model, weights: Floats, parts: Sequence[tuple[str, tuple[Effects, list[int]]]]
) -> Ledger:
    """The ledger of the effects, each with its account and the indices of its loads.

    weights (stages,): of the method. Parts that are inputs share an account.
    """
    from alf_ros.kernel import work_ledger as compiled

    names = accounts([label for label, _ in parts if label != INPUTS])
    each = [effects for _, (effects, _) in parts]
    first = [loads[0] if loads else 0 for _, (_, loads) in parts]
    return Ledger(
        tally=np.array([compiled.record(model.layout.dimension).address], dtype=np.uint64),
        effects=replace(_joined(each), loads_at=np.array(first, dtype=np.uint64)),
        account=indices([names.index(label) for label, _ in parts]),
        weights=weights,
        rates=np.zeros(weights.size * len(names)),
        Q=np.zeros(model.q.size),
        good=np.zeros(len(names)),
    )


def _joined(parts: Sequence[Effects]) -> Effects:
    """Lists of effects as one."""
    if not parts:
        return Effects.empty()
    functions = 'force', 'potential', 'friction', 'tangent', 'side', 'undated'
    names = (*functions, 'slots', 'params', 'loads_at')
    whole = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    for name in ('slots', 'params'):
        sizes = [getattr(part, name).size for part in parts]
        before = np.cumsum([0, *sizes[:-1]], dtype=np.uint64)
        at = [getattr(part, f'{name}_at') + n for part, n in zip(parts, before, strict=True)]
        whole[f'{name}_at'] = np.concatenate(at)
    return Effects(**whole)
