"""An accuracy in metres: kept against exact motions, honest where it cannot be, repeatable."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.scene import Solver, joined, scene_from_text
from alf_ros.simulation import setup as settings
from alf_ros.studies.exact import motions
from alf_ros.studies.exact.motions import ExactMotion
from support.effect_scenes import MASS
from support.thorough import LONG, combined

MOTIONS = [
    motions.paper('slider_crank'),
    motions.paper('double_four_bar'),
    motions.change_point(),
    motions.four_bars(10),
]


def farthest(simulation: Simulation, motion: ExactMotion) -> float:
    """The largest distance of a point from where it truly is, m."""
    found = np.array([s.q for s in simulation.run(motion.times[-1], at=motion.times)])
    apart = (found - motion.exact()).reshape(len(found), -1, 2)
    return float(np.linalg.norm(apart, axis=2).max())


@pytest.mark.parametrize(
    ('motion', 'accuracy', 'step'),
    combined(
        [pytest.param(motion, id=motion.mechanism) for motion in MOTIONS],
        [pytest.param(accuracy, id=f'{accuracy:g}') for accuracy in (1e-3, 1e-6, 1e-9)],
        [pytest.param(step, id=f'{step:g}') for step in (1e-3, 0.05)],
    ),
)
def test_the_true_error_is_below_what_was_asked(
    motion: ExactMotion, accuracy: float, step: float
) -> None:
    simulation = Simulation(motion.scene(), accuracy=accuracy, step=step)
    budget = simulation.accuracy
    assert budget is not None and budget.met and budget.asked == accuracy
    assert budget.estimate <= accuracy and budget.horizon == pytest.approx(10.0)
    error = farthest(simulation, motion)  # within the horizon
    assert error < accuracy
    assert error < 2.0 * budget.estimate
    assert simulation.h == step and simulation.solver.accuracy == accuracy


def test_the_fewest_evaluations_are_picked() -> None:
    """A fine grid is kept with rk4, a coarse one with dop853; else there is a tolerance."""
    scene = load_scene('slider_crank')
    picked = [
        Simulation(scene, accuracy=accuracy, step=step).solver.integrator
        for accuracy, step in ((1e-6, 1e-3), (1e-3, 0.05), (1e-6, 0.05))
    ]
    assert picked == ['rk4', 'dop853', 'dop853_adaptive']
    tolerances = [
        Simulation(scene, accuracy=accuracy, step=0.05).solver.tolerance
        for accuracy in (1e-5, 1e-7, 1e-9)
    ]
    assert tolerances == sorted(tolerances, reverse=True) and len(set(tolerances)) == 3


@pytest.mark.parametrize(('stiffness', 'picked'), [(30, 'dop853'), (1e9, 'esdirk43_adaptive')])
def test_what_is_stiff_is_left_to_the_implicit_method(stiffness: float, picked: str) -> None:
    """A mass of 2 kg swings on a spring."""
    spring = f'{{between: [O, P], stiffness: {stiffness}, free_length: 1}}'
    damper = f'{{between: [O, P], damping: {0.1 * stiffness**0.5}}}'
    gravity = '{acceleration: [0, -9.81]}'
    effects = f'effects: {{gravity: {gravity}, spring: {spring}, damper: {damper}}}'
    scene = scene_from_text(f'{MASS}\n{effects}\n')
    simulation = Simulation(scene, accuracy=1e-4, step=0.05)
    assert simulation.solver.integrator == picked
    budget = simulation.accuracy
    assert budget is not None and budget.met
    exact = Simulation(scene, integrator='dop853_adaptive', step=0.05, tolerance=1e-10)
    error = 0.0
    for _ in range(min(60 if LONG else 20, round(budget.horizon / 0.05))):
        simulation.step()
        exact.step()
        apart = simulation.sample().points['P'] - exact.sample().points['P']
        error = max(error, float(np.linalg.norm(apart)))
    assert error < 1e-4


def test_it_says_when_it_cannot_be_met() -> None:
    simulation = Simulation(load_scene('slider_crank'), accuracy=1e-14, step=0.01)
    budget = simulation.accuracy
    assert budget is not None and not budget.met
    assert 1e-14 < budget.estimate < 1e-8  # about the best there is
    assert farthest(simulation, MOTIONS[0]) < budget.estimate


def test_a_force_that_jumps_does_not_end_what_is_compared() -> None:
    """A mass swings through the place where its spring has no direction: no step across it is
    small enough for the tolerance of the first comparison."""
    spring = '{between: [O, P], stiffness: 50, free_length: 0.4}'
    scene = scene_from_text(f'{MASS}\neffects: {{spring: {spring}}}\n')
    simulation = Simulation(scene, accuracy=1e-6, step=0.01)
    budget = simulation.accuracy
    assert budget is not None and budget.met and budget.horizon == pytest.approx(10.0)
    quarter = math.acos(-0.4 / 0.6) / 5.0  # s from x = 1 to 0, at a rate of 5/s
    for sample in simulation.run(3.0, every=50):
        turn, since = divmod(sample.t + quarter, 2.0 * quarter)
        x = (-1.0) ** turn * (0.4 + 0.6 * math.cos(5.0 * (since - quarter)))
        assert sample.points['P'][0] == pytest.approx(x, abs=1e-6)


def test_nothing_that_runs_is_nothing_that_is_met() -> None:
    """A start from which no step can be made: infinite, for no time at all."""
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                'bodies': {'rod': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'}},
                'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
            },
            'effects': {'joint_effort': {'joint': 'pin', 'effort': 1e39}},
        }
    )
    budget = Simulation(scene, accuracy=1e-6).accuracy
    assert budget is not None and not budget.met
    assert budget.estimate == math.inf and budget.horizon == 0.0


def test_a_large_mechanism_is_looked_at_for_a_shorter_time() -> None:
    scene = load_scene('n_four_bar', {'N': 1000})
    budget = Simulation(scene, accuracy=1e-3, step=1e-3).accuracy
    assert budget is not None and budget.met and 0.1 < budget.horizon < 9.0


def test_what_is_picked_is_repeated_bit_for_bit_without_trying_again() -> None:
    scene = load_scene('double_four_bar')
    first, again = (Simulation(scene, accuracy=1e-9, step=0.05) for _ in range(2))
    assert first.solver == again.solver and first.accuracy == again.accuracy
    assert first.solver.integrator == 'dop853_adaptive'
    logged = Simulation(scene, **dataclasses.asdict(first.solver))  # as a log has it
    assert logged.solver == first.solver and logged.accuracy is None
    for simulation in (first, logged):
        simulation.step(100)
    assert first.state.q.tobytes() == logged.state.q.tobytes()


def asking(solver: str = '{accuracy: 1e-6, step: 0.02}') -> str:
    return f'mechanism: slider_crank\ninitial: {{velocities: {{B: [-4, 0]}}}}\nsolver: {solver}\n'


def test_a_scene_asks_for_it() -> None:
    scene = scene_from_text(asking())
    assert scene.solver.accuracy == 1e-6
    again = scene_from_text(scene.text)
    assert again.solver == scene.solver and again.text == scene.text
    assert 'tolerance' not in scene.text.partition('solver:')[2]
    simulation = Simulation(scene)
    assert simulation.accuracy is not None and simulation.accuracy.met
    assert simulation.solver == Simulation(again).solver
    # an integrator or a tolerance of the caller ends it; another step does not
    for given in ({'integrator': 'rk4'}, {'tolerance': 1e-5}, {'formulation': 'alf1'}):
        other = Simulation(scene, **given)
        assert other.accuracy is None and other.solver.accuracy is None
    finer = Simulation(scene, step=0.01).accuracy
    assert finer is not None and finer.solver.step == 0.01


def test_scenes_that_do_not_ask_have_the_text_they_had() -> None:
    assert 'accuracy' not in load_scene('slider_crank').text


@pytest.mark.parametrize(
    ('solver', 'message'),
    [
        ('{accuracy: 1e-6, tolerance: 1e-9}', 'solver.tolerance: accuracy chooses it'),
        ('{accuracy: 1e-6, integrator: rk4}', 'solver.integrator: accuracy chooses it'),
        ('{accuracy: 1e-6, formulation: alf1}', 'solver.accuracy: only alf2 supports it'),
        ('{accuracy: 0}', 'solver.accuracy: not usable'),
        ('{accuracy: -1e-6}', 'solver.accuracy: not usable'),
        ('{acuracy: 1e-6}', "did you mean 'accuracy'"),
    ],
)
def test_what_a_scene_cannot_ask(solver: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        scene_from_text(asking(solver))
    assert caught.value.line == 3


def test_what_a_caller_cannot_ask() -> None:
    scene = load_scene('slider_crank')
    for given in ({'tolerance': 1e-9}, {'integrator': 'rk4'}, {'formulation': 'alf1'}):
        with pytest.raises(InputError, match='an accuracy picks'):
            Simulation(scene, accuracy=1e-6, **given)


def test_changes_of_a_scene_by_name() -> None:
    """Changes of `fork`: an accuracy discards a tolerance, a tolerance discards an accuracy."""
    scene = with_changes(load_scene('slider_crank'), {'solver.accuracy': '1e-5'})
    assert scene.solver.accuracy == 1e-5
    scene = with_changes(scene, {'solver.tolerance': '1e-5'})
    assert scene.solver.accuracy is None and scene.solver.tolerance == 1e-5


def test_changes_of_settings() -> None:
    before = dataclasses.asdict(Solver(accuracy=1e-6, integrator='dop853', step=2e-3))
    asked = joined(before, {'accuracy': 1e-3})
    assert asked['accuracy'] == 1e-3 and 'integrator' not in asked and asked['step'] == 2e-3
    assert 'tolerance' not in joined(before, {'step': 1e-3})  # picked anew
    ended = joined(before, {'tolerance': 1e-3})
    assert 'accuracy' not in ended and ended['integrator'] == 'dop853'


def test_a_change_while_it_runs_picks_again() -> None:
    setup = settings.made(load_scene('slider_crank'), {'accuracy': 1e-6, 'step': 0.05}, 20.0)
    setup.simulation.step(5)
    heavy = settings.changed(setup, {}, {'effects.gravity.acceleration': [0.0, -98.1]}, 20.0)
    (before, after) = (each.simulation.solver for each in (setup, heavy))
    assert after.accuracy == before.accuracy == 1e-6 and heavy.simulation.step_index == 5
    assert after != before  # with ten times the weight it is another motion
    fresh = Simulation(heavy.scene)  # what its own text asks for, from the start
    assert fresh.solver.accuracy is None
    assert after == Simulation(heavy.scene, accuracy=1e-6, step=0.05).solver
    same = settings.changed(setup, {}, {}, 10.0)
    assert same.simulation is setup.simulation
