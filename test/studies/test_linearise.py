"""Linear models against closed forms, and about moving instants against differences."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from alf_ros import InputError, Simulation, equilibrium, linearise, load_scene, modes
from alf_ros.arrays import Floats
from alf_ros.model import assembly
from support.statics_scenes import GRAVITY, KNOWN, chain, redundant_parallelogram, sprung


def accelerations(simulation: Simulation, model: Any, step: Floats, speed: Floats) -> Floats:
    """(f,) ν̇ beside the present: closed and completed by the assembly, accelerated by a sample."""
    own, state, t = simulation.model, simulation.state, simulation.t
    Y = model.directions
    D, points = own.layout.dimension, sum(not p.fixed for p in own.mechanism.points)
    blocks = np.empty((len(Y), own.layout.movable, D))
    ordered = Y.reshape(len(Y), -1, D).copy()
    ordered[:, points:] *= own.layout.length
    blocks[:, own.coordinate_block] = ordered
    along = blocks.reshape(len(Y), -1)
    q, qd = np.array(state.q), np.array(state.qd)
    q[: own.n] += step @ along
    q = assembly.close(own, {}, q)
    qd[: own.n] += speed @ along
    qd = assembly.complete(own, q, {}, t, near=qd)
    sample = simulation._sample(t, replace(state, q=q, qd=qd), False)
    qdd = np.array(sample.qdd).reshape(-1, D)
    qdd[points:] *= own.layout.length
    whole = np.empty((own.layout.movable, D))
    whole[own.coordinate_block] = qdd
    from alf_ros.studies.statics.sparse_rows import mass_matrix

    return np.asarray(along @ (mass_matrix(own) @ whole.ravel()))


DAMPED: dict[str, Any] = {
    'mechanism': 'four_bar',
    'effects': {
        **GRAVITY,
        'spring': {'between': ['A', 'C'], 'stiffness': 50.0, 'free_length': 0.1},
        'damper': {'between': ['B', 'ground'], 'at': [None, [0.1, 0.4]], 'damping': 3.0},
    },
    'initial': {'velocities': {'A': ['-3*a*sin(theta)', '3*a*cos(theta)']}},
}
DRIVEN: dict[str, Any] = {
    'mechanism': 'double_pendulum',
    'effects': {
        **GRAVITY,
        'damper': {'between': ['B', 'ground'], 'at': [None, [0, -2]], 'damping': 1.0},
    },
    'drives': {'turn': {'joint': 'shoulder', 'angle': '0.5*t + sin(t)'}},
    'initial': {'velocities': {'B': [0.3, None]}},
}


@pytest.mark.parametrize('scene', [DAMPED, DRIVEN, 'bricard'], ids=['damped', 'driven', 'bricard'])
def test_about_a_moving_instant(scene: Any) -> None:
    simulation = Simulation(load_scene(scene))
    simulation.step(40)
    model = linearise(simulation)
    assert model.A.shape == (2, 2)
    h, found = 3e-5, np.zeros((1, 2))
    for k, away in enumerate(np.eye(2)):
        for n, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
            for sign in (1.0, -1.0):
                step, speed = sign * n * h * away[:1], sign * n * h * away[1:]
                value = accelerations(simulation, model, step, speed)
                found[:, k] += sign * weight / h * value
    np.testing.assert_allclose(model.A[1:], found, rtol=2e-7, atol=1e-6)
    np.testing.assert_allclose(model.A[0], [0.0, 1.0], atol=1e-12)
    assert model.drift[1] == pytest.approx(
        accelerations(simulation, model, np.zeros(1), np.zeros(1))[0], rel=1e-9
    )


@pytest.mark.parametrize('number', range(len(KNOWN['four_bar'])))
def test_eigenvalues_are_those_of_30_digits(number: int) -> None:
    known = KNOWN['four_bar'][number]
    near = {'A': [float(x) for x in known['points']['A']]}
    model = linearise(equilibrium(sprung('four_bar', near), nearest=True))
    square = float(known['square'])
    expected = np.sqrt(complex(-square))
    assert abs(model.eigenvalues[0] - expected) < 1e-10 * abs(expected)
    np.testing.assert_allclose(model.stiffness, [[square]], rtol=1e-10)
    assert model.is_stable is False  # without damping nothing decays


def test_inputs_and_outputs_of_a_damped_pendulum() -> None:
    """m l² θ̈ + c θ̇ + m g l θ = τ + l F, with l = 1 m, m = 1 kg."""
    friction = {'joint': 'j0', 'viscous': 0.4}
    scene = chain(1, {**GRAVITY, 'joint_friction': friction})
    names = ['joints.j0.effort', 'wrenches.P1.force.x', 'wrenches.b0.torque']
    outputs = ['j0.position', 'j0.velocity', 'points.P1.x', 'velocities.P1.x', 'j0.force']
    model = linearise(scene, inputs=names, outputs=outputs)
    assert model.inputs == tuple(names)
    assert model.input_units == ('N m', 'N', 'N m')
    assert model.outputs[-2:] == ('reactions.j0.force.x', 'reactions.j0.force.y')
    assert model.output_units[:4] == ('rad', 'rad/s', 'm', 'm/s')
    np.testing.assert_allclose(model.A, [[0.0, 1.0], [-9.81, -0.4]], atol=1e-10)
    sense = np.sign(model.C[0, 0])
    np.testing.assert_allclose(sense * model.B, [[0, 0, 0], [1, 1, 1]], atol=1e-11)
    np.testing.assert_allclose(sense * model.C[:4], [[1, 0], [0, 1], [1, 0], [0, 1]], atol=1e-10)
    np.testing.assert_allclose(model.D[:4], 0.0, atol=1e-12)
    # m ẍ = F + R_x of the tip, ẍ = -9.81 x - 0.4 ẋ + τ + F; the damper is on the axis
    np.testing.assert_allclose(sense * model.C[4], [-9.81, -0.4], atol=1e-8)
    np.testing.assert_allclose(model.D[4], [1.0, 0.0, 1.0], atol=1e-10)
    decay = 0.2 / np.sqrt(9.81)
    assert model.damping_ratios[0] == pytest.approx(decay, rel=1e-10)
    assert model.frequencies[0] == pytest.approx(np.sqrt(9.81) / (2.0 * np.pi), rel=1e-11)
    assert model.is_stable


@pytest.mark.parametrize(('mass', 'length'), [(1e9, 1e3), (1e-6, 1e-3), (1e-6, 1e3)])
def test_inputs_beside_large_and_small_loads(mass: float, length: float) -> None:
    """A rod, m l² / 3 θ̈ = τ + l F: the hinge carries what a force on the tip leaves."""
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'O': {'at': [0, 0], 'fixed': True}, 'P': {'at': [0, -length]}},
                'bodies': {'rod': {'points': ['O', 'P'], 'mass': mass, 'inertia': 'rod'}},
                'joints': {'hinge': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
            },
            'effects': {'gravity': {'acceleration': [3.0, -9.0]}},
        }
    )
    rest = equilibrium(scene)
    outputs = ['hinge.position', 'hinge.force']
    model = linearise(rest, inputs=['hinge.effort', 'wrenches.P.force.x'], outputs=outputs)
    along = np.array(rest.points['P']) / length
    turning = np.array([1.0 / length, -along[1]]) / np.sqrt(mass / 3.0)
    np.testing.assert_allclose(np.abs(model.B[1]), np.abs(turning), rtol=1e-12)
    across = np.array([-along[1], along[0]])
    # of the joint's force: m/2 of the tip's acceleration 3 (τ / l + F · across) / m, less F
    forces = 1.5 * np.outer(across, [1.0 / length, across[0]]) - [[0.0, 1.0], [0.0, 0.0]]
    np.testing.assert_allclose(model.D[0], 0.0, atol=1e-12 * np.abs(turning).max())
    np.testing.assert_allclose(model.D[1:], forces, atol=1e-10, rtol=1e-10)


def test_targets_of_a_controlled_mechanism() -> None:
    """A motor (k_p, k_v) on a pendulum: its target acts with k_p, the speed of it with k_v."""
    motor = {
        'joint': 'j0',
        'position': 0.3,
        'velocity': 0.0,
        'position_gain': 50.0,
        'velocity_gain': 6.0,
    }
    scene = chain(1, {'motor': motor})
    model = linearise(
        scene, inputs=['targets.j0.position', 'targets.j0.velocity'], outputs=['j0.position']
    )
    sense = model.C[0, 0]
    np.testing.assert_allclose(model.A, [[0.0, 1.0], [-50.0, -6.0]], atol=1e-9)
    np.testing.assert_allclose(sense * model.B, [[0, 0], [50, 6]], atol=1e-8)
    gain = -model.C @ np.linalg.solve(model.A, model.B)
    np.testing.assert_allclose(gain[0, 0], 1.0, atol=1e-9)


def test_the_target_of_a_fast_motor() -> None:
    motor = {'joint': 'j0', 'velocity': 5e4, 'velocity_gain': 6e4}
    scene = chain(1, {'motor': motor, 'torsion_spring': {'joint': 'j0', 'stiffness': 6e9}})
    model = linearise(scene, inputs=['targets.j0.velocity'])
    np.testing.assert_allclose(np.abs(model.B[1]), 6e4, rtol=1e-10)


def test_redundant_rows_change_nothing() -> None:
    model = linearise(redundant_parallelogram(), outputs=['pin0.position'])
    np.testing.assert_allclose(model.stiffness, [[9.81 * 2.5 / 2.0]], rtol=1e-11)
    assert model.directions.shape == (1, 6)


def test_the_multipliers_of_redundant_rows_may_be_any() -> None:
    """Adding any left null vector to λ leaves the reduced stiffness of Bricard's mechanism."""
    from alf_ros.studies.statics.instant import Instant, Loads
    from alf_ros.studies.statics.rest_stability import reduced_stiffness

    rest = equilibrium(load_scene('bricard'))
    instant = Instant(Loads(rest.simulation), 0.0, rest.state.q, rest.state.qd, rest.state.turns)
    model, lam = instant.model, np.empty(len(instant.model.row_names))
    lam[model.row] = rest.sample.lam
    J = instant.J[:, : model.n].toarray()
    U, s, _ = np.linalg.svd(J)
    null = U[:, int((s > 1e-9 * s[0]).sum()) :]
    assert null.shape[1] == 1
    before = reduced_stiffness(instant, lam).matrix
    after = reduced_stiffness(instant, lam + 100.0 * null[:, 0]).matrix
    np.testing.assert_allclose(after, before, rtol=1e-9)
    assert np.abs(instant.curvature(null[:, 0]).toarray()).max() > 0.1


def test_a_rolling_disk_keeps_what_cannot_be_integrated() -> None:
    """Positions that rows of velocities do not bind are states too."""
    model = linearise(Simulation(load_scene('chaplygin_sleigh')))
    places, speeds = len(model.directions), len(model.A) - len(model.directions)
    assert (places, speeds) == (3, 2) and model.stiffness.size == 0
    assert len(model.states) == 5


def test_eigenvalues_of_zero_but_for_rounding_have_no_damping() -> None:
    """A coin that rolls round: it does so wherever it is, so two eigenvalues are zero."""
    simulation = Simulation(load_scene('coin'))
    for _ in range(3):
        simulation.step(round(0.1 / simulation.h))
        model = linearise(simulation)
        assert np.abs(model.eigenvalues[:2]).max() < 1e-12 < np.abs(model.eigenvalues[2]).min()
        assert model.frequencies[:2].tolist() == [0.0, 0.0]
        assert np.isnan(model.damping_ratios).tolist() == [True] * 2 + [False] * 4


def test_eigenvalues_about_a_motion_do_not_tell_its_stability() -> None:
    """Directions do not turn with a flywheel, so neighbours of its motion seem to swing."""
    points = {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0.1, 0]}}
    wheel = {'points': ['O', 'A'], 'mass': 1.0, 'inertia': {'about_com': 0.1}, 'com': [0, 0]}
    hub = {'type': 'revolute', 'between': ['ground', 'wheel'], 'at': 'O'}
    mechanism = {
        'alf': 1,
        'points': points,
        'bodies': {'wheel': wheel},
        'joints': {'hub': hub},
    }
    for speed in (0.0, 2.0):
        initial = {'velocities': {'A': [None, speed]}}
        simulation = Simulation(load_scene({'mechanism': mechanism, 'initial': initial}))
        model = linearise(simulation)
        turns = simulation.sample().velocities['A'][1] / 0.1 / (2.0 * np.pi)
        assert model.frequencies[0] == pytest.approx(turns, abs=1e-12)
        assert ['whether the motion is stable' in note for note in model.notes] == [True] * (
            speed > 0.0
        )


def test_outputs_that_are_one_of_many_are_noted() -> None:
    """How the wheels of one axle share the side force is open; how they turn is not."""
    names = ['left_tyre.force.y', 'left_hub.position']
    at_rest = load_scene('wheeled_robot').at_rest()
    model = linearise(Simulation(at_rest), outputs=names)
    assert model.notes == ('joints are redundant, and one solution of many: ' + model.outputs[0],)


def test_the_speed_up_to_which_dry_friction_is_linear_is_noted() -> None:
    """The force is within a percent of the slope up to a tenth of this speed, and not beyond."""
    slow = {'joint': 'j0', 'static': 0.2, 'load': 1.0, 'stribeck': 0.05, 'slip': 0.1}
    none = {'joint': 'j0', 'viscous': 0.1, 'dynamic': 0.1, 'load': 0.0}
    dry = {'slow': slow, 'loaded': {'joint': 'j0', 'dynamic': 0.1}, 'none': none}
    ground = {'on': 'P1', 'stiffness': 1e3, 'friction': 0.5, 'through': [0, -2]}
    tendon = {'path': ['P1', ['ground', [0, -3]]], 'stiffness': 1.0, 'friction': 0.1}
    effects = {'joint_friction': dry, 'ground_contact': {'floor': ground}, 'tendon': tendon}
    scene = chain(1, {**GRAVITY, **effects})
    about = 'dry friction is taken as viscous, which holds while it slides far more slowly than'
    notes = linearise(scene).notes
    for said in (
        f'joint_friction.slow: {about} 0.05 rad/s',
        f'joint_friction.loaded: {about} 0.01 rad/s',
        f'tendon: {about} 0.01 m/s',
    ):
        assert said in notes
    assert not any(name in note for note in notes for name in ('none', 'floor'))
    assert modes(scene).notes == (
        f'joint_friction.slow: {about} 0.05 rad/s',
        'joint_friction.loaded: dry friction under a reaction is left out',
        f'tendon: {about} 0.01 m/s',
    )
    simulation = Simulation(scene)
    simulation.step(10)
    assert any(
        note.endswith('far below 0.05 rad/s, or below the speed at which it slides here')
        for note in linearise(simulation).notes
    )


def test_none_in_a_singular_position() -> None:
    upright = {'A': [0, 1], 'B': [0, 0]}
    scene = load_scene(
        {'mechanism': 'slider_crank', 'effects': GRAVITY, 'initial': {'positions': upright}}
    )
    with pytest.raises(InputError, match=r'singular position \(crossing\) has no linear model'):
        linearise(Simulation(scene))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match='inputs.*j0.effort'):
        linearise(chain(1), inputs=['j0.efort'])
    with pytest.raises(InputError, match='inputs: no such quantity, got .wrenches.P0'):
        linearise(chain(1), inputs=['wrenches.P0.force.x'])  # the point is fixed
    with pytest.raises(InputError, match='outputs: no such quantity'):
        linearise(chain(1), outputs=['j0.positio'])
    with pytest.raises(InputError, match='inputs: named twice'):
        linearise(chain(1), inputs=['joints.j0.effort', 'j0.effort'])


def test_files_hold_the_model(tmp_path: Path) -> None:
    model = linearise(chain(2), inputs=['j0.effort'], outputs=['points.P2.x'])
    for name in ('m.npz', 'm.mat', 'm.json'):
        assert model.write(tmp_path / name) == tmp_path / name
    archive, mat = np.load(tmp_path / 'm.npz'), loadmat(tmp_path / 'm.mat')
    text = json.loads((tmp_path / 'm.json').read_text('utf-8'))
    for key in 'ABCD':
        expected = getattr(model, key)
        np.testing.assert_array_equal(archive[key], expected)
        np.testing.assert_array_equal(mat[key], expected)
        np.testing.assert_array_equal(text[key], expected)
    np.testing.assert_array_equal(mat['eigenvalues'][:, 0], model.eigenvalues)
    np.testing.assert_array_equal(np.array(text['eigenvalues']) @ [1, 1j], model.eigenvalues)
    assert archive['inputs'].tolist() == text['inputs'] == ['joints.j0.effort']
    assert mat['outputs'][0, 0].item() == 'points.P2.x'
    with pytest.raises(InputError, match=r"got 'm.txt'; expected .json or .mat or .npz"):
        model.write(tmp_path / 'm.txt')


def test_a_path_that_is_none_is_refused() -> None:
    model = linearise(chain(1))
    for path in (None, 1, b'model.npz'):
        with pytest.raises(InputError, match='path: not a path'):
            model.write(path)  # type: ignore[arg-type]


def test_control_is_asked_for_by_name() -> None:
    model = linearise(chain(1), inputs=['j0.effort'])
    try:
        import control
    except ImportError:
        with pytest.raises(InputError, match='pip install control'):
            model.state_space()
    else:
        space = model.state_space()
        assert isinstance(space, control.StateSpace)
        np.testing.assert_array_equal(space.A, model.A)
        assert list(space.input_labels) == ['joints_j0_effort']


@pytest.mark.parametrize('stiffness', [1e3, 1e6, 1e9])
@pytest.mark.parametrize('exponent', [1.0, 1.5])
def test_outputs_on_a_stiff_contact(stiffness: float, exponent: float) -> None:
    """A mass at the end of a bar u lies on a floor: it presses with N = k δᵖ = m g, and the bar
    carries (N - m g) u_y along u: its slope is -p k δᵖ⁻¹ δy u_y u. The depth δ is 1e-8 m or more.
    """
    floor = {'on': 'P1', 'stiffness': stiffness, 'exponent': exponent, 'through': [0.0, -0.5]}
    rest = equilibrium(chain(1, {**GRAVITY, 'ground_contact': floor}))
    model = linearise(rest, outputs=['j0.force'])
    u = rest.points['P1']
    depth = (9.81 / stiffness) ** (1.0 / exponent)
    slope = exponent * stiffness * depth ** (exponent - 1.0) * model.directions[0][1] * u[1]
    sign = np.sign(model.C[0, 0] * slope * u[0])
    rounding = 1e-9 + 1e-15 / depth  # of the depth in the position
    np.testing.assert_allclose(model.C[:, 0], sign * slope * u, rtol=100.0 * rounding)
    shares = modes(rest).potential_shares
    assert shares['ground_contact'][0] == pytest.approx(1.0, abs=1e-9)


def test_an_output_in_a_kink_has_no_slope() -> None:
    stop = {'joint': 'j0', 'lower': -np.pi / 2, 'stiffness': 1e4, 'exponent': 1.0}
    model = linearise(
        equilibrium(chain(1, {**GRAVITY, 'joint_stop': stop})),
        outputs=['j0.position', 'j0.force.x'],
    )
    assert model.outputs[1].endswith('force.x') and np.isnan(model.C[1, 0])
    assert np.isfinite(model.C[0]).all()
    of_force, of_output = model.notes
    assert 'kink' in of_force and 'kink' in of_output and 'j0' in of_output
    beside = linearise(equilibrium(chain(1, {**GRAVITY, 'joint_stop': {**stop, 'lower': -1.57}})))
    assert not beside.notes


@pytest.mark.parametrize(
    ('scene', 'outputs'),
    [
        ('slider_crank', ['points.B.y', 'velocities.B.y']),  # it slides along x
        ('governor', ['velocities.S.x', 'bearing.force.x']),  # it is symmetric
        ('jansen_leg', ['joints.foot.velocity']),  # both bars turn as one
    ],
)
def test_an_output_that_is_always_zero_is_no_kink(scene: str, outputs: list[str]) -> None:
    """Rounding is all that it has."""
    model = linearise(Simulation(load_scene(scene)), outputs=outputs)
    np.testing.assert_allclose(model.C, 0.0, atol=1e-11)
    assert not any('kink' in note for note in model.notes)


@pytest.mark.parametrize(('exponent', 'told'), [(1.5, True), (2.0, False)])
def test_outputs_where_a_force_begins_without_a_slope(exponent: float, told: bool) -> None:
    """The stiffness is exact there, differences of outputs are not."""
    stop = {'joint': 'j0', 'lower': -np.pi / 2, 'stiffness': 1e4, 'exponent': exponent}
    model = linearise(
        equilibrium(chain(1, {**GRAVITY, 'joint_stop': stop})), outputs=['j0.force.x']
    )
    assert model.stiffness == pytest.approx(9.81, rel=1e-12)
    assert any('begins here' in note for note in model.notes) == told
    assert abs(model.C[0, 0] + 9.81) < (0.1 if told else 1e-5)


@pytest.mark.parametrize('in_tension', [1.0, 10.0])
def test_a_damper_with_two_slopes_is_noted(in_tension: float) -> None:
    """At rest the damping is of one side, unless both are the same."""
    damper = {'between': ['P1', 'ground'], 'at': [None, [1.0, -1.0]]}
    scene = chain(
        1, {**GRAVITY, 'damper': {**damper, 'table': [[-1, -1], [0, 0], [1, in_tension]]}}
    )
    notes = linearise(scene).notes
    assert ['kink at this velocity' in note for note in notes] == [True] * (in_tension != 1.0)
