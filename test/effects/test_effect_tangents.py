"""How effects yield, as an implicit method asks: against the complex step of what they exert."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

from alf_ros import effects
from alf_ros.arrays import Floats
from support.complex_step import along, in_complex, slope, slopes, value, values
from support.effect_examples import CASES, EXAMPLES, simulation

YIELDING = [kind for kind in EXAMPLES if hasattr(effects.load(kind), 'tangent')]
SHOWN = [(kind, which) for kind, which in CASES if kind in YIELDING]
EXACT = 1e-12  # relative, or beside forces of 1 N
Numbers = list[Any]


class Alone:
    """One instance of an effect, at an instant of the motion of its mechanism."""

    def __init__(self, kind: str, which: str, n: int) -> None:
        sim = simulation(kind, which)
        sim.step(130)
        self.module, self.t = effects.load(kind), sim.t
        self.packed = self.module.pack([sim.scene.effects[n]], sim.model.layout)
        sample, state = sim.sample(), sim.state
        self.near, self.q, self.qd = sample._near, state.q, state.qd
        loads = sample.friction_loads if which.endswith('loaded') else np.zeros(9)
        self.loads = loads[n:].copy()

        self.data = self.packed.slots.tolist(), self.packed.params.tolist()

    def exerted(self, q: Numbers, qd: Numbers) -> list[Any]:
        Q: list[Any] = len(q) * [0.0]
        near, loads = self.near.tolist(), self.loads.tolist()
        in_complex(self.module.force.__wrapped__)(self.t, q, qd, near, *self.data, Q)
        if hasattr(self.module, 'friction'):
            friction = in_complex(self.module.friction.__wrapped__)
            friction(self.t, q, qd, near, loads, *self.data, Q)
        return Q

    def yields(self, n: int) -> tuple[float, float, Floats]:
        """k, c and G of direction n, as it is written."""
        k, c, G = self.yields_at(self.q.tolist(), n)
        return value(k), value(c), values(G)

    def yields_at(self, q: Numbers, n: int) -> tuple[Any, Any, list[Any]]:
        """The same at other positions, which may be complex."""
        stiff: list[Any] = [0.0, 0.0]
        G: list[Any] = len(q) * [0.0]
        given = self.qd.tolist(), self.near.tolist(), self.loads.tolist()
        in_complex(self.module.tangent.function)(self.t, q, *given, *self.data, n, stiff, G)
        return (*stiff, G)


def instances(kind: str, which: str) -> int:
    return len(simulation(kind, which).scene.effects)


def test_what_is_stiff_says_so() -> None:
    """The others push as they do wherever things are: nothing but a table, or time."""
    rest = {'gravity', 'constant_wrench', 'joint_effort', 'user_table'}
    assert set(YIELDING) == set(EXAMPLES) - rest


@pytest.mark.parametrize(('kind', 'which'), SHOWN)
def test_compiled_is_what_is_written(kind: str, which: str) -> None:
    pointer, number = ctypes.c_void_p, ctypes.c_double
    call = ctypes.CFUNCTYPE(None, number, *(6 * [pointer]), ctypes.c_int64, pointer, pointer)(
        effects.load(kind).tangent.address
    )
    for instance in range(instances(kind, which)):
        alone = Alone(kind, which, instance)
        assert alone.packed.directions
        for n, blocks in enumerate(alone.packed.directions):
            k, c, G = alone.yields(n)
            stiff, found = np.zeros(2), np.zeros(G.size)
            packed = alone.packed
            data = (alone.q, alone.qd, alone.near, alone.loads, packed.slots, packed.params)
            call(
                alone.t,
                *(array.ctypes.data for array in data),
                n,
                *(array.ctypes.data for array in (stiff, found)),
            )
            assert stiff == pytest.approx([k, c], rel=1e-12, abs=1e-12)
            assert found == pytest.approx(G, rel=1e-12, abs=1e-12)
            # nothing moves but the blocks that the pattern has room for
            touched = {int(i) // int(packed.slots[0]) for i in np.nonzero(G)[0]}
            assert touched <= set(blocks)


@pytest.mark.parametrize(('kind', 'which'), SHOWN)
def test_c_is_the_slope_of_what_it_exerts(kind: str, which: str) -> None:
    """Σ c g gᵀ = -∂Q/∂q̇, along each of its directions."""
    largest = 0.0
    for instance in range(instances(kind, which)):
        alone = Alone(kind, which, instance)
        directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
        for _, _, d in directions:
            found = -slopes(alone.exerted(alone.q.tolist(), along(alone.qd, d))) @ d
            wanted = float(sum(c * (G @ d) ** 2 for _, c, G in directions))
            assert found == pytest.approx(wanted, rel=EXACT, abs=EXACT)
            largest = max(largest, abs(wanted))
    if kind != 'spring':
        assert largest > 1e-3


@pytest.mark.parametrize(('kind', 'which'), [s for s in SHOWN if s[0] not in ('spring', 'drag')])
def test_k_is_the_slope_of_what_it_exerts(kind: str, which: str) -> None:
    """-ΔF = k Δx + c Δẋ, F the effort on the scalar x of its first direction."""
    for instance in range(instances(kind, which)):
        alone = Alone(kind, which, instance)
        k, c, G = alone.yields(0)
        if not G.any():
            continue  # out of touch
        d = G / (G @ G)
        q = along(alone.q, d)
        g, forces = alone.yields_at(q, 0)[2], alone.exerted(q, alone.qd.tolist())
        square = sum(x * x for x in g)
        change = slope(sum(x * y for x, y in zip(forces, g, strict=True)) / square)
        rate = slopes(g) @ alone.qd
        assert -change == pytest.approx(k + c * rate, rel=EXACT, abs=EXACT)


@pytest.mark.parametrize('which', ['planar', 'spatial'])
def test_a_spring_in_tension_is_stiff_in_all_directions(which: str) -> None:
    """Σ k g gᵀ = -∂Q/∂q; under pressure what pushes it aside is left out."""
    tensions = 0
    for instance in range(instances('spring', which)):
        alone = Alone('spring', which, instance)
        directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
        d: Any = np.random.default_rng(instance).normal(size=alone.q.size)
        tension = directions[1][0] > 0.0
        tensions += int(tension)
        if not tension:
            d = directions[0][2]
        found = -slopes(alone.exerted(along(alone.q, d), alone.qd.tolist()))
        wanted = sum(k * (G @ d) * G for k, _, G in directions)
        assert found == pytest.approx(wanted, rel=EXACT, abs=EXACT)
    assert 0 < tensions < instances('spring', which)  # both are shown


@pytest.mark.parametrize('which', ['planar', 'spatial'])
def test_a_path_in_tension_is_stiff_in_all_directions(which: str) -> None:
    """Σ k g gᵀ = -∂Q/∂q at rest, over places and pulleys."""
    alone = Alone('tendon', which, 1)
    alone.qd = np.zeros_like(alone.qd)
    directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
    assert min(k for k, _, _ in directions) > 0.1
    d: Any = np.random.default_rng(3).normal(size=alone.q.size)
    found = -slopes(alone.exerted(along(alone.q, d), alone.qd.tolist()))
    wanted = sum(k * (G @ d) * G for k, _, G in directions)
    assert found == pytest.approx(wanted, rel=EXACT, abs=EXACT)
