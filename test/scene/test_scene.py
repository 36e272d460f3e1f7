"""Scenes and mechanisms that are right: what they load to, and that their text stands alone."""

from __future__ import annotations

import cProfile
import dataclasses
import hashlib
import math
import pickle
import random
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml

from alf_ros.effects import Effect, constant_wrench, gravity
from alf_ros.mechanism import Body, Frame, Joint, Mechanism, Point
from alf_ros.resources import folder
from alf_ros.scene.scene import UNSAID, Scene, Solver, load_scene, scene_from_text
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.scene.text.yaml_writer import entry, serialise
from support.thorough import LONG

SCENES = sorted(path.stem for path in folder('scenes')[0].glob('*.yaml'))
MECHANISMS = sorted(path.stem for path in folder('mechanisms')[0].glob('*.yaml'))

PENDULUM: dict[str, object] = {
    'alf': 1,
    'parameters': {'L': 2.0},
    'points': {'O': {'at': [0, 0], 'fixed': True}, 'P': {'at': [0, '-L']}},
    'bodies': {'rod': {'points': ['O', 'P'], 'mass': 3, 'inertia': 'rod'}},
    'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
}


def test_the_slider_crank_of_the_paper() -> None:
    scene = load_scene('slider_crank')
    r = 0.5 * math.sqrt(2.0)
    points = {point.name: point for point in scene.mechanism.points}
    assert list(points) == ['O', 'A', 'B']
    assert points['O'] == Point('O', (0.0, 0.0), fixed=True)
    assert points['A'].at == pytest.approx((r, r), abs=1e-15)
    assert points['B'].at == pytest.approx((2.0 * r, 0.0), abs=1e-15)
    ends = ((0.0, 0.0), (1.0, 0.0))
    for body, names in zip(scene.mechanism.bodies, (('O', 'A'), ('A', 'B')), strict=True):
        assert body.points == names
        assert body.local[0] == (0.0, 0.0)
        assert list(body.local) == [ends[0], pytest.approx(ends[1], abs=1e-15)]
        assert (body.mass, body.com[1]) == (1.0, 0.0)
        assert (body.com[0], body.inertia) == pytest.approx((0.5, 1.0 / 12.0), rel=1e-15)
    kinds = [
        (joint.name, joint.kind, joint.parent, joint.child, joint.point)
        for joint in scene.mechanism.joints
    ]
    assert kinds == [
        ('crank_pin', 'revolute', 'ground', 'crank', 'O'),
        ('knee', 'revolute', 'crank', 'coupler', 'A'),
        ('guide', 'slider', 'ground', 'coupler', None),
    ]
    line, tip = scene.mechanism.joints[2].frames
    assert line == Frame((0.0, 0.0), ((1.0, 0.0), (0.0, 1.0)))
    assert tip.origin == pytest.approx((1.0, 0.0), abs=1e-15)
    assert scene.effects == (Effect('gravity', 'gravity', gravity.Parameters((0.0, -9.81))),)
    assert (scene.positions, scene.velocities) == ({}, {'B': (-4.0, 0.0)})
    assert scene.solver == Solver(step=1e-3, integrator='rk4')
    assert scene.name == scene.mechanism.name == 'slider_crank'
    assert scene.file is not None
    assert Path(scene.file).name == 'slider_crank.yaml'


def test_the_double_four_bar_is_the_n_four_bar_of_two() -> None:
    """Written out and written with repetition: the same points and bodies."""
    double, repeated = load_scene('double_four_bar'), load_scene('n_four_bar', {'N': 2})
    assert sorted(double.mechanism.points, key=str) == sorted(repeated.mechanism.points, key=str)
    assert double.mechanism.bodies == repeated.mechanism.bodies
    assert sorted(double.mechanism.joints, key=str) == sorted(repeated.mechanism.joints, key=str)
    assert double.velocities == repeated.velocities == {'B0': (1.0, 0.0)}


def test_the_four_bar_turns_over_at_any_crank_angle() -> None:
    """Grashof, and drawn closed wherever its crank starts."""
    for degrees in range(0, 360, 15):
        mechanism = load_scene('four_bar', {'theta': math.radians(degrees)}).mechanism
        at = {point.name: point.at for point in mechanism.points}
        a, b, c, d = (
            math.dist(at[i], at[j]) for i, j in (('O', 'A'), ('A', 'B'), ('C', 'B'), ('O', 'C'))
        )
        assert (a, b, c, d) == pytest.approx((0.1, 0.3, 0.25, 0.3), rel=1e-12)
        assert [body.local[1][0] for body in mechanism.bodies] == [0.1, 0.3, 0.25]
    assert a == min(a, b, c, d)
    assert a + max(b, c, d) < b + c + d - max(b, c, d)


@pytest.mark.parametrize('name', SCENES)
def test_every_scene_stands_alone_as_text(name: str) -> None:
    scene = load_scene(name)
    again = scene_from_text(scene.text)
    assert again == scene
    assert (again.text, again.hash) == (scene.text, scene.hash)
    assert scene.hash == hashlib.sha256(scene.text.encode()).hexdigest()
    assert _without_text(load_scene(yaml.safe_load(scene.text))) == _without_text(scene)
    assert pickle.loads(pickle.dumps(scene)) == scene


def _without_text(scene: Scene) -> Scene:
    """Another YAML library may write the same numbers in another way."""
    return dataclasses.replace(scene, document=SceneDocument(''))


@pytest.mark.parametrize('name', MECHANISMS)
def test_every_mechanism_is_in_a_scene(name: str) -> None:
    assert name in SCENES
    assert load_scene(name).mechanism.name == name


def test_the_text_holds_what_was_replaced() -> None:
    scene = load_scene('n_four_bar', {'N': 3, 'L': 0.1 + 0.2})
    again = scene_from_text(scene.text)
    assert again == scene
    assert len(again.mechanism.bodies) == 7
    assert again.mechanism.bodies[0].local[1] == (0.1 + 0.2, 0.0)
    assert scene.hash != load_scene('n_four_bar', {'N': 3}).hash


def test_parameters_reach_what_depends_on_them() -> None:
    """Parameters of the call replace parameters of the scene before expressions are evaluated."""
    text = 'mechanism: slider_crank\nparameters: {L: 3, m: 4*L}\ninitial: {positions: {B: [L, ~]}}'
    scene = scene_from_text(text, parameters={'L': 0.5})
    crank = scene.mechanism.bodies[0]
    assert crank.local[1][0] == pytest.approx(0.5, rel=1e-15)
    assert (crank.mass, scene.positions) == (2.0, {'B': (0.5, None)})
    assert scene_from_text(scene.text) == scene


def test_the_hash_is_of_the_meaning() -> None:
    """Comments, quotes, flow or block: no difference. A number: a difference."""
    plain = 'mechanism: slider_crank\neffects: {gravity: {acceleration: [0, -9.81]}}\n'
    other = 'mechanism: "slider_crank"  # of 6.2\neffects:\n  gravity:\n    acceleration:\n'
    other += '      - 0\n      - "-9.81"\n'
    assert scene_from_text(plain).hash == scene_from_text(other).hash
    assert scene_from_text(plain).hash != scene_from_text(plain.replace('9.81', '9.8')).hash


def test_a_mapping_is_a_scene() -> None:
    scene = load_scene(
        {'mechanism': PENDULUM, 'initial': {'velocities': {'P': np.array([1.5, 0.0])}}}
    )
    there = Frame((0.0, 0.0), ((1.0, 0.0), (0.0, 1.0)))
    on_rod = scene.mechanism.joints[0].frames[1]
    assert on_rod.origin == (0.0, 0.0)
    assert np.array(on_rod.axes) == pytest.approx(np.array([[0, 1], [-1, 0]]), abs=1e-15)
    assert scene.mechanism == Mechanism(
        'scene',
        (Point('O', (0.0, 0.0), True), Point('P', (0.0, -2.0))),
        (Body('rod', ('O', 'P'), ((0.0, 0.0), (2.0, 0.0)), 3.0, (1.0, 0.0), 1.0),),
        (Joint('pin', 'revolute', 'ground', 'rod', (there, on_rod), 'O'),),
    )
    assert scene.velocities == {'P': (1.5, 0.0)}
    assert (scene.effects, scene.solver, scene.file) == ((), UNSAID, None)
    assert scene_from_text(scene.text) == scene


def test_a_mapping_from_another_yaml_reader() -> None:
    """A file of ours, read by PyYAML, which takes the key `on` for True."""
    path = folder('mechanisms')[0] / 'slider_crank.yaml'
    mechanism = yaml.safe_load(path.read_text())
    guide = mechanism['joints']['guide']
    assert 'on' not in guide and True in guide, 'PyYAML reads it otherwise: this shows nothing'
    scene = load_scene({'name': 'slider_crank', 'mechanism': mechanism})
    assert scene.mechanism == load_scene('slider_crank').mechanism


def test_a_path_and_a_mechanism_beside_it(tmp_path: Path) -> None:
    (tmp_path / 'parts').mkdir()
    (tmp_path / 'parts' / 'my pendulum.yaml').write_text(yaml.safe_dump(PENDULUM))
    path = tmp_path / 'swing.yml'
    path.write_text('mechanism: parts/my pendulum.yaml\n')
    scene = load_scene(str(path))
    assert (scene.name, scene.mechanism.name) == ('swing', 'my_pendulum')
    assert load_scene(path) == scene
    assert scene_from_text(scene.text) == scene


def _scene(bodies: str, points: str = '', more: str = '') -> Scene:
    return scene_from_text(f"""
mechanism:
  alf: 1
  points:
    A: {{at: [1, 1]}}
    B: {{at: [1, 3]}}
    {points}
  bodies:
    {bodies}
{more}""")


def test_body_frame() -> None:
    """Origin at the first point, x towards the second: here +y of the world."""
    scene = _scene(
        'plate: {points: [A, B, C], mass: 2, inertia: {about_com: 0.3}, com: [1, -0.5]}',
        'C: {at: [0, 2]}',
    )
    (plate,) = scene.mechanism.bodies
    assert plate.local == ((0.0, 0.0), (2.0, 0.0), (1.0, 1.0))
    assert (plate.com, plate.inertia) == ((1.0, -0.5), 0.3)


def test_length_overrides_the_drawing() -> None:
    (rod,) = _scene('rod: {points: [A, B], mass: 12, inertia: rod, length: 0.5}').mechanism.bodies
    assert (rod.local, rod.com, rod.inertia) == (((0.0, 0.0), (0.5, 0.0)), (0.25, 0.0), 0.25)


def test_centre_of_mass_by_default() -> None:
    scene = _scene(
        """a: {points: [A, B], mass: 1, inertia: {about_com: 2}}
    b: {points: [C, A], mass: 0}
    c: {points: [D], mass: 5, inertia: point}
    d: {points: [E, F], mass: 1, inertia: point, com: [4, 0]}""",
        'C: {at: [5, 1]}\n    D: {at: [0, 9]}\n    E: {at: [0, 0]}\n    F: {at: [4, 0]}',
        """  joints:
    pin: {type: revolute, between: [a, b], at: A}""",
    )
    found = {body.name: (body.com, body.inertia) for body in scene.mechanism.bodies}
    assert found == {
        'a': ((1.0, 0.0), 2.0),
        'b': ((2.0, 0.0), 0.0),
        'c': ((0.0, 0.0), 0.0),
        'd': ((4.0, 0.0), 0.0),
    }


@pytest.mark.parametrize('size', [1e-59, 1.0, 1e39])
def test_direction_is_normalised(size: float) -> None:
    scene = _scene(
        'rod: {points: [A, B], mass: 1, inertia: rod}',
        more=f"""  joints:
    guide: {{type: slider, point: B, on: {{through: [0, 3], direction: [{3 * size}, {4 * size}]}}}}
    other:
     {{type: slider, point: A, between: [ground, rod], on: {{through: [1, 1], direction: [1, 1]}}}}
""",
    )
    line = scene.mechanism.joints[0].frames[0]
    assert line.axes[0] == pytest.approx((0.6, 0.8), rel=1e-15)
    assert [joint.child for joint in scene.mechanism.joints] == ['rod', 'rod']


def test_yaml_1_1_plays_no_tricks() -> None:
    """`on`, `y` and `no` are names, 1e-3 and 1E3 are numbers, 010 is ten."""
    scene = _scene(
        'on: {points: [y, no, A, B], mass: 010, inertia: {about_com: .1}, com: [0, 0]}',
        'y: {at: [1e-3, 0]}\n    no: {at: [1_000, 0]}',
        """effects:
  constant_wrench: {on: on, force: [1, 0], torque: 1e-3, at: no}
initial: {velocities: {y: [null, 1E3]}}""",
    )
    assert scene.mechanism.bodies[0].points == ('y', 'no', 'A', 'B')
    assert scene.mechanism.bodies[0].mass == 10.0
    assert scene.mechanism.bodies[0].local[1] == (999.999, 0.0)
    wrench = constant_wrench.Parameters('on', (1.0, 0.0), torque=1e-3, at='no')
    assert scene.effects[0].parameters == wrench
    assert scene.velocities == {'y': (None, 1000.0)}


@pytest.mark.parametrize(
    ('given', 'names'),
    [
        ('{on: A, force: [1, 0]}', ['constant_wrench']),
        (
            '[{on: A, force: [0, 0]}, {on: B, force: [0, 2]}]',
            ['constant_wrench_0', 'constant_wrench_1'],
        ),
        ('{left: {on: A, force: [0, 0]}, right: {on: rod, torque: 2}}', ['left', 'right']),
        ('[]', []),
    ],
)
def test_an_effect_may_stand_several_times(given: str, names: list[str]) -> None:
    scene = _scene(
        'rod: {points: [A, B], mass: 1, inertia: rod}',
        more=f'effects:\n  constant_wrench: {given}',
    )
    assert [effect.name for effect in scene.effects] == names
    assert {effect.kind for effect in scene.effects} <= {'constant_wrench'}
    assert scene_from_text(scene.text) == scene


def test_what_is_not_named_is_not_there() -> None:
    for more in ('', 'effects:', 'effects: {}\ninitial:\nsolver:'):
        scene = _scene('rod: {points: [A, B], mass: 1, inertia: rod}', more=more)
        assert (scene.effects, scene.positions, scene.velocities) == ((), {}, {})
        assert scene.solver == UNSAID and not scene.says_solver


def test_repetition_over_two_indices() -> None:
    """A grid of names; the last index runs fastest."""
    scene = scene_from_text("""
mechanism:
  alf: 1
  parameters: {M: 2, N: 3}
  points:
    P<i>_<j>: {for: {i: [1, M], j: [0, N]}, at: [i, 10*j]}
    Q<M*N>: {at: [-1, 0]}
  bodies:
    b<i>_<j>:
      {for: {i: [1, M], j: [1, N]}, points: ['P<i>_<j-1>', "P<i>_<j>"], mass: i, inertia: rod}
    cross: {points: [P1_0, P2_0, Q<M*N>], mass: 1, inertia: rod}
  joints:
    pin<i>_<j>:
      for: {i: [1, M], j: [2, N]}
      type: revolute
      between: [b<i>_<j-1>, b<i>_<j>]
      at: P<i>_<j-1>
    foot<i>: {for: {i: [1, M]}, type: revolute, between: [cross, b<i>_1], at: P<i>_0}
    none<i>: {for: {i: [1, 0]}, type: revolute, between: [cross, b<i>_1], at: P<i>_0}
""")
    points = [point.name for point in scene.mechanism.points]
    assert points == [f'P{i}_{j}' for i in (1, 2) for j in range(4)] + ['Q6']
    assert scene.mechanism.points[6].at == (2.0, 20.0)
    assert [body.mass for body in scene.mechanism.bodies] == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0]
    assert Counter(joint.name[:3] for joint in scene.mechanism.joints) == {'pin': 4, 'foo': 2}
    assert scene_from_text(scene.text) == scene


def calls_of(work: Callable[[], object]) -> int:
    """How many calls of functions it makes."""
    profile = cProfile.Profile()
    profile.runcall(work)
    return sum(entry.callcount for entry in profile.getstats())


def test_a_thousand_four_bars() -> None:
    """More take as much more work as they are more."""
    calls = [calls_of(partial(load_scene, 'n_four_bar', {'N': N})) for N in (100, 200, 400)]
    assert calls[2] - calls[1] < 2.1 * (calls[1] - calls[0])
    mechanism = load_scene('n_four_bar', {'N': 1000}).mechanism
    assert (len(mechanism.points), len(mechanism.bodies)) == (2002, 2001)
    assert len(mechanism.joints) == 3001
    assert mechanism.points[-1] == Point('B1000', (1000.0, 1.0))
    assert mechanism.bodies[-1].points == ('B999', 'B1000')


def _random_value(rng: random.Random, depth: int) -> object:
    kind = rng.randrange(9) if depth else rng.randrange(6)
    if kind >= 6:
        size = rng.choice((0, 1, 3, 30))
        if kind == 6:
            return [_random_value(rng, depth - 1) for _ in range(size)]
        return {_random_text(rng): _random_value(rng, depth - 1) for _ in range(size)}
    numbers = (rng.randint(-9, 10**6), rng.gauss(0, 1) * 10 ** rng.randint(-300, 300))
    return (None, True, False, *numbers, _random_text(rng))[kind]


def _random_text(rng: random.Random) -> str:
    words = (
        'null',
        '~',
        'true',
        'on',
        '1e-3',
        '',
        ' ',
        '- a',
        '---',
        '<<',
        'B<k-1>',
        '#',
        'é',
        '😀',
    )
    alphabet = 'aZ09_.-+*/%<>()[]{}:,#&!|\'"`@?\\ \t\n\r\x07\x85\u2028\u00e9\U0001f600'
    return (
        rng.choice(words)
        if rng.random() < 0.3
        else ''.join(rng.choices(alphabet, k=rng.randint(1, 9)))
    )


def _plain(node: yaml_document.Entry) -> object:
    """The value of an entry without its place; a scalar with its other possible readings."""
    if isinstance(node.value, tuple):
        return [_plain(item) for item in node.value]
    if isinstance(node.value, dict):
        return {key: _plain(value) for key, value in node.value.items()}
    null, boolean = node.is_null, node.plain and node.value in yaml_document.BOOLEAN
    return (None if null else node.value, null, boolean)


@pytest.mark.parametrize(
    'loader', [yaml_document._Loader, yaml.SafeLoader], ids=['libyaml', 'python']
)
def test_whatever_is_written_reads_back(loader: type, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_document, '_Loader', loader)
    rng = random.Random(7)
    for _ in range(150 if LONG else 60):
        data = entry({_random_text(rng): _random_value(rng, 3) for _ in range(4)})
        text = serialise(data)
        read = yaml_document.parse(text, None)
        assert _plain(read) == _plain(data)
        assert serialise(read) == text
