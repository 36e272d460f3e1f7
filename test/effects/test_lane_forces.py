"""Forces of several members at once have the bits of each member's own, or say that they part."""

from __future__ import annotations

import copy
import ctypes
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
from support.effect_examples import CASES, LOADED, simulation
from support.side_by_side_members import check, member
from support.thorough import combined

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


@pytest.mark.parametrize('kind, which', CASES)
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
    combined([case for case in CASES if case not in LOADED], ['rk4', 'dop853_adaptive']),
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
