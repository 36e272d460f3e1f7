"""Data of the kernel for kinks that are met and left within a step, where effects know kinks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.kernel import Kinks
from alf_ros.model.compile import Model
from alf_ros.model.constraints.packing import indices


def kinks(model: Model, scalars: Sequence[tuple[int, int]]) -> Kinks:
    """The search for the kinks of effects, of each the address of `interval` (0: none) and how
    many scalars it knows."""
    known = [
        (address, effect, n)
        for effect, (address, count) in enumerate(scalars)
        if address
        for n in range(count)
    ]
    if not known:
        return Kinks.empty()
    from alf_ros.kernel import grazed_kinks as compiled

    addresses, effects, numbers = zip(*known, strict=True)
    return Kinks(
        search=np.array([compiled.search(model.layout.dimension).address], dtype=np.uint64),
        interval=np.array(addresses, dtype=np.uint64),
        effect=indices(effects),
        number=np.array(numbers, dtype=np.int64),
        path=np.zeros((len(known) + 1) * compiled.PLACES * 4),
        doubt=np.zeros(2 * len(known)),
        q=np.zeros(model.q.size),
        qd=np.zeros(model.q.size),
        xi=np.zeros(model.n),
        xid=np.zeros(model.n),
    )
