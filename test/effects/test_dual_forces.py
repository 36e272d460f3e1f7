"""The derivative of each effect along a direction, as tangents use it: against differences of
eighth order of what it exerts. Every effect is found; one without a derivative fails by its name.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
import pytest

from alf_ros import effects
from alf_ros.arrays import Floats
from alf_ros.effects.contract.dual_force import dual_force
from alf_ros.effects.contract.force_branches import force_branches
from alf_ros.effects.contract.traced_force import traced_force
from support.effect_examples import CASES, simulation

_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
_POINTER, _NUMBER = ctypes.c_void_p, ctypes.c_double


class At:
    """All instances of an effect, at an instant of the motion of its mechanism."""

    def __init__(self, kind: str, which: str) -> None:
        sim = simulation(kind, which)
        sim.step(130)
        module, self.t = effects.load(kind), sim.t
        self.packed = module.pack(sim.scene.effects, sim.model.layout)
        self.q, self.qd, self.near = sim.state.q, sim.state.qd, sim.sample()._near
        self._force = ctypes.CFUNCTYPE(None, _NUMBER, *(6 * [_POINTER]))(module.force.address)
        compiled = dual_force(module.force._pyfunc)
        self._dual = ctypes.CFUNCTYPE(None, _NUMBER, *(10 * [_POINTER]))(compiled.address)

    def exerted(self, q: Floats, qd: Floats, params: Floats) -> Floats:
        Q = np.zeros(q.size)
        given = (q, qd, self.near, self.packed.slots, params, Q)
        self._force(self.t, *(each.ctypes.data for each in given))
        return Q

    def slope(self, dq: Floats, dqd: Floats, dparams: Floats) -> tuple[Floats, Floats]:
        """Q, and its derivative along a direction."""
        Q, dQ = np.zeros(self.q.size), np.zeros(self.q.size)
        slots, params = self.packed.slots, self.packed.params
        given = (self.q, dq, self.qd, dqd, self.near, slots, params, dparams, Q, dQ)
        self._dual(self.t, *(each.ctypes.data for each in given))
        return Q, dQ

    def differences(self, dq: Floats, dqd: Floats, dparams: Floats, h: float) -> Floats:
        params, found = self.packed.params, np.zeros(self.q.size)
        for k, weight in enumerate(_WEIGHTS, 1):
            for sign in (1.0, -1.0):
                s = sign * k * h
                ends = self.q + s * dq, self.qd + s * dqd, params + s * dparams
                found += sign * weight / h * self.exerted(*ends)
        return found


def directions(at: At, rng: np.random.Generator) -> dict[str, tuple[Floats, Floats, Floats]]:
    """Along positions, along velocities, along the numbers of the effect; and along all."""
    n, params = at.q.size, at.packed.params
    # limits of infinity and counts of arms, tables and roles are no numbers to be changed
    numbers = np.where(np.isfinite(params) & (params != np.round(params)), params, 0.0)
    q, qd, p = rng.normal(size=n), rng.normal(size=n), rng.normal(size=params.size) * numbers
    zero, none = np.zeros(n), np.zeros(params.size)
    found = {'q': (q, zero, none), 'qd': (zero, qd, none), 'all': (q, qd, none)}
    return {**found, 'numbers': (zero, zero, p)}


@pytest.mark.parametrize(('kind', 'which'), [case for case in CASES if 'loaded' not in case[1]])
def test_derivative_of_an_effect(kind: str, which: str) -> None:
    at = At(kind, which)
    rng = np.random.default_rng(7)
    for name, along in directions(at, rng).items():
        Q, dQ = at.slope(*along)
        plain = at.exerted(at.q, at.qd, at.packed.params)
        np.testing.assert_allclose(Q, plain, rtol=1e-14, atol=1e-14 * np.abs(plain).max())
        tries = [at.differences(*along, h) for h in (1e-2, 1e-3, 1e-4)]
        error = min(float(np.abs(each - dQ).max()) for each in tries)
        scale = float(max(np.abs(dQ).max(), np.abs(plain).max()))
        assert error <= 2e-10 * scale, f'{kind}, {which}: by {name}'


def test_every_effect_has_examples() -> None:
    """A new effect is differentiated above as soon as it exists."""
    named = {kind for kind, _ in CASES}
    assert set(effects.own()) <= named


def test_a_trace_has_the_slopes_of_dual_numbers() -> None:
    """Also where a root or a power has a slope of 0 by convention, where values decide, and where
    arguments are constant."""

    def force(t: Any, q: Any, qd: Any, near: Any, slots: Any, params: Any, Q: Any) -> None:
        Q[0] += math.sqrt(q[0] * q[0] + q[3] * q[3]) * q[0] + q[1] ** params[0] - 2.0 * q[2] / q[1]
        Q[1] += math.hypot(q[0], q[3]) * max(q[1], 3 * q[2]) + (1 - abs(qd[0])) * t
        if q[2] > 0.0:
            Q[2] -= math.sin(qd[1]) ** 2 * params[1]
        Q[3] += max(qd[0], qd[1] * q[1], 0.2) - min(1, q[1], q[2], params[0])
        Q[1] += 2.0 * Q[2] + Q[1] * q[1]

    q, qd = np.array([0.0, 1.5, 0.7, 0.0]), np.array([-0.3, 0.4, 0.0, 0.0])
    params = np.array([1.2, 2.0])
    leaves, room = 10, 50
    numbers = np.arange(leaves)
    numbers[9] = -1  # params[1]
    words, slopes = np.zeros(3 + 2 * room, dtype=np.int64), np.zeros(2 * room)
    words[1:3] = room, leaves
    none, Q, along = np.zeros(1, dtype=np.int64), np.zeros(4), np.zeros(4)
    made = np.full(4, -1)
    types = (None, _NUMBER, *(13 * [_POINTER]))
    of_state = (q, qd, none, none, params, numbers, numbers[4:], numbers[8:])
    given = (*of_state, Q, made, along, words, slopes)
    address = traced_force(force).address
    ctypes.CFUNCTYPE(*types)(address)(0.5, *(each.ctypes.data for each in given))
    assert 0 < words[0] < 14  # operations on one number are not written down
    for direction in np.eye(leaves)[:9]:
        moves = np.concatenate([direction, np.zeros(room)])
        for k in range(words[0]):
            for m in range(2):
                number = words[3 + 2 * k + m]
                if number >= 0 and moves[number] != 0.0:
                    moves[leaves + k] += slopes[2 * k + m] * moves[number]
        found = np.where(made >= 0, along * moves[made], 0.0)
        dQ, beside = np.zeros(4), np.zeros(4)
        parts = (direction[:4].copy(), direction[4:8].copy(), direction[8:].copy())
        alike = (q, parts[0], qd, parts[1], none, none, params, parts[2], beside, dQ)
        duals = ctypes.CFUNCTYPE(None, _NUMBER, *(10 * [_POINTER]))(dual_force(force).address)
        duals(0.5, *(each.ctypes.data for each in alike))
        np.testing.assert_allclose(found, dQ, rtol=1e-14, atol=1e-15)
        np.testing.assert_array_equal(Q, beside)
        assert dQ[3] == direction[5] * q[1] + direction[1] * qd[1] - direction[2]


def test_a_function_without_derivative_is_refused() -> None:
    def force(t: Any, q: Any, qd: Any, near: Any, slots: Any, params: Any, Q: Any) -> None:
        Q[0] += np.sinc(q[0])

    with pytest.raises(TypeError, match='sinc'):
        dual_force(force)


@pytest.mark.parametrize(('kind', 'which'), [case for case in CASES if 'loaded' not in case[1]])
def test_an_effect_without_side_has_no_branches(kind: str, which: str) -> None:
    """By the motion: so nobody needs to look for their kinks (`packed_effects`). An effect with
    branches has a `side`."""
    module, at = effects.load(kind), At(kind, which)
    branches = ctypes.CFUNCTYPE(_NUMBER, _NUMBER, *(5 * [_POINTER]))(
        force_branches(module.force._pyfunc, False)
    )
    rng, found = np.random.default_rng(5), set()
    for size in (*20 * [1e-3], *20 * [1.0], *20 * [30.0]):
        q, qd = at.q + size * rng.normal(size=at.q.size), size * rng.normal(size=at.q.size)
        given = (q, qd, at.near, at.packed.slots, at.packed.params)
        found.add(branches(at.t, *(each.ctypes.data for each in given)))
    assert len(found) == 1 or hasattr(module, 'side')
