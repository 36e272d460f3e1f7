"""Copies and pickles own their memory, and continue bit for bit, in other processes too."""

from __future__ import annotations

import copy
import gc
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import (
    AssemblyError,
    BusyError,
    InputError,
    Simulation,
    StepError,
    StoppedError,
    load_scene,
)
from alf_ros.effects.contract.trajectory import through
from alf_ros.kernel.numba_ext.structs import Struct
from support.paths import ROOT
from support.runs import RUNS, bits, made, scene
from support.thorough import thinned

COPIES: dict[str, Callable[[Any], Any]] = {
    'copy': copy.copy,
    'deepcopy': copy.deepcopy,
    'pickle': lambda x: pickle.loads(pickle.dumps(x)),
}


@pytest.mark.parametrize('copied', COPIES)
@pytest.mark.parametrize('name', RUNS)
def test_a_copy_goes_on_by_itself_bit_for_bit(name: str, copied: str) -> None:
    sim, alone = made(name), made(name)
    alone.step(60)
    sim.step(25)
    other = COPIES[copied](sim)
    assert bits(other.state) == bits(sim.state)
    before = bits(sim.state)
    other.step(35)
    assert bits(sim.state) == before
    sim.step(35)
    assert bits(other.state) == bits(sim.state) == bits(alone.state)
    assert other.evaluations == sim.evaluations
    assert other.rounded_steps == sim.rounded_steps
    assert repr(other.resolution) == repr(sim.resolution)
    a, b = other.sample(), alone.sample()
    assert a.energy == b.energy and a.qdd.tobytes() == b.qdd.tobytes()
    assert a.reaction_forces.tobytes() == b.reaction_forces.tobytes()
    if RUNS[name][1].get('watch'):
        assert other.passes == sim.passes == alone.passes
    again = made(name)
    other.reset()
    assert bits(other.state) == bits(again.state)


@pytest.mark.parametrize('copied', thinned(COPIES, keep=['copy', 'pickle']))
def test_a_copy_outlives_its_original(copied: str) -> None:
    sim = made('driven')
    sim.step(10)
    other = COPIES[copied](sim)
    del sim
    gc.collect()
    rubbish = [np.full(999, np.nan) for _ in range(999)]
    other.step(50)
    alone = made('driven')
    alone.step(60)
    assert bits(other.state) == bits(alone.state) and rubbish


def test_a_copy_has_the_passes_and_finds_the_next_ones() -> None:
    sim = Simulation(load_scene('double_four_bar'), watch=True)
    alone = Simulation(load_scene('double_four_bar'), watch=True)
    sim.step(1000)
    other = pickle.loads(pickle.dumps(sim))
    assert other.passes == sim.passes
    other.step(2000)
    alone.step(3000)
    assert other.passes == alone.passes and len(alone.passes) > len(sim.passes) > 0


def test_copies_hold_inputs_of_their_own() -> None:
    sim = made('explicit')
    sim.apply_effort('crank_pin', through([0.0, 1.0], [(0.0,), (2.0,)]))
    sim.apply_wrench('coupler', [0.0, 1.0], at='A')
    other = copy.deepcopy(sim)
    other.clear_inputs()
    assert sim.state.inputs.efforts and not other.state.inputs.efforts
    third = pickle.loads(pickle.dumps(sim))
    third.step(30)
    sim.step(30)
    assert bits(third.state) == bits(sim.state)


def test_what_is_copied_within_a_step_of_the_grid_is_the_grid_point() -> None:
    sim = made('adaptive')
    run = sim.run(1.0, at=[0.5 * sim.h, 1.5 * sim.h])
    next(run)
    other = copy.copy(sim)
    next(run)
    *_, last = other.run(1.5 * other.h, at=[1.5 * other.h])
    assert last.step == 1


CHILD = """
import pickle, sys
from alf_ros import Simulation
parts = pickle.load(sys.stdin.buffer)
told = {}
for name, part in parts.items():
    if isinstance(part, Simulation):
        part.step(35)
        told[name] = part.state, part.sample().reaction_forces
    else:
        told[name] = part
pickle.dump(told, sys.stdout.buffer)
"""


def in_another_process(parts: Any) -> Any:
    """The result of a child process for pickled parts; the child steps the simulations."""
    done = subprocess.run(
        [sys.executable, '-c', CHILD],
        input=pickle.dumps(parts),
        capture_output=True,
        cwd=ROOT,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return pickle.loads(done.stdout)


def test_simulations_go_on_in_another_process() -> None:
    simulations = {name: made(name) for name in RUNS}
    for sim in simulations.values():
        sim.step(25)
    told = in_another_process(simulations)
    for name, sim in simulations.items():
        sim.step(35)
        state, forces = told[name]
        assert bits(state) == bits(sim.state), name
        assert forces.tobytes() == sim.sample().reaction_forces.tobytes()


def test_every_public_part_travels() -> None:
    sim = Simulation(load_scene('slider_crank'), accuracy=1e-4, watch=True, ledger=True)
    sim.step(900)
    rubbing = made('rubbing')
    rubbing.step(5)
    sample = rubbing.sample()
    parts: dict[str, Any] = {
        'scene': sim.scene,
        'model': made('driven').model,
        'state': sim.state,
        'sample': sample,
        'diagnostics': sample.diagnostics,
        'points': sample.points,
        'reactions': sample.reactions,
        'multipliers': sample.multipliers,
        'joints': sample.joints,
        'method': sim.solver.method,
        'solver': sim.solver,
        'accuracy': sim.accuracy,
        'passes': sim.passes,
        'resolution': sim.resolution,
        'singular_start': Simulation(load_scene('change_point')).singular_start,
        'departure': sim.departure,
        'adjustment': sim.adjustment,
        'errors': [
            InputError('no', key='a', value=1, choices=['b']),
            AssemblyError('open'),
            StepError('slow', 'wait', 1.5),
            StoppedError(),
            BusyError('Simulation', 'step'),
        ],
    }
    found = in_another_process(parts)
    assert found['scene'] == sim.scene and found['scene'].text == sim.scene.text
    assert bits(found['state']) == bits(sim.state)
    for name in ('accuracy', 'passes', 'solver', 'adjustment'):
        assert found[name] == parts[name]
    assert repr(found['resolution']) == repr(sim.resolution)
    assert found['sample'].energy == sample.energy
    assert found['sample'].lam.tobytes() == sample.lam.tobytes()
    assert found['diagnostics'].rank == sample.diagnostics.rank
    assert found['method'].a.tobytes() == sim.solver.method.a.tobytes()
    assert found['model'].q.tobytes() == parts['model'].q.tobytes()
    assert not found['model'].q.flags.writeable
    for name in ('points', 'multipliers', 'joints'):
        assert repr(found[name]) == repr(dict(parts[name]))
    for one, other in zip(found['errors'], parts['errors'], strict=True):
        assert type(one) is type(other) and vars(one) == vars(other) and str(one) == str(other)


EFFECT = '''
"""A force along x that grows with time."""
from dataclasses import dataclass, field
import numpy as np
from alf_ros.effects import contract

MULTIPLE = True

@dataclass(frozen=True)
class Parameters:
    point: str = field(metadata={'kind': 'point', 'doc': 'on what'})
    rate: float = field(metadata={'kind': 'number', 'unit': 'N/s', 'doc': 'how fast'})

def pack(effects, layout):
    slots = np.array([len(effects), *(layout.of_point[e.parameters.point] for e in effects)])
    slots = np.append(slots, layout.dimension)
    return contract.Packed(slots, np.array([e.parameters.rate for e in effects]))

@contract.force
def force(t, q, qd, near, slots, params, Q):
    n = slots[0]
    for i in range(n):
        Q[slots[1 + i] * slots[1 + n]] += params[i] * t
'''


def test_a_users_effect_travels_with_its_text(tmp_path: Path) -> None:
    file = tmp_path / 'growing.py'
    file.write_text(EFFECT)
    text = {'mechanism': 'slider_crank', 'effects': {str(file): {'point': 'A', 'rate': 30.0}}}
    sim = Simulation(load_scene(text), integrator='rk4')
    sim.step(25)
    pickled = {'sim': sim, 'scene': sim.scene}
    file.write_text('raise SystemExit("not the text that was run")')
    told = in_another_process(pickled)
    sim.step(35)
    assert bits(told['sim'][0]) == bits(sim.state)
    assert told['scene'] == sim.scene


def addresses(struct: Any) -> set[int]:
    """The addresses of the table and the arrays of a struct, and of the structs in it."""
    found = {struct._address}
    for name in struct.__dataclass_fields__:
        value = getattr(struct, name)
        if isinstance(value, Struct):
            found |= addresses(value)
        elif isinstance(value, np.ndarray) and value.size:
            found.add(value.ctypes.data)
            if name in struct.addresses:
                found |= {int(each) for each in value.ravel() if each}
    return found


@pytest.mark.parametrize('name', RUNS)
def test_no_address_leaves_an_object(name: str) -> None:
    sim = made(name)
    sim.step(5)
    sample = sim.sample()
    _ = sample.qdd, sample.reaction_forces
    known = addresses(sim.model.system) | addresses(sim._run.applied.assembled)
    known |= addresses(sim._run.stepper.work) | addresses(sim._run.present.phase)
    told = b''.join(pickle.dumps(part) for part in (sim, sim.model, sim.state, sample, sim.scene))
    assert not any(each.to_bytes(8, 'little') in told for each in known)


def test_what_holds_addresses_is_not_pickled() -> None:
    sim = made('rubbing')
    sim.step(1)
    forces = sim._run.applied.assembled
    for struct in (forces, forces.effects, forces.bearings, forces.ledger, sim._run.stepper.work):
        with pytest.raises(TypeError, match='addresses of this process'):
            pickle.dumps(struct)
    work = copy.copy(sim._run.stepper.work)
    assert not work.caller.any() and work.q is not sim._run.stepper.work.q


def test_a_pickle_of_another_version_is_refused() -> None:
    sim = made('explicit')
    saved = sim.__getstate__()
    saved['version'] = '0.0.1'
    with pytest.raises(InputError, match=r"another version, got '0\.0\.1'"):
        Simulation.__new__(Simulation).__setstate__(saved)


def test_a_scene_equals_its_pickle() -> None:
    for name in RUNS:
        whole = scene(name)
        assert pickle.loads(pickle.dumps(whole)) == whole
