"""Inputs from outside that act during a recording, as numbers that `identify` finds."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, identify, load_scene
from alf_ros.__main__ import main as program
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.studies.identification.recording import HeldInput
from support.log_files import make
from support.recordings import SLIDER_CRANK, Machine, pushes, scene
from support.thorough import LONG

EFFORT, FORCE, TORQUE = 'joints.crank_pin.effort', 'wrenches.B.force.x', 'wrenches.coupler.torque'
TRUE = {EFFORT: 1.5, FORCE: -0.7}


class Pushed(Machine):
    """The machine while something that is not recorded pushes it."""

    def __init__(self, of: Scene, values: dict[str, float], inputs: list[HeldInput]) -> None:
        more = {name: repr(value) for name, value in values.items()}
        super().__init__(
            overrides.with_changes(of, more), ('crank_pin', 'guide'), 3.0, inputs=inputs
        )


@cache
def machine() -> Pushed:
    return Pushed(scene(), TRUE, pushes('crank_pin', 2.0, 3.0))


def test_efforts_and_forces_are_found() -> None:
    """Within three deviations of the truth, and without noise exactly, beside recorded efforts."""
    exact = identify(scene(), machine().recording(), list(TRUE), window=1.0)
    np.testing.assert_allclose(exact.values, list(TRUE.values()), rtol=1e-6)
    found = identify(scene(), machine().recording(1e-3, seed=4), list(TRUE), window=1.0)
    off = (found.values - list(TRUE.values())) / found.deviations
    assert found.settled and (np.abs(off) < 3.0).all()
    assert (found.intervals[:, 0] < found.values).all()
    assert (found.intervals[:, 1] > found.values).all()
    assert 0.05 < abs(found.correlations[0, 1]) < 0.99
    assert f'{EFFORT}  ' in str(found)


@pytest.mark.thorough
def test_deviations_are_those_of_refits() -> None:
    """The scatter of estimates from other noise has the size that each fit tells."""
    each = [
        identify(scene(), machine().recording(1e-3, seed=seed), list(TRUE), window=1.0)
        for seed in range(20 if LONG else 8)
    ]
    off = np.array([(f.values - list(TRUE.values())) / f.deviations for f in each])
    assert (np.abs(off.mean(axis=0)) < 4.0 / np.sqrt(len(each))).all()
    assert ((off.std(axis=0) > 0.5) & (off.std(axis=0) < 1.6)).all()


def test_the_scene_holds_the_new_numbers(tmp_path: Path) -> None:
    found = identify(scene(), machine().recording(1e-3, seed=4), list(TRUE), window=1.0)
    found.save(tmp_path)
    again = load_scene(tmp_path / 'machine.yaml')
    for name in TRUE:
        assert overrides.number(again, name) == found[name]
    assert [e.name for e in again.effects][-2:] == ['crank_pin_effort', 'B_force']


def test_beside_a_recorded_wrench_that_turns_with_its_body() -> None:
    held = [HeldInput(0.0, 'wrench', 'coupler', {'force': (2.0, -1.0), 'frame': 'body'})]
    turned = {'wrenches.coupler.force.y': 0.8}
    recording = Pushed(scene(), turned, held).recording(1e-3, seed=1)
    found = identify(scene(), recording, list(turned), window=1.0)
    assert abs(found.values[0] - 0.8) < 3.0 * found.deviations[0]


def test_a_torque_alone_begins_at_zero() -> None:
    """A torque of 0 without a force has a derivative: the effect of its own in the world."""
    found = identify(
        scene(), Pushed(scene(), {TORQUE: 0.3}, []).recording(1e-3), [TORQUE], window=1.0
    )
    assert abs(found.values[0] - 0.3) < 3.0 * found.deviations[0]


@pytest.mark.thorough
def test_an_effort_over_time_is_a_table_of_a_motor() -> None:
    """Whose values are numbers of the scene."""

    def of(values: list[float]) -> Scene:
        table = [[float(k), value] for k, value in enumerate(values)]
        motor = {'push': {'joint': 'crank_pin', 'effort': table}}
        return load_scene({**SLIDER_CRANK, 'effects': {**SLIDER_CRANK['effects'], 'motor': motor}})

    true, names = [0.5, 1.0, -0.8, 0.3], [f'push.effort.{k}.1' for k in range(4)]
    moved = Pushed(of(true), {}, [])
    exact = identify(of([0.0] * 4), moved.recording(), names, window=1.0)
    np.testing.assert_allclose(exact.values, true, rtol=1e-5)
    found = identify(of([0.0] * 4), moved.recording(1e-3, seed=1), names, window=1.0)
    assert (np.abs(found.values - true) < 3.0 * found.deviations).all()


def test_what_no_recording_tells_apart_is_named() -> None:
    """Both rods turn by the same angle, one to each side: their torques act alike."""
    found = identify(scene(), machine().recording(1e-3), [EFFORT, TORQUE, FORCE], window=1.0)
    assert np.isinf(found.deviations[:2]).all() and np.isfinite(found.deviations[2])
    assert 'not determined at all' in str(found)


def test_a_target_that_was_not_recorded() -> None:
    name = 'targets.crank_pin.position'
    servo = {'joint': 'crank_pin', 'position': 0.5, 'position_gain': 15, 'velocity_gain': 2}
    effects = {'gravity': {'acceleration': [0, -9.81]}, 'motor': {'servo': servo}}
    of = load_scene({**SLIDER_CRANK, 'effects': effects, 'initial': {}})
    moved = Pushed(of, {name: 0.9}, [])
    found = identify(of, moved.recording(1e-3), [name, 'servo.position_gain'], window=1.0)
    assert found.names == (name, 'servo.position_gain')
    assert (np.abs(found.values - [0.9, 15.0]) < 3.0 * found.deviations).all()
    assert found.fitted_scene.effects[1].parameters.position == found[name]
    # recorded targets act in place of the number, which nothing tells then
    told = [HeldInput(0.0, 'target', 'crank_pin', {'position': 0.9})]
    known = identify(of, Pushed(of, {}, told).recording(1e-3), [name], window=1.0)
    assert np.isinf(known.deviations[0])


def test_the_program_writes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From a log of a machine with an effort that the scene does not have."""
    (tmp_path / 'scene.yaml').write_text(scene().text, 'utf-8')
    pushed = overrides.with_changes(scene(), {EFFORT: '1.5'})
    (tmp_path / 'pushed.yaml').write_text(pushed.text, 'utf-8')
    log, _ = make(tmp_path / 'log', tmp_path / 'pushed.yaml', ticks=100)
    out = tmp_path / 'out'
    given = ['identify', str(tmp_path / 'scene.yaml'), str(log), '--fit', EFFORT, '-o', str(out)]
    assert program([*given, '--design', 'initial.velocities.B.0=-5']) == 0
    assert EFFORT in capsys.readouterr().out
    assert overrides.number(load_scene(out / 'machine.yaml'), EFFORT) == pytest.approx(1.5)
    assert program([*given, '--design', f'{EFFORT}=2']) == 2
    assert '--design: is fitted' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('fit', 'told'),
    [
        (['joints.crank_pn.effort'], "'crank_pn'; did you mean 'crank_pin'?"),
        (['wrenches.Q.force.x'], "fit.wrenches.Q.force.x: unknown name, got 'Q'"),
        ([f'{EFFORT}[10:20]'], f'acts in some of the steps.*expected {EFFORT}.*a motor with'),
        ([f'{FORCE}[10:]'], f'acts in some of the steps.*expected {FORCE}, .* recording$'),
        (['targets.crank_pin.position'], 'fit: no target: no motor or tendon of the scene'),
        ([EFFORT, 'crank_pin_effort.effort'], f'given twice, also by {EFFORT}'),
    ],
)
def test_what_is_refused(fit: Any, told: str) -> None:
    with pytest.raises(InputError, match=told) as error:
        identify(scene(), machine().recording(), fit)
    assert '\n' not in str(error.value)


def test_a_torque_of_zero_alone_has_a_tangent() -> None:
    effects = {'constant_wrench': {'twist': {'on': 'coupler', 'torque': 0}}}
    of = load_scene({'mechanism': 'slider_crank', 'effects': effects})
    simulation = Simulation(of, tangents=['twist.torque', TORQUE])
    simulation.step(300)
    tangents = simulation.sample().tangents
    found, wanted = (tangents[name].q for name in ('twist.torque', TORQUE))
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
