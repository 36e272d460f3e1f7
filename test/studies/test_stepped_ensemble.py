"""Ensembles in a loop: each member has the bits of a simulation with the same inputs."""

from __future__ import annotations

import copy
import pickle
import threading
from typing import Any

import numpy as np
import pytest

from alf_ros import BusyError, Ensemble, InputError, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.scene.overrides import with_changes
from alf_ros.studies.ensemble.distributions import uniform
from alf_ros.studies.ensemble.study_reading import study_of

pytestmark = pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')

CRANK: dict[str, Any] = {'efforts': ['crank_pin'], 'step': 2e-3, 'integrator': 'rk4'}


def numbers(simulation: Simulation) -> Floats:
    sample = simulation.sample()
    return np.concatenate([sample.joint_positions, sample.joint_velocities])


def test_members_have_the_bits_of_simulations_with_the_same_efforts():
    efforts = np.random.default_rng(3).normal(0.0, 5.0, (30, 11, 1))
    ensemble = Ensemble('slider_crank', 11, steps=4, **CRANK)
    seen = np.array([ensemble.step(each) for each in efforts])
    assert seen.shape == (30, 11, 6) and not ensemble.failed
    for k in (0, 4, 10):
        alone = Simulation(load_scene('slider_crank'), step=2e-3, integrator='rk4')
        for effort, row in zip(efforts[:, k, 0].tolist(), seen[:, k], strict=True):
            alone.apply_effort('crank_pin', effort)
            alone.step(4)
            assert numbers(alone).tobytes() == row.tobytes()
        member = ensemble.simulation(k)
        assert member.state.q.tobytes() == alone.state.q.tobytes()
        assert member.evaluations == alone.evaluations
        # also what depends on forces, and what comes next
        forces = [each.sample().reactions['knee'].force for each in (member, alone)]
        assert forces[0].tobytes() == forces[1].tobytes()
        member.step(5)
        alone.step(5)
        assert member.state.qd.tobytes() == alone.state.qd.tobytes()
    assert ensemble.t.tolist() == [0.24] * 11


def test_members_with_other_numbers():
    vary = {'coupler.mass': uniform(0.5, 2.0), 'm': uniform(0.9, 1.1)}
    ensemble = Ensemble('slider_crank', 10, vary=vary, seed=4, steps=50, **CRANK)
    seen = ensemble.step(np.full((10, 1), 0.25))
    study = study_of('slider_crank', vary, members=10, seed=4)
    for k in range(10):
        scene = with_changes(load_scene('slider_crank'), study.samples.values(k))
        alone = Simulation(scene, step=2e-3, integrator='rk4')
        alone.apply_effort('crank_pin', 0.25)
        alone.step(50)
        assert numbers(alone).tobytes() == seen[k].tobytes()


def test_efforts_in_space():
    """Three motors of a delta robot, as efforts, on members that stand differently."""
    joints = [f'motor_{k}' for k in '123']
    scene = load_scene('delta_robot')
    names = [n for n in Simulation(scene).model.coordinate_names if n in joints]
    joints = names or list(Simulation(scene).model.coordinate_names[:3])
    ensemble = Ensemble(scene, 3, efforts=joints, steps=10, step=2e-3, integrator='rk4')
    efforts = np.random.default_rng(1).normal(0.0, 1.0, (4, 3, 3))
    for each in efforts:
        seen = ensemble.step(each)
    alone = Simulation(scene, step=2e-3, integrator='rk4')
    for each in efforts[:, 1]:
        for joint, effort in zip(joints, each.tolist(), strict=True):
            alone.apply_effort(joint, effort)
        alone.step(10)
    assert numbers(alone).tobytes() == seen[1].tobytes()


def test_single_members_are_reset():
    ensemble = Ensemble('slider_crank', 9, steps=5, **CRANK)
    begin = ensemble.observe()
    first = ensemble.step(np.ones((9, 1)))
    second = ensemble.step()
    assert second[0].tolist() != first[0].tolist()
    seen = ensemble.reset(np.arange(9) % 4 == 0)
    assert np.array_equal(seen[::4], begin[::4])
    assert np.array_equal(seen[1:4], second[1:4])
    assert ensemble.efforts[:, 0].tolist() == [0, 1, 1, 1, 0, 1, 1, 1, 0]
    again = ensemble.step(np.ones((9, 1)))
    assert np.array_equal(again[::4], first[::4])
    assert np.array_equal(ensemble.reset(), begin)
    assert np.array_equal(ensemble.reset(3), begin)


def by_pickle(ensemble: Ensemble) -> Ensemble:
    read: Ensemble = pickle.loads(pickle.dumps(ensemble))
    return read


@pytest.mark.parametrize('copied', [copy.copy, copy.deepcopy, by_pickle])
def test_a_copy_moves_by_itself(copied: Any) -> None:
    vary = {'m': uniform(0.9, 1.1)}
    one, other = (Ensemble('slider_crank', 9, vary=vary, steps=5, **CRANK) for _ in range(2))
    for each in (one, other):
        each.step(np.ones((9, 1)))
        each.reset(2)
    split = copied(one)
    assert np.array_equal(split.step(np.full((9, 1), 50.0)), other.step(np.full((9, 1), 50.0)))
    assert one.t.tolist() == [0.01, 0.01, 0.0, *[0.01] * 6]
    assert split.t.tolist() == other.t.tolist() == [0.02, 0.02, 0.01, *[0.02] * 6]
    other.reset()
    other.step(np.ones((9, 1)))
    other.reset(2)
    assert np.array_equal(one.step(), other.step())  # which the efforts of the copy did not reach
    assert np.array_equal(split.reset(), other.reset())


@pytest.mark.parametrize('copied', [copy.copy, copy.deepcopy, by_pickle])
def test_a_copy_resets_members_and_pushes_them_again(copied: Any) -> None:
    efforts = np.array([[1.0], [0.0], [-2.0]])
    ensemble = Ensemble('slider_crank', 3, steps=4, **CRANK)
    first = ensemble.step(efforts)
    other = copied(ensemble)
    other.reset([0, 2])
    seen = other.step(efforts)
    assert np.array_equal(seen[[0, 2]], first[[0, 2]])
    assert np.array_equal(seen[1], ensemble.step(efforts)[1])


def test_points_are_observed_too():
    names = ['points.B.x', 'velocities.A.y', 'joints.guide.position']
    ensemble = Ensemble('slider_crank', 2, observations=names, step=2e-3, integrator='rk4')
    seen = ensemble.step()
    sample = ensemble.simulation(1).sample()
    expected = sample.points['B'][0], sample.velocities['A'][1], sample.joint_positions[-1]
    assert seen[1].tolist() == list(expected)


@pytest.mark.parametrize(
    ('scene', 'effort'), [('delta_robot_controlled', 'motor0'), ('spring_leg', 'knee')]
)
@pytest.mark.filterwarnings('error')
def test_numbers_of_effects_that_are_infinite_stay(scene: str, effort: str) -> None:
    ensemble = Ensemble(scene, 2, efforts=[effort])
    infinite = np.isinf(ensemble._params)
    assert infinite.any()
    ensemble.step(np.zeros((2, 1)))
    assert (np.isinf(ensemble._params) == infinite).all()


def test_a_member_that_fails_waits_until_it_is_reset():
    """Efforts that tear at one member until its steps are too long for it."""
    ensemble = Ensemble('slider_crank', 9, steps=50, **CRANK)
    efforts = np.zeros((9, 1))
    efforts[5] = 1e9
    for _ in range(4):
        ensemble.step(efforts)
    assert list(ensemble.failed) == [5] and 't = ' in ensemble.failed[5]
    stands = ensemble.t[5]
    ensemble.step(np.zeros((9, 1)))
    assert ensemble.t[5] == stands < ensemble.t[4]
    ensemble.reset([5])
    ensemble.step()
    assert not ensemble.failed and ensemble.t[5] == 0.1


@pytest.mark.parametrize(
    ('settings', 'said'),
    [
        ({'members': 0}, 'members'),
        ({'members': 10**9}, 'members'),
        (
            {'members': 2, 'efforts': ['crank']},
            "efforts: unknown joint, got 'crank'; did you mean",
        ),
        ({'members': 2, 'observations': ['points.B.z']}, 'points.B'),
        ({'members': 2, 'steps': 0}, 'steps'),
        ({'members': 2, 'seed': 5}, '^seed: nothing is drawn.*expected vary'),
        ({'members': 2, 'seed': np.zeros(3)}, '^seed: nothing is drawn.*expected vary'),
        ({'members': 2, 'sampling': 'sobol'}, '^sampling: nothing is drawn'),
        ({'members': 2, 'sampling': ''}, '^sampling: nothing is drawn'),
        ({'members': 2, 'sampling': np.zeros(3)}, '^sampling: nothing is drawn'),
        (
            {'members': 2, 'integrator': 'esdirk43'},
            "^integrator: member 0: only explicit .*'esdirk43'$",
        ),
        ({'members': 2, 'watch': True}, '^scene: member 0: a watched run,'),
        (
            {'vary': {'solver.step': [1e-3, 2e-3]}, 'sampling': 'table'},
            '^vary: not of one step and integrator$',
        ),
        (
            {'vary': {'solver.step': [1e-3, 2e-3]}, 'sampling': 'table', 'step': 1e-3},
            '^step: varied too, got 0.001$',
        ),
    ],
)
def test_refusals(settings, said):
    with pytest.raises(InputError, match=said):
        Ensemble('slider_crank', **settings)


def test_inputs_of_another_shape_change_nothing() -> None:
    ensemble = Ensemble('slider_crank', 3, **CRANK)
    arrays = np.zeros(3), np.zeros((3, 2)), np.zeros((3, 1), complex)
    days = np.full((3, 1), np.datetime64('2020-01-01'))
    others = [['1']] * 3, [[0.0], [np.nan], [0.0]], [[1j]] * 3, 'x', [[0.0], []]
    objects = np.array([['1'], [2], [3]], dtype=object), [[10**400]] * 3
    for wrong in (*arrays, days, np.ma.masked_all((3, 1)), *others, *objects):
        with pytest.raises(InputError):
            ensemble.step(wrong)
    for which in (3, 'x', [True], 1.5, [[0.5]]):
        with pytest.raises(InputError, match='which: '):
            ensemble.reset(which)
    assert ensemble.t.tolist() == [0.0, 0.0, 0.0]


def test_efforts_are_held_until_others_are_given() -> None:
    ensemble = Ensemble('slider_crank', 2, **CRANK)
    with pytest.raises(ValueError, match='read-only'):
        ensemble.efforts[:] = 5.0
    ensemble.step(np.ones((2, 1)))
    assert ensemble.efforts.tolist() == [[1.0], [1.0]]


def test_two_threads_at_once_are_refused() -> None:
    """Steps of two threads mixed their members without a word."""
    ensemble = Ensemble('slider_crank', 64, steps=500, **CRANK)
    together, refused = threading.Barrier(2), []

    def steps() -> None:
        together.wait()
        for _ in range(4):
            try:
                ensemble.step()
            except BusyError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=steps) for _ in range(2)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    alone = Ensemble('slider_crank', 64, steps=500, **CRANK)
    for _ in range(8 - len(refused)):
        expected = alone.step()
    assert not ensemble.failed
    assert np.array_equal(ensemble.observe(), expected)


def test_steps_too_long_for_some_are_said():
    efforts = np.array([[0.0], [200.0], [1.0]])
    ensemble = Ensemble('slider_crank', 3, steps=60, **{**CRANK, 'step': 5e-3})
    ensemble.step(efforts)
    said = ensemble.trouble
    assert list(said) == [1] and 'steps of 0.005 s are too long' in said[1]
    seen = ensemble.step(efforts)
    for k, (effort,) in enumerate(efforts.tolist()):
        alone = Simulation(load_scene('slider_crank'), step=5e-3, integrator='rk4')
        alone.apply_effort('crank_pin', effort)
        alone.step(60)
        assert alone.sample().diagnostics.trouble == said.get(k, '')
        alone.step(60)
        assert numbers(alone).tobytes() == seen[k].tobytes()
    ensemble.reset([1])
    assert not ensemble.trouble
