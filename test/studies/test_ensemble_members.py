"""A member has the bits of its single run, whoever runs it."""

from __future__ import annotations

import gc
import re
from typing import Any

import numpy as np
import pytest

import alf_ros
from alf_ros import InputError, Run, Simulation, load_scene, record
from alf_ros.scene.overrides import with_changes
from alf_ros.simulation.sample import Sample
from alf_ros.studies.ensemble.chunk import run_chunk
from alf_ros.studies.ensemble.distributions import normal, uniform
from alf_ros.studies.ensemble.member import run_member
from alf_ros.studies.ensemble.study_reading import load_study, study_of
from support.thorough import combined

DOWN, BELOW = 'gravity.acceleration.1', 'gravity.acceleration.2'
# scene, what varies, duration (s): singular positions, space, redundant rows, drives
LIBRARY: dict[str, tuple[dict[str, Any], float]] = {
    'slider_crank': ({'coupler.mass': normal(1, 0.05), DOWN: uniform(-10, -9)}, 0.8),
    'change_point': ({'m': uniform(0.9, 1.1), DOWN: uniform(-10, -9)}, 0.6),
    'double_four_bar': ({DOWN: uniform(-10, -9)}, 0.2),
    'four_bar': ({'coupler.mass': uniform(0.5, 2.0), 'initial.velocities.A.0': ['-20*a']}, 0.1),
    'spatial_slider_crank': ({BELOW: uniform(-10, -9)}, 0.2),
    'wiper': ({DOWN: uniform(-10, -9)}, 0.2),
}

SAID = ('mass', 'beta|value|sqrt|acos', 't = ')
WITH_A = ('slider_crank', 'change_point', 'four_bar')


@pytest.mark.parametrize('name', LIBRARY)
def test_a_member_has_the_bits_of_its_single_run(name):
    vary, duration = LIBRARY[name]
    kept = ['energy', 'points.A'] if name in WITH_A else ['energy', 'kinetic_energy']
    study = study_of(name, vary, members=2, seed=5, duration=duration, period=0.02, outputs=kept)
    for k in range(2):
        member = run_member(study, k)
        scene = with_changes(load_scene(name), study.samples.values(k))
        if member.reason:
            assert name == 'four_bar' and 'contradict' in member.reason
            continue
        simulation = Simulation(scene)
        alone = record(simulation, duration, period=0.02)
        for array, output in zip(member.arrays, study.outputs, strict=True):
            assert array.tobytes() == alone[output.quantity].tobytes()
        # and the same as without looking at it
        blind = Simulation(scene)
        blind.step(simulation.step_index)
        assert blind.state.q.tobytes() == simulation.state.q.tobytes()


def test_other_integrators_and_instants_between_steps():
    scene = load_scene('slider_crank')
    vary = {
        'solver.integrator': ['rk4', 'dop853', 'dop853_adaptive'],
        'solver.tolerance': [1e-8],
        'm': [1.1],
    }
    outputs = {'at': {'at': [0.1001, 0.39104, 0.45], 'of': 'velocities.B'}}
    study = study_of(scene, vary, sampling='grid', duration=0.45, outputs=outputs, period=0.1)
    for k in range(3):
        simulation = Simulation(with_changes(scene, study.samples.values(k)))
        times = sorted({*study.times.tolist(), 0.1001, 0.39104, 0.45})
        seen = {s.t: s.velocities['B'] for s in simulation.run(0.45, at=times)}
        found = run_member(study, k).arrays[0]
        assert [row.tobytes() for row in found] == [
            seen[t].tobytes()
            for t in seen
            if any(abs(t - x) < 1e-9 for x in study.outputs[0].times)
        ]


@pytest.mark.thorough
def test_processes_and_chunks_change_nothing():
    settings: dict[str, Any] = {
        'vary': {'coupler.mass': normal(1.0, 0.05)},
        'members': 7,
        'duration': 0.1,
        'outputs': ['max(norm(knee.force))', 'energy'],
    }
    one = alf_ros.ensemble('slider_crank', workers=0, chunk=7, **settings)
    two = alf_ros.ensemble('slider_crank', workers=2, chunk=2, **settings)
    assert one.drop_attrs().identical(two.drop_attrs())
    assert one['max_norm_knee.force'].attrs == {'units': 'N'}
    assert one['coupler.mass'].dims == ('member',)


def _samples_in_memory(_: Run | None = None) -> float:
    return sum(type(each) is Sample for each in gc.get_objects())


@pytest.mark.thorough
def test_members_together_are_read_sample_by_sample():
    """Half a gigabyte for sixteen slider-cranks, and twice the time: of samples that were kept."""
    vary = {'coupler.mass': uniform(0.9, 1.1)}
    kept = {
        'force': 'max(norm(knee.force))',
        'samples': {'function': _samples_in_memory, 'reads': ['energy']},
    }
    study = study_of(
        'slider_crank', vary, members=4, duration=0.1, period=0.01, outputs=kept, chunk=4
    )
    gc.collect()
    others = _samples_in_memory()  # which an earlier test has left
    found = run_chunk(study, 0).arrays
    assert list(found['reason']) == [''] * 4
    assert (
        found['samples'].max() - others <= 2 * 4
    )  # the last ones, of members whose loads may be open
    alone = [run_member(study, k).arrays[0] for k in range(4)]
    assert [float(force) for force in alone] == found['force'].tolist()


def test_members_that_fail_are_rows_with_a_reason():
    """A negative density is no scene; bars that do not reach each other do not close; a step that
    is far too long fails on the way."""
    study = study_of(
        'four_bar',
        {
            'density': [0.54, -1.0, 0.54, 0.54],
            'd': [0.3, 0.3, 0.9, 0.3],
            'solver.step': [5e-4, 5e-4, 5e-4, 5e-2],
        },
        sampling='table',
        duration=0.5,
        period=0.05,
        outputs=['final(energy)', 'points.A'],
        chunk=4,
    )
    chunk = run_chunk(study, 0)
    reasons = chunk.arrays['reason'].tolist()
    assert reasons[0] == '' and chunk.failed == 3
    assert [
        bool(re.search(said, reason)) for said, reason in zip(SAID, reasons[1:], strict=True)
    ] == [True] * 3, reasons
    assert np.isnan(chunk.arrays['points.A'][1:]).all()
    assert np.isfinite(chunk.arrays['points.A'][0]).all()


def test_a_long_reason_is_cut_between_words():
    """A step of 0.0063 s that is advised must not end as one of 0.006 s."""
    words = 'a step of 0.0063 s ' * 20

    def verbose(run):
        raise ValueError(words)

    settings: dict[str, Any] = {
        'duration': 0.01,
        'period': 0.01,
        'members': 1,
        'outputs': [verbose],
    }
    study = study_of('pendulum', {'solver.step': [1e-3]}, **settings)
    (reason,) = run_chunk(study, 0).arrays['reason'].tolist()
    whole, kept = f'function verbose: ValueError: {words}', reason.removesuffix(' …')
    assert 190 < len(reason) <= 200 and kept != reason
    assert whole.startswith(f'{kept} ')


@pytest.mark.parametrize(
    'workers, error, said',
    combined([0, 1], [(ValueError('too much'), 'too much'), (SystemExit(3), '3')]),
)
def test_a_function_of_the_user_that_raises_is_a_reason(workers, error, said):
    def picky(run):
        if run['energy'][0] > 13.61:
            raise error
        return run['energy'].max()

    found = alf_ros.ensemble(
        'slider_crank',
        {'m': [1.0, 1.1]},
        sampling='table',
        outputs={'picky': {'function': picky, 'reads': ['energy']}},
        duration=0.01,
        workers=workers,
    )
    assert found.reason.values.tolist() == ['', f'function picky: {type(error).__name__}: {said}']
    assert np.isfinite(found.picky.values[0]) and np.isnan(found.picky.values[1])


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        (
            {'vary': {'couple.mass': uniform(1, 2)}},
            "vary: nothing of this name, got 'couple'",
        ),
        (
            {'outputs': ['max(kne.force)']},
            "outputs.max_kne.force: no such quantity, got 'kne.",
        ),
        (
            {'outputs': ['peak(energy)']},
            "outputs: no such output, got 'peak'; did you mean 'mean'?",
        ),
        ({'outputs': ['energy', 'energy']}, "outputs: two outputs of one label, got 'energy'"),
        ({'duration': 0.0}, 'duration: not usable, got 0.0; expected s, more than 0'),
        ({'period': 2.0}, 'period: longer than the duration, got 2.0'),
        ({'period': 1e-300}, 'period: too many samples, got 1e-300'),
        (
            {'vary': {'coupler.mass.0': uniform(1, 2)}},
            "vary.coupler.mass.0: a single value has no parts, got '0'",
        ),
        ({'members': 0}, 'members: '),
        ({'workers': 1, 'scheduler': 'tcp://127.0.0.1:1'}, 'workers: a cluster has its own'),
    ],
)
def test_what_cannot_be_is_said_before_anything_runs(changes, said):
    settings: dict[str, Any] = {'vary': {'m': uniform(1, 2)}, 'members': 4, 'duration': 1.0}
    settings |= changes
    with pytest.raises(InputError) as caught:
        alf_ros.ensemble('slider_crank', **settings)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize('step, said', [(0.1, 'steps of 0.1 s are too long'), (1e-3, '')])
def test_steps_that_are_too_long_are_said(step: float, said: str) -> None:
    found = alf_ros.ensemble(
        'slider_crank',
        {'solver.integrator': ['rk4'] * 2, 'solver.step': [step] * 2},
        sampling='table',
        outputs=['final(energy)'],
        duration=5.0,
        workers=0,
    )
    assert found.attrs['trouble'].startswith(said) and bool(found.attrs['trouble']) == bool(said)


INLINE = """\
scene:
  mechanism: own.yaml
  solver: {step: 1.0e-3}
vary: {L: [0.5, 0.6]}
sampling: grid
duration: 0.1
"""
OWN = """\
alf: 1
space: planar
parameters: {L: 1.0}
points:
  O: {at: [0, 0], fixed: true}
  e: {at: [L, 0]}
bodies:
  pi: {points: [O, e], mass: 2.0, inertia: rod}
joints:
  tau: {type: revolute, between: [ground, pi], at: O}
"""


def test_a_scene_within_a_study_is_that_of_a_scene_file(tmp_path):
    """Its paths begin in the folder of the study, and a point may have the name of a constant."""
    (tmp_path / 'own.yaml').write_text(OWN)
    (tmp_path / 'study.yaml').write_text(INLINE)
    study = load_study(tmp_path / 'study.yaml')
    assert study.scene_of(1).mechanism.points[1].at == (0.6, 0.0)
    indented = ''.join(f'    {line}\n' for line in OWN.splitlines())
    (tmp_path / 'whole.yaml').write_text(INLINE.replace(' own.yaml', f'\n{indented}'.rstrip()))
    assert load_study(tmp_path / 'whole.yaml').scene_of(1).mechanism.points[1].at == (0.6, 0.0)


def test_an_output_has_the_label_function(tmp_path):
    (tmp_path / 'own.yaml').write_text(OWN)
    (tmp_path / 'lift.py').write_text('def lift(run):\n    return 1.0\n')
    labels = 'outputs: {function: final(energy), lift: {function: "lift.py:lift"}}'
    (tmp_path / 'study.yaml').write_text(INLINE.replace('duration: 0.1', labels))
    found = load_study(tmp_path / 'study.yaml').outputs
    assert [(each.label, each.kind) for each in found] == [
        ('function', 'final'),
        ('lift', 'function'),
    ]


@pytest.mark.parametrize(
    'was, becomes, said',
    [
        ('solver: {step', 'solver: {stp', ":3: scene.solver.stp: unknown key, got 'stp'; did you"),
        (INLINE[: INLINE.index('vary')], 'scene: no.yaml\n', ':1: scene: no such file, got '),
        ('{L: [0.5, 0.6]}', 'no.csv', ':4: vary: no such file, got '),
        ('sampling: grid', 'sampling: lhs', ': members: how many?; expected a whole number'),
        ('duration: 0.1', 'outputs: [{at: 11, of: energy}]', ':6: outputs.energy_at: after the'),
        ('duration: 0.1', 'outputs: [{at: 0.1}]', ':6: outputs.of: not the name of a quantity'),
        ('duration: 0.1', 'outputs:\n- energy\n- mx(energy)', ':8: outputs: no such output, got'),
        ('duration: 0.1', "outputs:\n- energy\n- {function: 'no.py:f'}", ':8: function: '),
        ('duration: 0.1', 'outputs:\n- energy\n- max(enrgy)', ':8: outputs.max_enrgy: no such'),
        ('duration: 0.1', 'outputs:\n  a: energy\n  b: {at: 11, of: energy}', ':8: outputs.b: '),
        ('vary: {L:', 'vary:\n  m: [1]\n  L: {unifrm: [1, 2]}\n#', ':6: vary.L: no such dist'),
        ('{L:', '{initial.velocities.e:', ':4: vary.initial.velocities.e: wrong kind of value'),
        ('{L:', '{e.at.2:', ":4: vary.e.at.2: no such place in a list, got '2'; expected 0 to 1"),
    ],
)
def test_what_cannot_be_in_a_file_has_its_place(tmp_path, was, becomes, said):
    (tmp_path / 'own.yaml').write_text(OWN)
    (tmp_path / 'study.yaml').write_text(INLINE.replace(was, becomes))
    with pytest.raises(InputError) as caught:
        load_study(tmp_path / 'study.yaml')
    assert str(caught.value).startswith(f'{tmp_path}/study.yaml{said}')
