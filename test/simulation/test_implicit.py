"""`esdirk43`: stiff scenes at steps that no explicit method takes, and singular positions too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError, Scene, Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import scene_from_text
from support.bit_for_bit import same
from support.effect_scenes import MASS, ROTOR, SKATE
from support.paths import DATA

G = 9.81


def run(scene: Scene, duration: float, **method: Any) -> Simulation:
    sim = Simulation(scene, **method)
    sim.step(round(duration / sim.h))
    return sim


def small(mechanism: str, effects: str, **method: Any) -> Simulation:
    return Simulation(scene_from_text(f'{mechanism}\neffects: {{{effects}}}\n'), **method)


def with_effects(name: str, effects: str) -> Scene:
    """A scene of the library with more effects."""
    return scene_from_text(load_scene(name).text.replace('effects:', f'effects:\n  {effects}', 1))


# -------------------------------------------------------------------------------------- the method


def test_the_tableau_is_of_order_4_and_3_and_l_stable() -> None:
    a, b, c, order, embedded, *_ = TABLEAUX['esdirk43_adaptive']
    assert order == 4 and np.array_equal(b, a[-1]) and a[0, 0] == 0.0
    assert a @ c == pytest.approx(c**2 / 2, abs=1e-15)  # every stage is of order 2
    conditions = [(np.ones(6), 1), (c, 1 / 2), (c**2, 1 / 3), (a @ c, 1 / 6)]
    fourth = [(c**3, 1 / 4), (c * (a @ c), 1 / 8), (a @ c**2, 1 / 12), (a @ a @ c, 1 / 24)]
    for weights, of in ((b, conditions + fourth), (b - embedded[0], conditions)):
        for vector, wanted in of:
            assert weights @ vector == pytest.approx(wanted, abs=1e-15)

    def growth(z: complex) -> float:
        return float(abs(1.0 + z * b @ np.linalg.solve(np.eye(6) - z * a, np.ones(6))))

    assert growth(-1e9) < 1e-8
    assert max(growth(1j * 10.0**k) for k in np.linspace(-3, 6, 100)) <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ('name', 'data'),
    [('slider_crank', 'slider_crank_6_2'), ('double_four_bar', 'n_fourbar_N2')],
)
def test_order_through_singular_positions_at_odd_steps(name: str, data: str) -> None:
    path = DATA / f'{data}.json'
    wanted = json.loads(path.read_text())['samples']
    times = np.linspace(0.0, 10.0, len(wanted)).tolist()

    def worst(**method: Any) -> float:
        found = 0.0
        samples = Simulation(load_scene(name), **method).run(10.0, at=times)
        for sample, exact in zip(samples, wanted, strict=True):
            points = sample.points
            error = points['A'] - exact['q'][:2] if 'q' in exact else points['B0'] - exact['B0']
            found = max(found, np.abs(error).max())
        return found

    for k in (1.0, 1.3, 1.7, 2.9, 5.0):
        assert worst(integrator='esdirk43', step=0.01 / k) < 2e-5 / k**4, k
    for tolerance in (1e-4, 1e-6, 1e-8):
        found = worst(integrator='esdirk43_adaptive', step=0.1, tolerance=tolerance)
        assert found < 200.0 * tolerance, tolerance


def test_change_point_four_bar_at_odd_steps() -> None:
    scene = load_scene('change_point')
    finest = run(scene, 4.0, step=1e-4).sample().q
    for k in (1.7, 2.9, 5.0):
        (last,) = Simulation(scene, integrator='esdirk43', step=0.01 / k).run(4.0, at=[4.0])
        assert last.q == pytest.approx(finest, abs=1e-3 / k**4), k


@pytest.mark.parametrize(
    'name', ['differential_drive_cart', 'stewart_platform', 'wiper', 'coin', 'scissor_lift']
)
def test_mechanisms_of_all_kinds(name: str) -> None:
    scene = load_scene(name)
    wanted = run(scene, 1.0, integrator='dop853_adaptive', step=0.05, tolerance=1e-10).sample()
    sim = run(scene, 1.0, integrator='esdirk43_adaptive', step=0.05, tolerance=1e-7)
    assert sim.sample().q == pytest.approx(wanted.q, abs=1e-6)
    assert sim.sample().diagnostics.position_violation < 1e-12


def test_rows_that_bind_velocities_only() -> None:
    scene = scene_from_text(SKATE)
    wanted = run(scene, 1.0, integrator='dop853', step=1e-2).sample().q
    sim = run(scene, 1.0, integrator='esdirk43', step=1e-2)
    assert sim.sample().q == pytest.approx(wanted, abs=1e-7)


# ---------------------------------------------------------------------------------- stiff, by law


@pytest.mark.parametrize('c', [1e3, 1e6, 1e9])
def test_an_overdamped_spring_creeps(c: float) -> None:
    """x = x₀ exp(-t k / c), after a moment of m / c, with steps up to 1e7 times as long."""
    m, rate, x0 = 2.0, 1.5, 0.3
    effects = (
        f'spring: {{between: [O, P], stiffness: {rate * c}, free_length: {1 - x0}}},'
        f'damper: {{between: [O, P], damping: {c}}}'
    )
    slow = 0.5 * (c / m - np.sqrt((c / m) ** 2 - 4.0 * rate * c / m))
    sim = small(MASS, effects, integrator='esdirk43_adaptive', step=0.1, tolerance=1e-8)
    sim.step(10)
    fast = c / m - slow
    wanted = 1.0 - x0 + x0 * (fast * np.exp(-slow) - slow * np.exp(-fast)) / (fast - slow)
    assert sim.sample().points['P'][0] == pytest.approx(wanted, abs=1e-7)
    assert sim.evaluations < 3000
    with pytest.raises(StepError):
        small(MASS, effects, integrator='rk4', step=0.02).step(500)


@pytest.mark.parametrize('k', [1e6, 1e8, 1e10])
def test_a_stiff_spring_is_as_good_as_a_rod(k: float) -> None:
    """A pendulum on a spring is off by what the spring gives: (m g + m l ω²) / k."""
    effects = (
        f'gravity: {{acceleration: [0, -{G}]}},'
        f'spring: {{between: [O, P], stiffness: {k}, free_length: 1}},'
        f'damper: {{between: [O, P], damping: {1e-2 * k}}}'
    )

    def rod(_: float, y: Floats) -> list[float]:
        return [y[1], -G * np.cos(y[0])]

    angle = solve_ivp(rod, (0, 2), [0, 0], rtol=1e-12, atol=1e-12).y[0, -1]
    wanted = [np.cos(angle), np.sin(angle)]
    off = 200.0 * G / k
    for step, error in ((2e-2, 1e-3), (1e-2, 1e-4), (5e-3, 1e-5)):
        sim = small(MASS, effects, integrator='esdirk43', step=step)
        sim.step(round(2.0 / step))
        assert sim.sample().points['P'] == pytest.approx(wanted, abs=error + off)
    options = {'integrator': 'esdirk43_adaptive', 'step': 0.1, 'tolerance': 1e-5}
    sim = small(MASS, effects, **options)
    sim.step(20)
    assert sim.sample().points['P'] == pytest.approx(wanted, abs=1e-4 + off)
    assert sim.evaluations < 10_000


def test_a_motor_with_steep_gains_holds_its_place() -> None:
    """x = x* - e / k_p at last, whatever the step."""
    effects = 'motor: {joint: pin, effort: 3, position: 1, position_gain: 1e8, velocity_gain: 1e6}'
    sim = small(ROTOR, effects, integrator='esdirk43', step=0.05)
    sim.step(100)
    joint = sim.sample().joints['pin']
    assert joint.position == pytest.approx(1.0 + 3e-8, abs=1e-9) and abs(joint.velocity) < 1e-9


# ------------------------------------------------------------------------ stiff, in a mechanism


def test_a_hard_stop_in_a_slider_crank_accounts_for_its_energy() -> None:
    """Input = stored + dissipated, at 1e6 N/m^1.5; the explicit method gives the same motion."""
    stop = 'joint_stop: {joint: guide, stiffness: 1e6, lower: -1.2, upper: 1.9, damping: 0.2}'
    scene = with_effects('slider_crank', stop)
    wanted = run(scene, 3.0, integrator='dop853_adaptive', step=0.1, tolerance=1e-10).sample().q
    adaptive: dict[str, Any] = {
        'integrator': 'esdirk43_adaptive',
        'step': 0.1,
        'tolerance': 1e-9,
    }
    sim = Simulation(scene, ledger=True, **adaptive)
    start = sim.sample()
    sim.step(30)
    end = sim.sample()
    assert end.q == pytest.approx(wanted, abs=1e-6)
    assert end.works['joint_stop'] < -6.0
    # not at the stop now, so that nothing is stored in it
    gained = end.energy - start.energy
    assert gained == pytest.approx(end.works['joint_stop'], abs=1e-6)
    total = sum(end.works.values())
    assert total == pytest.approx(end.kinetic_energy - start.kinetic_energy, abs=1e-6)


def test_a_strong_damper_costs_no_steps() -> None:
    """1e4 N s/m on the slide stops the slider-crank at once; the explicit method takes on the
    order of c / m steps a second."""
    scene = with_effects('slider_crank', 'joint_friction: {joint: guide, viscous: 1e4}')
    options = {'step': 0.1, 'tolerance': 1e-6}
    explicit = run(scene, 3.0, integrator='dop853_adaptive', **options)
    sim = run(scene, 3.0, integrator='esdirk43_adaptive', **options)
    assert sim.sample().q == pytest.approx(explicit.sample().q, abs=1e-9)
    assert 50 * sim.evaluations < explicit.evaluations


def test_dry_friction_that_is_nearly_a_lock() -> None:
    """Its slip speed is 1e-5 m/s: what the friction takes is what the motion loses."""
    friction = '{joint: guide, dynamic: 0.2, static: 0.4, slip: 1e-5, load: 20}'
    scene = with_effects('slider_crank', f'joint_friction: {friction}')
    for tolerance in (1e-5, 1e-7):
        sim = Simulation(
            scene, integrator='esdirk43_adaptive', step=0.1, tolerance=tolerance, ledger=True
        )
        start = sim.sample()
        sim.step(30)
        end = sim.sample()
        lost = end.energy - start.energy
        assert lost == pytest.approx(end.works['joint_friction'], abs=100.0 * tolerance)
        # it stands, but for the creep
        assert lost < -1.0 and abs(end.joints['guide'].velocity) < 1e-5
    with pytest.raises(StepError, match='esdirk43'):
        run(scene, 3.0, integrator='dop853_adaptive', step=0.1, tolerance=1e-9)


def test_friction_under_the_reactions_that_it_changes() -> None:
    scene = with_effects(
        'slider_crank', 'joint_friction: {joint: guide, dynamic: 0.1, viscous: 50, slip: 0.01}'
    )
    wanted = run(scene, 2.0, integrator='dop853_adaptive', step=0.1, tolerance=1e-9).sample()
    sim = run(scene, 2.0, integrator='esdirk43_adaptive', step=0.1, tolerance=1e-8)
    assert sim.sample().q == pytest.approx(wanted.q, abs=1e-6)


# ------------------------------------------------------------------------------- as any other run


@pytest.mark.parametrize('integrator', ['esdirk43', 'esdirk43_adaptive'])
def test_a_run_repeats_bit_for_bit(integrator: str) -> None:
    scene = with_effects('slider_crank', 'joint_friction: {joint: guide, dynamic: 0.1, load: 5}')
    options: dict[str, Any] = {'integrator': integrator, 'step': 0.01, 'tolerance': 1e-7}
    whole = run(scene, 1.0, **options)
    other = Simulation(scene, **options)
    for _ in other.run(0.37, at=[0.1, 0.123, 0.3]):
        pass
    kept = other.state
    other.step(30)
    other.restore(kept)
    other.step(100 - other.step_index)
    assert same(other.state, whole.state)


def test_watching_and_a_ledger_change_nothing() -> None:
    scene = load_scene('slider_crank')
    options = {'integrator': 'esdirk43', 'step': 5e-3}
    plain = run(scene, 3.0, **options)
    watched = run(scene, 3.0, **options, watch=True)
    assert same(plain.state, watched.state)
    known = run(scene, 3.0, integrator='dop853', step=2e-3, watch=True).passes
    assert [each.joints for each in watched.passes] == [each.joints for each in known]
    assert [each.t for each in watched.passes] == pytest.approx([e.t for e in known], abs=1e-5)


def test_what_has_no_balance_is_told_and_the_last_good_state_kept(tmp_path: Path) -> None:
    """A force that jumps with the speed that it makes."""
    (tmp_path / 'jump.py').write_text(JUMP)
    scene = tmp_path / 'scene.yaml'
    scene.write_text(f'{MASS}\neffects: {{jump.py: {{on: P, force: 1e4}}}}\n')
    sim = Simulation(load_scene(scene), integrator='esdirk43', step=0.01)
    with pytest.raises(StepError, match='balance'):
        sim.step(100)
    kept = sim.state
    assert np.isfinite(kept.q).all() and sim.t < 1.0
    with pytest.raises(StepError):
        sim.step()
    assert same(kept, sim.state)


def test_other_formulations_take_explicit_steps() -> None:
    with pytest.raises(InputError, match='explicit'):
        Simulation(load_scene('slider_crank'), formulation='alf1', integrator='esdirk43')


def test_nobody_else_asks_how_effects_yield() -> None:
    scene = with_effects('slider_crank', 'torsion_spring: {joint: knee, stiffness: 5}')
    explicit, implicit = (Simulation(scene, integrator=i) for i in ('rk4', 'esdirk43'))
    assert explicit._run.stepper.system.soft.weight.size == 0
    assert not explicit._run.applied.assembled.effects.tangent.any()
    assert implicit._run.stepper.system.soft.weight.size == 1


JUMP = """
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, component, numbers_of, place, push_component

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    on: str = field(metadata={'kind': 'body or point', 'doc': 'what'})
    force: float = field(metadata={'kind': 'number', 'doc': 'force'})


def pack(effects, layout):
    measures = Measures(layout)
    for effect in effects:
        measures.add_place(place(layout, effect.parameters.on), [])
        measures.give([effect.parameters.force])
    return measures.packed()


@contract.force
def force(t, q, qd, near, slots, params, Q):
    for n in range(slots[1]):
        _, v = component(q, qd, slots, params, n, 0)
        F = params[numbers_of(slots, n)]
        push_component(q, slots, params, n, 0, -F if v > 0.0 else F, Q)
"""
