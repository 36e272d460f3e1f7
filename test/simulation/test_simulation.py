"""Simulation: determinism, save and restore, output times, turns, inputs, failures."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from alf_ros import AssemblyError, InputError, Simulation, StepError, load_scene
from alf_ros.scene.scene import UNSAID, Scene, Solver, scene_from_text
from support.bit_for_bit import same
from support.effect_scenes import PENDULUM


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive'])
@pytest.mark.parametrize('name', ['slider_crank', 'double_four_bar', 'four_bar'])
def test_restored_run_repeats_bit_for_bit(name: str, integrator: str) -> None:
    sim = Simulation(load_scene(name), integrator=integrator)
    sim.step(700)
    state = pickle.loads(pickle.dumps(sim.state))
    sim.step(900)
    once = sim.sample()
    sim.restore(state)
    sim.step(900)
    assert same(once, sim.sample())
    again = Simulation(load_scene(name), integrator=integrator)
    again.restore(state)
    for _ in range(900):
        again.step()
    assert same(once, again.sample())


def test_the_initial_state_is_the_one_of_a_reset_and_a_copy() -> None:
    sim = Simulation(load_scene('slider_crank'))
    begun, q = sim.state, sim.state.q.copy()
    sim.apply_effort('crank_pin', 2.0)
    sim.step(20)
    first = sim.initial_state
    assert (first.step, first.inputs) == (0, begun.inputs)
    assert first.q.tobytes() == begun.q.tobytes() and first.qd.tobytes() == begun.qd.tobytes()
    first.q[:] = np.nan
    sim.reset()
    assert sim.state.q.tobytes() == q.tobytes()
    sim.step(20)
    assert np.isfinite(sim.state.q).all()


def test_a_state_of_other_steps_continues_at_its_time() -> None:
    """The crank is driven: at another time it would be elsewhere."""
    drives = {'motor': {'joint': 'crank_pin', 'angle': 'pi/4 + 2*t'}}
    scene = load_scene({'mechanism': 'slider_crank', 'drives': drives})
    long, short = (Simulation(scene, integrator='rk4', step=h) for h in (2e-3, 1e-3))
    long.step(50)
    short.restore(long.state)
    assert short.t == long.t == 0.1
    short.step(2)
    long.step(1)
    assert short.sample().q == pytest.approx(long.sample().q, abs=1e-12)
    (between,) = long.run(0.002, at=[long.t + 1e-3])
    with pytest.raises(InputError, match='lies between two steps'):
        long.restore(between.state)


def test_motion_does_not_depend_on_what_is_looked_at() -> None:
    states = []
    for options in ({'every': 1}, {'every': 7}, {'at': [0.0, 0.01234, 0.3, 0.33333]}):
        sim = Simulation(load_scene('slider_crank'))
        for sample in sim.run(0.5, **options):
            assert np.isfinite(sample.energy) and sample.lam.size == 3
            assert sample.diagnostics.rank == 3
        assert sim.step_index == 500
        states.append(sim.sample())
    assert all(same(states[0], state) for state in states[1:])


def test_samples_between_steps_lie_on_the_motion() -> None:
    fine = Simulation(load_scene('slider_crank'), step=1e-4)
    coarse = Simulation(load_scene('slider_crank'))
    times = [0.0123, 0.1234, 0.2999]
    for one, two in zip(fine.run(0.3, at=times), coarse.run(0.3, at=times), strict=True):
        assert one.t == pytest.approx(two.t, abs=1e-12)
        assert one.q == pytest.approx(two.q, abs=1e-9)


def test_many_instants_within_one_adaptive_step_cost_what_the_motion_costs() -> None:
    times = np.linspace(0.0, 10.0, 1001).tolist()
    options: dict[str, Any] = {'integrator': 'dop853_adaptive', 'tolerance': 1e-12, 'ledger': True}
    fine = Simulation(load_scene('slider_crank'), step=0.01, **options)
    alone = Simulation(load_scene('slider_crank'), step=10.0, **options)
    looked_at = Simulation(load_scene('slider_crank'), step=10.0, **options)
    alone.step()
    pairs = zip(fine.run(10.0, at=times), looked_at.run(10.0, at=times), strict=True)
    for one, two in pairs:
        assert two.q == pytest.approx(one.q, abs=1e-10)
        assert two.works == pytest.approx(one.works, abs=1e-8)
    assert looked_at.evaluations <= 2 * alone.evaluations + len(times) * alone.stages
    assert same(alone.sample(), looked_at.sample())


def test_an_input_between_two_instants_acts_from_the_grid_point_on() -> None:
    options: dict[str, Any] = {'integrator': 'dop853_adaptive', 'step': 0.5}
    one, two = (Simulation(load_scene('slider_crank'), **options) for _ in range(2))
    samples = []
    for sample in one.run(1.0, at=[0.1, 0.2]):
        samples.append(sample)
        one.apply_effort('crank_pin', 5.0)
    two.apply_effort('crank_pin', 5.0)
    (other,) = two.run(1.0, at=[0.2])
    assert same(samples[-1], other)
    assert same(one.sample(), two.sample())


def test_times_must_ascend() -> None:
    sim = Simulation(load_scene('slider_crank'))
    with pytest.raises(InputError, match='past'):
        list(sim.run(1.0, at=[0.5, 0.2]))


def test_turns_are_counted_and_velocity_is_the_rate_of_position() -> None:
    sim = Simulation(load_scene('slider_crank'))
    positions, velocities = [], []
    for sample in sim.run(10.0, every=5):
        positions.append(sample.joints['crank_pin'].position)
        velocities.append(sample.joints['crank_pin'].velocity)
    assert np.all(np.abs(np.diff(positions)) < 0.1)
    assert positions[-1] > 10 * np.pi  # five turns and more
    rate = (np.array(positions[2:]) - positions[:-2]) / 0.01
    assert rate == pytest.approx(velocities[1:-1], abs=0.05)
    backwards = Simulation(scene_from_text(PENDULUM), step=1e-3)
    backwards.apply_effort('pin', -20.0)
    backwards.step(1000)
    # J = 2/3: α = -30 rad/s², 15 rad in the first second
    assert backwards.sample().joints['pin'].position == pytest.approx(-15.0, abs=1e-6)


def test_effort_and_wrench_are_the_same_thing() -> None:
    """A torque by joint, by wrench and as a couple of forces: one motion."""
    states = []
    for apply in (
        lambda sim: sim.apply_effort('pin', 3.0),
        lambda sim: sim.apply_wrench('rod', torque=3.0),
        lambda sim: sim.apply_wrench('rod', force=[0.0, 3.0], at='A', frame='body'),
    ):
        sim = Simulation(scene_from_text(PENDULUM))
        apply(sim)
        sim.step(1500)
        states.append(sim.sample().q)
    assert states[0] == pytest.approx(states[1], abs=1e-12)
    assert states[0] == pytest.approx(states[2], abs=1e-9)


def test_effort_on_a_slider_and_between_two_bodies() -> None:
    """The power of an effort is effort times joint velocity: work balances energy."""
    for joint, effort in (('guide', 5.0), ('knee', -2.0), ('crank_pin', 1.0)):
        sim = Simulation(load_scene('slider_crank'), step=2e-4)
        sim.apply_effort(joint, effort)
        first = sim.sample()
        sim.step(1500)
        last = sim.sample()
        travel = last.joints[joint].position - first.joints[joint].position
        assert abs(travel) > 0.1
        assert last.energy - first.energy == pytest.approx(effort * travel, rel=1e-7)
        assert last.joints[joint].effort == effort


def test_inputs_are_part_of_the_state() -> None:
    sim = Simulation(load_scene('slider_crank'))
    sim.apply_wrench('coupler', force=[0.0, 5.0], torque=0.1, at='A')
    sim.step(100)
    state = sim.state
    sim.step(400)
    with_inputs = sim.sample()
    sim.clear_inputs()
    sim.step(10)
    sim.restore(state)
    sim.step(400)
    assert same(with_inputs, sim.sample())
    sim.reset()
    assert sim.t == 0.0 and not sim.state.inputs.wrenches


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda sim: sim.apply_wrench('copler', force=[0, 1]), "did you mean 'coupler'"),
        (lambda sim: sim.apply_wrench('coupler', force=[0, float('nan')]), 'finite'),
        (lambda sim: sim.apply_wrench('coupler', force=[0, 1, 2]), '2 finite forces'),
        (lambda sim: sim.apply_wrench('coupler', force=[0, 1], at='O'), 'not a point'),
        (lambda sim: sim.apply_wrench('coupler', force=[0, 1], frame='map'), 'unknown frame'),
        (lambda sim: sim.apply_wrench('A', torque=1.0), 'orientation'),
        (lambda sim: sim.apply_wrench('O', force=[0, 1]), 'unknown body or point'),
        (lambda sim: sim.apply_effort('crankpin', 1.0), "did you mean 'crank_pin'"),
        (lambda sim: sim.apply_effort('crank_pin', float('inf')), 'finite'),
    ],
)
def test_refused_inputs_change_nothing(call, words) -> None:
    sim = Simulation(load_scene('slider_crank'))
    sim.apply_effort('crank_pin', 0.5)
    before = sim.state.inputs
    with pytest.raises(InputError, match=words):
        call(sim)
    assert sim.state.inputs == before


def test_velocities_are_completed_from_any_consistent_subset() -> None:
    wanted = Simulation(load_scene('slider_crank')).sample()
    for subset in ({'A': [-2, 2]}, {'A': [-2, None]}, {'A': [None, 2], 'B': [-4, 0]}):
        sample = Simulation(with_velocities(**subset)).sample()
        assert sample.qd == pytest.approx(wanted.qd, abs=1e-9)


def test_contradicting_velocities_name_the_constraints() -> None:
    with pytest.raises(AssemblyError) as error:
        Simulation(with_velocities(A=[-2, 1]))
    assert 'crank_length' in str(error.value) and 'A (y given)' in str(error.value)
    assert error.value.exit_code == 2


def with_velocities(**velocities: object) -> Scene:
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'effects': {'gravity': {'acceleration': [0, -9.81]}},
            'initial': {'velocities': velocities},
        }
    )


def test_rough_positions_are_closed() -> None:
    """The crank is put elsewhere; couplers and cranks follow onto the branch that was drawn."""
    scene = load_scene(
        {
            'mechanism': 'double_four_bar',
            'initial': {'positions': {'B0': ['cos(1.2)', 'sin(1.2)']}},
        }
    )
    sample = Simulation(scene).sample()
    for k in range(3):
        expected = [k + np.cos(1.2), np.sin(1.2)]
        assert sample.points[f'B{k}'] == pytest.approx(expected, abs=1e-12)


def test_impossible_geometry_names_what_stays_open() -> None:
    with pytest.raises(AssemblyError, match='cannot be closed: .*_length is off by'):
        Simulation(load_scene('four_bar', parameters={'b': 3.0, 'beta': 1.0}))


def test_failed_step_keeps_the_last_good_state() -> None:
    sim = Simulation(load_scene('slider_crank'))
    sim.step(100)
    before = sim.sample()
    sim.apply_wrench('coupler', force=[1e200, 0.0])
    with pytest.raises(StepError) as error:
        sim.step(10)
    assert error.value.reason and error.value.remedy and error.value.t == before.t
    assert same(before, sim.sample())
    sim.clear_inputs()
    sim.step(100)
    other = Simulation(load_scene('slider_crank'))
    other.step(200)
    assert same(sim.sample(), other.sample())


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
@pytest.mark.parametrize('step', [0.5, 30.0])
def test_a_step_much_too_long_says_so(integrator: str, step: float) -> None:
    sim = Simulation(load_scene('slider_crank'), step=step, integrator=integrator)
    before = sim.sample()
    with pytest.raises(StepError, match='smaller step'):
        sim.step(50)
    assert sim.step_index > 0 or same(before, sim.sample())


def test_keywords_override_the_scene() -> None:
    sim = Simulation(load_scene('slider_crank'), step=5e-4, penalty=1e7, iterations=4)
    assert (sim.h, sim.solver.penalty, sim.solver.iterations) == (5e-4, 1e7, 4)
    with pytest.raises(InputError, match="did you mean 'rk4'"):
        Simulation(load_scene('slider_crank'), integrator='rk5')
    with pytest.raises(InputError):
        Simulation(load_scene('slider_crank'), step=-1.0)


def test_samples_keep_their_instant_and_are_read_only() -> None:
    sim = Simulation(load_scene('slider_crank'))
    early = sim.sample()
    sim.apply_effort('crank_pin', 3.0)
    sim.step(500)
    assert early.t == 0.0 and early.points['B'][0] == pytest.approx(np.sqrt(2.0))
    assert early.joints['crank_pin'].effort == 0.0
    with pytest.raises(ValueError, match='read-only'):
        early.q[0] = 0.0


def test_what_is_too_stiff_for_an_adaptive_step_says_so_and_keeps_the_state() -> None:
    """The step fails with a message: it does not run for hours."""
    source = {
        'mechanism': 'double_pendulum',
        'effects': {
            'gravity': {'acceleration': [0, -9.81]},
            'torsion_spring': {'joint': 'elbow', 'stiffness': 1e9},
        },
        'initial': {'velocities': {'A': [0, 1], 'B': [-1, 1]}},
    }
    simulation = Simulation(load_scene(source), integrator='dop853_adaptive', step=1e3)
    before = simulation.sample().q
    with pytest.raises(
        StepError, match='20000 steps within one because of the stiff effect torsion_spring'
    ):
        simulation.step(1)
    assert np.array_equal(simulation.sample().q, before)
    short = Simulation(load_scene(source), integrator='dop853_adaptive', step=1e-2)
    short.step(1)


@pytest.mark.parametrize('name', ['spatial_four_bar', 'four_bar', 'change_point'])
def test_a_scene_that_says_nothing_of_its_solver_holds_a_micrometre(name: str) -> None:
    said, down = load_scene(name), [0.0, -9.81, 0.0]
    positions = {point: list(at) for point, at in said.positions.items()}
    velocities = {point: list(at) for point, at in said.velocities.items()}
    scene = load_scene(
        {
            'mechanism': name,
            'effects': {'gravity': {'acceleration': down[: said.mechanism.dimension]}},
            'initial': {'positions': positions, 'velocities': velocities},
        }
    )
    sim = Simulation(scene)
    fine = Simulation(scene, integrator='dop853_adaptive', tolerance=1e-12, step=0.1)
    assert sim.solver == UNSAID
    for one, two in zip(sim.run(5.0, every=100), fine.run(5.0), strict=True):
        assert one.q == pytest.approx(two.q, abs=1e-6)
    # whoever says something gets the defaults of the table for the rest
    assert Simulation(scene, step=5e-3).solver == Solver(step=5e-3)
    assert Simulation(scene, formulation='penalty').solver == Solver(formulation='penalty')
