"""Starts in singular positions at rest or driven: where forces and drives lead, or cannot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from alf_ros import Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.inspection.answer import BAD
from alf_ros.scene.scene import INTEGRATORS
from alf_ros.studies.exact import one_freedom
from support.singular_starts import (
    FLAT,
    IN_LINE,
    answers,
    change_point,
    change_point_rates,
    motor,
    refused,
    scene,
    slope,
    velocities,
)
from support.thorough import combined

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


@pytest.mark.parametrize(('angle', 'D'), combined([0.05, 0.7, 2.0, 4.1], [2, 3]))
def test_a_table_on_two_parallel_guides_is_not(D: int, angle: float) -> None:
    """Nothing turns, so that all that rows leave of an acceleration is rounding: with guides that
    lay aslant the start was refused."""
    turn = Rotation.from_rotvec([0.0, angle / 2.0 if D == 3 else 0.0, angle])
    x, y, z = turn.as_matrix().T[:, :D]
    at = dict(zip('ABC', ([0.0] * D, y.tolist(), z.tolist()), strict=True))
    points = [*'ABC'][:D]
    body = {2: {'inertia': 'rod'}, 3: {'com': at['A'], 'inertia': {'about_com': [0.1] * 3}}}[D]
    guide = {'type': 'prismatic', 'axis': x.tolist()}
    mechanism = {
        'alf': 1,
        'space': 'planar' if D == 2 else 'spatial',
        'points': {name: {'at': at[name]} for name in points},
        'bodies': {'table': {'points': points, 'mass': 2, **body}},
        'joints': {n: {**guide, 'between': ['ground', 'table'], 'at': n.upper()} for n in 'ab'},
    }
    gravity = [0.0, -9.81, 0.0][:D]
    effects = {'gravity': {'acceleration': gravity}}
    pushed = scene(mechanism, {}, effects, A=(0.3 * x).tolist())
    assert answers(pushed)['initial position'][1] == 'not singular'
    simulation = Simulation(pushed)
    simulation.step(100)
    t = simulation.t
    way = 0.3 * t + 0.5 * (gravity @ x) * t * t
    assert simulation.sample().points['A'][:D] == pytest.approx(way * x, abs=1e-12)


# ------------------------------------------------------------------------------------------ drives


def test_driven_through_the_position() -> None:
    """The crank is driven: the coupler follows or folds, and the start must say which."""
    said = refused(scene(drives=motor('pi/2 + t')))
    assert 'fit 2 branches, A: [-1, 0] with 1) B: [-2, 0], or 2) B: [0, 0] m/s' in said
    said = refused(scene(drives=motor('pi/2 + t'), B=[-1, 0]))
    assert 'no motion begins' in said and 'A: [-1, 0] with 1) B: [-2, 0], or 2) B: [0, 0]' in said
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
    assert 'accelerate' in said and 'A: [-2, 0] with 1) B: [-4, 0], or 2) B: [0, 0]' in said
    assert not Simulation(scene(drives=motor('pi/2'))).state.qd[:4].any()


def test_a_slider_that_is_pushed_from_rest_below_an_upright_crank() -> None:
    """Held there, the crank swings about the pin with the coupler on it, and one row depends on
    others all the way. A drive that moves the slider makes that a singular position."""
    effects = {'gravity': {'acceleration': [1.0, -9.81]}}
    held = Simulation(scene(effects=effects, drives={'push': {'joint': 'guide', 'length': 0.0}}))
    assert held.sample().qdd[:4] == pytest.approx([1.5, 0.0, 0.0, 0.0], abs=1e-9)
    push = {'push': {'joint': 'guide', 'length': '3*t*t'}}
    pushed = Simulation(scene(effects={}, drives=push))
    sample = pushed.sample()
    assert np.isnan(sample.qdd[:4]).all()  # A: [3, 0], which rows without the lost one do not tell
    assert np.isnan(sample.drive_efforts['push']).all()
    with pytest.raises(StepError, match='a singular position is near'):
        pushed.step()


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
    assert 'not unique' in said and 'A: [1, 0] with 1) B: [2, 0], or 2) B: [0, 0]' in said
    effects['constant_wrench']['two']['force'] = [1.1, 0]
    simulation = Simulation(scene(effects=effects))
    simulation.step(100)
    points = simulation.sample().points
    assert points['B'][0] == pytest.approx(2 * points['A'][0], abs=1e-9)
    effects['constant_wrench']['two']['force'] = [0.9, 0]
    simulation = Simulation(scene(effects=effects))
    simulation.step(100)
    assert simulation.sample().points['B'] == pytest.approx([0, 0], abs=1e-9)


PENDULUM = {
    'points': {'P': {'at': [5, 0], 'fixed': True}, 'T': {'at': [5.5, 0]}},
    'bodies': {'bob': {'points': ['P', 'T'], 'mass': 1.0, 'inertia': 'rod'}},
    'joints': {'pivot': {'type': 'revolute', 'between': ['ground', 'bob'], 'at': 'P'}},
}


def beside_a_pendulum() -> dict[str, Any]:
    """The flat double four-bar, and a pendulum that is no part of it."""
    source: dict[str, Any] = yaml.safe_load(scene('double_four_bar', FLAT).text)
    for section, entries in PENDULUM.items():
        source['mechanism'][section].update(entries)
    return source


def test_a_sample_at_rest_of_a_large_and_a_small_part() -> None:
    """The pendulum turns so much from place to place that values between them were not determined:
    its acceleration and the force in its pivot, both unique, were NaN."""
    sample = Simulation(load_scene(beside_a_pendulum())).sample()
    assert sorted(sample.qdd) == pytest.approx([-14.715] + 3 * [-11.445] + 4 * [0.0], abs=1e-4)
    pivot = sample.reactions['pivot']
    assert pivot.force == pytest.approx([0.0, 9.81 / 4], abs=1e-4) and not pivot.indeterminate


@pytest.mark.parametrize('driven', [False, True])
def test_a_loop_at_rest_in_its_position_while_another_part_moves(driven: bool) -> None:
    """Gravity sets the flat four-bars in motion, but no velocity leads out of their position. The
    accelerations were those without the lost rows, and reactions balanced them."""
    source = beside_a_pendulum()
    if driven:
        source['drives'] = {'motor': {'joint': 'pivot', 'angle': '3*t'}}
    else:
        source['initial']['velocities'] = {'T': [0, 3], **{f'B{k}': [0, 0] for k in range(3)}}
    sample = Simulation(load_scene(source)).sample()
    rests = Simulation(load_scene({**beside_a_pendulum(), 'drives': {}})).sample()
    assert sample.qd.any() and not rests.qd.any() and rests.qdd.any()
    assert np.count_nonzero(np.abs(sample.qdd - rests.qdd) > 1e-9) <= 2  # of T
    source['effects'] = {}  # then it stays where it is
    sample = Simulation(load_scene(source)).sample()
    assert sorted(sample.qdd) == pytest.approx([-4.5 if driven else -18.0] + 7 * [0.0], abs=1e-12)


# --------------------------------------------------------------------------- beside what moves


BESIDE = """\
alf: 1
points:
  O: {at: [0, 0], fixed: true}
  A: {at: [1, 0]}
  B: {at: [3, 0]}
  C: {at: [2, 0], fixed: true}
  P: {at: [5, 0], fixed: true}
  Q: {at: [5, -1]}
bodies:
  crank: {points: [O, A], mass: 1, inertia: rod}
  coupler: {points: [A, B], mass: 1, inertia: rod}
  rocker: {points: [C, B], mass: 2, inertia: rod}
  pendulum: {points: [P, Q], mass: 1, inertia: rod}
joints:
  o: {type: revolute, between: [ground, crank], at: O}
  a: {type: revolute, between: [crank, coupler], at: A}
  b: {type: revolute, between: [coupler, rocker], at: B}
  c: {type: revolute, between: [ground, rocker], at: C}
  p: {type: revolute, between: [ground, pendulum], at: P}
"""


def check_it_leaves_as_alone(beside: Simulation, alone: Simulation) -> None:
    """The loop, for 100 steps."""
    for steps in (1, 5, 94):
        alone.step(steps)
        beside.step(steps)
        for point in 'AB':
            there = alone.sample().points[point]
            assert beside.sample().points[point] == pytest.approx(there, abs=1e-11)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43'])
def test_a_flat_loop_beside_a_swing_leaves_as_it_does_alone(integrator: str) -> None:
    mechanism = yaml.safe_load(BESIDE)
    alone = Simulation(scene(mechanism, {}), integrator=integrator)
    beside = Simulation(scene(mechanism, {}, Q=[8.0, 0.0]), integrator=integrator)
    fallen = alone.sample().qdd[:4]
    assert np.abs(fallen).max() > 5.0
    assert beside.sample().qdd[:4] == pytest.approx(fallen, abs=1e-9)
    check_it_leaves_as_alone(beside, alone)
    assert beside.sample().energy == pytest.approx(32.0 / 3.0 - 4.905, abs=1e-8)


@pytest.mark.parametrize(
    ('motion', 'integrator'),
    combined(
        [
            '-pi/2 + 0.5*t**2',
            '-pi/2 + t**3',
            '-pi/2 + 0.3*(1 - cos(9*t))',
            {'table': [[0.0, -math.pi / 2.0], [0.05, -1.4], [0.1, -1.5]]},
        ],
        ['rk4', 'dop853', 'dop853_adaptive', 'esdirk43'],
    ),
)
def test_a_flat_loop_beside_a_drive_that_begins_at_rest_leaves_as_it_does_alone(
    motion: Any, integrator: str
) -> None:
    """It was refused, at the start or at the first step: the radius of the path of all, which the
    acceleration of the drive made zero, was taken for its own."""
    mechanism = yaml.safe_load(BESIDE)
    drive = {'sway': {'joint': 'p', 'angle': motion}}
    alone = Simulation(scene(mechanism, {}), integrator=integrator)
    beside = Simulation(scene(mechanism, {}, drives=drive), integrator=integrator)
    assert beside.sample().qdd[:4] == pytest.approx(alone.sample().qdd[:4], abs=1e-9)
    check_it_leaves_as_alone(beside, alone)


def test_a_flat_loop_on_a_body_that_swings_is_named() -> None:
    """How a loop leaves that is carried along is not told by forces alone."""
    mechanism = yaml.safe_load(BESIDE)
    points, bodies, joints = (mechanism[each] for each in ('points', 'bodies', 'joints'))
    points['O'], points['C'] = {'at': [0, 0]}, {'at': [2, 0]}
    bodies['pendulum']['points'] = ['P', 'Q', 'O', 'C']
    bodies['pendulum'] |= {'com': [1.0, 0.0], 'inertia': {'about_com': 1.0}}
    joints['o']['between'] = ['pendulum', 'crank']
    joints['c']['between'] = ['pendulum', 'rocker']
    carried = Simulation(scene(mechanism, {}, Q=[4.0, 0.0], A=[0.0, -16.0], B=[0.0, -8.0]))
    with pytest.raises(StepError, match='a loop rests in its singular position, or is slow there'):
        carried.step(20)
