"""How effects yield, as an implicit method asks: against differences of what they exert."""

from __future__ import annotations

import ctypes
import importlib
from typing import Any

import numpy as np
import pytest

from alf_ros import effects
from alf_ros.arrays import Floats
from support.effect_examples import CASES, EXAMPLES, as_python, simulation

YIELDING = [kind for kind in EXAMPLES if hasattr(effects.load(kind), 'tangent')]
SHOWN = [(kind, which) for kind, which in CASES if kind in YIELDING]
H = 1e-6


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

    def exerted(self, q: Floats, qd: Floats) -> Floats:
        Q = np.zeros(q.size)
        data = (self.packed.slots, self.packed.params, Q)
        self.module.force.__wrapped__(self.t, q, qd, self.near, *data)
        if hasattr(self.module, 'friction'):
            self.module.friction.__wrapped__(self.t, q, qd, self.near, self.loads, *data)
        return Q

    def yields(self, n: int, q: Floats | None = None) -> tuple[float, float, Floats]:
        """k, c and G of direction n, as it is written."""
        stiff, G = np.zeros(2), np.zeros(self.q.size)
        data = (self.packed.slots, self.packed.params, n, stiff, G)
        at = self.q if q is None else q
        self.module.tangent.function(self.t, at, self.qd, self.near, self.loads, *data)
        return stiff[0], stiff[1], G


def written(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    shared = [
        importlib.import_module(f'alf_ros.effects.contract.{name}')
        for name in ('scalars', 'gap_vectors', 'piecewise', 'affine_force')
    ]
    as_python(monkeypatch, effects.load(kind), *shared)


def instances(kind: str, which: str) -> int:
    return len(simulation(kind, which).scene.effects)


def test_what_is_stiff_says_so() -> None:
    """The others push as they do wherever things are: nothing but a table, or time."""
    rest = {'gravity', 'constant_wrench', 'joint_effort', 'user_table'}
    assert set(YIELDING) == set(EXAMPLES) - rest


@pytest.mark.parametrize(('kind', 'which'), SHOWN)
def test_compiled_is_what_is_written(
    kind: str, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pointer, number = ctypes.c_void_p, ctypes.c_double
    call = ctypes.CFUNCTYPE(None, number, *(6 * [pointer]), ctypes.c_int64, pointer, pointer)(
        effects.load(kind).tangent.address
    )
    written(monkeypatch, kind)
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
def test_c_is_the_difference_of_what_it_exerts(
    kind: str, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Σ c g gᵀ = -∂Q/∂q̇, along each of its directions."""
    written(monkeypatch, kind)
    largest = 0.0
    for instance in range(instances(kind, which)):
        alone = Alone(kind, which, instance)
        directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
        for _, _, d in directions:
            ahead, behind = (alone.exerted(alone.q, alone.qd + s * d) for s in (H, -H))
            found = (behind - ahead) @ d / (2.0 * H)
            wanted = float(sum(c * (G @ d) ** 2 for _, c, G in directions))
            assert found == pytest.approx(wanted, rel=1e-5, abs=1e-6)
            largest = max(largest, abs(wanted))
    if kind != 'spring':
        assert largest > 1e-3


@pytest.mark.parametrize(('kind', 'which'), [s for s in SHOWN if s[0] not in ('spring', 'drag')])
def test_k_is_the_difference_of_what_it_exerts(
    kind: str, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """-ΔF = k Δx + c Δẋ, F the effort on the scalar x of its first direction."""
    written(monkeypatch, kind)
    for instance in range(instances(kind, which)):
        alone = Alone(kind, which, instance)
        k, c, G = alone.yields(0)
        if not G.any():
            continue  # out of touch
        d = G / (G @ G)
        change, rate = 0.0, 0.0
        for s in (H, -H):
            q = alone.q + s * d
            g = alone.yields(0, q)[2]
            change += np.sign(s) * alone.exerted(q, alone.qd) @ g / (g @ g)
            rate += np.sign(s) * g @ alone.qd
        assert -change == pytest.approx(2.0 * H * k + c * rate, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize('which', ['planar', 'spatial'])
def test_a_spring_in_tension_is_stiff_in_all_directions(
    which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Σ k g gᵀ = -∂Q/∂q; under pressure what pushes it aside is left out."""
    written(monkeypatch, 'spring')
    tensions = 0
    for instance in range(instances('spring', which)):
        alone = Alone('spring', which, instance)
        directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
        d: Any = np.random.default_rng(instance).normal(size=alone.q.size)
        tension = directions[1][0] > 0.0
        tensions += int(tension)
        if not tension:
            d = directions[0][2]
        ahead, behind = (alone.exerted(alone.q + s * d, alone.qd) for s in (H, -H))
        wanted = sum(k * (G @ d) * G for k, _, G in directions)
        assert (behind - ahead) / (2.0 * H) == pytest.approx(wanted, rel=1e-5, abs=1e-5)
    assert 0 < tensions < instances('spring', which)  # both are shown


@pytest.mark.parametrize('which', ['planar', 'spatial'])
def test_a_path_in_tension_is_stiff_in_all_directions(
    which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Σ k g gᵀ = -∂Q/∂q at rest, over places and pulleys."""
    written(monkeypatch, 'tendon')
    alone = Alone('tendon', which, 1)
    alone.qd = np.zeros_like(alone.qd)
    directions = [alone.yields(n) for n in range(len(alone.packed.directions))]
    assert min(k for k, _, _ in directions) > 0.1
    d: Any = np.random.default_rng(3).normal(size=alone.q.size)
    ahead, behind = (alone.exerted(alone.q + s * d, alone.qd) for s in (H, -H))
    wanted = sum(k * (G @ d) * G for k, _, G in directions)
    assert (behind - ahead) / (2.0 * H) == pytest.approx(wanted, rel=1e-5, abs=1e-5)
