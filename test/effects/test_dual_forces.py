"""The derivatives of each effect, as tangents and adjoints use them, against the complex step of
its own function. Every effect is found; one without a derivative fails by its name.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.ccallback import CFunc

from alf_ros import effects
from alf_ros.arrays import Floats
from alf_ros.effects.contract import OnDemand
from alf_ros.effects.contract.dual_force import dual_force
from alf_ros.effects.contract.force_branches import force_branches
from alf_ros.effects.contract.traced_force import traced_force
from support import complex_step
from support.effect_examples import CASES, EXAMPLES, in_plane_or_space, simulation
from support.thorough import LONG, thinned

_EXACT = 2e-14  # of the largest force or slope: a hundred roundings
_DISPLACED = 1e-12  # likewise: a stop that is hardly touched has a depth of few digits
# how far states are from the motion, so that they lie on several branches of a law
_SIZES = (0.0, *(10 if LONG else 2) * [0.03, 0.3], *(20 if LONG else 4) * [3.0])
# functions that have no derivative, and why
WITHOUT_DERIVATIVE = {
    'friction': 'it depends on the reactions, which it changes: tangents of a run refuse it',
}
_POINTER, _NUMBER = ctypes.c_void_p, ctypes.c_double


class At:
    """All instances of an effect, at an instant of the motion of its mechanism."""

    def __init__(self, kind: str, which: str) -> None:
        sim = simulation(kind, which)
        sim.step(130)
        module, self.t = effects.load(kind), sim.t
        self.packed = module.pack(sim.scene.effects, sim.model.layout)
        self.q, self.qd, self.near = sim.state.q, sim.state.qd, sim.sample()._near
        self.written = module.force._pyfunc
        self._force = ctypes.CFUNCTYPE(None, _NUMBER, *(6 * [_POINTER]))(module.force.address)
        compiled = dual_force(self.written)
        self._dual = ctypes.CFUNCTYPE(None, _NUMBER, *(10 * [_POINTER]))(compiled.address)

    @property
    def are_numbers(self) -> Any:
        """(params,) Limits of infinity and counts of arms, tables and roles are no numbers to be
        changed."""
        params = self.packed.params
        return np.isfinite(params) & (params != np.round(params))

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

    def complex_step(self, dq: Floats, dqd: Floats, dparams: Floats) -> tuple[Floats, Floats]:
        """The same, of the function as it is written."""
        found: list[Any] = self.q.size * [0.0]
        moving = (complex_step.along(x, dx) for x, dx in ((self.q, dq), (self.qd, dqd)))
        fixed = self.near.tolist(), self.packed.slots.tolist()
        numbers = complex_step.along(self.packed.params, dparams)
        complex_step.in_complex(self.written)(self.t, *moving, *fixed, numbers, found)
        return complex_step.values(found), complex_step.slopes(found)


class Trace:
    """Forces of a function, and how they depend on q, q̇ and the numbers that vary."""

    def __init__(self, force: Any, t: float, data: tuple[Any, ...], varied: Any) -> None:
        """data: q, q̇, near, slots, params; varied: which of q, q̇ and params."""
        q, qd, near, slots, params = data
        self.leaves, room = varied.size, 8192
        numbers = np.where(varied, np.arange(self.leaves), -1)
        self.words, self.slopes = np.zeros(3 + 2 * room, dtype=np.int64), np.zeros(2 * room)
        self.words[1:3] = room, self.leaves
        self.Q, self._along = np.zeros(q.size), np.zeros(q.size)
        self._made = np.full(q.size, -1)
        parts = numbers[: q.size], numbers[q.size : 2 * q.size], numbers[2 * q.size :]
        given = (q, qd, near, slots, params, *parts)
        written = (self.Q, self._made, self._along, self.words, self.slopes)
        address = traced_force(force).address
        call = ctypes.CFUNCTYPE(None, _NUMBER, *(13 * [_POINTER]))(address)
        call(t, *(each.ctypes.data for each in (*given, *written)))
        assert 0 <= self.words[0] <= room

    def slope(self, direction: Floats) -> Floats:
        """Of the forces along a direction (leaves,)."""
        count = int(self.words[0])
        moves = np.concatenate([direction, np.zeros(count)])
        for k in range(count):
            for m in range(2):
                number = self.words[3 + 2 * k + m]
                if number >= 0 and moves[number] != 0.0:
                    moves[self.leaves + k] += self.slopes[2 * k + m] * moves[number]
        return np.where(self._made >= 0, self._along * moves[self._made], 0.0)


def directions(at: At, rng: np.random.Generator) -> dict[str, tuple[Floats, Floats, Floats]]:
    """Along positions, along velocities, along the numbers of the effect; and along all."""
    n, params = at.q.size, at.packed.params
    numbers = np.where(at.are_numbers, params, 0.0)
    q, qd, p = rng.normal(size=n), rng.normal(size=n), rng.normal(size=params.size) * numbers
    zero, none = np.zeros(n), np.zeros(params.size)
    found = {'q': (q, zero, none), 'qd': (zero, qd, none), 'all': (q, qd, none)}
    return {**found, 'numbers': (zero, zero, p)}


def test_every_effect_has_examples() -> None:
    """A new effect is differentiated below as soon as it exists."""
    missing = set(effects.kinds()) - set(EXAMPLES)
    assert not missing, f'without an example to differentiate: {", ".join(sorted(missing))}'


@pytest.mark.parametrize(('kind', 'which'), thinned(CASES, in_plane_or_space))
def test_derivative_of_an_effect(kind: str, which: str) -> None:
    """Of its force, along positions, velocities and its numbers: by dual numbers, as tangents
    have it, and by the trace of the adjoint."""
    at, rng = At(kind, which), np.random.default_rng(7)
    q, qd = at.q, at.qd
    moved = 0.0
    for size in _SIZES:
        at.q, at.qd = (x + size * rng.normal(size=x.size) for x in (q, qd))
        for name, along in directions(at, rng).items():
            most = _DISPLACED if size else _EXACT
            largest = assert_exact(at, along, most, f'{kind}, {which}, {size}: by {name}')
            moved = max(moved, largest)
    assert moved > 0.1


def assert_exact(at: At, along: tuple[Floats, Floats, Floats], most: float, told: str) -> float:
    """Compare all derivatives along a direction with the complex step. The largest derivative."""
    exact, slope = at.complex_step(*along)
    atol = most * float(max(np.abs(slope).max(), np.abs(exact).max()))
    Q, dQ = at.slope(*along)
    data = (at.q, at.qd, at.near, at.packed.slots, at.packed.params)
    varied = np.concatenate([np.full(2 * at.q.size, True), at.are_numbers])
    trace = Trace(at.written, at.t, data, varied)
    for found in (Q, at.exerted(at.q, at.qd, at.packed.params), trace.Q):
        np.testing.assert_allclose(found, exact, rtol=0, atol=atol, err_msg=told)
    for found in (dQ, trace.slope(np.concatenate(along))):
        np.testing.assert_allclose(found, slope, rtol=0, atol=atol, err_msg=told)
    return float(np.abs(slope).max())


def test_every_function_of_effects_is_differentiated() -> None:
    """Below, or in `test_effect_tangents`, if it has a slope at all and no reason not to."""
    found = {
        name: f'{kind}.{name}'
        for kind in effects.kinds()
        for name, function in vars(effects.load(kind)).items()
        if isinstance(function, (CFunc, OnDemand))
    }
    tested, of_branches = {'force', 'potential', 'tangent'}, {'side', 'interval'}
    assert set(found) == tested | of_branches | set(WITHOUT_DERIVATIVE), found


@pytest.mark.parametrize('kind', [k for k in EXAMPLES if hasattr(effects.load(k), 'potential')])
@pytest.mark.parametrize('which', ['planar', 'spatial'])
def test_force_is_the_slope_of_the_potential(kind: str, which: str) -> None:
    """-∂V/∂q at rest, along any motion of the coordinates."""
    at, rest = At(kind, which), []
    potential = complex_step.in_complex(effects.load(kind).potential._pyfunc)
    data = at.near.tolist(), at.packed.slots.tolist(), at.packed.params.tolist()
    Q = at.exerted(at.q, np.zeros(at.q.size), at.packed.params)
    for d in np.random.default_rng(1).normal(size=(5, at.q.size)):
        energy = potential(at.t, complex_step.along(at.q, d), *data)
        size = float(np.abs(Q) @ np.abs(d))
        assert -complex_step.slope(energy) == pytest.approx(Q @ d, rel=0, abs=_EXACT * size)
        rest.append(size)
    assert min(rest) > 0.1


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
    none = np.zeros(1, dtype=np.int64)
    varied = np.arange(10) < 9  # all but params[1]
    trace = Trace(force, 0.5, (q, qd, none, none, params), varied)
    assert 0 < trace.words[0] < 14  # operations on one number are not written down
    for direction in np.eye(10)[:9]:
        found = trace.slope(direction)
        dQ, beside = np.zeros(4), np.zeros(4)
        parts = (direction[:4].copy(), direction[4:8].copy(), direction[8:].copy())
        alike = (q, parts[0], qd, parts[1], none, none, params, parts[2], beside, dQ)
        duals = ctypes.CFUNCTYPE(None, _NUMBER, *(10 * [_POINTER]))(dual_force(force).address)
        duals(0.5, *(each.ctypes.data for each in alike))
        np.testing.assert_allclose(found, dQ, rtol=1e-14, atol=1e-15)
        np.testing.assert_array_equal(trace.Q, beside)
        assert dQ[3] == direction[5] * q[1] + direction[1] * qd[1] - direction[2]


def test_a_function_without_derivative_is_refused() -> None:
    def force(t: Any, q: Any, qd: Any, near: Any, slots: Any, params: Any, Q: Any) -> None:
        Q[0] += np.sinc(q[0])

    with pytest.raises(TypeError, match='sinc'):
        dual_force(force)


def without_side(kind: str, which: str) -> bool:
    """Whether the test below can fail; nothing is compiled while tests are collected."""
    text = Path(effects.__file__).with_name(f'{kind}.py').read_text('utf-8')
    return in_plane_or_space(kind, which) and '\ndef side(' not in text


@pytest.mark.parametrize(
    ('kind', 'which'),
    thinned([case for case in CASES if 'loaded' not in case[1]], without_side),
)
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
