"""Equilibrium paths against closed forms: snap-through, pitchforks, toggles, redundant rows."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError, Simulation, equilibrium, equilibrium_path, linearise, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.scene import Scene, scene_from_text
from alf_ros.studies.statics.arc_length import LostPathError, corrected
from alf_ros.studies.statics.equilibrium_path import EquilibriumPath
from alf_ros.studies.statics.path_point import PathDirection
from support.statics_scenes import GRAVITY, chain, redundant_parallelogram, sprung
from support.thorough import thinned

STIFFNESS = 1000.0


def arch(height: float) -> Scene:
    """Von Mises' truss: two springs (half span 1 m, slack as drawn) hold an apex with a load."""
    springs = {
        name: {
            'between': ['apex', 'ground'],
            'at': [None, [x, 0.0]],
            'stiffness': STIFFNESS,
            'free_length': float(np.hypot(1.0, height)),
        }
        for name, x in (('left', -1.0), ('right', 1.0))
    }
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'P': {'at': [0.0, height]}},
                'bodies': {'apex': {'points': ['P'], 'mass': 1.0, 'inertia': 'point'}},
            },
            'effects': {'constant_wrench': {'load': {'on': 'apex', 'force': [0, 0]}}}
            | {'spring': springs},
        }
    )


def load(y: Floats | float, height: float) -> Floats:
    """The load that holds the apex at (0, y): F = 2 k (l - l₀) y / l."""
    length = np.hypot(1.0, y)
    return np.asarray(2.0 * STIFFNESS * (length - np.hypot(1.0, height)) * y / length)


def limit(height: float) -> float:
    """y where dF/dy = 0: l³ = l₀ (half span)²."""
    return float(np.sqrt(np.hypot(1.0, height) ** (2.0 / 3.0) - 1.0))


@cache
def shallow() -> tuple[EquilibriumPath, tuple[float, ...]]:
    """The path of a shallow arch, and how far it said that it is."""
    told: list[float] = []
    path = equilibrium_path(arch(0.5), over='load.force.1', end=-60.0, report=told.append)
    return path, tuple(told)


@cache
def tall_by(more: float) -> EquilibriumPath:
    """Of an arch that is higher by a part than the one in which both stiffnesses vanish."""
    height = float(np.sqrt(7.0)) * (1.0 + more)
    return equilibrium_path(arch(height), over='load.force.1', end=-2600.0, back=500.0)


@pytest.mark.thorough
@pytest.mark.parametrize('more', thinned([0.0, 1e-9], [0.0]))
def test_a_turn_and_a_branch_point_in_one_position(more: float) -> None:
    """At y = 1 both stiffnesses, along l³ = l₀ and across l³ - l₀ l² + l₀ = 0, vanish."""
    path = tall_by(more)
    *_, both = path.events
    assert (both.kind, both.count) == ('branch', 2)
    assert [event.count for event in path.events] == [1, 2]
    assert both.value == pytest.approx(-2000.0, abs=1e-4)
    assert path['P.y'][both.index] == pytest.approx(1.0, abs=1e-7)


def test_a_shallow_arch_snaps_through_at_both_limit_points() -> None:
    path, _ = shallow()
    x, y = path.points['P'].T
    np.testing.assert_allclose(path.values, load(y, 0.5), rtol=0.0, atol=1e-13 * STIFFNESS)
    np.testing.assert_allclose(x, 0.0, atol=1e-12)
    assert path.values[0] == 0.0 and path.values[-1] == -60.0
    assert [event.name for event in path.events] == ['turn 1', 'turn 2']
    for event, sense in zip(path.turns, (1.0, -1.0), strict=True):
        expected = load(sense * limit(0.5), 0.5)
        assert event.value == pytest.approx(float(expected), rel=1e-12)
        assert y[event.index] == pytest.approx(sense * limit(0.5), rel=1e-12)
        np.testing.assert_allclose(event.direction, [0.0, 1.0], atol=1e-9)
        assert event.smooth and event.count == 1
    first, second = path.turns
    assert (first.before, first.after) == ('stable', 'unstable')
    assert (second.before, second.after) == ('unstable', 'stable')
    # the vertical stiffness of two springs, for 1 kg
    length = np.hypot(1.0, y)
    square = 2.0 * STIFFNESS * (1.0 - np.hypot(1.0, 0.5) / length**3)
    lowest = np.abs(path.stiffness - square[:, None]).min(axis=1)
    np.testing.assert_allclose(lowest, 0.0, atol=1e-8)


def test_a_path_tells_how_far_it_is_also_where_it_turns_back() -> None:
    path, told = shallow()
    assert len(path.turns) == 2
    assert list(told) == sorted(told) and told[-1] == 1.0
    first = abs(path.values[1]) / 60.0
    assert told[0] == pytest.approx(first, rel=1e-12)  # so much of the load is on it
    cut: list[float] = []
    equilibrium_path(arch(0.5), over='load.force.1', end=-60.0, most=10, report=cut.append)
    assert cut[-1] == 1.0


def test_a_tall_arch_sways_before_it_snaps() -> None:
    """Pitchforks where the lateral stiffness vanishes: l³ = l₀ y²."""
    slack = np.hypot(1.0, 3.0)
    lengths = [z.real for z in np.roots([1.0, -slack, 0.0, slack]) if z.real > 1.0]
    heights = np.sqrt(np.square(sorted(lengths, reverse=True)) - 1.0)
    path = equilibrium_path(arch(3.0), over='load.force.1', end=-2500.0, back=50.0)
    names = [event.name for event in path.events]
    assert names == ['branch 1', 'turn 1', 'branch 2']
    for event, height in zip(path.branch_points, heights, strict=True):
        assert event.value == pytest.approx(float(load(height, 3.0)), rel=1e-11)
        np.testing.assert_allclose(np.abs(event.direction), [1.0, 0.0], atol=1e-9)
    assert path.turns[0].value == pytest.approx(float(load(limit(3.0), 3.0)), rel=1e-12)
    assert path.branch_points[0].before == 'stable'

    sides = path.follow('branch 1')
    assert len(sides) == 2 and all('50' in side.ending for side in sides)
    ends = np.array([side.points['P'][-1] for side in sides])
    np.testing.assert_allclose(ends[0], ends[1] * [-1.0, 1.0], atol=1e-9)
    for side in sides:
        assert set(side.stability[1:]) == {'unstable'} and not side.turns
        # forces on the apex, from both springs
        for at, value in zip(side.points['P'], side.values, strict=True):
            arms = at - np.array([[-1.0, 0.0], [1.0, 0.0]])
            lengths_ = np.linalg.norm(arms, axis=1)
            pull = STIFFNESS * ((1.0 - slack / lengths_) @ arms)
            np.testing.assert_allclose(pull, [0.0, value], atol=1e-7)


@pytest.mark.thorough
@pytest.mark.parametrize('height', thinned([2.6, 2.63, 2.6457, 2.646, 2.66], [2.6457]))
def test_a_turn_and_a_branch_point_within_a_step(height: float) -> None:
    """Beside a height of √7 m one stiffness falls through zero where the other one rises."""
    slack = np.hypot(1.0, height)
    lengths = [z.real for z in np.roots([1.0, -slack, 0.0, slack]) if z.real > 1.0]
    expected = [('branch', float(np.sqrt(z**2 - 1.0))) for z in lengths]
    expected = sorted([*expected, ('turn', limit(height))], key=lambda each: -each[1])
    path = equilibrium_path(arch(height), over='load.force.1', end=-2600.0, back=500.0)
    assert [event.kind for event in path.events] == [kind for kind, _ in expected]
    for event, (kind, y) in zip(path.events, expected, strict=True):
        assert path.points['P'][event.index, 1] == pytest.approx(y, rel=1e-11)
        assert event.value == pytest.approx(float(load(y, height)), rel=1e-12)
        assert event.smooth and event.count == 1
        moves = [1.0, 0.0] if kind == 'branch' else [0.0, 1.0]
        np.testing.assert_allclose(np.abs(event.direction), moves, atol=1e-9)
    between = 'stable' if height < np.sqrt(7.0) else 'unstable'
    assert path.events[1].after == path.events[2].before == between


@pytest.mark.thorough
def test_a_turn_at_a_branch_point_is_a_position_of_rest() -> None:
    """Where both stiffnesses vanish, no force has a size. It ended with a KeyError."""
    path = tall_by(0.0)
    np.testing.assert_allclose(path['P.y'], path.points['P'][:, 1])
    assert path.events[-1].value == pytest.approx(-2000.0, rel=1e-9)


@pytest.mark.thorough
def test_an_imperfect_arch_has_no_pitchfork() -> None:
    scene = with_changes(arch(3.0), {'load.force.0': '1.0'})
    path = equilibrium_path(scene, over='load.force.1', end=-2000.0, back=100.0)
    assert not path.branch_points and len(path.turns) == 1
    assert path.turns[0].value > float(load(2.55265467, 3.0))  # sooner than the perfect one


def test_a_toggle_turns_and_passes_a_singular_position() -> None:
    """A slider-crank with equal rods and a spring on its slider: τ = -2 k (2 cos θ - 1) sin θ."""
    spring = {'between': ['B', 'ground'], 'at': [None, [-10, 0]], 'stiffness': 100.0}
    scene = load_scene(
        {'mechanism': 'slider_crank', 'effects': {'spring': {**spring, 'free_length': 11.0}}}
    )
    path = equilibrium_path(scene, over='crank_pin.effort', end=400.0)
    assert (path.over, path.unit) == ('joints.crank_pin.effort', 'N m')
    cosine = np.array([(1.0 - np.sqrt(33.0)) / 8.0, (1.0 + np.sqrt(33.0)) / 8.0])
    highest, lower = -200.0 * (2.0 * cosine - 1.0) * np.sqrt(1.0 - cosine**2)
    found = [event.value for event in path.turns]
    np.testing.assert_allclose(found, [highest, -highest, -lower, lower], rtol=1e-11)
    assert path.ending == 'it comes back to its start'
    angle = path['crank_pin.position']
    assert angle[-1] - angle[0] == pytest.approx(2.0 * np.pi, abs=1e-9)
    torque = 200.0 * (1.0 - 2.0 * np.cos(angle)) * np.sin(angle)
    np.testing.assert_allclose(path.values, torque, atol=1e-8)
    # the slider carries no force along its line, the crank pin the spring's
    np.testing.assert_allclose(
        path.reactions['crank_pin'][:, 0], 100.0 * (2.0 * np.cos(angle) - 1.0), atol=1e-4
    )


def test_redundant_rows_change_nothing() -> None:
    """Three cranks under gravity that turns point along it."""
    path = equilibrium_path(redundant_parallelogram(), over='gravity.acceleration.0', end=100.0)
    crank = path.points['B1'] - path.points['A1']
    angle = np.arctan2(crank[:, 1], crank[:, 0])
    np.testing.assert_allclose(angle, np.arctan2(-9.81, path.values), atol=1e-13)
    assert path.rest(-1).reactions['pin1'].indeterminate


@pytest.mark.thorough
def test_a_mass_that_a_torque_can_lift() -> None:
    """A pendulum with a torque T rests at sin φ = T / (m g l): below m = T / (g l) at no angle."""
    scene = chain(1, {**GRAVITY, 'constant_wrench': {'on': 'b0', 'torque': 9.81 / 2.0}})
    path = equilibrium_path(scene, over='b0.mass', end=0.1, back=1.25)
    assert [event.name for event in path.events] == ['turn 1']
    assert path.turns[0].value == pytest.approx(0.5, rel=1e-12)
    np.testing.assert_allclose(path.points['P1'][-1], [0.4, np.sqrt(1.0 - 0.16)], atol=1e-12)


@pytest.mark.thorough
def test_a_follower_load_without_potential() -> None:
    """A force across the last bar holds it at most upright to gravity: F = m g sin φ."""
    push = {'on': 'b1', 'at': 'P2', 'force': [0, 0], 'frame': 'body'}
    scene = chain(2, {**GRAVITY, 'constant_wrench': {'tip': push}})
    path = equilibrium_path(scene, over='tip.force.1', end=15.0, back=-1.0)
    assert [event.name for event in path.events] == ['flutter 1', 'flutter 2', 'turn 1']
    assert path.turns[0].value == pytest.approx(9.81, rel=1e-12)
    assert not path.rest(10).conservative
    for event in path.flutter_points:  # both frequencies become one
        low, high = np.sort(np.abs(linearise(path.rest(event.index)).eigenvalues.imag))[1:3]
        assert high - low < 1e-3 * high


SPATIAL = """
mechanism:
  alf: 1
  space: spatial
  points:
    P: {at: [0, 0, 0]JOINED}
    A: {at: [0, 0, -0.3]}
    B: {at: [0.1, 0.05, -0.1]}
  bodies:
    one: {points: [P, A, B], mass: 1, inertia: {about_com: [1, 1, 1]}, com: [0.1, 0, 0]}
  joints:
    j: {type: TYPE, between: [ground, one], at: P, axis: AXIS}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
"""
HINGED = SPATIAL.replace('JOINED', ', fixed: true').replace('TYPE', 'revolute')
HINGED = HINGED.replace('AXIS', '[0, 1, 0]')
SLIDING = SPATIAL.replace('JOINED', '').replace('TYPE', 'prismatic').replace('AXIS', '[0, 0, 1]')
SLIDING += '  torsion_spring: {joint: j, stiffness: 100.0, free_position: 0.0}\n'


@pytest.mark.parametrize(
    ('text', 'mirror', 'told'),
    [
        (HINGED, [-1.0, 1.0, 1.0], 'body one would be its mirror image'),
        (SLIDING, [-1.0, -1.0, 1.0], 'a body would be turned round in joint j'),
    ],
)
def test_a_path_in_space_never_goes_on_with_bodies_as_no_assembly_has_them(
    text: str, mirror: list[float], told: str
) -> None:
    """The image at rest fulfils all rows, and nothing is left there."""
    path = equilibrium_path(scene_from_text(text), over='gravity.acceleration.0', end=20.0)
    known = np.arctan2(-path.values, 9.81) if text == HINGED else np.full(len(path), -0.0981)
    found = [path.rest(k).joints['j'].position for k in range(len(path))]
    np.testing.assert_allclose(found, known, rtol=0.0, atol=1e-13)
    start = path._course.points[0]
    q = start.instant.q.reshape(-1, 3)
    away = ((np.array(mirror) - 1.0) * q).reshape(-1)[: start.instant.model.n]
    with pytest.raises(LostPathError, match=told):
        corrected(start, PathDirection(away, 0.0), 1.0)


def test_over_the_time_of_a_drive() -> None:
    scene = load_scene(
        {
            'mechanism': 'double_pendulum',
            'effects': GRAVITY,
            'drives': {'turn': {'joint': 'shoulder', 'angle': '0.5*t'}},
        }
    )
    path = equilibrium_path(scene, over='t', start=1.0, end=8.0, back=0.5)
    elbow = np.stack([np.cos(0.5 * path.values), np.sin(0.5 * path.values)], axis=1)
    np.testing.assert_allclose(path.points['A'], elbow, atol=1e-13)
    np.testing.assert_allclose(path.points['B'], elbow - [0.0, 0.8], atol=1e-12)
    assert path.unit == 's' and path.rest(-1).t == 8.0 and not path.events


@pytest.mark.thorough
def test_over_the_time_of_a_table_with_a_sharp_corner() -> None:
    """The target of a motor turns back at 1 s: so does the path, by more than a right angle."""
    table = [[0.0, -0.5], [1.0, 0.5], [1.8, -1.5]]
    motor = {'joint': 'j0', 'position': table, 'position_gain': 30.0}
    scene = chain(1, {**GRAVITY, 'motor': motor})
    path = equilibrium_path(scene, over='t', end=2.5, back=0.0, most=200)
    assert path.ending == 'it reaches 2.5' and not path.events
    angle = path['j0.position']
    torque = 30.0 * (np.interp(path.values, *np.transpose(table)) - angle)
    np.testing.assert_allclose(torque, 9.81 * np.cos(angle), atol=1e-8)


@pytest.mark.parametrize(
    ('over', 'end'), thinned([('b', 0.33), ('spring.stiffness', 0.0)], keep=[('b', 0.33)])
)
def test_the_last_point_is_what_equilibrium_finds(over: str, end: float) -> None:
    scene = sprung('four_bar')
    path = equilibrium_path(scene, over=over, end=end)
    assert path.values[-1] == end and not path.events
    changed = with_changes(scene, {over: repr(end)})
    alone, rest = equilibrium(changed), path.rest(-1)
    np.testing.assert_allclose(rest.points['B'], alone.points['B'], atol=1e-9)
    np.testing.assert_allclose(rest.stiffness, alone.stiffness, rtol=1e-8)
    np.testing.assert_allclose(
        path.reactions['knee'][-1], alone.reactions['knee'].force, atol=1e-7
    )


def test_held_inputs_stay_and_the_table_holds_all(tmp_path: Path) -> None:
    simulation = Simulation(chain(1))
    simulation.apply_wrench('P1', force=[9.81, 0.0])
    path = equilibrium_path(simulation, over='wrenches.P1.force.x', end=-2.0 * 9.81)
    np.testing.assert_allclose(path.points['P1'][-1], -np.sqrt([0.5, 0.5]), atol=1e-12)
    path.write(tmp_path / 'path.csv')
    with open(tmp_path / 'path.csv', encoding='utf-8', newline='') as stream:
        rows = list(csv.reader(stream))
    assert rows[0][:4] == ['wrenches.P1.force.x', 'stability', 'stiffness', 'event']
    assert [float(row[0]) for row in rows[1:]] == path.values.tolist()
    column = rows[0].index('reactions.j0.force.y')
    assert [float(row[column]) for row in rows[1:]] == path['j0.force.y'].tolist()


def test_a_picture_shows_the_path(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib')
    path, _ = shallow()
    (axes,) = path.plot('P.y', file=tmp_path / 'path.svg')
    assert axes.get_ylabel() == 'points.P.y, m'
    assert (tmp_path / 'path.svg').read_bytes().startswith(b'<?xml')
    with pytest.raises(InputError, match='no format of a picture'):
        path.plot(file=tmp_path / 'path.txt')


def test_a_rotor_does_not_keep_a_path_from_its_start() -> None:
    """The bar is back after a turn; its rotor has turned."""
    scene = chain(1, {**GRAVITY, 'motor': {'joint': 'j0', 'armature': 0.05}})
    path = equilibrium_path(scene, over='j0.effort', end=20.0)
    assert path.ending == 'it comes back to its start'
    found = sorted(event.value for event in path.events)
    np.testing.assert_allclose(found, [-9.81, 9.81], rtol=1e-11)


@pytest.mark.parametrize(
    ('over', 'message'),
    [
        ('spring.stifness', "over: no such part.*did you mean 'stiffness'"),
        ('nothing.mass', 'over: nothing of this name'),
        ('initial.positions.A.0', 'over: does not move the position of rest'),
        ('solver.step', 'over: does not move the position of rest'),
        ('joints.crank_pn.effort', 'over: no such quantity.*crank_pin.effort'),
        ('crank_pin.efort', "over: no such quantity.*did you mean 'crank_pin.effort'"),
        ('pin.efort', "over: no such quantity.*did you mean 'crank_pin.effort'"),
        ('spring', "over: not one value.*did you mean 'spring.stiffness'"),
    ],
)
def test_a_name_that_cannot_be_followed(over: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        equilibrium_path(sprung('four_bar'), over=over, end=1.0)
    assert '\n' not in str(error.value)


def test_refused() -> None:
    with pytest.raises(InputError, match='a: .*both sides'):
        equilibrium_path(load_scene('four_bar'), over='a', end=1e6)
    spring = {'torsion_spring': {'joint': 'axle', 'stiffness': 7.0}}
    held = {'mechanism': 'rack_and_pinion', 'effects': spring}
    with pytest.raises(InputError, match=r'both sides \(the equations have another form there\)'):
        equilibrium_path(load_scene(held), over='Q.at.0', end=-0.36)
    for start, end in ((0.0, 1e300), (0.0, 1e-300), (1e300, 0.1)):
        with pytest.raises(InputError, match='(start|end): not usable.*1e-60'):
            equilibrium_path(sprung('four_bar'), over='crank_pin.effort', start=start, end=end)
    with pytest.raises(InputError, match='not a scene'):
        equilibrium_path(1.0, over='t', end=1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match='two ends'):
        equilibrium_path(arch(0.5), over='load.force.1', end=0.0)
    with pytest.raises(InputError, match='same side'):
        equilibrium_path(arch(0.5), over='load.force.1', end=-1.0, back=-2.0)
    with pytest.raises(InputError, match='no such branch point'):
        equilibrium_path(arch(0.5), over='load.force.1', end=-1.0).follow('branch 1')
    with pytest.raises(InputError, match='singular position'):
        hanging = load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY})
        equilibrium_path(hanging, over='crank_pin.effort', end=1.0)
    with pytest.raises(InputError, match='rows bind velocities only'):
        equilibrium_path(load_scene('rolling_disk'), over='gravity.acceleration.2', end=-1.0)
