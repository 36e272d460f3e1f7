"""Mechanisms that move although rows hold a direction to second order only, wherever they go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import (
    AlfError,
    AssemblyError,
    Simulation,
    StepError,
    equilibrium,
    linearise,
    load_scene,
)
from alf_ros.arrays import Floats
from alf_ros.inspection.answer import NOTE
from alf_ros.inspection.soundness import examine
from support.thorough import combined, thinned

G = 9.81
LENGTH = 1.3  # of rods, m
PLATE, ROD = 2.0, 0.3  # kg
STEPS = {'rk4': 1e-3, 'dop853': 5e-3, 'dop853_adaptive': 1e-2, 'esdirk43_adaptive': 2e-3}
# feet of the rods (m): on a circle, or not; the plate of the first three may turn about the axis
# of the circle too, where the rods stand upright
FEET = {
    'square': [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)],
    'circle': [(math.cos(a), math.sin(a)) for a in (0.0, 1.1, 2.3, 3.7, 5.2)],
    'hexagon': [(math.cos(a), math.sin(a)) for a in np.arange(6) * math.pi / 3.0],
    'parallelogram': [(1.0, 1.0), (-0.6, 1.0), (-1.0, -1.0), (0.6, -1.0)],
    'four': [(1.0, 0.2), (-0.7, 1.0), (-1.0, -0.9), (0.5, -1.1)],
    'five': [(1.0, 0.2), (-0.7, 1.0), (-1.0, -0.9), (0.5, -1.1), (0.1, 0.3)],
}
# from the feet to the plate, and velocities across
WAYS = {
    'down': ([0.0, 0.0, -1.0], [0.7, 0.3, 0.0]),
    'lean': ([0.6, 0.0, -0.8], [0.4, -0.5, 0.3]),
    'skew': ([0.48, 0.36, -0.8], [0.4, 0.0, 0.24]),
}


def plate(feet: str, way: str, moving: bool = True, off: float = 0.0) -> dict[str, Any]:
    """A plate on equal, parallel rods. Its centre of mass is `off` (m) from the middle of the
    feet."""
    along, velocity = WAYS[way]
    rod = LENGTH * np.array(along)
    points: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for k, (x, y) in enumerate(FEET[feet]):
        points[f'A{k}'] = {'at': [x, y, 0.0], 'fixed': True}
        points[f'B{k}'] = {'at': [x + rod[0], y + rod[1], rod[2]]}
        bodies[f'rod{k}'] = {'points': [f'A{k}', f'B{k}'], 'mass': ROD, 'inertia': 'rod'}
        ball = {'type': 'spherical'}
        joints[f'foot{k}'] = {**ball, 'between': ['ground', f'rod{k}'], 'at': f'A{k}'}
        joints[f'head{k}'] = {**ball, 'between': [f'rod{k}', 'plate'], 'at': f'B{k}'}
    middle = np.mean(FEET[feet], axis=0) + [off, 0.0]
    points['C'] = {'at': [middle[0] + rod[0], middle[1] + rod[1], rod[2]]}
    heads = [name for name in points if name.startswith('B')]
    bodies['plate'] = {
        'points': ['C', *heads],
        'mass': PLATE,
        'com': [0.0, 0.0, 0.0],
        'inertia': {'about_com': [0.5, 0.5, 0.9]},
    }
    mechanism = {
        'alf': 1,
        'space': 'spatial',
        'points': points,
        'bodies': bodies,
        'joints': joints,
    }
    scene = {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [0.0, 0.0, -G]}}}
    if moving:
        scene['initial'] = {'velocities': dict.fromkeys(heads[:3], velocity)}
    return scene


def swung(feet: str, way: str, moving: bool, t: float) -> Floats:
    """How far (m) all points of the plate have moved at t (s): as a spherical pendulum, whose mass
    and weight count rods by their moment about the feet."""
    along, velocity = WAYS[way]
    rods = ROD * len(FEET[feet])
    weight = np.array([0.0, 0.0, -G * (PLATE + rods / 2.0) / (PLATE + rods / 3.0)])

    def rate(_: float, y: Floats) -> Floats:
        r, v = y[:3], y[3:]
        return np.concatenate([v, weight - r * (weight @ r + v @ v) / LENGTH**2])

    start = LENGTH * np.array(along)
    begin = np.concatenate([start, velocity if moving else np.zeros(3)])
    return np.asarray(
        solve_ivp(rate, (0.0, t), begin, 'DOP853', rtol=1e-13, atol=1e-14).y[:3, -1] - start
    )


CASES = [(feet, way) for feet in FEET for way in WAYS]


@pytest.mark.parametrize('moving', [True, False])
@pytest.mark.parametrize(
    ('feet', 'way', 'integrator'),
    combined(thinned(CASES, keep=[('four', 'skew'), ('hexagon', 'down')]), STEPS),
)
def test_a_plate_on_parallel_rods_swings(
    feet: str, way: str, integrator: str, moving: bool
) -> None:
    """It was refused, as if its lengths contradicted each other: walks turned it a little about
    the direction of the rods, along which they open with the square of the angle only."""
    scene = load_scene(plate(feet, way, moving))
    sim = Simulation(scene, step=STEPS[integrator], integrator=integrator)
    assert sim.adjustment is None
    before, after = sim.sample().points, sim.sample().points
    for _ in sim.run(1.0):
        after = sim.sample().points
    moved = swung(feet, way, moving, 1.0)
    for name in after:
        if not name.startswith('A'):
            assert after[name] - before[name] == pytest.approx(moved, abs=1e-10)


def hung_below(feet: str) -> dict[str, Any]:
    """The same, with a second plate on rods below the first one."""
    scene = plate(feet, 'lean')
    mechanism, rod = scene['mechanism'], LENGTH * np.array([0.0, -0.6, -0.8])
    points, bodies, joints = (mechanism[key] for key in ('points', 'bodies', 'joints'))
    for name in [name for name in points if not name.startswith('A')]:
        points[f'{name}low'] = {'at': (np.array(points[name]['at']) + rod).tolist()}
    for k in range(len(FEET[feet])):
        bodies[f'low{k}'] = {**bodies[f'rod{k}'], 'points': [f'B{k}', f'B{k}low']}
        ball = {'type': 'spherical'}
        joints[f'low_foot{k}'] = {**ball, 'between': ['plate', f'low{k}'], 'at': f'B{k}'}
        joints[f'low_head{k}'] = {**ball, 'between': [f'low{k}', 'below'], 'at': f'B{k}low'}
    bodies['below'] = {
        **bodies['plate'],
        'points': [f'{name}low' for name in bodies['plate']['points']],
    }
    velocities = scene['initial']['velocities']
    velocities |= {f'{name}low': [0.7, -0.1, 0.0] for name in velocities}
    return scene


def two_bobs(feet: str) -> dict[str, Any]:
    """A double pendulum of as much mass."""
    rods = {'mass': ROD * len(FEET[feet]), 'inertia': 'rod'}
    bob = {'mass': PLATE, 'inertia': {'about_com': [0.1, 0.1, 0.1]}}
    places = LENGTH * np.cumsum([[0.0, 0.0, 0.0], [0.6, 0.0, -0.8], [0.0, -0.6, -0.8]], axis=0)
    between = {
        'top': ('ground', 'upper', 'P0'),
        'middle': ('upper', 'lower', 'P1'),
        'first': ('upper', 'plate', 'P1'),
        'second': ('lower', 'below', 'P2'),
    }
    mechanism = {
        'alf': 1,
        'space': 'spatial',
        'points': {
            f'P{k}': {'at': place.tolist(), 'fixed': not k} for k, place in enumerate(places)
        },
        'bodies': {
            'upper': {'points': ['P0', 'P1'], **rods},
            'lower': {'points': ['P1', 'P2'], **rods},
            'plate': {'points': ['P1'], **bob},
            'below': {'points': ['P2'], **bob},
        },
        'joints': {
            name: {'type': 'spherical', 'between': [one, other], 'at': at}
            for name, (one, other, at) in between.items()
        },
    }
    return {
        'mechanism': mechanism,
        'effects': {'gravity': {'acceleration': [0.0, 0.0, -G]}},
        'initial': {'velocities': {'P1': WAYS['lean'][1], 'P2': [0.7, -0.1, 0.0]}},
    }


@pytest.mark.parametrize('feet', thinned(FEET, ['square', 'five']))
def test_a_plate_below_a_plate_swings_as_a_double_pendulum(feet: str) -> None:
    plates, bobs = (
        Simulation(load_scene(each(feet)), step=1e-3) for each in (hung_below, two_bobs)
    )
    start = plates.sample().points
    for sim in (plates, bobs):
        sim.step(500)
    now, other = plates.sample().points, bobs.sample().points
    first = LENGTH * np.array([0.6, 0.0, -0.8])
    assert now['B1'] - start['B1'] == pytest.approx(other['P1'] - first, abs=1e-12)
    second = first + LENGTH * np.array([0.0, -0.6, -0.8])
    assert now['B1low'] - start['B1low'] == pytest.approx(other['P2'] - second, abs=1e-12)


@pytest.mark.parametrize('integrator', STEPS)
def test_a_plate_that_hangs_at_rest_stays(integrator: str) -> None:
    """Accelerations of 1e-16 m/s² were followed as if they had a direction."""
    sim = Simulation(
        load_scene(plate('square', 'down', moving=False)), step=1e-2, integrator=integrator
    )
    sim.step(50)
    assert np.abs(sim.state.q - sim.initial_state.q).max() < 1e-14


def turned(sim: Simulation) -> float:
    """By how much (m) the plate has turned: between its first head and its centre."""
    first = sim.initial_state.q.reshape(-1, 3)
    of, now = sim.model.layout.of_point, sim.state.q.reshape(-1, 3)
    head, centre = of['B0'], of['C']
    return float(np.abs((now[head] - now[centre]) - (first[head] - first[centre])).max())


@pytest.mark.parametrize('off', thinned([1e-2, 1e-3, 1e-5, 1e-7, 1e-9], [1e-3, 1e-7]))
@pytest.mark.parametrize(('feet', 'way'), thinned(CASES, keep=[('four', 'down')]))
def test_a_plate_that_is_pushed_round_moves_right_or_says_so(
    feet: str, way: str, off: float
) -> None:
    """No finite forces of rods hold it where its centre of mass lies beside their middle. Rods of
    any stiffness would, so it swings as if nothing pushed, until steps cannot hold it."""
    sim = Simulation(load_scene(plate(feet, way, off=off)), step=1e-3)
    try:
        for _ in range(10):
            sim.step(100)
            assert turned(sim) < 1e-5
    except StepError as error:
        assert off > 1e-8
        assert 'shaky wherever it goes' in error.reason or 'singular position' in error.reason


@pytest.mark.parametrize('later', [False, True])
@pytest.mark.parametrize('way', WAYS)
def test_a_moment_about_the_rods_is_refused_by_name(way: str, later: bool) -> None:
    sim = Simulation(load_scene(plate('four', way)), step=1e-3)
    if later:
        sim.step(300)
    sim.apply_wrench('B0', [1.0, 2.0, 0.0])
    with pytest.raises(StepError, match='shaky wherever it goes, B0, B1, B2, B3.*may yield'):
        sim.step(100)


@pytest.mark.parametrize('error', thinned([1e-4, 1e-6, 1e-8, 1e-10], [1e-6, 1e-10]))
@pytest.mark.parametrize(('feet', 'way'), thinned(CASES, keep=[('four', 'down')]))
def test_a_rod_of_another_length_is_refused(feet: str, way: str, error: float) -> None:
    scene = plate(feet, way)
    foot = scene['mechanism']['points']['A3']
    foot['at'] = (np.array(foot['at']) - error * np.array(WAYS[way][0])).tolist()
    with pytest.raises(AlfError, match=r'contradict|singular position|shaky'):
        Simulation(load_scene(scene), step=1e-3).step(1000)


def test_statics_name_what_counts_as_free() -> None:
    """To first order the plate may turn, too, which no linear model shows to be false."""
    scene = load_scene(plate('four', 'lean', moving=False))
    rest = equilibrium(scene)
    assert rest.stability == 'stable'
    assert rest.points['C'] == pytest.approx([*np.mean(FEET['four'], axis=0), -LENGTH], abs=1e-9)
    weight, mass = (PLATE + 4.0 * ROD / part for part in (2.0, 3.0))
    swing = math.sqrt(G * weight / mass / LENGTH) / (2.0 * math.pi)
    for found in (rest, linearise(rest)):
        assert np.sum(np.abs(found.frequencies - swing) < 1e-9) == 2
        told = 'rows hold 1 of the directions to second order only'
        assert any(told in note for note in found.notes)


def pin(one: str, other: str, at: str) -> dict[str, Any]:
    return {'type': 'revolute', 'between': [one, other], 'at': at}


def hung_up(angle: float, speed: float) -> dict[str, Any]:
    """A pendulum at an angle (rad) that hangs on two bars in line; the speed of its bob, m/s."""
    bar = {'mass': 1.0, 'inertia': 'rod'}
    s, c = math.sin(angle), math.cos(angle)
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {
            'A': {'at': [0.0, 0.0], 'fixed': True},
            'B': {'at': [2.0, 0.0], 'fixed': True},
            'C': {'at': [1.0, 0.0]},
            'D': {'at': [1.0 + s, -c]},
        },
        'bodies': {
            'left': {'points': ['A', 'C'], **bar},
            'right': {'points': ['C', 'B'], **bar},
            'bob': {'points': ['C', 'D'], **bar},
        },
        'joints': {
            'a': pin('ground', 'left', 'A'),
            'b': pin('ground', 'right', 'B'),
            'c': pin('left', 'right', 'C'),
            'd': pin('left', 'bob', 'C'),
        },
    }
    return {
        'mechanism': mechanism,
        'effects': {'gravity': {'acceleration': [0.0, -G]}},
        'initial': {'velocities': {'D': [speed * c, speed * s]}},
    }


@pytest.mark.parametrize('weight', [True, False])
@pytest.mark.parametrize('angle', [0.0, 0.3, 1.2])
def test_a_pendulum_on_two_bars_in_line_pulls_them_where_they_yield(
    angle: float, weight: bool
) -> None:
    scene = hung_up(angle, 1.0)
    if not weight:
        del scene['effects']
    with pytest.raises(StepError, match='shaky wherever it goes, C, D may yield'):
        Simulation(load_scene(scene), step=1e-3).step(100)


def test_such_a_pendulum_that_nothing_pulls_stays() -> None:
    scene = hung_up(0.3, 0.0)
    del scene['effects']
    sim = Simulation(load_scene(scene), step=1e-2)
    sim.step(10)
    assert np.array_equal(sim.state.q, sim.initial_state.q)


def test_two_bars_in_line_that_hang_up_a_pendulum_are_shaky() -> None:
    with pytest.raises(AssemblyError, match='infinitesimally mobile only'):
        Simulation(load_scene(hung_up(0.0, 0.0)))


def test_check_tells_how_many_directions_yield() -> None:
    found = examine(load_scene(hung_up(0.3, 0.0)))
    by_question = {answer.question: answer for answer in found.answers}
    told = by_question['initial position']
    assert found.sound and told.verdict == NOTE
    assert 'shaky wherever it goes: rows hold 1 of the 2 freedoms of velocity' in told.answer
    assert by_question['mobility'].answer == '2 freedoms of velocity, 1 of position'
    assert 'initial velocities' not in by_question  # it leaves on no branch
