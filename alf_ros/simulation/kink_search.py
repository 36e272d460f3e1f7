"""Data of the kernel for kinks over time, and for kinks that are met and left within a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.effects.contract.piecewise import spline_instants
from alf_ros.kernel import Kinks
from alf_ros.mechanism import Mechanism
from alf_ros.mechanism.time_function import tables
from alf_ros.model.compile import Model
from alf_ros.model.constraints.packing import indices
from alf_ros.splines import cubic_spline


def kinks(
    model: Model, scalars: Sequence[tuple[int, int]], instants: Floats, crossed: bool
) -> Kinks:
    """The kinks of effects: of each the address of `interval` (0: none) and how many scalars it
    knows; and the instants (s) of kinks over time, ascending. `crossed`: whether a step may cross
    a kink."""
    found = _none()
    if instants.size:
        found = replace(found, instants=instants)
    known = [
        (address, effect, n)
        for effect, (address, count) in enumerate(scalars)
        if address
        for n in range(count)
    ]
    if not known:
        return found
    from alf_ros.kernel import grazed_kinks as compiled

    addresses, effects, numbers = zip(*known, strict=True)
    return replace(
        found,
        search=np.array([compiled.search(model.layout.dimension).address], dtype=np.uint64),
        interval=np.array(addresses, dtype=np.uint64),
        effect=indices(effects),
        number=np.array(numbers, dtype=np.int64),
        path=np.zeros((len(known) + 1) * compiled.PLACES * 4),
        doubt=np.zeros(2 * len(known)),
        crossed=np.array([float(crossed)]),
        near=np.zeros(1),
    )


@cache
def _none() -> Kinks:
    return Kinks.empty()


def kinks_of_drives(mechanism: Mechanism) -> Floats:
    """The instants (s) of the tables of all drives."""
    parts = [part for item in mechanism.prescribed for part in item.components if part is not None]
    found: list[Floats] = [np.zeros(0)]
    for points in (points for part in parts for points in tables(part)):
        t, x = np.array(points).T
        found.append(spline_instants(cubic_spline(t, x, 'clamped')))
    return np.unique(np.concatenate(found))
