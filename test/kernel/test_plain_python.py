"""The kernel as plain Python: the same steps, in which every index is checked."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from alf_ros.kernel import Status, status
from alf_ros.kernel.numba_ext.plain import PlainVector, flat
from support.paths import ROOT
from support.traced import traced

SCRIPT = """
import json, sys
import numpy as np
from alf_ros import Simulation, load_scene
from alf_ros.simulation.observables import READINGS
from alf_ros.simulation.sample_reader import KEYS, SampleReader, fits, mask

def read(simulation):
    # all that the node sends
    if not fits(simulation):
        return []
    sample = simulation.sample()
    into = {key: tuple(np.zeros(np.size(x)) for x in READINGS[key].values(sample))
            for key in KEYS if key != 'work'}
    reader = SampleReader(simulation, into)
    if not reader.read(mask(tuple(into))):
        return []
    return [array.tolist() for arrays in into.values() for array in arrays]

told = []
for name, options, steps in json.load(sys.stdin):
    simulation = Simulation(load_scene(name), **options)
    simulation.step(steps)
    sample = simulation.sample()
    told.append([simulation.state.q.tolist(), simulation.state.qd.tolist(),
                 sample.energy, sample.works if options.get('ledger') else {},
                 simulation.evaluations,
                 read(simulation)])
print(json.dumps(told))
"""
# in the plane and in space; explicit, adaptive and implicit; with a ledger, a drive and friction;
# through a singular position
RUNS = [
    ('slider_crank', {'integrator': 'rk4', 'ledger': True}, 5),
    ('slider_crank', {'integrator': 'dop853_adaptive', 'watch': True}, 3),
    ('slider_crank', {'integrator': 'esdirk43_adaptive'}, 2),
    ('spatial_slider_crank', {'integrator': 'dop853'}, 3),
    ('wiper', {'integrator': 'rk4'}, 3),
    ('rolling_disk', {'integrator': 'rk4'}, 3),
    ('slider_crank', {'integrator': 'dop853', 'step': 0.391732 / 20}, 21),  # a step ends in it
]


def run(**variables):
    """Return what the script computes in a process of its own."""
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT],
        input=json.dumps(RUNS),
        env={**os.environ, 'PYTHONPATH': str(ROOT), **traced(), **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_plain_python_takes_the_same_steps():
    for name, plain, compiled in zip(RUNS, run(NUMBA_DISABLE_JIT='1'), run(), strict=True):
        for a, b in zip(plain[:3], compiled[:3], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12, err_msg=str(name))
        assert plain[3] == pytest.approx(compiled[3], rel=1e-9, abs=1e-12)
        assert plain[4] == compiled[4]
        for a, b in zip(plain[5], compiled[5], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-10, err_msg=str(name))


def test_a_vector_refuses_what_is_outside_of_it():
    numbers = np.arange(6, dtype=np.uint32).reshape(2, 3)
    v = flat(numbers)
    v[5] = 9
    assert numbers[1, 2] == 9 and v.size == 6 and v.behind(4)[1] == 9
    assert (v[1] - v[0]).dtype == np.uint64
    for i in (-1, 6):
        with pytest.raises(IndexError, match=f'number {i} of 6'):
            v[i]
    with pytest.raises(IndexError):
        v.behind(7)
    with pytest.raises(ValueError, match='read-only'):
        flat(numbers, constant=True)[0] = 1
    assert isinstance(v.behind(6), PlainVector)


def test_every_result_says_what_to_do():
    assert [int(one) for one in Status][:9] == list(range(9))
    for one in Status:
        assert getattr(status, one.name) == one and type(getattr(status, one.name)) is int
        assert bool(one.reason) == bool(one.remedy) == (one != Status.OK)


def test_only_one_folder_knows_llvm():
    """Elsewhere the kernel takes from numba at most its types, for signatures."""
    for path in (ROOT / 'alf_ros/kernel').glob('*.py'):
        lines = path.read_text(encoding='utf-8').splitlines()
        told = [line for line in lines if line.startswith(('import', 'from'))]
        known = [line for line in told if 'llvmlite' in line or ' numba' in line]
        assert not known or known == ['from numba import types'], path
