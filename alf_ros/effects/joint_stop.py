"""Stops of a coordinate x of a joint: compliant, with losses.

At a depth δ (rad or m) behind a stop it is pushed back with k δᵖ (1 + c δ̇), never pulled. Of an
impact at speed v the speed u is left with c (u + v) = ln (1 + c v) - ln (1 - c u), whatever k, p
and mass are; about 1 - u/v = ⅔ c v for small c v. V = k δᵖ⁺¹ / (p + 1). Hunt & Crossley,
J. Appl. Mech. 42 (1975), 440.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, numbers_of, push, scalar
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint, or one of its coordinates'})
    stiffness: float = field(
        metadata={'kind': 'number', 'unit': 'N m/rad^p or N/m^p', 'doc': 'stiffness k'}
    )
    lower: float | None = field(
        default=None, metadata={'kind': 'number', 'unit': 'rad or m', 'doc': 'lower stop'}
    )
    upper: float | None = field(
        default=None, metadata={'kind': 'number', 'unit': 'rad or m', 'doc': 'upper stop'}
    )
    exponent: float = field(
        default=1.5, metadata={'kind': 'number', 'unit': '1', 'doc': 'exponent p, at least 1'}
    )
    damping: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 's/rad or s/m', 'doc': 'losses c'}
    )

    def __post_init__(self) -> None:
        contract.not_negative(self, 'stiffness', 'damping')
        if self.exponent < 1.0:
            raise ValueError('exponent must be 1 at least')
        if self.lower is None and self.upper is None:
            raise ValueError('give a lower or an upper stop, or both')
        if None not in (self.lower, self.upper) and not self.lower < self.upper:  # type: ignore[operator]
            raise ValueError('the lower stop must be below the upper one')


def at_rest(_: Parameters) -> str:
    """A stop."""
    return contract.STOP


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: lower, upper, k, p, c. Raises ValueError for a joint without coordinate."""
    measures = Measures(layout)
    for effect in effects:
        p: Parameters = effect.parameters
        lower = -math.inf if p.lower is None else p.lower
        upper = math.inf if p.upper is None else p.upper
        measures.add_coordinate(p.joint)
        measures.give([lower, upper, p.stiffness, p.exponent, p.damping])
    return measures.packed(intervals=True)


@contract.force
def force(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    slots: Integers,
    params: Floats,
    Q: Floats,
) -> None:
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        lower, upper, k, p, c = (
            params[at],
            params[at + 1],
            params[at + 2],
            params[at + 3],
            params[at + 4],
        )
        x, xd = scalar(q, qd, near, slots, params, n)
        if x < lower:
            push(q, slots, params, n, k * (lower - x) ** p * max(0.0, 1.0 - c * xd), Q)
        elif x > upper:
            push(q, slots, params, n, -k * (x - upper) ** p * max(0.0, 1.0 + c * xd), Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        x, xd = scalar(q, qd, near, slots, params, n)
        if x < params[at] and params[at + 4] * xd < 1.0:
            total += n + 1.0
        elif x > params[at + 1] and -params[at + 4] * xd < 1.0:
            total -= n + 1.0
    return total


@contract.interval
def interval(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    out: Floats,
) -> None:
    at = numbers_of(slots, n)
    lower, upper = params[at], params[at + 1]
    out[0], out[1] = scalar(q, qd, near, slots, params, n)
    out[2], out[3] = lower, upper
    if params[at + 2] == 0.0:  # no force, no kink
        out[2], out[3] = -math.inf, math.inf
    elif out[0] < lower:
        out[2], out[3] = -math.inf, lower
    elif out[0] > upper:
        out[2], out[3] = upper, math.inf


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        x, _ = scalar(q, q, near, slots, params, n)
        depth = max(0.0, max(params[at] - x, x - params[at + 1]))
        exponent = params[at + 3] + 1.0
        energy += params[at + 2] * depth**exponent / exponent
    return energy


@contract.tangent
def tangent(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    loads: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    stiff: Floats,
    G: Floats,
) -> None:
    at = numbers_of(slots, n)
    k, p, c = params[at + 2], params[at + 3], params[at + 4]
    x, xd = scalar(q, qd, near, slots, params, n)
    depth = max(0.0, max(params[at] - x, x - params[at + 1]))
    losses = 1.0 - c * xd if x < params[at] else 1.0 + c * xd
    stiff[0] = 0.0
    stiff[1] = 0.0
    if depth > 0.0 and losses > 0.0:
        stiff[0] = k * p * depth ** (p - 1.0) * losses
        stiff[1] = k * depth**p * c
    push(q, slots, params, n, 1.0, G)
