"""Starts in singular positions with a speed, against closed forms.

The tests cover the velocities that begin a motion, their completion, and the refused velocities
with the text of the refusal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import AssemblyError, Simulation, load_scene
from alf_ros.inspection.answer import NOTE
from alf_ros.model import assembly, singular_branches, singular_start
from alf_ros.resources import library
from alf_ros.scene.scene import INTEGRATORS, Scene, scene_from_text
from alf_ros.studies.exact import crossed_bars, one_freedom
from support.singular_starts import (
    FLAT,
    GRAVITY,
    IN_LINE,
    answers,
    change_point,
    change_point_rates,
    refused,
    scene,
    slope,
    velocities,
)
from support.thorough import LONG

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
    assert 'fit 2 branches, A: [1, 0] with 1) B: [2, 0], or 2) B: [0, 0] m/s' in said
    both: tuple[dict[str, Any], ...] = ({'A': [1, 0], 'B': [2, 0]}, {'A': [1, 0], 'B': [0, 0]})
    for speeds in both:
        found = velocities(Simulation(scene(**speeds)))
        assert found['B'] == pytest.approx(speeds['B'], abs=1e-15)


def test_speeds_of_no_branch_are_refused_with_the_branches_named() -> None:
    said = refused(scene(A=[-1, 0], B=[1, 0]))
    assert 'initial.velocities' in said and 'no motion begins' in said
    assert 'A: [-1, 0] with 1) B: [-2, 0], or 2) B: [0, 0]' in said
    assert 'no motion begins' in refused(scene(A=[1, 0], B=[-4, 0]))
    # what the constraints do not allow to first order says so as anywhere else
    assert 'contradict each other' in refused(scene(A=[1, 0.5], B=[2, 0]))


def test_at_rest_without_more() -> None:
    rest: tuple[dict[str, Any], ...] = ({}, {'B': [0, 0]}, {'A': [0, None]})
    for speeds in rest:
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
    assert 'B1: [0, 2] with 1) B0: [0, 2], or 2) B0: [0, 0]' in said
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
    """Eleven cranks flat: all below one stand still, and all from there on turn together."""
    flat = {f'B{k}': [k + 1, 0] for k in range(11)}
    simulation = Simulation(parallelogram(flat, 10, B0=[0, -2]))
    position = simulation.singular_start
    assert position is not None and position.kind == singular_branches.CROSSING
    assert [branch.dimension for branch in position.branches] == [1] * 11
    simulation.step(100)
    wanted = one_freedom.four_bars(10).motion(0.0, -2.0, [0.0, 0.1])[-1]
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-11)
    assert not simulation.sample().diagnostics.trouble
    middle = velocities(Simulation(parallelogram(flat, 10, B3=[0, 0], B4=[0, 1])))
    for k in range(11):
        assert middle[f'B{k}'] == pytest.approx([0, float(k > 3)], abs=1e-10)
    assert 'fit 11 branches' in refused(parallelogram(flat, 10, B10=[0, -2]))
    every = {f'B{k}': [0, -2] for k in range(11)}
    assert 'no motion begins' in refused(parallelogram(flat, 10, **(every | {'B7': [0, 1]})))
    resting = Simulation(parallelogram(flat, 10))
    assert not resting.sample().diagnostics.trouble
    resting.step(300)
    wanted = one_freedom.four_bars(10).motion(0.0, 0.0, [0.0, 0.3])[-1]
    assert resting.sample().q == pytest.approx(wanted, abs=1e-9)
    assert not resting.sample().diagnostics.trouble


def test_a_sample_at_rest_is_on_the_branch_that_it_leaves_on() -> None:
    """It was the acceleration without the lost rows, which is on no branch."""
    flat = {f'B{k}': [k + 1, 0] for k in range(4)}
    sample = Simulation(parallelogram(flat, 3)).sample()
    falls = -9.81 * (4 / 2 + 3) / (4 / 3 + 3)  # m/s^2: all cranks as one pendulum
    assert sample.qdd == pytest.approx([0.0, falls] * 4, abs=1e-8)


def test_what_is_not_examined_at_rest_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """More freedoms than null spaces are looked at for; fewer here, for the time."""
    n = singular_branches.WIDE if LONG else 8
    for module in (singular_branches, singular_start):
        monkeypatch.setattr(module, 'WIDE', n)
    flat = {f'B{k}': [k + 1, 0] for k in range(n + 1)}
    simulation = Simulation(parallelogram(flat, n))
    said = simulation.sample().diagnostics.trouble
    assert 'branches are not enumerated' in said and 'give velocities' in said
    assert np.isnan(simulation.sample().qdd).all()
    assert answers(parallelogram(flat, n))['initial velocities'] == (NOTE, said)


@pytest.mark.thorough
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


@pytest.mark.parametrize('offset', [6e-5, 1e-4, 2e-4, 4e-4])
@pytest.mark.parametrize(('crank', 'coupler'), [(0.7, 1.19), (1.07, 2.51)])
def test_soft_rows_beside_a_position_do_not_contradict(
    crank: float, coupler: float, offset: float
) -> None:
    """Three four-bars, two of them crossed: the velocity of the first crank tells the others."""
    pattern = [True, True, False]
    alone = crossed_bars.crossed_four_bars(crank, coupler, pattern)
    places, rates = alone.position(offset).reshape(-1, 2), alone.tangent(offset).reshape(-1, 2)
    scene = load_scene(
        {
            'mechanism': crossed_bars.crossed_mechanism(crank, coupler, pattern),
            'initial': {
                'positions': {f'B{k}': at.tolist() for k, at in enumerate(places)},
                'velocities': {'B0': rates[0].tolist()},
            },
        }
    )
    # lengths as drawn are off by rounding, 1e-16, which turns a row by 1e-16 over the square
    assert Simulation(scene).sample().qd == pytest.approx(rates.ravel(), rel=1e-5, abs=1e-9)
