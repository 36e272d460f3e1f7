"""Positions of rest against closed forms and a computation at 30 digits."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from alf_ros import (
    InputError,
    Simulation,
    equilibria,
    equilibrium,
    linearise,
    load_scene,
    modes,
)
from alf_ros.effects.contract.trajectory import through
from alf_ros.scene.scene import Scene, scene_from_text
from alf_ros.studies.statics import descent, newton_rest
from alf_ros.studies.statics.instant import angles
from alf_ros.studies.statics.positions_of_rest import beginning, found_at
from alf_ros.studies.statics.turned_starts import counting, turned_starts
from support.statics_scenes import (
    GRAVITY,
    KNOWN,
    chain,
    level_chain,
    pendulum_and_slider,
    redundant_parallelogram,
    sprung,
)
from support.thorough import combined, thinned


def points_of(known: dict[str, object]) -> dict[str, list[float]]:
    return {name: [float(x) for x in at] for name, at in known['points'].items()}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ('mechanism', 'number'),
    [(name, n) for name, found in KNOWN.items() for n in range(len(found))],
)
def test_rest_and_frequency_are_those_of_30_digits(mechanism: str, number: int) -> None:
    known = KNOWN[mechanism][number]
    at, square = points_of(known), float(known['square'])
    angle = float(known['angle']) + 0.1
    first, radius = next(iter(at)), {'four_bar': 0.1}.get(mechanism, 1.0)
    tip = radius * np.array([np.cos(angle), np.sin(angle)])
    near = {first: tip.tolist()}
    if mechanism == 'double_four_bar':
        near |= {f'B{k}': (tip + [k, 0.0]).tolist() for k in range(3)}
    found = equilibrium(sprung(mechanism, near), nearest=True)
    for name, place in at.items():
        np.testing.assert_allclose(found.points[name], place, rtol=0.0, atol=1e-11)
    assert found.stiffness.shape == (1,)
    assert found.stiffness[0] == pytest.approx(square, rel=1e-10)
    assert found.stability == ('stable' if square > 0.0 else 'unstable')
    assert found.conservative and found.notes == ()


def test_a_descent_ends_in_a_stable_position() -> None:
    known = KNOWN['four_bar'][0]
    found = equilibrium(sprung('four_bar'))
    np.testing.assert_allclose(found.points['B'], points_of(known)['B'], rtol=0.0, atol=1e-11)
    assert found.stability == 'stable'


CROSSED = """
mechanism:
  alf: 1
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [0.3, 0, 0]}}
  bodies:
    one: {points: [O, A], mass: 1, inertia: {about_com: [1, 1, 1]}, com: [0.1, 0.02, 0.05]}
    two: {points: [A], mass: 2, inertia: {about_com: [1, 1, 1]}, com: [0.05, 0.1, -0.03]}
  joints:
    first: {type: revolute, between: [ground, one], at: O, axis: [0, 1, 0]}
    second: {type: revolute, between: [one, two], at: A, axis: [1, 0, 0]}
effects: {gravity: {acceleration: [0, 0, -9.81]}}
"""


@pytest.mark.thorough
def test_bodies_at_rest_are_neither_mirrored_nor_turned_round() -> None:
    """Two crossed hinges: rests of the closed form V / g = b cos q1 - a sin q1, each of them once;
    b depends on q2, the turn of the second mass centre about the axis x of the first body."""
    found = equilibria(scene_from_text(CROSSED), starts=12)
    r, a = np.hypot(0.1, 0.03), 0.1 + 2.0 * (0.3 + 0.05)
    top = np.arctan2(0.1, -0.03)  # of the second mass centre along z of the first body
    wanted = []
    for q2, b in ((top, 0.05 + 2.0 * r), (top + np.pi, 0.05 - 2.0 * r)):
        wanted += [(np.arctan2(-a, b) + up, q2) for up in (0.0, np.pi)]
    level = np.arccos(-0.025 / r)  # b = 0: the first body hangs or stands, x along the vertical
    wanted += [(q1, top + q2) for q1 in (0.5 * np.pi, -0.5 * np.pi) for q2 in (level, -level)]
    places = []
    for each in found:
        at = [each.joints[name].position for name in ('first', 'second')]
        apart = np.abs(np.exp(1j * np.subtract(wanted, at)) - 1.0).max(axis=1)
        assert apart.min() < 1e-9
        places.append(int(apart.argmin()))
    assert len(set(places)) == len(places) > 2
    assert [each.stability for each in found] == ['stable', *['unstable'] * (len(found) - 1)]


def test_several_starts_find_all_that_are_known() -> None:
    found = equilibria(sprung('four_bar'), starts=8)
    open_ones = {round(float(np.arctan2(*e.points['A'][::-1])), 9) for e in found}
    assert {round(float(each['angle']), 9) for each in KNOWN['four_bar']} <= open_ones
    kinds = [e.stability for e in found]
    assert kinds == sorted(kinds) and set(kinds) == {'stable', 'unstable'}


def test_a_wheel_on_a_line_comes_to_rest_without_slip() -> None:
    """An eccentric wheel on a spring: x = -r θ, which the search has to keep."""
    r, hub = 0.2, [0.0, 0.2]
    floor, level = {'through': [0, 0], 'direction': [1, 0]}, {'through': hub, 'direction': [1, 0]}
    both = {'between': ['ground', 'wheel']}
    wheel = {'points': ['W', 'X'], 'mass': 2.0, 'com': [0.1, 0], 'inertia': {'about_com': 0.05}}
    spring = {'between': ['W', 'ground'], 'at': [None, [-3, r]], 'stiffness': 30, 'free_length': 3}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'W': {'at': hub}, 'X': {'at': [r, r]}},
                'bodies': {'wheel': wheel},
                'joints': {
                    'line': {'type': 'slider', **both, 'point': 'W', 'on': level},
                    'tread': {'type': 'no_slip', **both, 'at': 'W', 'radius': r, 'on': floor},
                },
            },
            'effects': {'gravity': {'acceleration': [3.0, -9.81]}, 'spring': spring},
        }
    )

    def force(angle: float) -> float:
        weight = 2.0 * 0.1 * (3.0 * np.sin(angle) + 9.81 * np.cos(angle))
        return float(r * (30.0 * r * angle + 2.0 * 3.0) + weight)

    expected = -r * brentq(force, -2.0, 0.0, xtol=1e-14)
    for rest in (
        equilibrium(scene),
        equilibrium(scene, nearest=True),
        *equilibria(scene, starts=3),
    ):
        assert rest.points['W'][0] == pytest.approx(expected, abs=1e-10)


def coupled(**drives: object) -> Scene:
    """Two bars on the ground: one turns twice as far as the other."""
    points = {'O': [0, 0], 'P': [3, 0], 'A': [1, 0], 'B': [4, 0]}
    rod = {'mass': 1.0, 'inertia': 'rod'}
    pins = (('first', 'a', 'O'), ('second', 'b', 'P'))
    mechanism = {
        'alf': 1,
        'points': {name: {'at': at, 'fixed': name in 'OP'} for name, at in points.items()},
        'bodies': {'a': {'points': ['O', 'A'], **rod}, 'b': {'points': ['P', 'B'], **rod}},
        'joints': {
            name: {'type': 'revolute', 'between': ['ground', body], 'at': at}
            for name, body, at in pins
        },
        'couplings': {'belt': {'joints': {'first': 1, 'second': -2}}},
    }
    return load_scene({'mechanism': mechanism, 'drives': drives, 'effects': GRAVITY})


@pytest.mark.thorough
def test_couplings_keep_their_phase_from_random_starts() -> None:
    found = equilibria(coupled(), starts=8)
    assert len(found) > 1
    for each in found:
        first, second = (each.joints[name].position for name in ('first', 'second'))
        assert first == pytest.approx(2.0 * second, abs=1e-9)


@pytest.mark.parametrize(
    ('angle', 'expected'),
    thinned(
        [('2*t', 14.0), ({'table': [[0, 0], [3, 0], [4, 14], [7, 14]]}, 14.0)],
        keep=lambda angle, expected: angle == '2*t',
    ),
)
def test_drives_bring_couplings_along(angle: object, expected: float) -> None:
    """Over turns, and also where a table rests at the end of a long step."""
    rest = equilibrium(coupled(motor={'joint': 'first', 'angle': angle}), t=7.0)
    assert rest.joints['first'].position == pytest.approx(expected, abs=1e-9)
    assert rest.joints['second'].position == pytest.approx(0.5 * expected, abs=1e-9)


def test_a_rotor_makes_no_other_positions() -> None:
    found = equilibria(chain(1, {**GRAVITY, 'motor': {'joint': 'j0', 'armature': 0.5}}), starts=6)
    assert [round(float(each.points['P1'][1]), 6) for each in found] == [-1.0]


def test_a_torsion_spring_rests_turns_away() -> None:
    """k (θ - θ₀) + ½ m g L cos θ = 0 has roots in several turns of a soft spring."""
    drawn, k = np.arctan2(-1.0, 0.1), 0.3
    torque, rate = 0.5 * 9.81 * np.hypot(1.0, 0.1), 1e-3
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0.1, -1]}},
                'bodies': {'bar': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'}},
                'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
            },
            'effects': {**GRAVITY, 'torsion_spring': {'joint': 'pin', 'stiffness': k}},
        }
    )

    def force(angle: float) -> float:
        return float(k * (angle - drawn) + torque * np.cos(angle))

    grid = np.arange(drawn - 2.5 * np.pi, drawn + 2.5 * np.pi, rate)
    expected = [
        brentq(force, low, high, xtol=1e-13)
        for low, high in zip(grid[:-1], grid[1:], strict=True)
        if force(low) < 0.0 < force(high)
    ]
    for starts in (0, 4):
        found = equilibria(scene, starts=starts)
        stable = sorted(e.joints['pin'].position for e in found if e.stability == 'stable')
        np.testing.assert_allclose(stable, expected, atol=1e-10)
    assert len(expected) == 3


def test_turns_of_a_loop_belong_together() -> None:
    """The crank comes round, with its loop; the rocker cannot."""
    springs = {name: {'joint': name, 'stiffness': 0.1} for name in ('crank_pin', 'rocker_pin')}
    effects = {**GRAVITY, 'torsion_spring': springs}
    _, start = beginning(load_scene({'mechanism': 'four_bar', 'effects': effects}), None)
    which = counting(start)
    assert which.sum() == 2 < which.size
    before = angles(start.model, start.q, start.turns)[0]
    turned = turned_starts(start, which)
    assert len(turned) == 2
    for each, sense in zip(turned, (1.0, -1.0), strict=True):
        after = angles(start.model, each.q, each.turns)[0]
        turns = np.where(np.arange(before.size) == np.flatnonzero(which)[0], sense, 0.0)
        np.testing.assert_allclose((after - before) / (2.0 * np.pi), turns, atol=0.05)
    _, still = beginning(sprung('four_bar'), None)
    assert not counting(still).any()


def test_a_hanging_chain_has_the_zeros_of_laguerre() -> None:
    found = equilibrium(chain(8))
    zeros = np.polynomial.laguerre.lagroots([0.0] * 8 + [1.0])
    np.testing.assert_allclose(found.stiffness, 9.81 * zeros, rtol=1e-10)
    np.testing.assert_allclose(found.points['P8'], [0.0, -8.0], atol=1e-12)
    np.testing.assert_allclose(
        found.frequencies, np.sqrt(9.81 * zeros) / (2.0 * np.pi), rtol=1e-10
    )
    # a mode moves with unit kinetic energy ½ at unit speed
    tips = found.directions.reshape(8, 8, 2)
    np.testing.assert_allclose((tips**2).sum(axis=(1, 2)), np.ones(8), rtol=1e-12)
    assert found.reactions['j0'].force[1] == pytest.approx(8 * 9.81, rel=1e-12)


def test_redundant_rows_change_nothing() -> None:
    found = equilibrium(redundant_parallelogram())
    assert found.stability == 'stable' and found.stiffness.shape == (1,)
    assert found.stiffness[0] == pytest.approx(9.81 * 2.5 / 2.0, rel=1e-11)
    np.testing.assert_allclose(found.points['B1'], [1.0, -1.0], atol=1e-12)
    loads = [found.reactions[f'pin{k}'] for k in range(3)]
    assert all(load.indeterminate for load in loads)
    assert sum(load.force[1] for load in loads) == pytest.approx(4 * 9.81, rel=1e-11)


def test_upright_is_unstable_and_says_how_it_falls() -> None:
    found = equilibrium(redundant_parallelogram(np.pi / 2.0))
    assert found.stability == 'unstable'
    assert found.stiffness[0] == pytest.approx(-9.81 * 2.5 / 2.0, rel=1e-12)
    assert np.isnan(found.frequencies[0])
    motion = dict(zip(('B0', 'B1', 'B2'), found.directions[0].reshape(-1, 2), strict=True))
    np.testing.assert_allclose(motion['B1'], [np.sqrt(0.5), 0.0], atol=1e-12)


def test_nothing_acts_is_neutral() -> None:
    found = equilibrium(load_scene({'mechanism': 'bricard', 'effects': {}}))
    assert found.stability == 'neutral' and found.residual == 0.0


def test_held_inputs_count_and_the_state_can_be_restored() -> None:
    simulation = Simulation(chain(1))
    simulation.apply_wrench('P1', force=[9.81, 0.0])
    found = equilibrium(simulation)
    np.testing.assert_allclose(
        found.points['P1'], np.array([1.0, -1.0]) * np.sqrt(0.5), atol=1e-12
    )
    assert found.stiffness[0] == pytest.approx(9.81 * np.sqrt(2.0), rel=1e-11)
    simulation.restore(found.state)
    simulation.step(200)
    np.testing.assert_allclose(simulation.sample().points['P1'], found.points['P1'], atol=1e-12)


def test_a_follower_moment_beside_gravity() -> None:
    """Torque T on a pendulum: sin of the angle from the vertical is T / (m g l)."""
    scene = chain(1, {**GRAVITY, 'constant_wrench': {'on': 'b0', 'torque': 9.81 / 2.0}})
    found = equilibrium(scene)
    np.testing.assert_allclose(found.points['P1'], [0.5, -np.sqrt(0.75)], atol=1e-12)
    assert found.stiffness[0] == pytest.approx(9.81 * np.sqrt(0.75), rel=1e-11)


def test_drives_are_frozen_at_the_instant_asked_for() -> None:
    scene = load_scene(
        {
            'mechanism': 'double_pendulum',
            'effects': GRAVITY,
            'drives': {'turn': {'joint': 'shoulder', 'angle': '0.5*t'}},
        }
    )
    found = equilibrium(scene, t=1.0)
    elbow = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(found.points['A'], elbow, atol=1e-12)
    np.testing.assert_allclose(found.points['B'], elbow - [0.0, 0.8], atol=1e-12)
    assert found.stiffness[0] == pytest.approx(1.5 * 9.81 / 0.8, rel=1e-11)
    assert found.t == 1.0 and 'drives are frozen at t = 1 s' in found.notes


READS_TIME = """
from dataclasses import dataclass, field
import math
from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, push

MULTIPLE = True

@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint'})

def pack(effects, layout):
    measures = Measures(layout)
    for effect in effects:
        measures.add_coordinate(effect.parameters.joint)
        measures.give([])
    return measures.packed()

@contract.force
def force(t, q, qd, near, slots, params, Q):
    for n in range(slots[1]):
        push(q, slots, params, n, math.sin(t), Q)
"""


def test_what_reads_time_says_the_instant(tmp_path: Path) -> None:
    """Tables, motors that follow them, effects of users, and held inputs; not a steady motor."""
    (tmp_path / 'swaying.py').write_text(READS_TIME)
    table = [[0.0, 0.0], [1.0, 1.0]]
    loads = {
        'user_table': {'push': {'joint': 'shoulder', 'table': table}},
        'motor': {
            'led': {'joint': 'elbow', 'position': table, 'position_gain': 50.0},
            'still': {'joint': 'elbow', 'effort': 0.1},
        },
        str(tmp_path / 'swaying.py'): {'sway': {'joint': 'shoulder'}},
    }
    scene = load_scene({'mechanism': 'double_pendulum', 'effects': {**GRAVITY, **loads}})
    note = 'user_table.push, motor.led, swaying.sway: read at t = 0.5 s, as a function of time'
    found = equilibrium(scene, t=0.5)
    assert note in found.notes and note in linearise(found).notes
    moving = Simulation(scene)
    moving.step(500)
    assert note in linearise(moving).notes
    held = Simulation(load_scene({'mechanism': 'double_pendulum', 'effects': GRAVITY}))
    held.apply_effort('elbow', through([0.0, 1.0], [(0.0,), (2.0,)]))
    notes = equilibrium(held, t=0.5).notes
    assert 'the effort on elbow: read at t = 0.5 s, as a function of time' in notes


def test_a_drive_that_accelerates_loads_nothing_at_rest() -> None:
    """Where it is frozen it is accelerated by 9 g: more than holds the pendulum down."""
    pin = {'type': 'revolute', 'between': ['cart', 'bar'], 'at': 'P'}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'P': {'at': [0, 0.1]}, 'B': {'at': [0, -0.9]}},
                'bodies': {
                    'cart': {'points': ['P'], 'mass': 1, 'inertia': 'point'},
                    'bar': {'points': ['P', 'B'], 'mass': 1, 'inertia': 'rod'},
                },
                'joints': {'pin': pin},
                'drives': {'shake': {'point': 'P', 'at': [0, '0.1*cos(30*t)']}},
            },
            'effects': GRAVITY,
        }
    )
    found = equilibrium(scene)
    np.testing.assert_allclose(found.reactions['pin'].force, [0.0, 9.81], atol=1e-12)
    np.testing.assert_allclose(found.sample.drive_efforts['shake'], [0.0, 2 * 9.81], atol=1e-12)
    for model in (linearise(found), linearise(scene)):
        np.testing.assert_allclose(model.A, [[0.0, 1.0], [-1.5 * 9.81, 0.0]], atol=1e-11)
        assert model.notes == ('drives are frozen at t = 0 s',)


@pytest.mark.parametrize('force', [-5.0, 3.0])
def test_reactions_that_cancel_leave_a_folded_mechanism_neutral(force: float) -> None:
    """Two bars lie on each other and turn as one; a push on the slider does no work there, and the
    forces of the bars on the knee cancel."""
    bar = {'mass': 1, 'inertia': 'rod', 'length': 1}
    line = {'through': [0, 0], 'direction': [1, 0]}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {
                    'O': {'at': [0, 0], 'fixed': True},
                    'A': {'at': ['cos(1.2)', 'sin(1.2)']},
                    'B': {'at': [0, 0]},
                },
                'bodies': {
                    'crank': {'points': ['O', 'A'], **bar},
                    'rod': {'points': ['A', 'B'], **bar},
                },
                'joints': {
                    'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
                    'knee': {'type': 'revolute', 'between': ['crank', 'rod'], 'at': 'A'},
                    'guide': {'type': 'slider', 'point': 'B', 'on': line},
                },
            },
            'effects': {'constant_wrench': {'on': 'B', 'force': [force, 0]}},
        }
    )
    found = equilibrium(scene)
    assert (found.stability, found.stiffness.tolist(), found.notes) == ('neutral', [0.0], ())


def test_a_belt_stands_still_at_rest_and_a_note_says_so() -> None:
    roll = {'type': 'no_slip', 'between': ['ground', 'wheel'], 'at': 'P', 'radius': 0.1}
    line = {'through': [0, 0.1], 'direction': [1, 0]}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'P': {'at': [0, 0.1]}, 'R': {'at': [0.1, 0.1]}},
                'bodies': {
                    'wheel': {'points': ['P', 'R'], 'mass': 1, 'inertia': 'rod', 'com': [0, 0]}
                },
                'joints': {
                    'guide': {'type': 'slider', 'point': 'P', 'on': line},
                    'roll': {
                        **roll,
                        'on': {'through': [0, 0], 'direction': [1, 0], 'speed': '0.5 + t'},
                    },
                },
            },
            'effects': {
                'spring': {
                    'between': ['P', 'ground'],
                    'at': [None, [1, 0.1]],
                    'stiffness': 10,
                    'free_length': 0.5,
                },
                'drag': {'on': 'wheel', 'spin': 0.2},
            },
        }
    )
    found = equilibrium(scene)
    assert [note for note in found.notes if note.startswith('roll: ')]
    np.testing.assert_allclose(found.points['P'], [0.5, 0.1], atol=1e-9)
    assert linearise(found).drift == pytest.approx(0.0, abs=1e-9)


def test_friction_is_said_as_such() -> None:
    friction = {'joint': 'j0', 'dynamic': 0.2, 'radius': 0.01}
    found = equilibrium(chain(1, {**GRAVITY, 'joint_friction': friction}))
    np.testing.assert_allclose(found.points['P1'], [0.0, -1.0], atol=1e-12)
    assert len(found.notes) == 1 and 'friction holds positions around' in found.notes[0]


def test_a_stop_that_carries_is_said_as_such() -> None:
    stop = {'joint': 'j0', 'lower': -1.0, 'upper': 1.0, 'stiffness': 1e5}
    found = equilibrium(chain(1, {**GRAVITY, 'joint_stop': stop}))
    depth = -1.0 - found.joints['j0'].position
    # the child hangs below the stop at -1 rad: k depth^1.5 = m g l cos(angle)
    assert 1e5 * depth**1.5 == pytest.approx(9.81 * np.cos(1.0 + depth), rel=1e-9)
    assert found.notes == ('joint_stop: a stop carries load here',)


def test_a_long_chain_falls() -> None:
    """Its end moves by more than its length."""
    found = equilibrium(chain(100))
    np.testing.assert_allclose(found.points['P100'], [0.0, -100.0], atol=1e-11)


@pytest.mark.thorough
@pytest.mark.parametrize('links', thinned([150, 300, 650], keep=[300]))
def test_all_links_of_a_long_chain_turn_at_once(links: int) -> None:
    """One after another they need more steps than a search has."""
    found = equilibrium(level_chain(links))
    hanging = [[0.0, -0.1 * k] for k in range(links + 1)]
    places = [found.points[f'P{k}'] for k in range(links + 1)]
    np.testing.assert_allclose(places, hanging, rtol=0.0, atol=1e-12)
    assert found.reactions['j0'].force[1] == pytest.approx(0.1 * 9.81 * links, rel=1e-11)
    assert found.steps < 1000


@pytest.mark.parametrize(
    ('exponent', 'stiffness'), combined([1.0, 1.5, 2.0], [1e3, 1e5, 1e7, 1e9, 1e11])
)
def test_on_a_stiff_contact(stiffness: float, exponent: float) -> None:
    """A mass on a bar lies on a floor, 1e-10 m to 0.1 m deep: k δᵖ = m g, and ω² = p k δᵖ⁻¹ x²."""
    floor = {'on': 'P1', 'stiffness': stiffness, 'exponent': exponent, 'through': [0.0, -0.5]}
    found = equilibrium(chain(1, {**GRAVITY, 'ground_contact': floor}))
    depth = (9.81 / stiffness) ** (1.0 / exponent)
    np.testing.assert_allclose(found.points['P1'][1], -0.5 - depth, atol=1e-14)
    # the position, and with it the depth, is rounded to 1e-16 m
    x2 = 1.0 - (0.5 + depth) ** 2
    squared = exponent * stiffness * depth ** (exponent - 1.0) * x2
    rounding = 1e-15 * (exponent - 1.0) / depth
    assert found.stiffness[0] == pytest.approx(squared, rel=1e-12 + rounding)
    assert found.stability == 'stable'


@pytest.mark.parametrize('seed', thinned(range(8), keep=[0, 1, 3]))
def test_chains_fall_on_stiff_floors_and_stops(seed: int) -> None:
    """The potential is a narrow and bent valley with kinks, but the search ends at rest.

    Only rounding is left: the forward run does not accelerate from there."""
    random = np.random.default_rng(seed)
    masses, stiffness = int(random.integers(1, 7)), float(10.0 ** random.uniform(3.0, 10.0))
    exponent = float(random.choice([1.0, 1.5, 2.0]))
    floors, stops = [], []
    for k in range(masses):
        height = -float(random.uniform(0.1, 0.9)) * masses
        each = {'stiffness': stiffness, 'exponent': exponent}
        floors.append({'on': f'P{k + 1}', **each, 'through': [0.0, height]})
        lower, upper = -random.uniform(0.1, 1.5), random.uniform(0.1, 1.5)
        stops.append({'joint': f'j{k}', **each, 'lower': float(lower), 'upper': float(upper)})
    effects = {**GRAVITY, 'ground_contact': floors, 'joint_stop': stops}
    found = equilibrium(chain(masses, effects))
    assert found.stability == 'stable'
    assert found.residual <= 1e-8 * max(9.81, stiffness * 1e-9)
    # the accelerations of the forward run from there
    assert np.abs(found.sample.qdd).max() <= 10.0 * found.residual + 1e-9


def test_a_singular_position_is_named() -> None:
    found = equilibrium(load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY}))
    assert found.stability == 'undecided'
    assert 'singular position' in found.notes[0]
    np.testing.assert_allclose(found.points['A'], [0.0, -1.0], atol=1e-4)


def test_the_nearest_rest_where_the_force_is_stationary() -> None:
    """A level pendulum: the force on it is the largest, so that Newton's step is zero."""
    found = equilibrium(load_scene('pendulum'), nearest=True)
    assert np.cos(found.joints['pin'].position) == pytest.approx(0.0, abs=1e-14)
    assert found.stability == 'stable'
    assert found.stiffness[0] == pytest.approx(9.81, rel=1e-12)


def test_the_nearest_rest_of_two_links_drawn_at_right_angles() -> None:
    found = equilibrium(
        load_scene({'mechanism': 'double_pendulum', 'effects': GRAVITY}), nearest=True
    )
    upper, lower = found.points['A'], found.points['B'] - found.points['A']
    for link in (upper, lower):
        assert link[0] == pytest.approx(0.0, abs=1e-13)
    assert found.residual < 1e-12


def test_the_nearest_rest_where_no_force_gets_less() -> None:
    """The force on a slider has a least value at the start, but no zero; a stop holds it."""
    pull = [[-9.0, 1.0], [-1.0, 1.0], [0.0, 0.5], [1.0, 1.0], [9.0, 1.0]]  # m, N
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'P': {'at': [0.0, 0.0]}},
                'bodies': {'b': {'points': ['P'], 'mass': 1.0, 'inertia': 'point'}},
                'joints': {
                    'g': {
                        'type': 'slider',
                        'point': 'P',
                        'between': ['ground', 'b'],
                        'on': {'through': [0.0, 0.0], 'direction': [1.0, 0.0]},
                    }
                },
            },
            'effects': {
                'torsion_spring': {'joint': 'g', 'table': pull, 'free_position': 0.0},
                'joint_stop': {'joint': 'g', 'lower': -3.0, 'stiffness': 100.0, 'exponent': 1.0},
            },
        }
    )
    found = equilibrium(scene, nearest=True)
    np.testing.assert_allclose(found.points['P'], [-3.01, 0.0], atol=1e-12)


def test_a_search_that_ends_at_its_limit_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(descent, '_STEPS', 5)
    monkeypatch.setattr(newton_rest, '_STEPS', 2)
    for nearest in (False, True):
        with pytest.raises(InputError, match='limit of the search') as error:
            equilibrium(level_chain(30), nearest=nearest)
        assert 'never stop' not in str(error.value) and '\n' not in str(error.value)


@pytest.mark.parametrize(
    ('angle', 'force'),
    thinned(
        product([0.5, 0.1, 1e-3], [1e3, 1e9, 1e12, 1e15]),
        keep=lambda angle, force: (angle, force) != (0.5, 1e15),  # a hundred steps, others ten
    ),
)
def test_a_load_elsewhere_does_not_hide_what_is_left(force: float, angle: float) -> None:
    found = equilibrium(pendulum_and_slider(force, angle))
    np.testing.assert_allclose(found.points['A'], [0.0, -1.0], rtol=0.0, atol=1e-8)
    assert found.stability == 'stable' and found.notes == ()
    assert found.stiffness[0] == pytest.approx(1.5 * 9.81, rel=1e-8)


@pytest.mark.parametrize('force', [1e3, 1e6, 1e9, 1e12, 1e15])
@pytest.mark.parametrize('angle', [0.5, 1e-3, 2.5])
def test_a_load_beside_says_what_its_rounding_hides(force: float, angle: float) -> None:
    """1e15 N are known to 0.1 N: more than what brings the pendulum to rest."""
    found = equilibrium(pendulum_and_slider(force, angle, hung=True))
    away = float(np.abs(found.points['A'] - [0.0, -1.0]).max())
    if found.stability != 'stable':
        assert found.stability == 'undecided' and force > 1e9
    if away > 1e-7 or found.stability == 'undecided':
        assert 'the position is uncertain by about' in found.notes[0]
    if force < 1e9:
        assert away < 1e-10 and found.notes == ()


CORD = [[-1.0, 0.0], [0.0, 0.0], [1.0, 200.0]]  # m, N
OTHER = [[-1.0, 0.0], [0.0, 0.0], [1.0, 800.0]]
HALF = [[-1.0, 300.0], [0.0, 0.0], [1.0, 200.0]]  # pulls where it is shorter, too


@pytest.mark.parametrize(
    ('pulls', 'verdict', 'sides'),
    [
        ({'right': CORD}, 'neutral', ('neutral', 'stable')),
        ({'left': CORD, 'right': CORD}, 'stable', ()),
        ({'left': CORD, 'right': OTHER}, 'stable', ()),
        ({'right': HALF}, 'unstable', ('unstable', 'stable')),
    ],
)
def test_a_cord_that_is_just_taut(
    pulls: dict[str, list[list[float]]], verdict: str, sides: tuple[str, ...]
) -> None:
    """A mass on a guide, cords along the guide: each side has its own stiffness k / m."""
    cords = {}
    for name, table in pulls.items():
        end = [-3.0 if name == 'left' else 3.0, 0.0]
        cord = {'between': ['P', 'ground'], 'at': [None, end], 'free_length': 3.0}
        cords[name] = {**cord, 'table': table}
    guide = {'through': [0.0, 0.0], 'direction': [1.0, 0.0]}
    slider = {'type': 'slider', 'point': 'P', 'between': ['ground', 'b'], 'on': guide}
    mechanism = {
        'alf': 1,
        'points': {'P': {'at': [0.0, 0.0]}},
        'bodies': {'b': {'points': ['P'], 'mass': 2.0, 'inertia': 'point'}},
        'joints': {'g': slider},
    }
    found = equilibrium(load_scene({'mechanism': mechanism, 'effects': {'spring': cords}}))
    assert found.stability == verdict
    words = [note for note in found.notes if note.startswith('on one side')]
    assert len(words) == bool(sides)
    assert all(f'is {sides[0]}' in note and note.endswith(sides[1]) for note in words)


def test_sides_that_differ_with_two_freedoms_are_undecided() -> None:
    """A free mass with a cord, and a spring across it; the modes belong to one side."""
    body = {'points': ['P'], 'mass': 2.0, 'inertia': 'point'}
    mechanism = {'alf': 1, 'points': {'P': {'at': [0.0, 0.0]}}, 'bodies': {'b': body}}
    cord = {'between': ['P', 'ground'], 'at': [None, [3.0, 0.0]], 'free_length': 3.0}
    across = {'between': ['P', 'ground'], 'at': [None, [0.0, 3.0]], 'stiffness': 50.0}
    effects = {'spring': {'cord': {**cord, 'table': HALF}, 'across': across}}
    found = equilibrium(load_scene({'mechanism': mechanism, 'effects': effects}))
    assert found.stability == 'undecided' and found.has_stiffness
    assert 'is unstable, on another' in found.notes[-1]
    assert modes(found).squares.shape == (2,)


@pytest.mark.parametrize(
    ('table', 'at'), [(CORD, [1.2, 0.1]), ([[-1.0, -200.0], [0.0, 0.0], [1.0, 0.0]], [0.8, 0.1])]
)
def test_the_edge_of_a_force_with_two_freedoms_is_neutral(
    table: list[list[float]], at: list[float]
) -> None:
    """A mass comes to rest where a cord is just taut, or a spring that only pushes just free. No
    side falls: the force that would turn the mass away is zero there."""
    body = {'points': ['P'], 'mass': 2.0, 'inertia': 'point'}
    mechanism = {'alf': 1, 'points': {'P': {'at': at}}, 'bodies': {'b': body}}
    spring = {'between': ['P', 'ground'], 'at': [None, [0.0, 0.0]], 'free_length': 1.0}
    effects = {'spring': {**spring, 'table': table}}
    found = equilibrium(load_scene({'mechanism': mechanism, 'effects': effects}))
    assert np.hypot(*found.points['P']) == pytest.approx(1.0, abs=1e-12)
    assert found.stability == 'neutral'
    assert found.notes == ('a force has a kink here: the stiffness is of one side of it',)


@pytest.mark.thorough
def test_none_is_said_in_one_line() -> None:
    with pytest.raises(InputError, match='never stop doing work') as error:
        equilibrium(chain(1, {'constant_wrench': {'on': 'b0', 'torque': 1.0}}))
    assert '\n' not in str(error.value) and 'P1' in str(error.value)


def test_none_names_the_part_that_falls() -> None:
    """Forces act on the pendulum too, but balance there."""
    mechanism = {
        'alf': 1,
        'points': {'P': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}, 'F': {'at': [0, 1]}},
        'bodies': {
            'bar': {'points': ['P', 'A'], 'mass': 1.0, 'inertia': 'rod'},
            'free': {'points': ['F'], 'mass': 1.0, 'inertia': 'point'},
        },
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'P'}},
    }
    with pytest.raises(InputError, match=r'9\.81 m/s\^2 are left, at F; '):
        equilibrium(load_scene({'mechanism': mechanism, 'effects': GRAVITY}))


@pytest.mark.thorough
def test_none_under_the_weight_of_slides() -> None:
    """They have no stiffness: all of it is rounding, and so is its skew part."""
    x, y = [0.8, 0.6], [-0.4, 1.1]
    points = {'A': [0.0, 0.0], 'B': y, 'C': [0.5, 0.9], 'D': [0.4, 1.4]}
    mechanism = {
        'alf': 1,
        'points': {name: {'at': at} for name, at in points.items()},
        'bodies': {
            'bridge': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'},
            'head': {'points': ['C', 'D'], 'mass': 1.0, 'inertia': 'rod'},
        },
        'joints': {
            'along': {'type': 'prismatic', 'between': ['ground', 'bridge'], 'at': 'A', 'axis': x},
            'across': {'type': 'prismatic', 'between': ['bridge', 'head'], 'at': 'C', 'axis': y},
        },
    }
    with pytest.raises(InputError, match='never stop doing work'):
        equilibrium(load_scene({'mechanism': mechanism, 'effects': GRAVITY}))


def test_a_wheel_rests_on_planes_of_any_direction() -> None:
    """Nothing but its weight on the plane: reactions along the plane are rounding of that one, and
    so is the stiffness that they give."""
    normal, axle, spoke = np.array([[2.0, 1.0, 2.0], [1.0, 2.0, -2.0], [2.0, -2.0, -1.0]]) / 3.0
    mechanism = {
        'alf': 1,
        'space': 'spatial',
        'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'C': {'at': (0.5 * normal).tolist()}},
        'vectors': {'axle': {'along': axle.tolist()}, 'spoke': {'along': spoke.tolist()}},
        'bodies': {
            'disk': {
                'points': ['C'],
                'vectors': ['axle', 'spoke'],
                'mass': 2.0,
                'inertia': {'about_com': [0.25, 0.125, 0.125]},
            }
        },
        'joints': {
            'rim': {
                'type': 'no_slip',
                'between': ['ground', 'disk'],
                'at': 'C',
                'radius': 0.5,
                'on': {'through': [0, 0, 0], 'normal': normal.tolist()},
            },
            'upright': {
                'type': 'perpendicular',
                'between': ['ground', 'disk'],
                'axes': [normal.tolist(), axle.tolist()],
            },
        },
    }
    weight = {'gravity': {'acceleration': (-9.81 * normal).tolist()}}
    found = equilibrium(load_scene({'mechanism': mechanism, 'effects': weight}))
    assert found.stability == 'neutral' and found.stiffness.tolist() == [0.0, 0.0]
    assert found.conservative


def test_refused() -> None:
    with pytest.raises(InputError, match='not a scene'):
        equilibrium(5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match='t: '):
        equilibrium(chain(1), t=float('nan'))
    with pytest.raises(InputError, match='starts'):
        equilibria(chain(1), starts=-1)


def test_a_body_in_a_mirror_is_at_rest_nowhere() -> None:
    """Rows hold there as well: the search alone would call it a position of rest."""
    points = {'O': [0, 0, 0], 'B': [0.3, 0, 0], 'C': [0.1, 0.2, 0], 'D': [0.1, 0.1, 0.2]}
    tool = {'points': list(points), 'mass': 1, 'com': [0.1, 0.05, 0.05]}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {n: {'at': at, 'fixed': n == 'O'} for n, at in points.items()},
                'bodies': {'tool': tool | {'inertia': {'about_com': [0.1, 0.11, 0.12]}}},
                'joints': {
                    'ball': {'type': 'spherical', 'between': ['ground', 'tool'], 'at': 'O'}
                },
            },
            'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
        }
    )
    simulation, start = beginning(scene, None)
    q = np.array(start.q).reshape(-1, 3)
    q[:, 0] *= -1.0
    for search in (descent.descended, newton_rest.nearest_rest):
        assert found_at(simulation, search(start)).residual < 1e-9
        landing = search(replace(start, q=q.reshape(-1)))
        assert landing.rests
        with pytest.raises(InputError, match='where body tool would be its mirror image; start'):
            found_at(simulation, landing)
