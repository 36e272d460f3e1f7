"""The parts of an identification: readings, starts, residuals, derivatives, statistics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest
from scipy import optimize, stats

from alf_ros import Simulation, identify, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.scene import overrides
from alf_ros.simulation.input_values import NO_INPUTS
from alf_ros.simulation.state_trail import StateArrays
from alf_ros.studies.identification.best_starts import best_starts, costs
from alf_ros.studies.identification.gauss_newton import best_gain, compressed
from alf_ros.studies.identification.identifiability import beside, known
from alf_ros.studies.identification.joint_readings import JointReadings
from alf_ros.studies.identification.least_squares_fit import is_stalled
from alf_ros.studies.identification.posture_track import PostureTrack
from alf_ros.studies.identification.residual_tests import whiteness
from alf_ros.studies.identification.robust_loss import NAMES, rooted, spread
from alf_ros.studies.identification.shared_numbers import Shared
from alf_ros.studies.identification.weighed_windows import WeighedWindows
from alf_ros.studies.identification.window import Window, cut
from alf_ros.studies.identification.window_runs import Misfit, WindowRuns
from alf_ros.studies.identification.window_start import StartChart
from support.recordings import Machine, changed, pushes
from support.thorough import LONG

R = TypeVar('R', bound=WindowRuns)


@pytest.mark.parametrize(
    ('name', 'names'),
    [
        ('slider_crank', ['coupler.mass', 'L']),
        ('delta_robot', ['arm', 'l']),
        ('screw_jack', []),
        ('scissor_lift', []),
    ],
)
def test_readings_are_those_of_samples(name: str, names: list[str]) -> None:
    simulation = Simulation(load_scene(name), tangents=names)
    simulation.step(40)
    state, sample, following = simulation.state, simulation.sample(), simulation.following
    carried = state.tangents.reshape(1, len(names), 2, -1 if names else state.q.size)
    slopes = [each.arrays for each in following.slopes] if following else []
    read = JointReadings(simulation.model, slopes).read(
        StateArrays(
            state.q[None], state.qd[None], state.turns[None], carried[:, :, 0], carried[:, :, 1]
        )
    )
    assert np.allclose(read.x[0], sample.joint_positions, rtol=1e-14, atol=1e-15)
    assert np.allclose(read.v[0], sample.joint_velocities, rtol=1e-13, atol=1e-14)
    for k, each in enumerate(names):
        tangent = sample.tangents[each]
        assert np.allclose(read.dx[0, :, k], tangent.joint_positions, rtol=1e-12, atol=1e-14)
        assert np.allclose(read.dv[0, :, k], tangent.joint_velocities, rtol=1e-12, atol=1e-14)


def test_a_state_direction_is_a_derivative_by_the_start() -> None:
    names = ['state.0', 'initial.velocities.B.0']
    simulation = Simulation(load_scene('slider_crank'), tangents=names)
    state = simulation.state
    carried = state.tangents.reshape(2, -1).copy()
    carried[0] = 3.0 * carried[1]
    simulation.restore(replace(state, tangents=carried.ravel()))
    simulation.step(300)
    free, named = (simulation.sample().tangents[name].q for name in names)
    assert np.allclose(free, 3.0 * named, rtol=1e-13)


def test_slopes_that_serve_again_are_the_same() -> None:
    """Masses are kept where nothing beside them changes, and found again where a product does."""
    scene = load_scene('slider_crank')
    names = ['coupler.mass', 'gravity.acceleration.1']
    first = Simulation(scene, tangents=names)
    for numbers in ({'coupler.mass': 1.4}, {'coupler.mass': 1.4, 'gravity.acceleration.1': -5.0}):
        other = changed(scene, numbers)
        kept, anew = (Simulation(other, tangents=names, like=x) for x in (first, None))
        for simulation in (kept, anew):
            simulation.step(100)
        assert kept.following is not None and anew.following is not None
        for of, wanted in zip(kept.following.slopes, anew.following.slopes, strict=True):
            assert np.allclose(
                of.params(NO_INPUTS), wanted.params(NO_INPUTS), rtol=1e-11, atol=1e-12
            )
        for name in names:
            a, b = (x.sample().tangents[name].q for x in (kept, anew))
            assert np.allclose(a, b, rtol=1e-9, atol=1e-12)


def tracked(runs: WindowRuns, machine: Machine, length: float, margin: float) -> list[Window]:
    recording = machine.recording(velocities=True)
    channels = [(0, channel) for channel in recording.channels]
    windows = cut([recording], channels, length, runs.h, 0.0, margin)
    track = PostureTrack(runs.reference, recording.channels)
    return [replace(w, chart=track.start(w.first * runs.h)) for w in windows]


@pytest.mark.parametrize(
    ('name', 'names', 'size'),
    [('slider_crank', ['coupler.mass', 'L'], 1.0), ('delta_robot', ['platform', 'l'], 0.3)],
)
def test_derivatives_are_those_of_differences(name: str, names: list[str], size: float) -> None:
    """Of masses, lengths, delay and starts, with efforts that change within a window."""
    scene = load_scene(name)
    joints = Simulation(scene).model.coordinate_names
    machine = Machine(scene, joints, 0.3, inputs=pushes(joints[0], size, 0.3, 0.05))
    runs = WindowRuns(scene, names, machine.recording(velocities=True).channels, delay=True)
    (window,) = tracked(runs, machine, 0.3, margin=0.02)
    assert window.chart is not None
    values = np.array([overrides.number(scene, each) for each in names])
    x = np.concatenate([values, [0.0037], window.chart.free])
    P = len(names)

    def residuals(at: Floats) -> Floats:
        return runs.misfit(runs.simulation(at[:P]), window, at[P + 1 :], at[P]).residuals

    with_tangents = runs.simulation(values, window.chart.free.size)
    J = runs.misfit(with_tangents, window, x[P + 1 :], x[P]).jacobian
    for k in range(x.size):
        e = np.zeros(x.size)
        e[k] = 1e-5 if k == P else 1e-4 * max(1.0, abs(x[k]))
        near = (residuals(x + e) - residuals(x - e)) * 2.0 / 3.0
        far = (residuals(x + 2.0 * e) - residuals(x - 2.0 * e)) / 12.0
        expected = (near - far) / e[k]
        # the delay: a velocity between two steps is a parabola, and one effort less smooth
        least = 1e-4 if k == P else 1e-7
        assert np.abs(J[:, k] - expected).max() <= least * np.abs(expected).max(), k


def runs_of_a_window(kind: type[R], delay: bool) -> tuple[R, Window, Floats]:
    """The runs of a slider-crank over 0.3 s, by the mass of its coupler; its window, and the start
    of that."""
    scene = load_scene('slider_crank')
    machine = Machine(scene, ('crank_pin', 'guide'), 0.3)
    channels = machine.recording(velocities=True).channels
    runs = kind(scene, ['coupler.mass'], channels, delay=delay)
    (window,) = tracked(runs, machine, 0.3, margin=0.02)
    assert window.chart is not None
    return runs, window, window.chart.free


class CountedRuns(WindowRuns):
    """With the number of runs."""

    count = 0

    def misfit(self, *given: Any) -> Misfit:
        self.count += 1
        return super().misfit(*given)


def test_a_run_that_fails_is_made_once_and_leaves_the_others() -> None:
    """One start of three is far too fast for the step."""
    runs, window, free = runs_of_a_window(CountedRuns, delay=False)
    shared = np.array([1.0])
    starts = [(window, each) for each in (free, 1e9 * (free + 1.0), 1.01 * free)]
    fit = WeighedWindows(runs, [window] * 3, np.full(len(runs.channels), 1e-3), 'linear')
    assert np.isinf(costs(fit, starts, shared)).tolist() == [False, True, False]
    assert runs.count == 3
    good, bad, _ = fit.attempts(starts, shared)
    assert isinstance(good, Misfit) and isinstance(bad, AlfError)
    alone = WindowRuns.misfit(runs, runs.simulation(shared), window, free, 0.0)
    assert good.residuals.tobytes() == alone.residuals.tobytes()
    with pytest.raises(AlfError):
        runs.misfits_at(shared, starts, 0.0, None)
    # a start without a run stays, and holds up no other one
    best = best_starts(fit, shared, [each for _, each in starts], 1e-3)
    stays = [np.array_equal(there, own) for there, (_, own) in zip(best, starts, strict=True)]
    assert stays[1:] == [True, False]


def test_a_window_is_not_run_twice_at_the_same_numbers() -> None:
    """With its jacobian it serves without, too; other numbers, starts and delays are others."""
    runs, window, free = runs_of_a_window(WindowRuns, delay=True)
    values = np.array([1.0])
    count = free.size
    start = [(window, free)]
    (plain,) = runs.misfits_at(values, start, 0.0, None)
    (whole,) = runs.misfits_at(values, start, 0.0, count)
    assert whole is not plain and np.array_equal(whole.residuals, plain.residuals)
    assert runs.misfits_at(values, start, 0.0, None)[0] is whole
    for other in ((values, 1.01 * free, 0.0), (1.1 * values, free, 0.0), (values, free, 1e-3)):
        (found,) = runs.misfits_at(other[0], [(window, other[1])], other[2], None)
        assert not np.array_equal(found.residuals, plain.residuals)
    alone = runs.misfit(runs.simulation(values, count, alone=True), window, free, 0.0).jacobian
    assert np.allclose(alone, whole.jacobian[:, 2:], rtol=1e-12, atol=1e-14)


def test_the_track_finds_the_start() -> None:
    """From exact measurements: the first residuals come from the smoothing alone."""
    scene = load_scene('slider_crank')
    machine = Machine(scene, ('crank_pin', 'guide'), 1.0)
    runs = WindowRuns(scene, [], machine.recording(velocities=True).channels, delay=False)
    for window in tracked(runs, machine, 0.5, 0.0):
        assert window.chart is not None
        found = runs.misfit(runs.simulation(np.zeros(0)), window, window.chart.free, 0.0)
        assert np.abs(found.residuals).max() < 0.05


def test_turns_of_rotors_are_no_free_numbers() -> None:
    """Angles of a double pendulum tell where it is, whether its joints have rotors or not."""
    motor = {
        'a': {'joint': 'shoulder', 'armature': 0.2, 'effort': 1.0},
        'b': {'joint': 'elbow', 'armature': 0.15},
    }
    for effects in ({}, {'motor': motor}):
        scene = load_scene(
            {
                'mechanism': 'double_pendulum',
                'effects': {'gravity': {'acceleration': [0, -9.81]}, **effects},
            }
        )
        machine = Machine(scene, ('shoulder', 'elbow'), 0.3)
        channels = machine.recording(velocities=True).channels
        runs = WindowRuns(scene, ['upper.mass'], channels, delay=False)
        (window,) = tracked(runs, machine, 0.3, margin=0.0)
        chart = window.chart
        assert isinstance(chart, StartChart) and chart.is_told
        assert (chart.positions, chart.velocities) == (2, 2)
        simulation = runs.simulation(np.ones(1), 4)
        J = runs.misfit(simulation, window, chart.free, 0.0).jacobian
        for k in range(4):
            e = np.zeros(4)
            e[k] = 1e-4
            ends = [
                runs.misfit(runs.simulation(np.ones(1)), window, chart.free + d, 0.0).residuals
                for d in (e, -e)
            ]
            expected = (ends[0] - ends[1]) / 2e-4
            assert np.abs(J[:, 1 + k] - expected).max() <= 1e-6 * np.abs(expected).max()


GEARED: dict[str, Any] = {
    'name': 'geared',
    'mechanism': {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [-0.12, 0], 'fixed': True},
            'D': {'at': [0.3, 0], 'fixed': True},
            'A': {'at': [-0.03, 0.1]},
            'W': {'at': [-0.12, 0.08]},
            'E': {'at': [0.3, 0.1]},
        },
        'bodies': {
            'bar': {'points': ['O', 'A'], 'mass': 0.3, 'inertia': 'rod'},
            'wheel': {
                'points': ['C', 'W'],
                'mass': 0.5,
                'com': [0, 0],
                'inertia': {'about_com': 2e-3},
            },
            'arm': {'points': ['D', 'E'], 'mass': 0.2, 'inertia': 'rod'},
        },
        'joints': {
            'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'},
            'axle': {'type': 'revolute', 'between': ['ground', 'wheel'], 'at': 'C'},
            'shoulder': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'D'},
            'mesh': {
                'type': 'gear',
                'between': ['bar', 'wheel'],
                'centres': ['O', 'C'],
                'radii': [0.04, 0.08],
            },
        },
        'couplings': {'belt': {'joints': {'shoulder': 1.0, 'pin': -0.5}}},
    },
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'torsion_spring': {'twist': {'joint': 'axle', 'stiffness': 0.5}},
        'joint_friction': {'rub': {'joint': 'pin', 'viscous': 0.01}},
    },
    'initial': {'velocities': {'A': [0.3, None]}},
    'solver': {'step': 2e-3, 'integrator': 'rk4'},
}


@pytest.mark.parametrize('joints', [('pin',), ('pin', 'shoulder', 'axle')])
def test_meshes_hold_where_windows_begin(joints: tuple[str, ...]) -> None:
    """Phases of a gear and a coupling were free: a fit moved those that no joint tells by
    rounding, and did not settle. Where all joints tell them they are free, as encoders may be."""
    true = {'twist.stiffness': 0.55, 'rub.viscous': 0.012}
    of = load_scene(GEARED)
    machine = Machine(changed(of, true), joints, 1.0)
    runs = WindowRuns(of, ['twist.stiffness'], machine.recording().channels, delay=False)
    chart = tracked(runs, machine, 0.4, 0.0)[1].chart
    assert isinstance(chart, StartChart) and chart.is_told
    assert (chart.positions, chart.velocities) == (1 if len(joints) == 1 else 3, 1)
    found = identify(of, machine.recording(), list(true), window=0.4)
    assert found.settled
    assert np.allclose(found.values, list(true.values()), rtol=1e-6)


def test_a_start_in_mesh_has_its_derivatives() -> None:
    """By free numbers far from the first estimate: the wheel and the arm stay in mesh."""
    machine = Machine(load_scene(GEARED), ('pin',), 0.3)
    channels = machine.recording().channels
    runs = WindowRuns(machine.scene, ['twist.stiffness'], channels, delay=False)
    (window,) = tracked(runs, machine, 0.3, margin=0.0)
    chart = window.chart
    assert isinstance(chart, StartChart)
    simulation = runs.simulation(np.array([0.5]), 2)
    assert simulation.following is not None
    free = chart.free + 0.02
    begun = chart.start(simulation.model, free, simulation.following.slopes[:1])
    turned = [
        np.arctan2(*(begun.q.reshape(-1, 2)[at] - np.array(centre))[::-1])
        for at, centre in zip(_places(simulation), ((0, 0), (-0.12, 0), (0.3, 0)), strict=True)
    ]
    bar, wheel, arm = np.array(turned) - [np.arctan2(0.1, -0.03), np.pi / 2, np.pi / 2]
    assert wheel == pytest.approx(-0.5 * bar, abs=1e-9) and abs(bar) > 0.05
    assert arm == pytest.approx(0.5 * bar, abs=1e-9)
    for k in range(2):
        e = np.zeros(2)
        e[k] = 1e-5
        ends = [chart.start(simulation.model, free + d) for d in (e, -e)]
        assert np.allclose(begun.dq[1 + k], (ends[0].q - ends[1].q) / 2e-5, atol=1e-7)
        assert np.allclose(begun.dqd[1 + k], (ends[0].qd - ends[1].qd) / 2e-5, atol=1e-7)


def _places(simulation: Simulation) -> list[int]:
    return [simulation.model.layout.of_point[name] for name in ('A', 'W', 'E')]


def test_a_window_in_few_rows_is_the_same_problem() -> None:
    rng = np.random.default_rng(1)
    for rows in (50, 3):
        value, J = rng.normal(size=rows), rng.normal(size=(rows, 5))
        R = compressed(value, J)
        assert R.shape == (6, 6)
        assert np.allclose(R[:, 0], np.linalg.norm(value) * np.eye(6)[0], atol=1e-14)
        assert np.allclose(R[:, 1:].T @ R[:, 0], J.T @ value)
        assert np.allclose(R[:, 1:].T @ R[:, 1:], J.T @ J)


def test_the_gain_of_the_best_step() -> None:
    """By a fit of scipy, also with columns of very different size, and one of zeros."""
    rng = np.random.default_rng(7)
    value, J = rng.normal(size=40), rng.normal(size=(40, 5)) * [1e6, 1.0, 1e-6, 1.0, 0.0]
    done = optimize.least_squares(lambda x: value + J @ x, np.zeros(5), x_scale='jac')
    expected = 0.5 * value @ value - done.cost
    assert best_gain(value, J) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize('name', NAMES)
def test_losses(name: str) -> None:
    """By the formulas of scipy.optimize.least_squares, and slopes by differences."""
    r = np.array([-9.0, -2.5, -1.0, -1e-9, 0.0, 1e-5, 0.3, 1.9, 2.1, 30.0])
    value, slope = rooted(name, r)
    z = (r / 2.0) ** 2
    rho = {
        'linear': z,
        'huber': np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
        'soft_l1': 2.0 * (np.sqrt(1.0 + z) - 1.0),
        'cauchy': np.log1p(z),
    }[name]
    assert np.allclose(value**2, 4.0 * rho, rtol=1e-10, atol=1e-14)
    e = 1e-6
    near = (rooted(name, r + e)[0] - rooted(name, r - e)[0]) / (2.0 * e)
    assert np.allclose(slope, near, rtol=1e-6)


def test_the_spread_of_huber() -> None:
    """Of normal noise, by its formula with the normal distribution."""
    r = stats.norm.ppf((np.arange(200_000) + 0.5) / 200_000)
    k = 2.0
    inside = stats.norm.cdf(k) - stats.norm.cdf(-k)
    square = inside - 2.0 * k * stats.norm.pdf(k) + k * k * (1.0 - inside)
    assert spread('huber', r) == pytest.approx(square / inside**2, rel=1e-3)


def test_covariance_is_that_of_the_whole_problem() -> None:
    """Starts of two windows and three numbers: the block of the inverse of JᵀJ."""
    rng = np.random.default_rng(2)
    A = [rng.normal(size=(30, 4)) for _ in range(2)]
    B = [rng.normal(size=(30, 3)) for _ in range(2)]
    whole = np.zeros((60, 11))
    for k in range(2):
        whole[30 * k : 30 * k + 30, :3] = B[k]
        whole[30 * k : 30 * k + 30, 3 + 4 * k : 7 + 4 * k] = A[k]
    expected = np.linalg.inv(whole.T @ whole)[:3, :3]
    sizes = np.array([1.0, 10.0, 0.1])
    parts = [beside(a, b) for a, b in zip(A, B, strict=True)]
    found = known(['a', 'b', 'c'], parts, sizes, np.zeros((3, 3)), 1.0)
    assert np.allclose(found.covariance, expected, rtol=1e-10)
    d = np.sqrt(np.diag(expected))
    assert np.allclose(found.correlations, expected / np.outer(d, d), rtol=1e-9)


def test_unseen_combinations_are_named() -> None:
    """a and b act as a + 2 b: their change a = 2, b = -1 is not seen; c is."""
    rng = np.random.default_rng(3)
    a, c = rng.normal(size=(2, 40))
    found = known(
        ['a', 'b', 'c'], [np.column_stack([a, 2 * a, c])], np.ones(3), np.zeros((3, 3)), 1
    )
    assert np.isinf(found.deviations[:2]).all() and np.isfinite(found.deviations[2])
    last = found.combinations[-1]
    assert not last.determined and last.text == '0.89 a -0.45 b'
    assert found.correlations[0, 1] == pytest.approx(-1.0)


def test_whiteness() -> None:
    rng = np.random.default_rng(4)
    white = [rng.normal(size=300) for _ in range(4)]
    found = whiteness(white)
    assert found.white and found.durbin_watson == pytest.approx(2.0, abs=0.2)
    smooth = [(part[2:] + part[1:-1] + part[:-2]) / 3.0 for part in white]
    found = whiteness(smooth)
    assert not found.white and found.durbin_watson < 1.0 and found.ljung_box < 1e-6
    # with many sequences of white noise the probabilities are uniform
    each = [whiteness([rng.normal(size=200)]) for _ in range(200)]
    for values in ([x.ljung_box for x in each], [x.runs for x in each]):
        assert 0.35 < float(np.mean(np.array(values) > 0.5)) < 0.65


def test_a_fit_that_ends_on_a_slopeis_stalled() -> None:
    """Not at a minimum, not at a bound that holds it, not where only rounding is left."""
    J, x = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]]), np.array([1.0, 3.0])
    endless, size = np.full(2, np.inf), np.ones(2)
    free = Shared(x, -endless, endless, x, endless, size)
    held = replace(free, lower=np.array([1.0, -np.inf]))
    across = np.array([-2.0, -1.0, 2.0])  # Jᵀ across = 0
    assert np.abs(J.T @ across).max() == 0.0
    assert not is_stalled(across, J, x, free)
    slope = across + J @ np.array([0.5, 0.0])
    assert is_stalled(slope, J, x, free)
    assert not is_stalled(slope, J, x, held)
    assert not is_stalled(1e-9 * slope, J, x, free)
    # as near as a search comes to a bound of zero
    near_zero, held = np.array([1e-12, 3.0]), replace(free, lower=np.array([0.0, -np.inf]))
    assert not is_stalled(slope, J, near_zero, held)
    assert is_stalled(slope, J, near_zero, free)


def test_no_slope_where_only_a_step_beyond_the_bounds_would_gain() -> None:
    """Two numbers of which only the sum is seen, but for a jacobian that is a little off."""
    J, x = np.array([[1.0, 1.0], [0.0, 1e-4], [1.0, 1.0]]), np.array([1.0, 3.0])
    endless = np.full(2, np.inf)
    free = Shared(x, -endless, endless, x, endless, np.ones(2))
    positive = replace(free, lower=np.zeros(2))
    value = np.array([-1.0, 1.0, 1.0])
    assert is_stalled(value, J, x, free)
    assert not is_stalled(value, J, x, positive)


def test_a_body_that_needs_other_directions_on_the_way_is_refused() -> None:
    """The points of the plate lie in a plane, and a direction across it is added. 6 mm above it
    they do without: the starts of windows and their derivatives are in other coordinates there."""
    name, of = 'mechanism.points.T<k>.at.2', load_scene('delta_robot')
    machine = Machine(changed(of, {name: -0.38}), ['motor0', 'motor1', 'motor2'], 0.3)
    if LONG:
        with pytest.raises(InputError, match='beside this value the equations have another form'):
            identify(of, machine.recording(1e-5), [name], window=0.3)
    channels = machine.recording().channels
    with pytest.raises(InputError, match='a body has other directions there .*: plate_z'):
        WindowRuns(of, [name], channels, False).simulation(np.array([-0.38]))
