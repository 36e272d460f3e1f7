"""The ledger: what effects have done is what the energy lacks, to the order of the method."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from alf_ros import InputError, Simulation, StepError, load_scene
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation import state_vector
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.saved_states import as_data, from_data
from support.driven_mechanisms import BELT
from support.effect_scenes import MASS, PENDULUM, ROTOR, ROTOR_IN_SPACE

G = 9.81
METHODS: list[dict[str, Any]] = [
    {'integrator': 'rk4', 'step': 5e-4},
    {'integrator': 'dop853', 'step': 2e-3},
    {'integrator': 'dop853_adaptive', 'step': 0.02, 'tolerance': 1e-10},
]


@pytest.fixture(params=METHODS, ids=lambda p: p['integrator'])
def method(request: pytest.FixtureRequest) -> dict[str, Any]:
    return dict(request.param)


def small(mechanism: str, effects: str, velocities: str = '', **solver: Any) -> Simulation:
    text = f'{mechanism}\neffects: {{{effects}}}\ninitial: {{velocities: {{{velocities}}}}}\n'
    return Simulation(scene_from_text(text), ledger=True, **{'step': 1e-3, **solver})


def missing(start: Sample, end: Sample) -> float:
    """The change of kinetic energy that the works do not explain, J."""
    return end.kinetic_energy - start.kinetic_energy - sum(end.works.values())


def taken(start: Sample, end: Sample) -> Mapping[str, float]:
    """The energy that each effect has removed from the mechanism for good, J."""
    return {
        label: start.stored[label] - end.stored[label] - end.works[label] for label in end.stored
    }


# ---------------------------------------------------------------------------------- closed forms


def damped(**solver: Any) -> tuple[float, float]:
    """Errors of spring and damper of an oscillator after 2 s, J."""
    m, k, c, v = 2.0, 50.0, 3.0, 1.5
    between = 'between: [O, P]'
    sim = small(
        MASS,
        f'spring: {{{between}, stiffness: {k}}}, damper: {{{between}, damping: {c}}}',
        f'P: [{v}, 0]',
        **solver,
    )
    sim.step(round(2.0 / sim.h))
    t, decay = 2.0, c / (2.0 * m)
    omega = math.sqrt(k / m - decay**2)
    x = v / omega * math.exp(-decay * t) * math.sin(omega * t)
    xd = v * math.exp(-decay * t) * (math.cos(omega * t) - decay / omega * math.sin(omega * t))
    works = sim.sample().works
    spring, damper = -0.5 * k * x**2, 0.5 * m * (xd**2 - v**2) + 0.5 * k * x**2
    assert works['inputs'] == works['drives'] == 0.0
    return abs(works['spring'] - spring), abs(works['damper'] - damper)


def test_damped_oscillator(method: dict[str, Any]) -> None:
    assert max(damped(**method)) < 1e-9


@pytest.mark.parametrize('integrator, order, step', [('rk4', 4, 0.01), ('dop853', 8, 0.2)])
def test_works_have_the_order_of_the_method(integrator: str, order: int, step: float) -> None:
    before, after = (max(damped(integrator=integrator, step=h)) for h in (step, 0.5 * step))
    assert before > 1e-8
    assert math.log2(before / after) > order - 0.5


@pytest.mark.parametrize('tolerance', [1e-6, 1e-10])
def test_works_of_an_implicit_method_have_its_order(tolerance: float) -> None:
    """Whatever Newton's method leaves of a stage, and with a torque that jumps within a step."""
    table = '[[0, 0], [0.401, 3], [0.401001, -3], [1, 8]]'
    effects = f'gravity: {{acceleration: [0, {-G}]}}, user_table: {{joint: pin, table: {table}}}'
    errors = []
    for step in (5e-3, 2.5e-3):
        sim = small(PENDULUM, effects, step=step, integrator='esdirk43', tolerance=tolerance)
        start = sim.sample()
        sim.step(round(1.0 / step))
        errors.append(abs(missing(start, sim.sample())))
    assert 1e-9 < errors[0] < 1e-7
    assert math.log2(errors[0] / errors[1]) > 3.5


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_motor_that_runs_up(mechanism: str, method: dict[str, Any]) -> None:
    L, free, J = 2.0, 30.0, 0.5
    line = f'effort: 9, limit: {L}, free_speed: {free}'
    sim = small(mechanism, f'motor: {{joint: pin, {line}}}', **method)
    sim.step(round(1.0 / sim.h))
    omega = free * (1.0 - math.exp(-L / (J * free)))
    assert sim.sample().works['motor'] == pytest.approx(0.5 * J * omega**2, rel=1e-9)


def test_rotor_of_a_motor_counts() -> None:
    """The work of the motor is the kinetic energy of J + I; a rotor is no effect."""
    sim = small(ROTOR, 'motor: {joint: pin, effort: 0.3, armature: 0.7}')
    sim.step(1000)
    omega = 0.3 / 1.2
    assert sim.sample().works['motor'] == pytest.approx(0.5 * 1.2 * omega**2, rel=1e-9)


def test_inputs_from_outside() -> None:
    """An input is held, replaced and released, at a point and on a joint, in one account."""
    sim = small(MASS, 'gravity: {acceleration: [0, -1]}')
    sim.apply_wrench('P', force=[3.0, 0.0])
    sim.step(100)
    x = sim.sample().points['P'][0] - 1.0
    assert sim.sample().works['inputs'] == pytest.approx(3.0 * x, rel=1e-9)
    sim.apply_wrench('P', force=[-5.0, 2.0])
    sim.step(100)
    where = sim.sample().points['P'] - [1.0 + x, 0.0]
    fall = -0.5 * 0.1**2
    work = 3.0 * x - 5.0 * where[0] + 2.0 * (where[1] - fall)
    assert sim.sample().works['inputs'] == pytest.approx(work, rel=1e-9)
    sim.clear_inputs()
    sim.step(100)
    assert sim.sample().works['inputs'] == pytest.approx(work, rel=1e-9)
    rotor = small(ROTOR, '')
    rotor.apply_effort('pin', 0.5)
    rotor.step(500)
    turned = rotor.sample().joints['pin'].position
    assert turned > 0.1
    assert rotor.sample().works['inputs'] == pytest.approx(0.5 * turned, rel=1e-9)


# ------------------------------------------------------------------------------ stiff and rubbing


def test_a_stop_of_a_million() -> None:
    """Hunt and Crossley's loss, and all of it in the account of the stop."""
    v, damping = 3.0, 0.2
    stop = f'joint_stop: {{joint: pin, upper: 0.5, stiffness: 1e6, damping: {damping}}}'
    friction = 'joint_friction: {joint: pin, viscous: 0.1}'
    sim = small(ROTOR, f'{stop}, {friction}', f'A: [~, {v}]', step=5e-6)
    start = sim.sample()
    for sample in sim.run(0.3, every=2000):
        assert abs(missing(start, sample)) < 1e-6 * start.energy
    lost = taken(start, sample)
    assert sample.joints['pin'].velocity < -1.0
    assert lost['joint_stop'] > 0.05 * start.energy and lost['joint_friction'] > 0.0
    assert sample.energy + sum(lost.values()) == pytest.approx(start.energy, rel=1e-6)


def governor(**solver: Any) -> Simulation:
    """The library's governor with a spring and a damper of 1e5 N/m at its sleeve, driven by a
    motor: input = stored + dissipated."""
    scene = {
        'mechanism': 'governor',
        'effects': {
            'gravity': {'acceleration': [0, 0, -G]},
            'spring': {'between': ['O', 'S'], 'stiffness': 1e5},
            'damper': {'between': ['O', 'S'], 'damping': 200.0},
            'motor': {'joint': 'bearing', 'effort': 0.5},
        },
        'initial': {'velocities': {'hinge': ['-rate', None, 0]}},
    }
    return Simulation(load_scene(scene), ledger=True, **solver)


def test_a_stiff_governor() -> None:
    sim = governor(step=1e-4, integrator='dop853')
    start = sim.sample()
    sim.step(10000)
    end = sim.sample()
    lost, given = taken(start, end), end.works['motor']
    assert given > 1.0 and lost['damper'] > 1e-4
    assert lost['spring'] == pytest.approx(0.0, abs=1e-6 * given)
    assert lost['gravity'] == pytest.approx(0.0, abs=1e-6 * given)
    assert end.energy - start.energy + lost['damper'] == pytest.approx(given, rel=1e-6)


def test_friction_under_the_true_load(method: dict[str, Any]) -> None:
    """With the loads of each stage; friction and gravity explain all of the motion."""
    bearings = {'dynamic': 0.3, 'radius': 0.02, 'slip': 1.0}
    joints = load_scene('four_bar').mechanism.joints
    scene = {
        'mechanism': 'four_bar',
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {j.name: {'joint': j.name, **bearings} for j in joints},
        },
        'initial': {'velocities': {'A': ['-30*a*sin(theta)', '30*a*cos(theta)']}},
    }
    sim = Simulation(load_scene(scene), ledger=True, **method)
    start = sim.sample()
    for sample in sim.run(1.0, every=round(0.1 / sim.h)):
        rest = sample.works
        assert abs(missing(start, sample)) < 1e-6
        rubbed = [work for name, work in rest.items() if name.startswith('joint_friction')]
        assert max(rubbed) <= 0.0
        assert sample.energy - start.energy == pytest.approx(sum(rubbed), abs=1e-6)
    assert sum(rubbed) < -0.5


# ------------------------------------------------------------------------------------- prescribed


def test_slider_crank_driven_through_its_singular_position(method: dict[str, Any]) -> None:
    """The stages beside it are interpolated: so is what the drive gives there."""
    text = load_scene('slider_crank').text
    text = text[text.index('mechanism:') : text.index('effects:')] + (
        '  drives:\n    motor: {joint: crank_pin, angle: pi/4 + 2*t}\n'
        f'effects: {{gravity: {{acceleration: [0, -{G}]}}}}\n'
    )
    sim = Simulation(scene_from_text(text), ledger=True, **method)
    # two rods of 1 m and 1 kg, at a steady speed; V = g sin. What a drive exerts is as exact as λ
    # beside a singular position, and adaptive steps are chosen for the motion alone: they are long
    # here, where it is prescribed
    bound = 1e-7 if method['integrator'] == 'dop853_adaptive' else 1e-8
    for sample in sim.run(3.0, at=np.linspace(0.1, 3.0, 30).tolist()):
        angle = math.pi / 4 + 2.0 * sample.t
        change = 4.0 * (math.sin(angle) ** 2 - 0.5)
        fall = G * (math.sin(math.pi / 4) - math.sin(angle))
        assert sample.works['gravity'] == pytest.approx(fall, abs=1e-8)
        assert sample.works['drives'] == pytest.approx(change - fall, abs=bound)


def test_free_slider_crank_through_its_singular_position(method: dict[str, Any]) -> None:
    """Friction, gravity and a held force, eleven times through it."""
    scene = load_scene('slider_crank')
    text = scene.text.replace(
        'effects:', 'effects:\n  joint_friction: {joint: knee, viscous: 0.01}'
    )
    sim = Simulation(scene_from_text(text), ledger=True, **method)
    sim.apply_wrench('B', force=[0.3, 0.0])
    start = sim.sample()
    for sample in sim.run(5.0, at=np.linspace(0.5, 5.0, 10).tolist()):
        assert abs(missing(start, sample)) < 1e-6
        assert sample.works['inputs'] == pytest.approx(
            0.3 * (sample.points['B'] - start.points['B'])[0], abs=1e-7
        )
    assert sample.works['joint_friction'] < -0.1


def test_a_wheel_on_a_belt(method: dict[str, Any]) -> None:
    """A solid wheel of 2 kg, 0.5 m reaches a third of the belt speed v; the work is v² / 3 J."""
    sim = Simulation(load_scene(BELT), ledger=True, **method)
    for sample in sim.run(2.0, at=[0.7, 2.0]):
        v = sample.t - math.sin(sample.t)
        assert sample.works == {'inputs': 0.0, 'drives': pytest.approx(v**2 / 3.0, abs=1e-9)}


# ------------------------------------------------------------------------- it is part of the state


def busy(ledger: bool = True, **solver: Any) -> Simulation:
    """Friction and a held force, through singular positions."""
    text = load_scene('slider_crank').text.replace(
        'effects:', 'effects:\n  joint_friction: {joint: knee, viscous: 0.01}'
    )
    sim = Simulation(scene_from_text(text), ledger=ledger, **solver)
    sim.apply_wrench('coupler', force=[0.5, 1.0])
    return sim


def test_it_changes_nothing(method: dict[str, Any]) -> None:
    kept, plain = busy(**method), busy(ledger=False, **method)
    for sim in (kept, plain):
        sim.step(round(1.0 / sim.h))
    assert plain.state.works == {} and plain._run.applied.assembled.ledger.tally.size == 0
    for field in ('q', 'qd', 'turns'):
        assert getattr(kept.state, field).tobytes() == getattr(plain.state, field).tobytes()
    with pytest.raises(InputError, match='no ledger is kept'):
        _ = plain.sample().works
    watched = Simulation(kept.scene, ledger=True, watch=True, **method)
    watched.restore(busy(**method).state)
    watched.step(round(1.0 / watched.h))
    assert watched.passes and watched.state.works == kept.state.works


def test_a_restored_run_repeats_bit_for_bit(method: dict[str, Any]) -> None:
    sim = busy(**method)
    count = round(0.5 / sim.h)
    sim.step(count)
    before = sim.state
    works = dict(before.works)
    assert len(set(works.values())) == 4 and works['drives'] == 0.0
    sim.step(count)
    end = sim.state
    saved = from_data(json.loads(json.dumps(as_data(before))), sim.state)
    model, (numbers, rates) = sim.model, state_vector.values(sim.model, before)
    assert len(state_vector.names(model, before)) == numbers.size
    assert 'works[joint_friction]' in state_vector.names(model, before)
    logged = state_vector.state(model, end, numbers, rates, before.inputs)
    for state in (before, saved, logged):
        other = busy(**method)
        other.restore(state)
        assert dict(other.sample().works) == works
        list(other.run(0.01, at=[other.t + 0.25 * other.h]))  # looked at aside
        other.restore(state)
        other.step(count)
        assert other.state.works == end.works
        assert other.state.q.tobytes() == end.q.tobytes()
    assert before.works == works  # a sample stays what it was


def test_works_between_two_steps() -> None:
    """A run with steps of that length gives the same works."""
    sim, finer = busy(step=1e-3), busy(step=5e-4)
    (between,) = sim.run(0.0105, at=[0.0105])
    finer.step(21)
    assert between.works == pytest.approx(finer.state.works, abs=1e-9)
    assert between.works['gravity'] != sim.state.works['gravity']


def test_a_state_of_other_effects_or_without_a_ledger() -> None:
    """Works that the state does not have begin at zero; works without an effect are left out."""
    sim, plain = busy(), busy(ledger=False)
    plain.step(10)
    sim.step(5)
    sim.restore(plain.state)
    assert set(sim.state.works.values()) == {0.0}
    plain.restore(dataclasses.replace(plain.state, works={'gravity': 1.0}))
    assert plain.state.works == {}
    sim.restore(dataclasses.replace(sim.state, works={'gravity': 1.0, 'drag': 2.0}))
    assert sim.state.works == {
        'joint_friction': 0.0,
        'gravity': 1.0,
        'inputs': 0.0,
        'drives': 0.0,
    }


def test_a_failed_step_does_not_count() -> None:
    """The adaptive method falls back to the last point of its grid, and so do the works."""
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'P': {'at': [1, 0]}},
            'bodies': {'mass': {'points': ['P'], 'mass': 1, 'inertia': 'point'}},
        },
        'effects': {
            'user_table': {'on': 'P', 'table': [[0, 0, 0], [0.1, 1, 0], [0.1001, 1e38, 0]]}
        },
    }
    sim = Simulation(
        load_scene(scene), ledger=True, integrator='dop853_adaptive', step=0.03, tolerance=1e-12
    )
    with pytest.raises(StepError):
        sim.step(20)
    sample = sim.sample()
    assert 0 < sim.step_index < 20
    assert sample.works['user_table'] == pytest.approx(sample.kinetic_energy, rel=1e-9)


def test_only_alf2_keeps_one() -> None:
    with pytest.raises(InputError, match='only alf2 keeps a ledger'):
        Simulation(load_scene('slider_crank'), ledger=True, formulation='alf1')


@pytest.mark.parametrize('scene', ['slider_crank', 'stewart_platform'])
def test_what_a_stage_notes_is_what_a_sample_says(scene: str) -> None:
    """The first stage of a step stands where the step begins."""
    sim = Simulation(load_scene(scene), ledger=True)
    sim.step(7)
    powers = sim.sample().powers
    sim.step()
    noted = sim._run.applied.assembled.ledger.rates[: len(powers)]
    assert noted == pytest.approx([*powers.values()], rel=1e-9)
    assert max(map(abs, powers.values())) > 1e-3
