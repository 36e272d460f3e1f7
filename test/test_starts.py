"""Starts in singular positions: which velocities begin a motion, how they are completed, what is
refused and in which words, how it starts from rest; against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import AssemblyError, Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.inspection.soundness import BAD, NOTE, OK, examine
from alf_ros.model import assembly, singular_branches
from alf_ros.resources import library
from alf_ros.scene.scene import INTEGRATORS, Scene, scene_from_text
from alf_ros.studies.exact import one_freedom

GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}
UPRIGHT = {'A': [0, 1], 'B': [0, 0]}  # the slider lies on the pin of the crank
FLAT = {f'B{k}': [k + 1, 0] for k in range(3)}
IN_LINE = {'A': [-1, 0], 'B': [1, 0]}


def scene(
    mechanism: object = 'slider_crank',
    positions: Mapping[str, Any] = UPRIGHT,
    effects: Mapping[str, Any] = GRAVITY,
    drives: Mapping[str, Any] | None = None,
    solver: Mapping[str, Any] | None = None,
    **velocities: Any,
) -> Scene:
    source: dict[str, Any] = {
        'mechanism': mechanism,
        'effects': dict(effects),
        'initial': {'positions': dict(positions), 'velocities': velocities},
        'solver': dict(solver or {}),
    }
    return load_scene(source | ({'drives': dict(drives)} if drives else {}))


def velocities(simulation: Simulation) -> dict[str, list[float]]:
    sample = simulation.sample()
    return {name: sample.velocities[name].tolist() for name in sample.velocities}


def refused(scene: Scene) -> str:
    with pytest.raises(AssemblyError) as error:
        Simulation(scene)
    assert '\n' not in str(error.value)
    return str(error.value)


def answers(scene: Scene) -> dict[str, tuple[str, str]]:
    return {each.question: (each.verdict, each.answer) for each in examine(scene).answers}


# ----------------------------------------------------------------- the slider-crank, all methods


def test_a_speed_that_fits_one_branch_is_completed_on_it() -> None:
    """b (b - 2 a) = 0 of the speeds a, b of A and B: B goes twice as fast, or stays."""
    simulation = Simulation(scene(B=[-4, 0]))
    found = velocities(simulation)
    assert found['A'] == pytest.approx([-2, 0], abs=1e-12)
    assert found['B'] == pytest.approx([-4, 0], abs=1e-12)
    position = simulation.singular_start
    assert position is not None and position.kind == singular_branches.CROSSING
    assert [branch.dimension for branch in position.branches] == [1, 1]


def test_a_speed_that_fits_both_is_refused() -> None:
    said = refused(scene(A=[1, 0]))
    assert 'fit 2 branches, A: [1, 0] with B: [2, 0], or B: [0, 0] m/s' in said
    for speeds in ({'A': [1, 0], 'B': [2, 0]}, {'A': [1, 0], 'B': [0, 0]}):
        found = velocities(Simulation(scene(**speeds)))
        assert found['B'] == pytest.approx(speeds['B'], abs=1e-15)


def test_speeds_of_no_branch_are_refused_with_the_branches_named() -> None:
    said = refused(scene(A=[-1, 0], B=[1, 0]))
    assert 'initial.velocities' in said and 'no motion begins' in said
    assert 'A: [-1, 0] with B: [-2, 0], or B: [0, 0]' in said
    assert 'no motion begins' in refused(scene(A=[1, 0], B=[-4, 0]))
    # what the constraints do not allow to first order says so as anywhere else
    assert 'contradict each other' in refused(scene(A=[1, 0.5], B=[2, 0]))


def test_at_rest_without_more() -> None:
    for speeds in ({}, {'B': [0, 0]}, {'A': [0, None]}):
        assert not Simulation(scene(**speeds)).state.qd.any()


FOLDED = one_freedom.OneFreedom(  # both rods turn as one about the pin
    lambda theta, rate: -1.5 * one_freedom.GRAVITY * math.cos(theta),
    lambda theta: np.array([np.cos(theta), np.sin(theta), 0.0, 0.0]),
    lambda theta: np.array([-np.sin(theta), np.cos(theta), 0.0, 0.0]),
    lambda theta: (2.0 / 3.0, 0.0),
)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_on_either_branch_the_motion_is_exact(integrator: str) -> None:
    for alone, b in ((one_freedom.slider_crank(), -4.0), (FOLDED, 0.0)):
        wanted = alone.motion(math.pi / 2, 2.0, [0.0, 0.1, 0.25])
        solver = {'integrator': integrator, 'step': 1e-3, 'tolerance': 1e-10}
        simulation = Simulation(scene(A=[-2, 0], B=[b, 0], solver=solver))
        energy = simulation.sample().energy
        for sample, q in zip(simulation.run(0.25, at=[0.0, 0.1, 0.25]), wanted, strict=True):
            assert sample.q == pytest.approx(q, abs=1e-9)
            assert sample.energy == pytest.approx(energy, abs=1e-7)


def test_nothing_is_lost_in_the_first_step() -> None:
    simulation = Simulation(scene(B=[-4, 0]))
    energy = simulation.sample().energy
    simulation.step()
    assert simulation.sample().energy == pytest.approx(energy, abs=1e-9)


@pytest.mark.parametrize('offset', [10.0**-k for k in range(1, 17)])
def test_beside_the_position_the_constraints_tell(offset: float) -> None:
    """However near: B tells the branch, and A follows from it."""
    angle = math.pi / 2 + offset
    positions = {'A': [math.cos(angle), math.sin(angle)], 'B': [2 * math.cos(angle), 0]}
    simulation = Simulation(scene(positions=positions, B=[-4 * math.sin(angle), 0]))
    wanted = [-2 * math.sin(angle), 2 * math.cos(angle)]
    assert velocities(simulation)['A'] == pytest.approx(wanted, abs=2e-6)
    energy = simulation.sample().energy
    simulation.step(20)
    assert simulation.sample().energy == pytest.approx(energy, abs=1e-6)


@pytest.mark.parametrize('offset', [1e-3, 1e-4, 1e-5])
def test_an_ordinary_position_is_known_beside_a_singular_one(offset: float) -> None:
    angle = math.pi / 2 + offset
    positions = {'A': [math.cos(angle), math.sin(angle)], 'B': [2 * math.cos(angle), 0]}
    simulation = Simulation(scene(positions=positions, B=[-4, 0]))
    assert simulation.model.system.ordinary > 0.02


# ------------------------------------------------------------------------------ other mechanisms


def test_a_parallelogram() -> None:
    """ω0 (ω1 - ω0) = 0 where bars of one length lie flat: both turn, or the second alone."""
    flat = {'B0': [1, 0], 'B1': [2, 0]}
    simulation = Simulation(parallelogram(flat, B0=[0, 2]))
    assert velocities(simulation)['B1'] == pytest.approx([0, 2], abs=1e-12)
    said = refused(parallelogram(flat, B1=[0, 2]))
    assert 'B1: [0, 2] with B0: [0, 2], or B0: [0, 0]' in said
    assert 'no motion begins' in refused(parallelogram(flat, B0=[0, 1], B1=[0, -1]))


def parallelogram(positions: Mapping[str, Any], n: int = 1, **speeds: Any) -> Scene:
    source = {
        'mechanism': 'n_four_bar',
        'parameters': {'N': n},
        'effects': GRAVITY,
        'initial': {'positions': dict(positions), 'velocities': speeds},
    }
    return load_scene(source)


def test_two_four_bars() -> None:
    """ω0 (ω1 - ω0) = ω1 (ω2 - ω1) = 0: three lines, the last one a double zero."""
    flat = Simulation(scene('double_four_bar', FLAT, B0=[0, -3]))
    for k in range(3):
        assert velocities(flat)[f'B{k}'] == pytest.approx([0, -3], abs=1e-12)
    position = flat.singular_start
    assert position is not None and position.kind == singular_branches.CROSSING
    rates = []
    for branch in position.branches:
        places = branch.directions[0].reshape(-1, 2)
        y = np.array([places[flat.model.layout.of_point[f'B{k}'], 1] for k in range(3)])
        rates.append(tuple(np.round(np.abs(y / np.abs(y).max()), 9)))
    assert sorted(rates) == [(0, 0, 1), (0, 1, 1), (1, 1, 1)]
    assert 'fit 2 branches' in refused(scene('double_four_bar', FLAT, B1=[0, 1]))
    assert 'fit 3 branches' in refused(scene('double_four_bar', FLAT, B2=[0, 1]))
    said = refused(scene('double_four_bar', FLAT, B0=[0, 1], B1=[0, 1], B2=[0, 0]))
    assert 'B2: [0, 1]' in said and 'no motion begins' in said
    one = Simulation(scene('double_four_bar', FLAT, B0=[0, 0], B1=[0, 2]))
    assert velocities(one)['B2'] == pytest.approx([0, 2], abs=1e-12)


def test_two_four_bars_on_a_branch_where_one_stands_still() -> None:
    """Crank 0 stays, coupler 1 turns on crank 1: a pendulum of inertia 2 and first moment 5/2."""
    rate = -2.0
    wanted = solve_ivp(
        lambda t, y: [y[1], -1.25 * one_freedom.GRAVITY * math.cos(y[0])],
        [0, 0.2],
        [0.0, rate],
        method='DOP853',
        rtol=1e-12,
        atol=1e-12,
    ).y[0, -1]
    simulation = Simulation(
        scene('double_four_bar', FLAT, B0=[0, 0], B1=[0, rate]), step=1e-3, integrator='dop853'
    )
    simulation.step(200)
    points = simulation.sample().points
    assert points['B0'] == pytest.approx([1, 0], abs=1e-9)
    assert points['B1'] == pytest.approx([1 + math.cos(wanted), math.sin(wanted)], abs=1e-9)


def test_two_four_bars_against_the_exact_motion() -> None:
    simulation = Simulation(scene('double_four_bar', FLAT, B0=[0, -3]))
    wanted = one_freedom.four_bars(2).motion(0.0, -3.0, [0.0, 0.3])[-1]
    simulation.step(300)
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-8)


def change_point(sign: float) -> Callable[[complex], np.ndarray]:
    """A and B of `change_point` as functions of the angle of its crank, on one of the branches
    through π: by the law of cosines, as in `exact.change_point`."""

    def points(phi: complex) -> np.ndarray:
        f = np.sqrt(17.0 - 8.0 * np.cos(phi))
        x = (f * f - 5.0) / (2.0 * f)
        y = sign * np.cos(phi / 2.0) * np.sqrt(4.0 * (f + 1.0) * (f - 1.0)) / f
        A = np.array([np.cos(phi), np.sin(phi)])
        along = (np.array([4.0, 0.0]) - A) / f
        return np.concatenate([A, A + x * along + y * np.array([-along[1], along[0]])])

    return points


def slope(points: Callable[[complex], np.ndarray], phi: float) -> tuple[Floats, Floats]:
    whole = points(phi + 1e-30j)
    return whole.real, whole.imag * 1e30


def change_point_rates(
    points: Callable[[complex], np.ndarray],
) -> Callable[[float, Floats], list[float]]:
    """φ̇, φ̈ of the one freedom: I φ̈ = -V' - ½ I' φ̇²."""

    def inertia(phi: float) -> float:
        _, d = slope(points, phi)
        a, b = d[:2], d[2:]
        return float(a @ a + (a @ a + a @ b + b @ b) + 2.0 * b @ b) / 3.0

    def rates(t: float, y: Floats) -> list[float]:
        phi, rate = y
        _, d = slope(points, phi)
        push = -0.5 * one_freedom.GRAVITY * (d[1] + (d[1] + d[3]) + 2.0 * d[3])
        h = 1e-4
        bend = (inertia(phi - 2 * h) - 8 * inertia(phi - h) + 8 * inertia(phi + h)) / (12 * h)
        bend -= inertia(phi + 2 * h) / (12 * h)
        return [rate, (push - 0.5 * bend * rate * rate) / inertia(phi)]

    return rates


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_general_change_point(sign: float) -> None:
    points = change_point(sign)
    _, d = slope(points, math.pi)
    A, B = (5.0 * d[:2]).tolist(), (5.0 * d[2:]).tolist()
    for speeds in ({'A': A}, {'B': B}):
        assert 'fit 2 branches' in refused(scene('change_point', IN_LINE, **speeds))
    assert 'no motion' in refused(scene('change_point', IN_LINE, A=A, B=[0, 1.001 * B[1]]))
    simulation = Simulation(
        scene('change_point', IN_LINE, A=A, B=B, solver={'integrator': 'dop853', 'step': 2e-3})
    )
    position = simulation.singular_start
    assert position is not None
    block = simulation.model.layout.of_point
    ratios = []
    for branch in position.branches:
        places = branch.directions[0].reshape(-1, 2)
        ratios.append(places[block['B'], 1] / places[block['A'], 1])
    wanted = [slope(change_point(s), math.pi)[1] for s in (1.0, -1.0)]
    assert sorted(ratios) == pytest.approx(sorted(w[3] / w[1] for w in wanted), abs=1e-9)
    phi = solve_ivp(
        change_point_rates(points),
        [0, 0.2],
        [math.pi, 5.0],
        method='DOP853',
        rtol=1e-12,
        atol=1e-12,
    ).y[0, -1]
    simulation.step(100)
    assert simulation.sample().q == pytest.approx(points(phi).real, abs=1e-8)


SPATIAL = {
    'alf': 1,
    'space': 'spatial',
    'points': {
        'O': {'at': [0, 0, 0], 'fixed': True},
        'A': {'at': [0, 0, 1]},
        'B': {'at': [0, 0, 0]},
    },
    'bodies': {
        'crank': {'points': ['O', 'A'], 'mass': 1, 'inertia': {'about_com': [0.1, 0.1, 0.1]}},
        'coupler': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
        'slider': {'points': ['B'], 'mass': 1, 'inertia': {'about_com': [0.1, 0.1, 0.1]}},
    },
    'joints': {
        'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O', 'axis': [0, 1, 0]},
        'knee': {'type': 'spherical', 'between': ['crank', 'coupler'], 'at': 'A'},
        'wrist': {'type': 'spherical', 'between': ['coupler', 'slider'], 'at': 'B'},
        'guide': {
            'type': 'prismatic',
            'between': ['ground', 'slider'],
            'at': 'B',
            'axis': [1, 0, 0],
        },
    },
}


def test_in_space() -> None:
    """An R-S-S-P with equal rods in one plane: the same second-order condition."""
    spatial = {'mechanism': SPATIAL}

    def started(**speeds: Any) -> Simulation:
        return Simulation(load_scene({**spatial, 'initial': {'velocities': speeds}}))

    found = started(B=[-4, 0, 0])
    assert velocities(found)['A'] == pytest.approx([-2, 0, 0], abs=1e-10)
    with pytest.raises(AssemblyError, match='fit 2 branches, A: .*B: '):
        started(A=[1, 0, 0])
    with pytest.raises(AssemblyError, match='no motion begins'):
        started(A=[1, 0, 0], B=[1, 0, 0])
    energy = found.sample().energy
    found.step(100)
    assert found.sample().energy == pytest.approx(energy, abs=1e-8)


def test_redundant_rows_refuse_nothing() -> None:
    """A crank that is doubled has one row too many everywhere: the branches are the same."""
    text = load_scene('slider_crank').text
    for key, more in (
        ('  bodies:', '    twin: {points: [O, A], mass: 1, inertia: rod}'),
        (
            '  joints:',
            '    pin: {type: revolute, between: [ground, twin], at: O}\n'
            '    tip: {type: revolute, between: [crank, twin], at: A}',
        ),
        ('initial:', '  positions: {A: [0, 1], B: [0, 0]}'),
    ):
        assert text.count(f'{key}\n') == 1
        text = text.replace(f'{key}\n', f'{key}\n{more}\n')
    assert '-4.0' in text
    simulation = Simulation(scene_from_text(text))
    assert simulation.sample().diagnostics.redundant == 2  # one of them here only
    assert velocities(simulation)['A'] == pytest.approx([-2, 0], abs=1e-10)
    mechanism = text[: text.index('  velocities')] + '  velocities: {A: [1, 0]}\n'
    assert 'fit 2 branches' in refused(scene_from_text(mechanism))


@pytest.mark.parametrize('name', sorted(library('scenes')))
def test_the_library_starts_as_before(name: str) -> None:
    loaded = load_scene(name)
    simulation = Simulation(loaded)
    state = simulation.state
    assert simulation.singular_start is None
    wanted = assembly.complete(simulation.model, state.q, loaded.velocities)
    assert state.qd.tobytes() == wanted.tobytes()
    here = singular_branches.position(simulation.model, state.q)
    assert here.kind == singular_branches.SMOOTH and here.can_begin(state.qd)


def test_many_freedoms_gained_at_once() -> None:
    """Eleven cranks flat: velocities of all are judged, fewer are not guessed at."""
    flat = {f'B{k}': [k + 1, 0] for k in range(11)}
    every = {f'B{k}': [0, -2] for k in range(11)}
    simulation = Simulation(parallelogram(flat, 10, **every))
    assert simulation.singular_start is not None
    assert simulation.singular_start.kind == singular_branches.MANY
    simulation.step(100)
    wanted = one_freedom.four_bars(10).motion(0.0, -2.0, [0.0, 0.1])[-1]
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-8)
    assert 'not enumerated' in refused(parallelogram(flat, 10, B0=[0, -2]))
    wrong = every | {'B7': [0, 1]}
    assert 'no motion begins' in refused(parallelogram(flat, 10, **wrong))


def test_a_thousand_freedoms_gained_at_once() -> None:
    n = 1000
    flat = {f'B{k}': [k + 1, 0] for k in range(n + 1)}
    every = {f'B{k}': [0, -2] for k in range(n + 1)}
    simulation = Simulation(parallelogram(flat, n, **every))
    simulation.step(20)
    wanted = one_freedom.four_bars(n).motion(0.0, -2.0, [0.0, 0.02])[-1]
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-7)
    assert 'no motion begins' in refused(parallelogram(flat, n, **(every | {'B7': [0, 1]})))
    assert 'not enumerated' in refused(parallelogram(flat, n, B0=[0, -2]))


# ------------------------------------------------------------------------------- shaky structures


SHAKY = {
    'alf': 1,
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'C': {'at': [2, 0], 'fixed': True},
        'A': {'at': [1, 0]},
    },
    'bodies': {
        'one': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'two': {'points': ['A', 'C'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'left': {'type': 'revolute', 'between': ['ground', 'one'], 'at': 'O'},
        'knee': {'type': 'revolute', 'between': ['one', 'two'], 'at': 'A'},
        'right': {'type': 'revolute', 'between': ['ground', 'two'], 'at': 'C'},
    },
}


def test_infinitesimally_mobile_only() -> None:
    """Two bars in one line between two pins: the point between them gives way, and that is all."""
    said = refused(scene(SHAKY, {}, A=[0, 1]))
    assert 'infinitesimally mobile only (shaky)' in said and 'A' in said
    assert 'shaky' in refused(scene(SHAKY, {}))  # its weight asks for a motion that there is not
    assert not Simulation(scene(SHAKY, {}, effects={})).state.qd.any()
    verdict, text = answers(scene(SHAKY, {}, effects={}))['initial position']
    assert verdict == BAD and 'infinitesimally mobile only (shaky)' in text


# ------------------------------------------------------------------------------------------ drives


def motor(angle: str) -> dict[str, Any]:
    return {'motor': {'joint': 'crank_pin', 'angle': angle}}


def test_driven_through_the_position() -> None:
    """The crank is driven: the coupler follows or folds, and the start must say which."""
    said = refused(scene(drives=motor('pi/2 + t')))
    assert 'fit 2 branches, A: [-1, 0] with B: [-2, 0], or B: [0, 0] m/s' in said
    said = refused(scene(drives=motor('pi/2 + t'), B=[-1, 0]))
    assert 'no motion begins' in said and 'A: [-1, 0] with B: [-2, 0], or B: [0, 0]' in said
    for b in (-2.0, 0.0):
        simulation = Simulation(scene(drives=motor('pi/2 + t'), B=[b, 0]))
        assert velocities(simulation)['A'] == pytest.approx([-1, 0], abs=1e-12)
        simulation.step(500)
        angle = math.pi / 2 + 0.5
        points = simulation.sample().points
        assert points['A'] == pytest.approx([math.cos(angle), math.sin(angle)], abs=1e-10)
        assert points['B'] == pytest.approx([-b * math.cos(angle), 0], abs=1e-9)


def test_a_drive_that_accelerates_from_rest() -> None:
    said = refused(scene(drives=motor('pi/2 + t*t')))
    assert 'accelerate' in said and 'A: [-2, 0] with B: [-4, 0], or B: [0, 0]' in said
    assert not Simulation(scene(drives=motor('pi/2'))).state.qd[:4].any()


def test_a_drive_that_asks_for_what_rows_have_lost() -> None:
    """Both rods in one line, away from the pin: there the slider can only come back."""
    positions = {'A': [1, 0], 'B': [2, 0]}
    drives = {'push': {'joint': 'guide', 'length': '2 - t'}}
    said = refused(scene(positions=positions, drives=drives))
    assert 'contradict each other' in said and 'push' in said
    # with the right acceleration it comes back: x = 2 cos θ, so ẍ = -2 θ̇²
    back = {'push': {'joint': 'guide', 'length': '2*cos(3*t)'}}
    simulation = Simulation(scene(positions=positions, drives=back, A=[0, 3]))
    assert velocities(simulation)['A'] == pytest.approx([0, 3])
    assert 'no motion begins' in refused(scene(positions=positions, drives=back, A=[0, 2]))
    assert 'fit 2 branches' in refused(scene(positions=positions, drives=back))


@pytest.mark.parametrize('integrator', INTEGRATORS)
@pytest.mark.parametrize('step', [1e-3, 3e-2])
def test_drives_beyond_reach_say_so(integrator: str, step: float) -> None:
    """The slider is pushed to where both rods lie in one line, and further."""
    drives = {'push': {'joint': 'guide', 'length': '2*cos(pi/4) + t'}}
    simulation = Simulation(
        scene(positions={}, drives=drives, solver={'integrator': integrator, 'step': step})
    )
    with pytest.raises(StepError) as error:
        simulation.step(round(1.0 / step))
    said = str(error.value)
    assert 'drives go beyond the reach of the loops at t = 0.585786 s' in said
    assert error.value.t == pytest.approx(math.floor(0.585786 / step) * step)


# ----------------------------------------------------------------------------------------- at rest


@pytest.mark.parametrize('integrator', INTEGRATORS)
@pytest.mark.parametrize('step', [1e-3, 4e-3])
def test_from_rest_on_the_branch_where_forces_do_most(integrator: str, step: float) -> None:
    """Gauss's principle of least constraint; the same motion with every method."""
    solver = {'integrator': integrator, 'step': step, 'tolerance': 1e-10}
    simulation = Simulation(scene('change_point', IN_LINE, solver=solver))
    branch = simulation.departure
    assert branch is not None and branch.dimension == 1
    works = {}
    for sign in (1.0, -1.0):
        acceleration = change_point_rates(change_point(sign))(0.0, np.array([math.pi, 0.0]))[1]
        _, d = slope(change_point(sign), math.pi)
        push = -0.5 * one_freedom.GRAVITY * (d[1] + (d[1] + d[3]) + 2.0 * d[3])
        works[sign] = push * acceleration
    points = change_point(max(works, key=lambda sign: works[sign]))
    phi = solve_ivp(
        change_point_rates(points),
        [0, 0.2],
        [math.pi, 0.0],
        method='DOP853',
        rtol=1e-12,
        atol=1e-12,
    ).y[0, -1]
    energy = simulation.sample().energy
    simulation.step(round(0.2 / step))
    sample = simulation.sample()
    assert sample.q == pytest.approx(points(phi).real, abs=1e-8)
    assert sample.energy == pytest.approx(energy, abs=1e-8)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_two_four_bars_fall_together(integrator: str) -> None:
    solver = {'integrator': integrator, 'tolerance': 1e-10}
    simulation = Simulation(scene('double_four_bar', FLAT, solver=solver))
    wanted = one_freedom.four_bars(2).motion(0.0, 0.0, [0.0, 0.3])[-1]
    simulation.step(300)
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_it_stays_where_no_force_acts_along_a_branch(integrator: str) -> None:
    simulation = Simulation(scene(solver={'integrator': integrator}))
    assert simulation.singular_start is not None and simulation.departure is None
    simulation.step(500)
    assert simulation.sample().points['A'] == pytest.approx([0, 1], abs=1e-12)
    assert simulation.sample().points['B'] == pytest.approx([0, 0], abs=1e-12)


def test_an_input_sets_it_going_too() -> None:
    """A force of 1 N on B along x: of the two branches it acts on one only."""
    finals = []
    for integrator in INTEGRATORS:
        simulation = Simulation(scene(effects={}, solver={'integrator': integrator}))
        simulation.apply_wrench('B', force=[1.0, 0.0])
        simulation.step(500)
        finals.append(simulation.sample().points['B'])
    # θ̈ = -2 F sin θ … / I with A = (cos θ, sin θ), B = (2 cos θ, 0), I = 2/3 + 2 sin² θ

    def rates(t: float, y: Floats) -> list[float]:
        sin, cos = math.sin(y[0]), math.cos(y[0])
        top = -2.0 * sin - 2.0 * sin * cos * y[1] ** 2
        return [y[1], top / (2.0 / 3.0 + 2.0 * sin * sin)]

    theta = solve_ivp(
        rates, [0, 0.5], [math.pi / 2, 0.0], method='DOP853', rtol=1e-12, atol=1e-12
    ).y[0, -1]
    for final in finals:
        assert final == pytest.approx([2 * math.cos(theta), 0], abs=1e-9)


def test_forces_that_act_alike_on_two_branches_are_refused() -> None:
    """(f_A + 2 f_B) / √(8/3) = f_A / √(2/3), accelerations times √inertia, for f_A = 2 f_B."""
    effects = {
        'constant_wrench': {
            'one': {'on': 'A', 'force': [2, 0]},
            'two': {'on': 'B', 'force': [1, 0]},
        }
    }
    said = refused(scene(effects=effects))
    assert 'not unique' in said and 'A: [1, 0] with B: [2, 0], or B: [0, 0]' in said
    effects['constant_wrench']['two']['force'] = [1.1, 0]
    simulation = Simulation(scene(effects=effects))
    simulation.step(100)
    points = simulation.sample().points
    assert points['B'][0] == pytest.approx(2 * points['A'][0], abs=1e-9)
    effects['constant_wrench']['two']['force'] = [0.9, 0]
    simulation = Simulation(scene(effects=effects))
    simulation.step(100)
    assert simulation.sample().points['B'] == pytest.approx([0, 0], abs=1e-9)


# ------------------------------------------------------------------------------------------- check


def test_check_calls_correct_starts_sound() -> None:
    for speeds in ({'B': [-4, 0]}, {'A': [1, 0], 'B': [0, 0]}, {}):
        found = examine(scene(**speeds))
        assert found.sound
        told = {each.question: (each.verdict, each.answer) for each in found.answers}
        verdict, text = told['initial position']
        assert verdict == NOTE and '1 freedom more' in text
        assert 'crossing, 2 branches: A: [1, 0] with B: [2, 0], or B: [0, 0]' in text
        assert told['initial velocities'][0] == OK
    verdict, text = answers(scene('change_point', IN_LINE))['initial velocities']
    assert verdict == NOTE and 'at rest: leaves along A: [0, 1], B: [0, 1.58]' in text


def test_check_judges_velocities() -> None:
    verdict, text = answers(scene(A=[1, 0]))['initial velocities']
    assert verdict == BAD and 'fit 2 branches' in text
    verdict, text = answers(scene(A=[1, 0], B=[1, 0]))['initial velocities']
    assert verdict == BAD and 'no motion begins' in text
    verdict, text = answers(scene(positions={}, A=[-2, 1]))['initial velocities']
    assert verdict == BAD and 'contradict each other' in text and 'crank_length' in text
    assert answers(scene(positions={}, B=[-4, 0]))['initial velocities'][0] == OK


def test_check_tells_drives_that_begin_off_the_drawing() -> None:
    found = examine(scene(positions={}, drives=motor('pi/4 + 0.1 + t')))
    told = [(each.verdict, each.answer) for each in found.answers if each.question == 'drives']
    text = '1 motion for 1 freedom; none left free; motor begins 0.1 rad from the drawing'
    assert found.sound and told == [(NOTE, text)]
    at_once = answers(scene(positions={}, drives=motor('pi/4 + t')))['drives']
    assert at_once == (OK, '1 motion for 1 freedom; none left free')
    verdict, text = answers(scene(positions={}, drives=motor('pi/4 + 3')))['drives']
    assert verdict == BAD and 'more than a right angle' in text and '3 rad from' in text
    length = {'push': {'joint': 'guide', 'length': '2*cos(pi/4) + 0.2 + t'}}
    verdict, text = answers(scene(positions={}, drives=length))['drives']
    assert verdict == NOTE and text.endswith('push begins 0.2 m from the drawing')
    assert answers(scene(drives=motor('pi/2 + t')))['initial velocities'][0] == BAD
    assert answers(scene(drives=motor('pi/2 + t'), B=[0, 0]))['initial velocities'][0] == OK


@pytest.mark.parametrize('name', ['slider_crank', 'spatial_slider_crank'])
def test_armature_is_no_freedom(name: str) -> None:
    plain = load_scene(name)
    motor = {'motor': {'joint': 'crank_pin', 'effort': 0.0, 'armature': 0.1}}
    with_rotor = load_scene({'mechanism': name, 'effects': motor})
    bare = load_scene({'mechanism': name})
    one, two = answers(bare), answers(with_rotor)
    assert two['mobility'] == one['mobility'] == (OK, '1 freedom')
    assert two['size'] == one['size'] and two['redundant rows'] == one['redundant rows']
    assert two['singular positions'] == one['singular positions']
    assert answers(plain)['mobility'] == one['mobility']


def test_armature_may_be_the_mass_of_what_moves() -> None:
    motor = {'motor': {'joint': 'pin', 'effort': 0.0, 'armature': 0.1}}
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'arm': {'points': ['O', 'A'], 'mass': 0}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'}},
    }
    found = answers(load_scene({'mechanism': mechanism, 'effects': motor}))
    assert found['mass'][0] == OK and found['mobility'] == (OK, '1 freedom')
