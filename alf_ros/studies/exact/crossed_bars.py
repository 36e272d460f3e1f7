"""Four-bars side by side that stand parallel or crossed: cranks alike, and grounds and couplers.

A four-bar with a longer coupler than cranks has two courses through each of the positions in which
all bars lie in a line: cranks turn together, or tan(θ₁/2) = K tan(θ₀/2) with
K = (crank + coupler) / (crank - coupler), which is smooth everywhere. Rods of 1 kg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.exact.one_freedom import GRAVITY, OneFreedom


def crossing_ratio(crank: float, coupler: float) -> float:
    """K, the rate of the next crank over the rate of this one at θ = 0; at π it is 1 / K."""
    return (crank + coupler) / (crank - coupler)


def crossed_four_bars(crank: float, coupler: float, crossed: Sequence[bool]) -> OneFreedom:
    """As many four-bars as `crossed` tells, as functions of the angle θ of the first crank.

    `crank` < `coupler` (m): the lengths; B_k = (k coupler + crank cos θ_k, crank sin θ_k).
    """
    K = crossing_ratio(crank, coupler)

    def turns(theta: float) -> Floats:
        """θ_k, dθ_k/dθ and d²θ_k/dθ² (cranks, 3), rad."""
        found = [(theta, 1.0, 0.0)]
        for is_crossed in crossed:
            angle, slope, bend = found[-1]
            if is_crossed:
                sin, cos = np.sin(0.5 * angle), np.cos(0.5 * angle)
                wide = cos * cos + K * K * sin * sin
                ratio, change = K / wide, -K * (K * K - 1.0) * sin * cos / wide**2
                angle = 2.0 * np.arctan2(K * sin, cos)
                slope, bend = ratio * slope, change * slope * slope + ratio * bend
            found.append((angle, slope, bend))
        return np.array(found)

    def places(theta: float) -> tuple[Floats, Floats, Floats]:
        """B_k and its first and second derivative by θ (cranks, 2), m."""
        angle, slope, bend = turns(theta).T[:, :, None]
        along = crank * np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        pins = np.outer(np.arange(len(along)), [coupler, 0.0])
        return pins + along, slope * across, bend * across - slope**2 * along

    def inertia(theta: float) -> tuple[float, float]:
        _, B, C = places(theta)
        whole, change = float(np.sum(B * B)), float(2.0 * np.sum(B * C))  # of cranks, times 3
        whole += float(np.sum(B[1:] * B[1:] + B[:-1] * B[1:] + B[:-1] * B[:-1]))
        change += float(np.sum(2.0 * B[1:] * C[1:] + 2.0 * B[:-1] * C[:-1]))
        change += float(np.sum(B[:-1] * C[1:] + C[:-1] * B[1:]))
        return whole / 3.0, change / 3.0

    def acceleration(theta: float, rate: float) -> float:
        whole, change = inertia(theta)
        heights = places(theta)[1][:, 1]
        pull = 0.5 * GRAVITY * float(2.0 * heights.sum() + heights[1:-1].sum())
        return -(0.5 * change * rate * rate + pull) / whole

    return OneFreedom(
        acceleration,
        lambda theta: places(theta)[0].ravel(),
        lambda theta: places(theta)[1].ravel(),
        inertia,
    )


def crossed_mechanism(crank: float, coupler: float, crossed: Sequence[bool]) -> dict[str, Any]:
    """The same as a mechanism file, drawn with the first crank at 1 rad."""
    drawn = crossed_four_bars(crank, coupler, crossed).position(1.0).reshape(-1, 2).tolist()
    last = len(crossed)
    return {
        'alf': 1,
        'space': 'planar',
        'points': {
            **{f'A{k}': {'at': [k * coupler, 0.0], 'fixed': True} for k in range(last + 1)},
            **{f'B{k}': {'at': at} for k, at in enumerate(drawn)},
        },
        'bodies': {
            f'{kind}{k}': {'points': [f'{one}{k}', f'B{k + more}'], 'mass': 1, 'inertia': 'rod'}
            for kind, one, more, count in (('crank', 'A', 0, last + 1), ('coupler', 'B', 1, last))
            for k in range(count)
        },
        'joints': {
            **{
                f'pin{k}': {'type': 'revolute', 'between': ['ground', f'crank{k}'], 'at': f'A{k}'}
                for k in range(last + 1)
            },
            **{
                f'{side}{k}': {
                    'type': 'revolute',
                    'between': [f'crank{k + more}', f'coupler{k}'],
                    'at': f'B{k + more}',
                }
                for k in range(last)
                for side, more in (('left', 0), ('right', 1))
            },
        },
    }
