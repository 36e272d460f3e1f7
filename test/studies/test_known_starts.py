"""`identify` where the start of a recording is known, or drives leave no part of it free."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import InputError, Recording, identify, load_scene, recorded
from alf_ros.arrays import Floats
from support.design_scenes import four_bar
from support.recordings import SLIDER_CRANK, Machine, changed
from support.thorough import thinned

TRUE = {'coupler.mass': 1.3, 'pin.viscous': 0.4}
NOISE = 1e-3
# from rest
FALLING: dict[str, Any] = {
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_friction': {'pin': {'joint': 'crank_pin', 'viscous': 0.3}},
        'torsion_spring': {'joint': 'crank_pin', 'stiffness': 30.0, 'free_position': 0.5},
    },
    'solver': {'step': 2e-3, 'integrator': 'rk4'},
}


def slopes(joints: tuple[str, ...]) -> Floats:
    """(measurements, 2) of a run from the start of the scene, by central differences of runs."""
    found = []
    for name, value in TRUE.items():
        ends = [
            Machine(changed(load_scene(FALLING), {**TRUE, name: value + d}), joints, 0.6).x
            for d in (1e-4, -1e-4)
        ]
        found.append((ends[0] - ends[1]).ravel() / 2e-4)
    return np.array(found).T


@pytest.mark.parametrize('joints', [('crank_pin', 'guide'), ('guide',)])
def test_a_start_as_in_the_scene_leaves_only_the_numbers(joints: tuple[str, ...]) -> None:
    """Deviations of the linear regression on whole runs; the estimates are as near."""
    machine = Machine(changed(load_scene(FALLING), TRUE), joints, 0.6)
    found = identify(
        FALLING,
        machine.recording(NOISE),
        list(TRUE),
        window=0.6,
        begins='scene',
        noise=dict.fromkeys(joints, NOISE),
    )
    J = slopes(joints)
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert np.allclose(found.deviations, expected, rtol=2e-2)
    assert (np.abs(found.values - list(TRUE.values())) < 4.0 * expected).all()
    assert found.settled and all(start.size == 0 for start in found.starts)


def test_less_that_is_free_tells_more(tmp_path: Path) -> None:
    """At rest only the angle of the crank is free, of the first window alone."""
    machine = Machine(changed(load_scene(FALLING), TRUE), ('crank_pin', 'guide'), 0.6)
    free, deviations = [], []
    for begins in ('anywhere', 'at_rest', 'scene'):
        found = identify(FALLING, machine.recording(NOISE), list(TRUE), window=0.3, begins=begins)
        free.append([start.size for start in found.starts])
        deviations.append(found.deviations)
        assert (np.abs(found.values - list(TRUE.values())) < 4.0 * found.deviations).all()
    assert free == [[2, 2], [1, 2], [0, 2]]
    report = found.save(tmp_path / 'report') / 'report.html'
    assert 'as the scene does, as was said' in report.read_text('utf-8')
    assert (deviations[1] < deviations[0]).all() and (deviations[2] < deviations[1]).all()


def test_the_start_of_the_scene_moves_with_a_length() -> None:
    """Without noise the length is exact: derivatives of the start count."""
    scene = load_scene(four_bar({'c': 0.25}, driven=False, step=1e-3))
    machine = Machine(changed(scene, {'c': 0.26}), ('rocker_pin',), 0.2)
    found = identify(scene, machine.recording(), ['c'], window=0.1, begins='scene')
    assert found['c'] == pytest.approx(0.26, abs=1e-8)


def test_windows_far_from_the_start_of_the_scene() -> None:
    """The joints turn on between the start and the second window."""
    machine = Machine(load_scene(SLIDER_CRANK), ('crank_pin', 'knee', 'guide'), 2.0)
    found = identify(
        SLIDER_CRANK, machine.recording(NOISE), ['pin.viscous'], window=1.0, begins='scene'
    )
    assert abs(found['pin.viscous'] - 0.3) < 4.0 * found.deviations[0] < 0.03


def test_a_recording_that_begins_later() -> None:
    """The scene runs to its first measurement."""
    machine = Machine(changed(load_scene(FALLING), TRUE), ('crank_pin',), 0.6)
    whole = machine.recording(NOISE)
    later = recorded(machine.t[20:], {'crank_pin': whole.channels[0].values[20:]})
    found = identify(FALLING, later, list(TRUE), window=0.4, begins='scene')
    assert (np.abs(found.values - list(TRUE.values())) < 4.0 * found.deviations).all()
    assert found.windows[0].first == 0


@pytest.mark.parametrize('begins', thinned(['at_rest', 'scene'], keep=['scene']))
def test_where_joints_do_not_tell_the_posture(begins: str) -> None:
    """The elbow alone: windows begin one after another."""
    scene: dict[str, Any] = {
        'mechanism': 'double_pendulum',
        'effects': {
            'gravity': {'acceleration': [0, -9.81]},
            'joint_friction': {'pin': {'joint': 'elbow', 'viscous': 0.3}},
        },
        'solver': {'step': 2e-3, 'integrator': 'rk4'},
    }
    machine = Machine(changed(load_scene(scene), {'pin.viscous': 0.4}), ('elbow',), 1.2)
    found = identify(scene, machine.recording(NOISE), ['pin.viscous'], window=0.4, begins=begins)
    assert abs(found['pin.viscous'] - 0.4) < 4.0 * found.deviations[0] < 0.04
    assert found.starts[0].size == {'at_rest': 2, 'scene': 0}[begins]


def test_an_unknown_start_is_refused() -> None:
    recording: Recording = recorded([0.0, 0.1, 0.2, 0.3], {'guide': [1.0, 1.0, 1.0, 1.0]})
    with pytest.raises(InputError, match=r"begins: no such start, got 'rest'; did you mean"):
        identify(FALLING, recording, ['coupler.mass'], begins='rest')


# -------------------------------------------------------------------------------------- all driven


def test_lengths_of_a_machine_whose_motion_is_prescribed() -> None:
    """No window has a free start; deviations of the linear regression, by differences."""
    joints = ('knee', 'rocker_pin')

    def machine(c: float, a: float) -> Machine:
        return Machine(load_scene(four_bar({'c': c, 'a': a}, step=1e-2)), joints, 1.0)

    found = identify(
        four_bar(step=1e-2),
        machine(0.253, 0.101).recording(NOISE),
        ['c', 'a'],
        window=0.25,
        noise=dict.fromkeys(joints, NOISE),
    )
    true, steps = np.array([0.253, 0.101]), 1e-6 * np.eye(2)
    sides = [machine(*(true + step)).x - machine(*(true - step)).x for step in steps]
    J = np.array([side.ravel() / 2e-6 for side in sides]).T
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert np.allclose(found.deviations, expected, rtol=2e-2)
    assert (np.abs(found.values - true) < 4.0 * expected).all()
    assert found.settled and all(start.size == 0 for start in found.starts)


def test_a_mass_of_it_is_not_seen_at_all() -> None:
    """Nothing depends on it; no deviation is made of rounding."""
    scene = four_bar(step=1e-2)
    recording = Machine(load_scene(scene), ('knee',), 0.5).recording(NOISE)
    found = identify(scene, recording, ['coupler.mass'], window=0.25)
    assert np.isinf(found.deviations).all()
    assert 'not determined at all: 1.00 coupler.mass' in str(found)
