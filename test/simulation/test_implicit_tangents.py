"""Tangents of implicit integrators, against exact derivatives. With stiff effects, an explicit
integrator with a small tolerance gives the tangents to compare with."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.studies.exact.exact_tangents import slider_crank
from support.some_scenes import SOME_SCENES
from support.stiff_effects import STIFF, driven_rod, stiff_four_bar

FINE: dict[str, Any] = {'integrator': 'dop853_adaptive', 'tolerance': 1e-11}
IMPLICIT: dict[str, Any] = {'integrator': 'esdirk43_adaptive', 'tolerance': 1e-9}


def errors(seconds: float, **settings: Any) -> tuple[float, dict[str, float]]:
    """Of the positions of a slider-crank and of each tangent, both in parts of the largest."""
    exact = slider_crank(seconds)
    sim = Simulation(load_scene(exact.scene), tangents=exact.names, **settings)
    samples = list(sim.run(exact.times[-1], at=list(exact.times)))
    motion = np.array([each.q for each in samples])
    found = {}
    for name, expected in zip(exact.names, exact.dq, strict=True):
        tangent = np.array([each.tangents[name].q for each in samples])
        found[name] = float(np.abs(tangent - expected).max() / np.abs(expected).max())
    return float(np.abs(motion - exact.q).max() / np.abs(exact.q).max()), found


@pytest.mark.parametrize('tolerance', [1e-5, 1e-7, 1e-9])
def test_exact(tolerance: float) -> None:
    settings = {'step': 0.05, 'integrator': 'esdirk43_adaptive', 'tolerance': tolerance}
    position, tangents = errors(0.25, **settings)
    assert position < tolerance
    for name, error in tangents.items():
        assert error <= 100.0 * position + 1e-11, name


def test_order_of_convergence() -> None:
    """The error falls with the fourth power of the step, like the error of the method."""
    coarse, fine = (errors(0.25, step=h, integrator='esdirk43') for h in (1e-2, 5e-3))
    for name, error in coarse[1].items():
        assert 3.5 < math.log2(error / fine[1][name]) < 6.5, name
        assert error <= 100.0 * coarse[0], name


@pytest.mark.parametrize('kind', STIFF)
def test_stiff_effects(kind: str) -> None:
    scene, names = stiff_four_bar(kind)
    found, expected = (Simulation(scene, tangents=names, **s) for s in (IMPLICIT, FINE))
    for each in (found, expected):
        each.step(100)
    for name in names:
        here, there = (each.sample().tangents[name] for each in (found, expected))
        assert np.abs(here.q - there.q).max() <= 1e-3 * np.abs(there.q).max() + 1e-12, name
        assert np.abs(here.qd - there.qd).max() <= 1e-3 * np.abs(there.qd).max() + 1e-10, name


def test_drives() -> None:
    scene, names = driven_rod()
    found, expected = (Simulation(scene, tangents=names, **s) for s in (IMPLICIT, FINE))
    for each in (found, expected):
        each.step(60)
    for name in names:
        here, there = (each.sample().tangents[name] for each in (found, expected))
        assert np.abs(here.q - there.q).max() <= 1e-6 * np.abs(there.q).max() + 1e-12, name


def test_starts_and_masses_that_change_nothing() -> None:
    """A mass that all bodies have moves nothing, and its tangent is rounding."""
    names = ['initial.velocities.B.0', 'm', 'state.0']
    found, expected = (
        Simulation(load_scene('slider_crank'), tangents=names, **s) for s in (IMPLICIT, FINE)
    )
    for each in (found, expected):
        each.step(300)
    for name in names:
        here, there = (each.sample().tangents[name] for each in (found, expected))
        assert np.abs(here.q - there.q).max() <= 1e-6 * np.abs(there.q).max() + 1e-12, name


def test_lengths_of_a_robot_in_space() -> None:
    """The energy of a sample has tangents as well."""
    scene = load_scene(
        {
            'mechanism': 'delta_robot',
            'solver': {'step': 5e-3},
            'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
        }
    )
    found, expected = (Simulation(scene, tangents=['a'], **s) for s in (IMPLICIT, FINE))
    for each in (found, expected):
        each.step(50)
    here, there = (each.sample().tangents['a'] for each in (found, expected))
    assert np.abs(here.q - there.q).max() <= 1e-7 * np.abs(there.q).max()
    assert here.of('energy') == pytest.approx(there.of('energy'), rel=1e-6)


@pytest.mark.parametrize('integrator', ['esdirk43', 'esdirk43_adaptive'])
def test_the_run_keeps_its_bits(integrator: str) -> None:
    scene, names = stiff_four_bar('spring and damper')
    plain = Simulation(scene, integrator=integrator)
    followed = Simulation(scene, integrator=integrator, tangents=names)
    for each in (plain, followed):
        each.step(30)
    assert plain.state.q.tobytes() == followed.state.q.tobytes()
    assert plain.state.qd.tobytes() == followed.state.qd.tobytes()
    assert plain.evaluations == followed.evaluations


def test_fixed_steps_against_differences_of_themselves() -> None:
    """The change of M̂ in projections is not followed: a small part of the error of the step."""
    scene, _ = stiff_four_bar('spring and damper', step=5e-4)
    name = 'coupler.mass'

    def moved(mass: float) -> Floats:
        sim = Simulation(overrides.with_changes(scene, {name: repr(mass)}), integrator='esdirk43')
        sim.step(400)
        return sim.sample().q

    def tangent(**settings: Any) -> Floats:
        sim = Simulation(scene, tangents=[name], **settings)
        sim.step(400)
        return np.asarray(sim.sample().tangents[name].q)

    mass = overrides.number(scene, name)
    d = 1e-5 * mass
    q = [moved(mass + k * d) for k in (-2, -1, 1, 2)]
    differences = (q[0] - 8.0 * q[1] + 8.0 * q[2] - q[3]) / (12.0 * d)
    found = tangent(integrator='esdirk43')
    own = np.abs(found - tangent(**FINE)).max()
    assert np.abs(found - differences).max() <= 0.05 * own


def test_a_singular_position_is_told() -> None:
    sim = Simulation(load_scene('slider_crank'), integrator='esdirk43_adaptive', tangents=['m'])
    with pytest.raises(StepError, match=r'not determined there; beside a singular position they'):
        sim.step(2000)
    assert 0.3 < sim.t < 0.5
    assert np.isfinite(sim.sample().tangents['m'].q).all()


def numbers_of(scene: Scene) -> list[str]:
    """Three numbers of a scene that it gives as such."""
    found = []
    for name in (*(f'{b.name}.mass' for b in scene.mechanism.bodies), 'gravity.acceleration.1'):
        try:
            if np.isfinite(overrides.number(scene, name)):
                found.append(name)
        except InputError:
            continue
    return found[:3]


@pytest.mark.parametrize('name', SOME_SCENES)
def test_every_scene(name: str) -> None:
    """All rows of the library. A mass that changes nothing has a tangent of rounding."""
    scene = load_scene(name)
    names = numbers_of(scene)
    found, expected = (Simulation(scene, tangents=names, **s) for s in (IMPLICIT, FINE))
    for each in (found, expected):
        each.step(20)
    for number in names:
        here, there = (each.sample().tangents[number] for each in (found, expected))
        assert np.abs(here.q - there.q).max() <= 1e-6 * np.abs(there.q).max() + 1e-12, number
        assert np.abs(here.qd - there.qd).max() <= 1e-6 * np.abs(there.qd).max() + 1e-10, number
