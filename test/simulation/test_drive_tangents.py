"""Derivatives by the numbers of drives: against the exact motion of a driven slider-crank, and
against differences of runs; and by the adjoint, against these tangents."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from support.dot_products import dot_products

ADAPTIVE: dict[str, Any] = {'step': 5e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-9}
DEAD = 0.15  # s, at which the piston is at its dead centre

# bars of 1 m; the piston moves as 2 cos of the angle of the crank, through its dead centre
PISTON = """
mechanism:
  alf: 1
  space: planar
  parameters: {w: 2.0, late: 0.15, reach: 2.0, m: 1.0}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [-0.9553364891256060, 0.2955202066613396]}
    B: {at: [-1.910672978251212, 0]}
  bodies:
    crank: {points: [O, A], mass: m, inertia: rod}
    coupler: {points: [A, B], mass: 1, inertia: rod}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    knee: {type: revolute, between: [crank, coupler], at: A}
    guide: {type: slider, point: B, on: {through: [0, 0], direction: [1, 0]}}
  drives:
    piston: {point: B, at: ['-reach*cos(w*(t - late))', null]}
effects: {gravity: {acceleration: [0, -9.81]}}
solver: {step: 1.0e-3}
"""

# two of the bars swing freely behind a driven point; forces act between it and them
CHAIN = """
mechanism:
  alf: 1
  space: planar
  parameters: {w: 3.0, k: 0.3, one: 1.0}
  points:
    P: {at: [0, 0]}
    Q: {at: [one, 0]}
    R: {at: [2, 0.2]}
    S: {at: [2.7, 0.9]}
  bodies:
    near: {points: [P, Q], mass: 2, inertia: rod}
    mid: {points: [Q, R], mass: 1, inertia: rod}
    far: {points: [R, S], mass: 1, inertia: rod}
  joints:
    q: {type: revolute, between: [near, mid], at: Q}
    r: {type: revolute, between: [mid, far], at: R}
  drives:
    base: {point: P, at: [DRIVE, '0.1*k*sin(w*t)']}
effects:
  gravity: {acceleration: [0, -9.81]}
  spring: {between: [P, S], stiffness: 20, free_length: 0.5}
  damper: {between: [P, S], damping: 1.5}
solver: {step: 1.0e-3}
"""
TABLE = 'crank: {joint: p, angle: {table: [[0, 0], [0.1, k], [0.2, 0.2], [w/10, k/2]]}}'
SWINGS = {
    'sine': "'k*sin(w*t)'",
    'others': "'k*atan2(sin(w*t), 1.5) + sqrt(1 + k*t) + (1 + t)**k + exp(-k*t) - 3'",
    'of equal numbers': "'k*sin(1.0*t)*1.0'",  # `one` and these are equal, and none is shared
    'asin': "'asin(k*sin(w*t)) + hypot(k*t, 1) - 1'",
}


def scene(tmp_path: Path, text: str) -> Scene:
    path = tmp_path / 'driven.yaml'
    path.write_text(text, 'utf-8')
    return load_scene(path)


@pytest.mark.parametrize('settings', [{}, {'step': 1e-2 / 7.0}, ADAPTIVE], ids=str)
def test_exact_through_a_dead_centre(settings: dict[str, Any], tmp_path: Path) -> None:
    driven, names = scene(tmp_path, PISTON), ['w', 'late', 'm']
    sim = Simulation(driven, tangents=names, **settings)
    sim.step(round(0.3 / sim.h))
    sample = sim.sample()
    w, late = 2.0, DEAD
    angle = w * (sample.t - late)
    A, turned = -np.array([math.cos(angle), math.sin(angle)]), np.array([math.sin(angle)] * 2)
    turned[1] = -math.cos(angle)
    assert sample.points['A'][:2] == pytest.approx(A, abs=1e-12)
    by = sample.tangents
    assert by['w'].points['A'][:2] == pytest.approx(turned * (sample.t - late), abs=1e-11)
    assert by['late'].points['A'][:2] == pytest.approx(-w * turned, abs=1e-11)
    assert by['late'].velocities['A'][:2] == pytest.approx(w * w * A, abs=1e-10)
    assert by['m'].points['A'] == pytest.approx(np.zeros(2), abs=1e-12)


def test_a_reach_that_the_loop_does_not_have_is_refused(tmp_path: Path) -> None:
    sim = Simulation(scene(tmp_path, PISTON), tangents=['reach', 'late'])
    sim.step(300)
    tangents, told = (
        sim.sample().tangents,
        r'it unfolds the singular position passed at t = 0\.15 s',
    )
    with pytest.raises(InputError, match=told):
        _ = tangents['reach'].q
    assert np.isfinite(tangents['late'].q).all()


@pytest.mark.parametrize('swing', SWINGS)
def test_against_differences(swing: str, tmp_path: Path) -> None:
    driven = scene(tmp_path, CHAIN.replace('DRIVE', SWINGS[swing]))
    names = ['w', 'k', 'damper.damping']
    settings: dict[str, Any] = {'step': 5e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-11}
    sim = Simulation(driven, tangents=names, **settings)
    sim.step(50)
    sample = sim.sample()
    for name in names:
        value = overrides.number(driven, name)

        def run(change: float, name: str = name, value: float = value) -> Any:
            other = overrides.with_changes(driven, {name: repr(value + change)})
            return Simulation(other, **settings)

        size, weights, found = 3e-3 * value, (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0), []
        for k, weight in enumerate(weights, 1):
            for sign in (1.0, -1.0):
                one = run(sign * k * size)
                one.step(50)
                end = one.sample()
                values = (end.q, end.qd, [end.energy], end.reactions['q'].force)
                found.append(sign * weight / size * np.concatenate([*map(np.ravel, values)]))
        expected, by = np.sum(found, axis=0), sample.tangents[name]
        own: list[Any] = [by.q, by.qd, [by.of('energy')], by.of('reactions.q.force')]
        got = np.concatenate([*map(np.ravel, own)])
        assert np.abs(expected).max() > 1e-2
        np.testing.assert_allclose(got, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize('settings', [{}, ADAPTIVE], ids=['fixed', 'adaptive'])
@pytest.mark.parametrize('swing', SWINGS)
def test_the_adjoint_equals_the_tangents(
    swing: str, settings: dict[str, Any], tmp_path: Path
) -> None:
    driven = scene(tmp_path, CHAIN.replace('DRIVE', SWINGS[swing]))
    expected, found, size = dot_products(driven, ['w', 'k', 'spring.stiffness'], 60, **settings)
    assert (np.abs(found - expected) <= 1e-13 * size).all()


@pytest.mark.parametrize('settings', [{}, ADAPTIVE], ids=['fixed', 'adaptive'])
def test_the_adjoint_equals_the_tangents_through_a_dead_centre(
    settings: dict[str, Any], tmp_path: Path
) -> None:
    driven = scene(tmp_path, PISTON)
    steps = round(0.3 / settings.get('step', 1e-3))
    expected, found, size = dot_products(driven, ['w', 'late', 'm'], steps, **settings)
    assert (np.abs(found - expected) <= 1e-9 * size.max()).all()


def test_tables(tmp_path: Path) -> None:
    """Places of a table have tangents; its ends, where the acceleration jumps, must not move."""
    text = CHAIN.replace("base: {point: P, at: [DRIVE, '0.1*k*sin(w*t)']}", TABLE)
    text = text.replace('P: {at: [0, 0]}', 'P: {at: [0, 0], fixed: true}').replace(
        'joints:', 'joints:\n    p: {type: revolute, between: [ground, near], at: P}'
    )
    driven = scene(tmp_path, text)
    sim = Simulation(driven, tangents=['k'], **ADAPTIVE)
    sim.step(40)
    found = sim.sample().tangents['k'].points['S']

    def place(k: float) -> Floats:
        one = Simulation(overrides.with_changes(driven, {'k': repr(k)}), **ADAPTIVE)
        one.step(40)
        return one.sample().points['S']

    d = 1e-3
    expected = (place(0.3 + d) - place(0.3 - d)) / (2.0 * d)
    assert found == pytest.approx(expected, rel=1e-4)
    with pytest.raises(InputError, match='jumps at t = 0.3 s, which moves with it'):
        Simulation(driven, tangents=['w'])


@pytest.mark.parametrize('kink', ['abs(k - t)', 'min(k, t)', 'max(2*k*t, t*t)'])
def test_a_kink_that_moves_is_refused(kink: str, tmp_path: Path) -> None:
    driven = scene(tmp_path, CHAIN.replace('DRIVE', f"'0.01*{kink}'"))
    with pytest.raises(InputError, match='abs, min or max in the motion of a drive depends on it'):
        Simulation(driven, tangents=['k'])
    Simulation(driven, tangents=['one'])
