"""The formulations for comparison: right where they work, and where they fail they say so."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from alf_ros import Scene, Simulation, kernel, load_scene
from alf_ros.arrays import Floats
from alf_ros.effects import contract
from alf_ros.errors import AlfError, InputError, StepError
from alf_ros.kernel import Phase
from alf_ros.model.compile import Model
from alf_ros.scene import scene
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation import formulations
from alf_ros.simulation import setup as settings
from alf_ros.simulation.formulations import Formulation
from alf_ros.studies.exact import motions
from support.effect_scenes import ROTOR

PENALTY = ('penalty', 'canonical')  # right up to 1/α
ITERATED = ('alf1', 'alf2_as_printed')
CLASSICAL = ('baumgarte', 'lagrange_canonical', 'independent')
NAMES = ('alf2', *PENALTY, *ITERATED, *CLASSICAL)
GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}


def double_pendulum() -> Scene:
    """Two rods hanging from O, let go askew: two freedoms, and no singular position anywhere."""
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {
                    'O': {'at': [0, 0], 'fixed': True},
                    'A': {'at': [0.3, '-sqrt(1 - 0.3**2)']},
                    'B': {'at': [0.2, '-sqrt(1 - 0.3**2) - sqrt(1 - 0.1**2)']},
                },
                'bodies': {
                    'upper': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
                    'lower': {'points': ['A', 'B'], 'mass': 2, 'inertia': 'rod'},
                },
                'joints': {
                    'pin': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
                    'knee': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
                },
            },
            'effects': GRAVITY,
        }
    )


def parallelogram() -> Scene:
    """A bar on three parallel cranks, of which one is redundant."""
    points: dict[str, object] = {}
    bodies: dict[str, object] = {'bar': {'points': ['B0', 'B2', 'B1'], 'mass': 2, 'com': [1, 0]}}
    bodies['bar'] |= {'inertia': {'about_com': 1}}  # type: ignore[operator]
    joints: dict[str, object] = {}
    for k in range(3):
        points |= {f'A{k}': {'at': [k, 0], 'fixed': True}, f'B{k}': {'at': [k, 1]}}
        bodies[f'crank{k}'] = {'points': [f'A{k}', f'B{k}'], 'mass': 1, 'inertia': 'rod'}
        for end, pair in (('A', ['ground', f'crank{k}']), ('B', [f'crank{k}', 'bar'])):
            joints[f'pin_{end}{k}'] = {'type': 'revolute', 'between': pair, 'at': f'{end}{k}'}
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    initial = {'velocities': {'B0': [1, 0]}}
    return load_scene({'mechanism': mechanism, 'effects': GRAVITY, 'initial': initial})


def end(
    of: Scene, name: str, h: float, duration: float, **solver: object
) -> tuple[Floats, Floats]:
    """Return q and q̇ after a run."""
    sim = Simulation(of, formulation=name, step=h, **solver)  # type: ignore[arg-type]
    sim.step(round(duration / h))
    sample = sim.sample()
    return sample.q, sample.qd


# ------------------------------------------------------------------------------- where they work


@pytest.mark.parametrize('name', formulations.NAMES)
def test_agrees_with_alf2_away_from_singular_positions(name: str) -> None:
    """0.02 s of the crank-rocker, 1 s of a double pendulum."""
    for mechanism, h, duration in (
        (load_scene('four_bar'), 2e-4, 0.02),
        (double_pendulum(), 2e-3, 1.0),
    ):
        q, qd = end(mechanism, name, h, duration)
        exact, exact_rate = end(mechanism, 'alf2', h, duration, integrator='dop853')
        speed = np.abs(exact_rate).max()
        assert q == pytest.approx(exact, abs=1e-7)
        assert qd == pytest.approx(exact_rate, abs=1e-6 * speed)


@pytest.mark.parametrize('name', formulations.NAMES)
@pytest.mark.parametrize(('integrator', 'order', 'first'), [('rk4', 4, 50), ('dop853', 8, 8)])
def test_keeps_the_order_of_the_method(name: str, integrator: str, order: int, first: int) -> None:
    """Against its own motion with small steps; a penalty of 1e4 keeps rounding out of it."""
    options = {'penalty': 1e4, 'integrator': integrator}
    own, _ = end(double_pendulum(), name, 0.8 / (16 * first), 0.8, **options)
    steps = [0.8 / round(first * longer) for longer in (1, 1.4, 2, 2.8, 4)]
    errors = [
        np.abs(end(double_pendulum(), name, h, 0.8, **options)[0] - own).max() for h in steps
    ]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > order - 0.6


@pytest.mark.parametrize('name', PENALTY)
def test_penalty_alone_errs_as_one_over_alpha(name: str) -> None:
    exact, _ = end(double_pendulum(), 'alf2', 1e-3, 1.0, integrator='dop853')
    errors = [
        np.abs(end(double_pendulum(), name, 1e-3, 1.0, penalty=alpha)[0] - exact).max()
        for alpha in (1e3, 1e4, 1e5)
    ]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.1)


@pytest.mark.parametrize('name', ITERATED)
def test_iterations_remove_the_error_of_the_penalty(name: str) -> None:
    exact, _ = end(double_pendulum(), 'alf2', 1e-3, 1.0, integrator='dop853')
    alone, twice, more = (
        np.abs(end(double_pendulum(), name, 1e-3, 1.0, penalty=1e3, iterations=n)[0] - exact).max()
        for n in (1, 2, 10)
    )
    assert alone > 1e-4
    assert twice < 1e-2 * alone
    assert more < 1e-9


def test_one_iteration_is_the_penalty_method() -> None:
    for whole, alone in (('alf1', 'penalty'), ('alf2_as_printed', 'canonical')):
        one = end(double_pendulum(), whole, 1e-3, 0.1, iterations=1)
        assert np.array_equal(one, end(double_pendulum(), alone, 1e-3, 0.1))


def dense(sim: Simulation) -> tuple[Floats, Floats, Floats, Floats]:
    """M, Φ_q, Φ̇_q q̇ and Q of the present state, without the formulations' own code."""
    model, work, state = sim.model, sim._run.stepper.work, sim.state
    m, unit, rows = len(model.row_names), model.unit, model.system.rows
    M, phi_q = np.zeros((model.n, model.n)), np.zeros((m, model.n))
    kernel.jacobian(unit, rows, state.q, work.g, work.g2)
    for j in range(model.n):
        e, column, rate = np.zeros(state.q.size), np.zeros(model.n), np.zeros(m)
        e[j] = 1.0
        kernel.add_mass_times(unit, model.system.mass, 1.0, e, column)
        kernel.times_jacobian(unit, rows, work.g, work.g2, e, rate)
        M[:, j], phi_q[:, j] = column, rate
    curving, Q = np.zeros(m), np.zeros(state.q.size)
    kernel.jacobian_rate(unit, rows, state.qd, work.g2d)
    kernel.convective(unit, rows, work.g2d, state.qd, curving)
    kernel.applied_forces(
        sim._run.applied.assembled.effects, sim.t, state.q, state.qd, np.zeros(8), Q
    )
    return M, phi_q, curving, Q[: model.n]


def rates(model: Model, sim: Simulation) -> Floats:
    """The derivatives that the formulation found at the end of its last step."""
    assert sim._run.stepper.formulation is not None
    return sim._run.stepper.formulation._storage.k[: sim.state.carried.size]


@pytest.mark.parametrize('name', ['baumgarte', 'independent', 'alf1'])
def test_accelerations_are_those_of_the_dense_equations(name: str) -> None:
    """(4), (15) and (26) after some steps, against the equations solved as they stand."""
    sim = Simulation(load_scene('four_bar'), formulation=name, step=1e-4)
    sim.step(50)
    M, phi_q, curving, Q = dense(sim)
    m, n = phi_q.shape
    whole = np.block([[M, phi_q.T], [phi_q, np.zeros((m, m))]])
    phi = np.zeros(m)
    kernel.violation(sim.model.unit, sim.model.system.rows, sim.state.q, phi)
    asked = -curving - 20.0 * phi_q @ sim.state.qd[:n] - 100.0 * phi
    qdd = np.linalg.solve(whole, np.concatenate([Q, asked]))[:n]
    found = rates(sim.model, sim)
    assert found[:n] == pytest.approx(sim.state.qd[:n], abs=1e-13)
    if name == 'independent':
        assert sim._run.stepper.formulation is not None
        z = sim._run.stepper.formulation._storage.order[m:]
        assert found[n:] == pytest.approx(qdd[z], rel=1e-9)
    else:
        assert found[n:] == pytest.approx(qdd, abs=1e-6 * np.abs(qdd).max())


@pytest.mark.parametrize(
    ('name', 'solver'),
    [
        ('lagrange_canonical', {}),
        ('alf2_as_printed', {}),
        ('alf2_as_printed', {'penalty': 1e2, 'iterations': 3}),  # where each residual still counts
        ('canonical', {'penalty': 1e4}),
    ],
)
def test_momenta_are_those_of_the_canonical_equations(name: str, solver: dict[str, float]) -> None:
    """p = M q̇ + Φ_qᵀ σ (32) and ṗ = Q + Φ̇_qᵀ σ (35), the same σ in both, after it has grown."""
    sim = Simulation(load_scene('four_bar'), formulation=name, step=1e-4, **solver)  # type: ignore[arg-type]
    sim.step(50)
    M, phi_q, _, Q = dense(sim)
    m, n = phi_q.shape
    state, e = sim.state, 1e-6
    qd = state.qd[:n]
    sigma = np.linalg.lstsq(phi_q.T, state.carried[n : 2 * n] - M @ qd, rcond=None)[0]
    assert phi_q.T @ sigma == pytest.approx(state.carried[n : 2 * n] - M @ qd, abs=1e-7)
    assert np.abs(sigma).max() > 1e-3
    turned = []
    for s in (e, -e):  # Φ_q is linear in q
        near = Simulation(load_scene('four_bar'))
        near._run.present.phase.q[:] = state.q + s * state.qd
        turned.append(dense(near)[1])
    phi_q_dot = (turned[0] - turned[1]) / (2 * e)
    expected = Q + phi_q_dot.T @ sigma
    assert rates(sim.model, sim)[n : 2 * n] == pytest.approx(expected, rel=1e-4, abs=1e-6)


@contract.force
def turning(t, q, qd, near, slots, params, Q):
    Q[0] += math.cos(t)


@pytest.mark.parametrize('name', formulations.NAMES)
def test_forces_are_those_of_the_time_of_the_stage(name: str) -> None:
    """A free mass pushed by cos t, which no constraint holds, in two calls: x = 1 - cos t."""
    body = {'puck': {'points': ['P'], 'mass': 1, 'inertia': 'point'}}
    source = {'alf': 1, 'points': {'P': {'at': [0, 0]}}, 'bodies': body}
    sim = Simulation(load_scene({'mechanism': source}), formulation=name, step=0.01)
    none, nothing = sim._run.applied.assembled, np.zeros(1, dtype=np.uint64)
    effects = replace(
        none.effects,
        force=np.array([turning.address], dtype=np.uint64),
        potential=nothing,
        friction=nothing,
        slots_at=nothing,
        params_at=nothing,
        loads_at=nothing,
    )
    forces = replace(none, effects=effects)
    sim._run.applied.__dict__['assembled'] = forces
    sim.step(50)
    sim.step(150)
    sample = sim.sample()
    assert sample.q == pytest.approx([1.0 - math.cos(2.0), 0.0], abs=1e-9)
    assert sample.qd == pytest.approx([math.sin(2.0), 0.0], abs=1e-9)


# ------------------------------------------------------------------------------- where they fail


@pytest.mark.parametrize('name', CLASSICAL)
@pytest.mark.parametrize('mechanism', ['slider_crank', 'double_four_bar'])
def test_classical_matrices_are_singular_in_a_singular_position(name: str, mechanism: str) -> None:
    """6.1: started in it, no step can be taken, and the state stays what it was."""
    sim = Simulation(motions.start(mechanism, 0.0, -2.0).scene(), formulation=name)
    before = sim.state
    with pytest.raises(StepError, match='alf2') as caught:
        sim.step(10)
    what = 'independent coordinates' if name == 'independent' else 'the classical matrix'
    assert what in caught.value.reason
    assert sim.step_index == 0
    assert np.array_equal(sim.state.q, before.q) and np.array_equal(sim.state.qd, before.qd)


@pytest.mark.parametrize('name', ['alf2', *ITERATED])
def test_augmented_ones_go_on_from_it(name: str) -> None:
    motion = motions.start('slider_crank', 0.0, -2.0)
    q, _ = end(motion.scene(), name, 1e-3, 3.0)
    assert q == pytest.approx(motion.exact()[-1], abs=1e-6)


def test_redundant_rows_are_singular_for_the_classical_matrix_only() -> None:
    wanted, _ = end(parallelogram(), 'alf2', 1e-3, 0.5, integrator='dop853')
    for name in formulations.NAMES:
        sim = Simulation(parallelogram(), formulation=name)
        if name in ('baumgarte', 'lagrange_canonical'):
            with pytest.raises(StepError, match='the classical matrix .* is singular here'):
                sim.step()
        else:
            sim.step(500)
            assert sim.sample().q == pytest.approx(wanted, abs=1e-6), name


def test_independent_coordinates_do_not_outlast_a_turn_of_the_crank() -> None:
    """No singular position in it, but each coordinate of a crank turns back twice in a turn."""
    sim = Simulation(load_scene('four_bar'), formulation='independent')
    with pytest.raises(StepError, match='independent coordinates.* chosen at the start'):
        sim.step(round(0.25 / sim.h))
    last = sim.sample()
    assert 0.0 < last.t < 0.25
    assert last.diagnostics.position_violation < 1e-12
    again = Simulation(load_scene('four_bar'))
    again.step(sim.step_index)
    assert last.q == pytest.approx(again.sample().q, abs=1e-3)


@pytest.mark.parametrize('name', formulations.NAMES)
def test_a_general_passage_loses_all_but_alf2(name: str) -> None:
    """Six chance steps through 4 change points: alf2 within its h⁴ in all, the others not."""
    motion = motions.change_point()
    exact = motion.exact()[-1]
    errors = []
    for odd in (0.0, 0.13, 0.26, 0.39, 0.52, 0.65):
        h = 4.0 / round(4.0 * (2 + odd) / 5e-3)
        assert end(motion.scene(), 'alf2', h, 4.0)[0] == pytest.approx(
            exact, abs=1e6 * h**4 + 5e-8
        )
        try:
            errors.append(np.abs(end(motion.scene(), name, h, 4.0)[0] - exact).max())
        except StepError:
            errors.append(np.inf)
    assert max(errors) > 1e-3


def test_what_runs_away_is_stopped() -> None:
    """The penalty method in the slider-crank: constraints that open end the run, not nan. At which
    passage is chance."""
    sim = Simulation(load_scene('slider_crank'), formulation='penalty')
    with pytest.raises(
        StepError, match='have opened; take a smaller step, or the formulation alf2'
    ):
        sim.step(30_000)
    sample = sim.sample()
    assert 0.9 < sample.t < 30.0
    assert np.isfinite(sample.qd).all()
    assert sample.diagnostics.position_violation < 0.2


@pytest.mark.parametrize('name', formulations.NAMES)
def test_what_is_no_longer_finite_is_stopped(name: str) -> None:
    sim = Simulation(double_pendulum(), formulation=name)
    sim.step(5)
    sim.apply_wrench('B', force=[1e308, 1e308])
    with pytest.raises(StepError, match='alf2'):
        sim.step(5)
    assert sim.step_index == 5
    assert all(np.isfinite(part).all() for part in (sim.state.q, sim.state.qd, sim.state.carried))


# ------------------------------------------------------------------------------------------ states


@pytest.mark.parametrize('name', formulations.NAMES)
def test_a_restored_run_repeats_bit_for_bit(name: str) -> None:
    sim = Simulation(double_pendulum(), formulation=name)
    sim.step(100)
    middle = sim.state
    sim.step(100)
    sim.sample()
    whole = sim.state
    other = Simulation(double_pendulum(), formulation=name)
    other.step(3)
    other.restore(middle)
    other.step(37)
    list(other.run(0.0, at=[other.t, other.t + 0.3e-3]))  # looking aside changes nothing
    other.step(63)
    for part in ('q', 'qd', 'carried', 'turns'):
        assert np.array_equal(getattr(other.state, part), getattr(whole, part)), part


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('table', ['pulse', 'jump'])
def test_a_table_acts_row_by_row(table: str, name: str) -> None:
    """Between two stages, or with a torque that jumps on the grid; in one call or in many."""
    J, h, T = 0.5, 0.01, 1.0
    if table == 'pulse':  # 0.25 N m s within 0.1 ms
        effects = 'user_table: {joint: pin, table: [[0.6037, 0], [0.60375, 5000], [0.6038, 0]]}'
        place, rate = 0.25 / J * (T - 0.60375), 0.25 / J
    else:  # the torque is 2 times the rate of the target: 1 N m from 0.29 s to 0.58 s
        rows = '[[0, 0], [0.29, 0], [0.58, 0.145], [1, 0.145]]'
        effects = f'motor: {{joint: pin, position: {rows}, position_gain: 1e-9, velocity_gain: 2}}'
        speed = 0.5 * (1.0 - math.exp(-2.0 / J * 0.29))
        rate = speed * math.exp(-2.0 / J * 0.42)
        place = 0.145 - J / 2.0 * rate
    of = scene_from_text(f'{ROTOR}\neffects: {{{effects}}}\n')
    one, many = (Simulation(of, formulation=name, step=h, integrator='dop853') for _ in range(2))
    one.step(100)
    for _ in range(100):
        many.step(1)
    found = one.sample().joints['pin']
    assert found.velocity == pytest.approx(rate, abs=1e-7)
    assert found.position == pytest.approx(place, abs=1e-7)
    assert one.state.q.tobytes() == many.state.q.tobytes()
    assert one.state.carried.tobytes() == many.state.carried.tobytes()


@pytest.mark.parametrize('name', NAMES[1:])
def test_a_step_that_fails_behind_a_row_is_not_taken(name: str) -> None:
    """A torque that no step can follow, in the second piece of a step: the state stays."""
    table = '[[0, 1], [0.1034, 1], [0.10341, 1e40], [1, 1e40]]'
    of = scene_from_text(f'{ROTOR}\neffects: {{user_table: {{joint: pin, table: {table}}}}}\n')
    before, after = (Simulation(of, formulation=name, step=0.01) for _ in range(2))
    before.step(10)
    with pytest.raises(StepError):
        after.step(20)
    assert after.step_index == 10
    for each in ('q', 'qd', 'carried'):
        assert getattr(after.state, each).tobytes() == getattr(before.state, each).tobytes()


@pytest.mark.parametrize('name', formulations.NAMES)
def test_forces_from_outside_and_turns_are_counted(name: str) -> None:
    """An effort drives a pendulum round: the effort does work, and the joint's angle passes π."""
    source = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0, -1]}},
        'bodies': {'rod': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
    }
    sim = Simulation(load_scene({'mechanism': source}), formulation=name)
    sim.apply_effort('pin', 1.0)
    seconds = 0.7 if name == 'independent' else 3.0  # θ = 3 t² / 2
    sim.step(round(seconds / sim.h))
    joint = sim.sample().joints['pin']
    assert joint.position == pytest.approx(1.5 * seconds**2 - math.pi / 2, abs=1e-6)
    assert joint.velocity == pytest.approx(3.0 * seconds, abs=1e-6)


# ------------------------------------------------------------------------------------------- input


@pytest.mark.parametrize('after', NAMES)
@pytest.mark.parametrize('before', NAMES)
def test_a_run_goes_on_with_another_formulation_or_is_refused(before: str, after: str) -> None:
    """As many numbers were enough: momenta were taken for velocities, without a word."""
    setup = settings.made(double_pendulum(), {'formulation': before, 'step': 1e-3}, 100.0)
    setup.simulation.step(100)
    try:
        changed = settings.changed(setup, {'formulation': after}, {}, 100.0)
    except InputError as error:
        assert f'cannot go on from a state of {before}, which holds other numbers' in str(error)
        assert setup.simulation.solver.formulation == before != after
        return
    for simulation in (setup.simulation, changed.simulation):
        simulation.step(100)
    found, wanted = (each.simulation.sample().points['B'] for each in (changed, setup))
    assert found == pytest.approx(wanted, abs=1e-6)


def test_names_are_those_of_the_solver() -> None:
    assert scene.FORMULATIONS == ('alf2', *formulations.NAMES)
    with pytest.raises(InputError, match="did you mean 'baumgarte'"):
        Simulation(load_scene('slider_crank'), formulation='baumgart')


@pytest.mark.parametrize('name', formulations.NAMES)
def test_adaptive_steps_are_refused(name: str) -> None:
    with pytest.raises(InputError, match='fixed steps only.*expected rk4 or dop853') as caught:
        Simulation(load_scene('slider_crank'), formulation=name, integrator='dop853_adaptive')
    assert name in str(caught.value) and isinstance(caught.value, AlfError)


@pytest.mark.parametrize(
    ('name', 'left'),
    [
        ('baumgarte', 3.0),  # Φ̈ + 2ΩμΦ̇ + Ω²Φ = 0 from rest: (1 + Ωt) exp(-Ωt)
        ('alf1', 3.0),
        ('penalty', 3.0),
        ('alf2_as_printed', -1.0),  # Φ̇ + 2ΩμΦ + Ω²∫Φ = 0: (1 - Ωt) exp(-Ωt)
        ('canonical', -1.0),
    ],
)
def test_omega_and_mu_close_what_stands_open(name: str, left: float) -> None:
    """Ω = 5 1/s, μ = 1; after 0.4 s."""
    sim = Simulation(double_pendulum(), integrator='rk4')
    state = sim.state
    q, qd, turns = state.q.copy(), np.zeros_like(state.qd), state.turns.copy()
    q[0] += 1e-3
    solver = replace(sim.solver, formulation=name)
    formulation = Formulation(sim.model, solver, q, omega=5.0, mu=1.0)
    phase = Phase(q, qd, turns, np.zeros(1), np.zeros(0))
    y = formulation.start(q, qd)

    def opening() -> Floats:
        phi = np.zeros(len(sim.model.row_names))
        kernel.violation(sim.model.unit, sim.model.system.rows, q, phi)
        return phi

    before = opening()
    formulation.advance(
        sim._run.applied.assembled, sim._run.stepper.work, phase, y, 0.0, 0, 400, 1e-3
    )
    wanted = left * math.exp(-2.0) * before
    assert opening() == pytest.approx(wanted, abs=1e-4 * np.abs(before).max())


def test_an_old_name_stays_valid_in_files() -> None:
    scene = load_scene('four_bar')
    old = Simulation(scene, formulation='alf2_literal')
    new = Simulation(scene, formulation='alf2_as_printed')
    assert old.solver == new.solver
    source = {'mechanism': 'four_bar', 'solver': {'formulation': 'alf2_literal'}}
    assert load_scene(source).solver.formulation == 'alf2_as_printed'
