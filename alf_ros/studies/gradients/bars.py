"""The derivatives of a number J by what it depends on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model


@dataclass(frozen=True, eq=False)
class Bars:
    """∂J/∂q and ∂J/∂q̇ (all blocks D,) of a state, ∂J/∂ the arrays that joint coordinates depend
    on, by the names of `ParameterSlopes.arrays`, and ∂J/∂ the numbers themselves (names,)."""

    q: Floats
    qd: Floats
    numbers: Floats
    arrays: dict[str, Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, model: Model, names: int) -> Bars:
        """All zero."""
        rows = {'angle': model.system.angles, 'length': model.lengths}
        arrays = {
            f'{name}_{part}': np.zeros_like(getattr(of, part))
            for name, of in rows.items()
            for part in ('b', 'c', 'term')
        }
        return cls(np.zeros_like(model.q), np.zeros_like(model.q), np.zeros(names), arrays)
