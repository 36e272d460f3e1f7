"""Forces of several members at once have the bits of each member's own, or say that they part."""

from __future__ import annotations

import copy
import ctypes
import hashlib
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from alf_ros import effects, load_scene
from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract.lane_force import lane_force
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.kernel.numba_ext.lane_structs import aligned
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.simulation.side_by_side import SideBySide
from support.documented_effect import FILES
from support.effect_examples import CASES, LOADED, in_plane_or_space, simulation
from support.side_by_side_members import check, member
from support.thorough import combined, thinned

pytestmark = pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')

W = width()
_pointer = ctypes.c_void_p
# steps of 1 ms at which the members are, and by how much their numbers differ
STATES = {'one state': (0, 0.0), 'neighbours': (1, 1e-3), 'far apart': (130, 1e-1)}


def single(
    kind: str, t: float, arrays: list[Floats], slots: Integers, params: Floats, Q: Floats
) -> None:
    call = ctypes.CFUNCTYPE(None, ctypes.c_double, *[_pointer] * 6)(
        effects.load(kind).force.address
    )
    call(t, *(each.ctypes.data for each in (*arrays, slots, params, Q)))


@pytest.mark.parametrize('kind, which', thinned(CASES, in_plane_or_space))
def test_lanes_have_the_bits_of_single_forces(kind: str, which: str) -> None:
    address = lane_force(effects.load(kind).force._pyfunc, W)
    assert address, f'the force of {kind} does not compile for lanes'
    together = ctypes.CFUNCTYPE(None, *[_pointer] * 8)(address)
    parts = {}
    for name, (every, spread) in STATES.items():
        sim = simulation(kind, which)
        sim.step(100)
        packed = effects.load(kind).pack(list(sim.scene.effects), sim.model.layout)
        members = []
        for m in range(W):
            sample = sim.sample()
            state = [sim.state.q.copy(), sim.state.qd.copy(), np.append(sample._near, 0.0)]
            whole = packed.params == np.round(packed.params)  # numbers of points and such
            params = packed.params * np.where(whole, 1.0, 1.0 + spread * m)
            members.append((sim.t, state, params, np.linspace(-1.0, 1.0, state[0].size) + m))
            sim.step(every)
        alone = []
        for t, state, params, before in members:
            Q = np.array(before, dtype=np.float64)
            single(kind, t, state, packed.slots, params, Q)
            alone.append(Q)
        columns = [
            [np.array([t]) for t, *_ in members],
            *([state[n] for _, state, *_ in members] for n in range(3)),
            [params for _, _, params, _ in members],
            [before for *_, before in members],
        ]
        lanes = []
        for column in columns:
            lanes.append(aligned(column[0].size, W))
            lanes[-1][:] = np.transpose(column)
        parted = np.zeros(1, dtype=np.int64)
        given = [each.ctypes.data for each in lanes]
        together(*given[:4], packed.slots.ctypes.data, *given[4:], parted.ctypes.data)
        parts[name] = bool(parted[0])
        if not parted[0]:
            assert lanes[-1].T.tobytes() == np.array(alone).tobytes(), name
    assert not parts['one state']


@pytest.mark.parametrize(
    ('kind', 'which', 'integrator'),
    combined(
        thinned([case for case in CASES if case not in LOADED], in_plane_or_space),
        ['rk4', 'dop853_adaptive'],
    ),
)
def test_runs_have_the_bits_of_single_runs(kind: str, which: str, integrator: str) -> None:
    """Members at other times, so that some of them part where the force has branches."""
    made = [simulation(kind, which, integrator=integrator) for _ in range(5)]
    for k, each in enumerate(made):
        each.step(40 * k)
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    for n in (1, 150):
        together.step(n)
        for each in alone:
            each.step(n)
        check(made, alone)


@pytest.mark.parametrize('law', ['length**2', 'length**2 * math.erf(9.0 * length)'])
def test_effects_of_users(tmp_path: Path, law: str) -> None:
    """The documented one, whose force compiles for lanes, and one that calls what lanes lack."""
    for name, text in FILES.items():
        text = text.replace('length**2', law).replace(
            'from dataclasses', 'import math\nfrom dataclasses'
        )
        (tmp_path / name).write_text(text, 'utf-8')
    scene = load_scene(tmp_path / 'orbit.yaml')
    made = [
        member(scene, {'initial.velocities.P.1': '{0.5+k/9}'}, k, integrator='rk4')
        for k in range(3)
    ]
    (kind,) = made[0]._run.applied.kinds
    assert bool(lane_force(effects.load(kind).force._pyfunc, W)) == (law == 'length**2')
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(50)
    for each in alone:
        each.step(50)
    check(made, alone)


HEAD = """
import math
from alf_ros.effects import contract


@contract.force
def force(t, q, qd, near, slots, params, Q):
"""


def in_lanes(
    tmp_path: Path, body: str, q: Floats, slots: Sequence[int] = (0,)
) -> tuple[int, bool, Floats, Floats]:
    """Of a force with these lines and members with these q: its address, whether they part, Q of
    the lanes, and Q of each member alone."""
    lines = [f'    {line}' for line in body.splitlines()]
    path = tmp_path / f'odd_law_{hashlib.sha256(body.encode()).hexdigest()[:12]}.py'
    module = sys.modules.get(path.stem)
    if module is None:
        path.write_text(HEAD + '\n'.join(lines) + '\n', 'utf-8')
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module
        spec.loader.exec_module(module)
    of = np.array(slots)
    alone = np.zeros((W, 4))
    call = ctypes.CFUNCTYPE(None, ctypes.c_double, *[_pointer] * 6)(module.force.address)
    zeros = np.zeros(4)
    for m in range(W):
        given = [np.array(q[m]), zeros, zeros, of, zeros, alone[m]]
        call(0.0, *(each.ctypes.data for each in given))
    address = lane_force(module.force._pyfunc, W)
    lanes = [aligned(n, W) for n in (1, 4, 4, 4, 4, 4)]
    lanes[1][:] = q.T
    parted = np.zeros(1, dtype=np.int64)
    if address:
        given = [each.ctypes.data for each in lanes]
        call = ctypes.CFUNCTYPE(None, *[_pointer] * 8)(address)
        call(*given[:4], of.ctypes.data, *given[4:], parted.ctypes.data)
    return address, bool(parted[0]), lanes[-1].T, alone


def test_a_loop_ends_where_members_part(tmp_path: Path) -> None:
    """Each member is in the window at another turn of the loop, and never all of them."""
    body = """
x, i = q[0], 0
while True:
    i += 1
    x -= 1.0
    if -60.0 <= x < -59.0:
        break
Q[0] += i"""
    address, parted, _, alone = in_lanes(
        tmp_path, body, np.array(range(4 * W), dtype=np.float64).reshape(W, 4)
    )
    assert address
    assert parted
    np.testing.assert_array_equal(alone[:, 0], 60.0 + 4.0 * np.arange(W))


def test_an_index_is_in_range_where_members_part(tmp_path: Path) -> None:
    """The first member returns before it. Its index is far outside of Q."""
    q = np.ones((W, 4))
    q[0] = -1e15
    body = 'if q[0] < 0.0:\n    return\nQ[int(q[0])] += 1.0'
    address, parted, _, alone = in_lanes(tmp_path, body, q)
    assert address
    assert parted
    assert alone[0].tolist() == [0.0] * 4


def test_numbers_without_a_member_do_not_part(tmp_path: Path) -> None:
    """A variable that is a plain number on the path that is taken, and is no number."""
    body = """
y = 0.0
if slots[0] > 5:
    y = q[1]
y = y * math.inf
Q[0] += 0.0 * math.floor(y)
Q[1] += 1.0 if y > 0.0 else 2.0"""
    address, parted, lanes, alone = in_lanes(tmp_path, body, np.ones((W, 4)))
    assert address
    assert not parted
    assert lanes[:, 1].tolist() == alone[:, 1].tolist() == [2.0] * W


@pytest.mark.filterwarnings('ignore::pytest.PytestUnraisableExceptionWarning')
def test_an_error_of_one_member_leaves_the_others(tmp_path: Path) -> None:
    """A contract does not allow it; the others have their forces nevertheless."""
    q = np.ones((W, 4))
    q[1] = 0.0
    address, parted, _, alone = in_lanes(tmp_path, 'Q[0] += q[0] ** -1', q)
    assert address
    assert parted
    assert alone[:, 0].tolist() == [1.0, 0.0, *[1.0] * (W - 2)]


@pytest.mark.filterwarnings('ignore::numba.NumbaPendingDeprecationWarning')
@pytest.mark.parametrize(
    'body',
    [
        'x = [q[0], q[1]]\nQ[0] += x[0] + len(x)',
        'Q[0] += sum([q[i] for i in range(3)])',
        'x = q[0]\nif x is x:\n    Q[0] += 1.0',
    ],
)
def test_what_lanes_cannot_do_does_not_compile(tmp_path: Path, body: str) -> None:
    address, *_ = in_lanes(tmp_path, body, np.ones((W, 4)))
    assert not address


def test_laws_at_odd_numbers(tmp_path: Path) -> None:
    body = """
a, b = q[0], q[1]
if not (a > b):
    a, b = b, a
Q[0] += max(0.0, a, -0.0) + b**3 / a - abs(-a) ** 0.5
Q[1] -= 1.0 / min(a, 0) + (math.atan2(b, a) if 0.0 <= b < 1.0 else 2)
Q[2] = (a > 0.5) * b + int(3.0 * a)
Q[3] += 2.0**b - math.hypot(a, b) + min(a * 5e-324, 1e-310)"""
    rng = np.random.default_rng(5)
    odd = [0.0, -0.0, 5e-324, 1e-310, np.inf, -np.inf, 1e300, 0.5, 1.0, -3.0, 1e-3]
    together = 0
    for n in range(300):
        q: Floats = np.tile(rng.choice(odd, size=4), (W, 1))
        if n % 2:
            near = 1e-9 * rng.normal(size=(W, 4))
            q = np.asarray(rng.normal(size=4) + near, dtype=np.float64)
        address, parted, lanes, alone = in_lanes(tmp_path, body, q)
        assert address
        if not parted:
            together += 1
            same = (lanes == alone) & (np.signbit(lanes) == np.signbit(alone))
            assert (same | (np.isnan(lanes) & np.isnan(alone))).all()
    assert together > 150
