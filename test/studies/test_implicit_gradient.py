"""Gradients of runs with implicit integrators: against tangents of the same run, which they equal
to rounding, and against differences of runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, StepError, gradient, load_scene
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.studies.gradients.legs import RunInstant
from alf_ros.studies.gradients.observed_number import observed_number
from alf_ros.studies.gradients.taped_run import TapedRun
from support.dot_products import dot_products
from support.some_scenes import SOME_SCENES
from support.stiff_effects import STIFF, driven_rod, stiff_four_bar
from support.tangent_robot import NUMBERS, ROBOT
from support.thorough import LONG, combined, thinned

FIXED: dict[str, Any] = {'integrator': 'esdirk43'}
ADAPTIVE: dict[str, Any] = {'integrator': 'esdirk43_adaptive', 'tolerance': 1e-7}
CASES = [pytest.param(FIXED, id='fixed'), pytest.param(ADAPTIVE, id='adaptive')]
BOTH = pytest.mark.parametrize('settings', CASES)
# Two tests have the dearest scenes: each keeps one of both.
ONE = pytest.mark.parametrize('settings', thinned(CASES, keep=lambda case: case is FIXED))
OTHER = pytest.mark.parametrize('settings', thinned(CASES, keep=lambda case: case is ADAPTIVE))


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = Path(tmp_path_factory.mktemp('robot')) / 'robot.yaml'
    path.write_text(ROBOT, 'utf-8')
    return load_scene(path)


@pytest.mark.parametrize(('kind', 'settings'), combined(STIFF, CASES))
def test_equals_the_tangents_with_stiff_effects(kind: str, settings: dict[str, Any]) -> None:
    scene, names = stiff_four_bar(kind)
    expected, found, size = dot_products(scene, names, 100, **settings)
    assert (size > 0.0).all()
    assert (np.abs(found - expected) <= 1e-11 * size).all()


@OTHER
def test_equals_the_tangents_for_all_kinds_of_numbers(
    robot: Scene, settings: dict[str, Any]
) -> None:
    """Lengths, places, masses, starts, and the numbers of an effect of every kind."""
    expected, found, size = dot_products(robot, NUMBERS, 50 if LONG else 20, **settings)
    for name, one, other, scale in zip(NUMBERS, found, expected, size, strict=True):
        assert abs(one - other) <= 1e-12 * scale, name


@ONE
def test_equals_the_tangents_of_a_robot_in_space(settings: dict[str, Any]) -> None:
    scene = load_scene(
        {
            'mechanism': 'delta_robot',
            'solver': {'step': 5e-3},
            'effects': {
                'gravity': {'acceleration': [0, 0, -9.81]},
                'torsion_spring': {'hold': {'joint': 'motor0', 'stiffness': 1e4, 'damping': 50}},
            },
        }
    )
    names = ['a', 'arm', 'platform', 'hold.stiffness', 'gravity.acceleration.2']
    expected, found, size = dot_products(scene, names, 20 if LONG else 8, **settings)
    assert (np.abs(found - expected) <= 1e-11 * size).all()


@BOTH
def test_equals_the_tangents_with_a_drive(settings: dict[str, Any]) -> None:
    scene, names = driven_rod()
    expected, found, size = dot_products(scene, names, 60, **settings)
    assert (np.abs(found - expected) <= 1e-11 * size).all()


@pytest.mark.parametrize('name', SOME_SCENES)
def test_equals_the_tangents_in_every_scene(name: str) -> None:
    """All rows and spaces of the library. Where all motion is driven, nothing changes."""
    scene = load_scene(name)
    names = [f'{body.name}.mass' for body in scene.mechanism.bodies]
    names = [each for each in (*names, 'gravity.acceleration.1') if is_number(scene, each)][:3]
    expected, found, size = dot_products(scene, names, 20, **ADAPTIVE)
    assert (np.abs(found - expected) <= 1e-11 * size.max(initial=0.0) + 1e-14).all()


def is_number(scene: Scene, name: str) -> bool:
    try:
        return np.isfinite(overrides.number(scene, name))
    except InputError:
        return False


@pytest.mark.parametrize(
    ('of', 'name'),
    thinned(
        [
            ('final(points.B.x)', 'coupler.mass'),
            ('max(velocities.B.x)', 'loss.damping'),
            ('mean(crank_pin.position)', 'hold.stiffness'),
        ],
        keep=lambda of, name: name == 'loss.damping',
    ),
)
def test_against_differences_of_runs(of: str, name: str) -> None:
    """Of fourth order, with the error of the motion: lengths of adaptive steps change from run to
    run."""
    scene, _ = stiff_four_bar('spring and damper')
    settings: dict[str, Any] = {'integrator': 'esdirk43_adaptive', 'tolerance': 1e-10}

    def value(change: float) -> float:
        text = repr(overrides.number(scene, name) + change)
        run = Simulation(overrides.with_changes(scene, {name: text}), **settings)
        return gradient(run, of, ['gravity.acceleration.1'], duration=0.1).value

    found = gradient(Simulation(scene, **settings), of, [name], duration=0.1)
    size = 1e-3 * overrides.number(scene, name)
    slopes = [
        weight / size * (value(k * size) - value(-k * size))
        for k, weight in enumerate((2.0 / 3.0, -1.0 / 12.0), 1)
    ]
    assert found.by[name] == pytest.approx(sum(slopes), rel=1e-4)


def test_inputs_that_are_held() -> None:
    """From a state on the way, with a wrench held."""
    scene, _ = stiff_four_bar('spring and damper')
    names = ['coupler.mass', 'hold.stiffness', 'loss.damping']
    on_the_way = Simulation(scene, **FIXED)
    on_the_way.step(10)
    followed, plain = Simulation(scene, tangents=names, **FIXED), Simulation(scene, **FIXED)
    begun = followed.state.tangents  # the numbers do not move the start
    for each in (followed, plain):
        each.apply_wrench('coupler', force=[10.0, 20.0], torque=3.0)
    found = gradient(plain, 'final(points.B.x)', names, duration=0.2)
    followed.step(40)
    sample = followed.sample()
    for name, slope in found.by.items():
        assert slope == pytest.approx(sample.tangents[name].points['B'][0], rel=1e-10), name
    on_the_way.apply_wrench('coupler', force=[10.0, 20.0], torque=3.0)
    state = replace(on_the_way.state, tangents=begun)
    later = gradient(on_the_way, 'final(points.B.x)', names, duration=0.2)
    followed.restore(state)
    followed.step(40)
    sample = followed.sample()
    for name, slope in later.by.items():
        assert slope == pytest.approx(sample.tangents[name].points['B'][0], rel=1e-10), name


@BOTH
def test_the_steps_keep_their_bits(settings: dict[str, Any]) -> None:
    """Where no kink is crossed."""
    scene, names = stiff_four_bar('spring and damper')
    written, plain = Simulation(scene, **settings), Simulation(scene, **settings)
    list(TapedRun(written, names).go_on(30))
    plain.step(30)
    assert written.state.q.tobytes() == plain.state.q.tobytes()
    assert written.state.qd.tobytes() == plain.state.qd.tobytes()


def test_in_legs() -> None:
    """A run in many legs, of which one at a time is in memory, has the same derivatives."""
    scene, names = stiff_four_bar('spring and damper')
    weights = {RunInstant(60): 1.0, RunInstant(31): 0.5, RunInstant(0, begins=True): 2.0}
    found = []
    for memory, count in ((1e9, 1), (1.0, 60)):
        run = TapedRun(Simulation(scene, **FIXED), names, memory)
        assert len(list(run.go_on(60))) == count
        number = observed_number('points.B.x', 'of', run._simulation.sample(), run.displaced)
        found.append(run.derivatives(number, weights))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-11)


def test_records_and_traces_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Too little memory is noticed, and the leg repeated."""
    scene, names = stiff_four_bar('spring and damper')
    simulation, of = Simulation(scene, **ADAPTIVE), 'final(points.B.x)'
    expected = gradient(simulation, of, names, duration=0.2)
    monkeypatch.setattr('alf_ros.simulation.adjoint_following.OPERATIONS', 1)
    monkeypatch.setattr('alf_ros.studies.gradients.taped_run._INNER', 1)
    assert gradient(simulation, of, names, duration=0.2) == expected


@BOTH
def test_a_singular_position_is_told(settings: dict[str, Any]) -> None:
    """The gradient is refused near it, as tangents are, and found before it."""
    simulation, names = Simulation(load_scene('slider_crank'), **settings), ['coupler.mass']
    of = 'final(points.B.x)'
    followed = Simulation(load_scene('slider_crank'), tangents=names, **settings)
    with pytest.raises(StepError, match='beside a singular position they') as told:
        followed.step(2000)
    end = followed.t
    assert 0.3 < end < 0.5
    found = gradient(simulation, of, names, duration=end - 1e-9).by[names[0]]
    tangent = followed.sample().tangents[names[0]].points['B'][0]
    assert found == pytest.approx(tangent, rel=1e-9)
    with pytest.raises(StepError) as caught:
        gradient(simulation, of, names, duration=end + 2.0 * simulation.h)
    assert str(caught.value).partition(': ')[2] == str(told.value).partition(': ')[2]
    assert end <= caught.value.t < end + 2.0 * simulation.h
