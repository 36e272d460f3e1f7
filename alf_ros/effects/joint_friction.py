"""Friction on a coordinate x of a joint: viscous, and dry under the load of its reaction.

The effort is -(b ẋ + μ(ẋ) N r ẋ / √(ẋ² + ε²)) with μ(ẋ) = μ_d + (μ_s - μ_d) exp(-(ẋ / ẋ_s)²):
Stribeck's curve from μ_s at rest to μ_d. N (N) is the force in the joint, which friction changes
in turn, or a given load; r (m) the radius at which it rubs; of a length r is 1. Below ε dry
friction is a steep viscous one: it holds a load only while creeping. Armstrong-Hélouvry, Dupont &
Canudas de Wit, Automatica 30 (1994), 1083.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, sqrt

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, numbers_of, push, scalar, shared
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
ONE_OF = ('viscous', 'dynamic', 'static')


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint, or one of its coordinates'})
    viscous: float = field(
        default=0.0,
        metadata={'kind': 'number', 'unit': 'N m s/rad or N s/m', 'doc': 'viscous friction b'},
    )
    dynamic: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': '1', 'doc': 'coefficient μ_d in motion'}
    )
    static: float | None = field(
        default=None,
        metadata={'kind': 'number', 'unit': '1', 'doc': 'coefficient μ_s at rest; μ_d if absent'},
    )
    load: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'N',
            'doc': 'normal load N; the force in the joint if absent',
            'needs': ('dynamic', 'static'),
        },
    )
    radius: float = field(
        default=1.0,
        metadata={
            'kind': 'number',
            'unit': 'm',
            'doc': 'radius r of an angle',
            'needs': ('dynamic', 'static'),
        },
    )
    stribeck: float = field(
        default=0.1,
        metadata={
            'kind': 'number',
            'unit': 'rad/s or m/s',
            'doc': 'speed of the fall to μ_d',
            'needs': ('static',),
        },
    )
    slip: float = field(
        default=1e-2,
        metadata={
            'kind': 'number',
            'unit': 'rad/s or m/s',
            'doc': 'speed ε below which dry friction fades',
            'needs': ('dynamic', 'static'),
        },
    )

    def __post_init__(self) -> None:
        contract.not_negative(self, 'viscous', 'dynamic', 'load')
        contract.positive(self, 'radius', 'stribeck', 'slip')
        if self.static is not None and self.static < self.dynamic:
            raise ValueError('static must not be less than dynamic')


def at_rest(p: Parameters) -> str | None:
    """Dry friction holds; viscous friction alone does not."""
    return contract.FRICTION_HOLDS if p.dynamic or p.static else None


def creeping(p: Parameters) -> float | None:
    """ε, or Stribeck's speed if that is less."""
    if at_rest(p) is None or p.load == 0.0:
        return None
    falls = p.static is not None and p.static > p.dynamic
    return min(p.slip, p.stribeck) if falls else p.slip


def loaded(parameters: Parameters) -> str | None:
    """The coordinate whose reaction an instance depends on."""
    rubs = parameters.dynamic > 0.0 or (parameters.static or 0.0) > 0.0
    return parameters.joint if rubs and parameters.load is None else None


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: b, μ_d r, (μ_s - μ_d) r, ẋ_s, ε, N if it is given, whether it is not.

    Raises ValueError for a joint without coordinate, and for a radius of a length.
    """
    measures = Measures(layout)
    for effect in effects:
        p: Parameters = effect.parameters
        measures.add_coordinate(p.joint)
        if p.radius != 1.0 and not measures.is_angle(p.joint):
            raise ValueError(f'{p.joint!r} is a length: no radius')
        static = p.dynamic if p.static is None else p.static
        dry = [p.dynamic * p.radius, (static - p.dynamic) * p.radius]
        unknown = float(loaded(p) is not None)
        measures.give([p.viscous, *dry, p.stribeck, p.slip, p.load or 0.0, unknown])
    return measures.packed()


@shared
def _dry(params: Floats, at: int, xd: float) -> float:
    """μ(ẋ) r / √(ẋ² + ε²)."""
    ratio = xd / params[at + 3]
    mu_r = params[at + 1] + params[at + 2] * exp(-ratio * ratio)
    return mu_r / sqrt(xd * xd + params[at + 4] * params[at + 4])


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
        _, xd = scalar(q, qd, near, slots, params, n)
        dry = params[at + 5] * _dry(params, at, xd)
        push(q, slots, params, n, -(params[at] + dry) * xd, Q)


@contract.friction
def friction(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    loads: Floats,
    slots: Integers,
    params: Floats,
    Q: Floats,
) -> None:
    for n in range(slots[1]):
        if loads[n] > 0.0:
            at = numbers_of(slots, n)
            _, xd = scalar(q, qd, near, slots, params, n)
            push(q, slots, params, n, -loads[n] * _dry(params, at, xd) * xd, Q)


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
    _, xd = scalar(q, qd, near, slots, params, n)
    load = params[at + 5]
    if params[at + 6] != 0.0:
        load += loads[n]
    ratio = xd / params[at + 3]
    falling = params[at + 2] * exp(-ratio * ratio)
    s = sqrt(xd * xd + params[at + 4] * params[at + 4])
    steep = (params[at + 1] + falling) * params[at + 4] * params[at + 4] / (s * s * s)
    stiff[0] = 0.0
    stiff[1] = params[at] + load * (steep - 2.0 * falling * ratio * ratio / s)
    push(q, slots, params, n, 1.0, G)
