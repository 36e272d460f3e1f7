"""Mistakes in mechanism and scene files: one line, with file, line, key, value, nearest name."""

from __future__ import annotations

import random
import re

import pytest
import yaml

from alf_ros.errors import InputError
from alf_ros.scene.scene import load_scene, scene_from_text
from alf_ros.scene.text import yaml_document
from support.ball_scene import BALLS

SCENE = """\
mechanism:
  alf: 1
  space: planar
  parameters:
    L: 1.0
    half: L/2
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0, L]}
    B: {at: [L, L]}
    C: {at: [half, 2*L]}
  bodies:
    crank: {points: [O, A], mass: 1.0, inertia: rod}
    plate: {points: [A, B, C], mass: 2.0, inertia: {about_com: 0.1}, com: [half, 0]}
    bob: {points: [C], mass: 0.5, inertia: point, shapes: [{sphere: {radius: 0.1}}]}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    knee: {type: revolute, between: [crank, plate], at: A}
    hook: {type: revolute, between: [plate, bob], at: C}
    guide: {type: slider, point: B, on: {through: [0, L], direction: [1, 0]}}
effects:
  gravity: {acceleration: [0, -9.81]}
  constant_wrench: {on: plate, force: [1, 0], at: B}
initial:
  positions: {A: [0, ~]}
  velocities: {B: [1.0, 0]}
solver: {step: 1e-3, integrator: rk4, iterations: 5}
"""
# (what stands there, what is put instead, text of the line to blame, what the message says)
MISTAKES = {
    # the document
    'syntax': ('at: [0, L]}', 'at: [0, L}', 'A: {at', 'not YAML'),
    'tab': ('  alf: 1', '\talf: 1', 'alf: 1', 'not YAML'),
    'duplicate key': (
        '    A: {',
        '    O: {',
        'O: {at: [0, L]',
        "key given twice, got 'O'.*line 8",
    ),
    'duplicate body': (
        'bob: {',
        'crank: {',
        'crank: {points: [C]',
        "key given twice, got 'crank'",
    ),
    'tag': ('1.0, inertia: rod', '!!float 1, inertia: rod', 'crank: {', 'tag has no meaning'),
    'alias of nothing': ('[half, 0]}', '*here}', 'plate: {', "alias of nothing.*'here'"),
    'alias of itself': ('[half, 0]}', '&a [*a, 0]}', 'plate: {', 'of itself'),
    'second document': ('effects:', '---\neffects:', '---', 'second document'),
    'control character': ('rod}', 'r\x07d}', 'crank: {', '0x07 does not belong'),
    'list as key': ('    A: {', '    [A]: {', '[A]', 'key must be a plain name'),
    # keys
    'root key': ('solver:', 'solvers:', 'solvers:', "unknown key, got 'solvers'.*mean 'solver'"),
    'mechanism key': ('  bodies:', '  bodys:', 'bodys:', "got 'bodys'; did you mean 'bodies'"),
    'body key': ('mass: 2.0', 'mas: 2.0', 'plate', "bodies.plate.mas: .*did you mean 'mass'"),
    'yaml 1.1 key': ('point: B, on:', 'point: B, no:', 'guide', "got 'no'; did you mean 'on'"),
    'missing key': ('mass: 2.0, ', '', 'plate', "bodies.plate: missing key 'mass'"),
    'missing at': ('{at: [L, L]}', '', 'B:', "points.B: missing key 'at'"),
    'missing version': ('  alf: 1\n', '', 'mechanism:', "missing key 'alf'"),
    'wrong version': ('alf: 1', 'alf: 2', 'alf', "unknown version.*got '2'; expected 1"),
    'spatial': ('planar', 'spatial', 'O: {', 'a list of 2 given; expected a list of 3'),
    'space': ('planar', 'plane', 'space', "got 'plane'; did you mean 'planar'"),
    'drives': (
        '  points:',
        '  drives: []\n  points:',
        'drives',
        'a list of 0 given; expected a map',
    ),
    'vectors': ('  points:', '  vectors: {}\n  points:', 'vectors', 'vectors are for space'),
    'other key of a joint': ('C}\n    guide', 'C, point: C}\n    guide', 'hook', 'unknown key'),
    # values
    'vector': ('[L, L]', '[L, L, 0]', 'B:', 'a list of 3 given; expected a list of 2'),
    'no vector': ('[L, L]', 'L', 'B:', "wrong kind of value, got 'L'; expected a list of 2"),
    'no number': ('mass: 2.0', 'mass: [2.0]', 'plate', 'a list of 1 given; expected a number'),
    'nothing': (
        'mass: 2.0',
        'mass: ',
        'plate',
        'bodies.plate.mass: nothing given; expected a number',
    ),
    'null point': ('    B: {at: [L, L]}', '    B:', 'B:', "points.B: missing key 'at'"),
    'no boolean': ('fixed: true', 'fixed: yes', 'O:', "got 'yes'; expected true or false"),
    'quoted boolean': ('fixed: true', 'fixed: "true"', 'O:', 'expected true or false'),
    'infinite': ('mass: 2.0', 'mass: .inf', 'plate', "not a finite number, got '.inf'"),
    'nan': ('mass: 2.0', 'mass: nan', 'plate', "not a finite number, got 'nan'"),
    'expression': ('mass: 2.0', 'mass: 2*', 'plate', "not arithmetic, got '2\\*'"),
    'zero division': ('mass: 2.0', 'mass: 1/0', 'plate', 'division by zero'),
    'unknown parameter': ('[half, 2*L]', '[haf, 0]', 'C:', "name 'haf' in 'haf'.*mean 'half'"),
    'unknown function': ('half: L/2', 'half: sqr(2)', 'half', "got 'sqr'; did you mean 'sqrt'"),
    'order of parameters': (
        'L: 1.0',
        'L: half',
        'L: half',
        "uses a parameter further below, got 'half'; expected parameters that stand above it",
    ),
    'parameter of itself': ('L: 1.0', 'L: 2*L', 'L: 2', "uses itself, got 'L'"),
    'reserved parameter': (
        'L: 1.0',
        'L: 1.0\n    pi: 3',
        'pi: 3',
        'cannot be used for a parameter',
    ),
    'parameter name': ('half: L/2', 'L-half: 1', 'L-half', 'cannot be used for a parameter'),
    # points
    'no point': ('[O, A], mass', '[O, AA], mass', 'crank', "no such point, got 'AA'.*mean 'A'"),
    'unused point': ('points: [C], mass: 0.5', 'points: [B], mass: 0.5', 'hook', 'not carry it'),
    'free point': ('    C: {', '    D: {at: [9, 9]}\n    C: {', 'D:', "'D' is of no body"),
    'name of a point': ('    A: {', '    1A: {', '1A', "not a name, got '1A'; expected a letter"),
    'underscore': ('    C: {', '    _x: {', '_x', 'not a name'),
    'ground as name': ('crank: {', 'ground: {', 'ground: {', "taken.*got 'ground'"),
    'world as name': ('    C: {', '    world: {', 'world: {', 'taken'),
    'body like point': ('bob: {', 'A: {', 'A: {points', 'already belongs to .*points.A in line 9'),
    'joint like body': (
        'knee: {',
        'crank: {',
        'crank: {type',
        'belongs to .*bodies.crank in line 13',
    ),
    # bodies
    'negative mass': ('mass: 2.0', 'mass: -2', 'plate', "negative mass, got '-2'; expected kg"),
    'negative inertia': ('about_com: 0.1', 'about_com: -1', 'plate', 'negative inertia'),
    'no points': ('points: [C]', 'points: []', 'bob', "body 'bob' has no points"),
    'point twice': ('[A, B, C]', '[A, B, A]', 'plate', "point given twice, got 'A'"),
    'unknown inertia': (
        'inertia: rod',
        'inertia: disc',
        'crank',
        "got 'disc'; expected rod, point",
    ),
    'no inertia': (', inertia: rod', '', 'crank', "missing key 'inertia'"),
    'rod of one point': ('inertia: point', 'inertia: rod', 'bob', 'one point, which cannot turn'),
    'turning point': ('inertia: point', 'inertia: {about_com: 1}', 'bob', 'cannot turn'),
    'com of one point': ('inertia: point', 'inertia: point, com: [1, 0]', 'bob', 'mass there'),
    'no com': (', com: [half, 0]', '', 'plate', "missing key 'com': where is the mass of 'plate'"),
    'no com of a point mass': ('inertia: rod', 'inertia: point', 'crank', "missing key 'com'"),
    'coincident': ('[L, L]', '[0, L]', 'plate', "first two points of 'plate'.*same place"),
    'length': ('mass: 2.0', 'mass: 2.0, length: 1', 'plate', 'for bodies of two points'),
    'zero length': ('inertia: rod', 'inertia: rod, length: 0', 'crank', 'more than zero'),
    'huge': ('[L, L]', '[1e200, L]', 'B:', "at.0.: too large, got '1e200'; expected 1e.40"),
    'tiny': ('[0, L]}', '[0, 1e-200]}', 'A: {', "too small, got '1e-200'; expected 0, or 1e-60"),
    'immovable': ('at: [0, L]', 'at: [0, L], fixed: true', 'crank', 'fixed at O and A'),
    'no body': (
        'crank: {points',
        'crank: {for: {k: [1, 0]}, points',
        'pin',
        "no such body.*'crank'",
    ),
    # joints
    'type': ('type: slider', 'type: slidder', 'guide', "got 'slidder'; did you mean 'slider'"),
    'later type': ('type: slider', 'type: spherical', 'guide', 'a joint of space'),
    'no such body': (
        '[crank, plate]',
        '[crank, plat]',
        'knee',
        "got 'plat'; did you mean 'plate'",
    ),
    'one side': ('[crank, plate]', '[crank]', 'knee', 'a list of 1 given; expected a list of 2'),
    'itself': ('[crank, plate]', '[crank, crank]', 'knee', 'between two bodies'),
    'ground last': ('[ground, crank]', '[crank, ground]', 'pin', r'expected \[ground, crank\]'),
    'not carried': (
        'plate], at: A',
        'plate], at: C',
        'knee',
        "'crank' does not carry it, got 'C'",
    ),
    'not fixed': ('crank], at: O', 'crank], at: A', 'pin', "not a fixed point.*got 'A'"),
    'no direction': ('direction: [1, 0]', 'direction: [0, L-L]', 'guide', 'zero is no direction'),
    'fixed slider': ('point: B, on', 'point: O, on', 'guide', "fixed point cannot slide, got 'O'"),
    'which slider': (
        'point: B, on',
        'point: C, on',
        'guide',
        'plate and bob meet at C: name the one',
    ),
    'slider of the wrong body': (
        'point: B, on',
        'between: [ground, crank], point: B, on',
        'guide',
        "'crank' does not carry it, got 'B'",
    ),
    'moving rail': (
        'point: B, on',
        'between: [crank, plate], point: B, on',
        'guide',
        r"between the ground and a body, got 'crank'; expected \[ground, plate\]",
    ),
    'missing joint': (
        '    hook: {type: revolute, between: [plate, bob], at: C}\n',
        '',
        'bob',
        'plate and bob meet at C, but no joint connects them there',
    ),
    'not on the ground': (
        '    pin: {type: revolute, between: [ground, crank], at: O}\n',
        '',
        'crank: {',
        'ground and crank meet at O, but no joint',
    ),
    'cycle': (
        '    guide:',
        '    again: {type: revolute, between: [plate, bob], at: C}\n    guide:',
        'again',
        "'again' is one too many: plate and bob are already connected at C",
    ),
    'name of a row': ('guide: {', 'crank_length: {', 'crank_length', 'both have a constraint'),
    # repetition
    'no index': ('    A: {', '    A: {for: {}, ', 'A: {', 'no index'),
    'index of nothing': ('    A: {', '    A<k>: {', 'A<k>', "index <k>: unknown name 'k'"),
    'fraction': ('    A: {', '    A<L/2>: {', 'A<L/2>', '0.5 is not a whole number'),
    'fraction as bound': ('    A: {', '    A<k>: {for: {k: [0, 0.5]}, ', 'A<k>', 'not a whole'),
    'bounds': (
        '    A: {',
        '    A<k>: {for: {k: [0]}, ',
        'A<k>',
        'a list of 1 given; expected a list of 2',
    ),
    'name of an index': (
        '    A: {',
        '    A<L>: {for: {L: [0, 1]}, ',
        'A<L>',
        'an index that cannot be used',
    ),
    'same name': (
        '    A: {',
        '    A: {for: {k: [0, 1]}, ',
        'A: {',
        'this name already belongs to',
    ),
    'too many': ('    A: {', '    A<k>: {for: {k: [0, 1e7]}, ', 'A<k>', 'more than 200000 repet'),
    'open bracket': ('    A: {', '    A<k: {', 'A<k', "not a name, got 'A<k'"),
    # the scene
    'effect': ('gravity:', 'gravty:', 'gravty', "unknown effect, got 'gravty'.*mean 'gravity'"),
    'key of an effect': ('acceleration', 'accelerate', 'gravity', "did you mean 'acceleration'"),
    'missing in an effect': ('{acceleration: [0, -9.81]}', '', 'gravity', "key 'acceleration'"),
    'effect twice': ('{acceleration: [0, -9.81]}', '[{}, {}]', 'gravity', 'expected a mapping'),
    'body of an effect': ('on: plate', 'on: plat', 'wrench', "got 'plat'; did you mean 'plate'"),
    'place of an effect': ('1, 0], at: B', '1, 0], at: O', 'wrench', "'O' is no point of 'plate'"),
    'frame of an effect': ('at: B}', 'at: B, frame: hand}', 'wrench', "got 'hand'.*world, body"),
    'refused by an effect': (
        'on: plate, force',
        'on: bob, torque: 1, force',
        'wrench',
        'no orient',
    ),
    'kind of shape': ('[{sphere', '[{spheer', 'bob', "got 'spheer'; did you mean 'sphere'"),
    'no shape': (
        '{sphere: {radius: 0.1}}',
        '{at: [0, 0]}',
        'bob',
        'has one kind; expected one of',
    ),
    'two shapes': (
        '{radius: 0.1}}',
        '{radius: 0.1}, box: {size: [1, 1, 1]}}',
        'bob',
        r"shapes\[0\]: a shape has one kind, got 'box and sphere'",
    ),
    'flat shape': ('radius: 0.1', 'radius: 0', 'bob', 'sphere.radius: not a length, got .0.'),
    'size of a shape': ('radius: 0.1', 'raduis: 1', 'bob', "got 'raduis'; did you mean 'radius'"),
    'colour of a shape': (
        'radius: 0.1}',
        'radius: 0.1}, color: [0, 0, 7]',
        'bob',
        r'color\[2\]: not a part of a colour, got .7.; expected a number from 0 to 1',
    ),
    'no mesh': (
        'sphere: {radius: 0.1}',
        'mesh: {file: /dev/zero}',
        'bob',
        "not a file of a mesh, got '/dev/zero'; expected one that ends in .3ds",
    ),
    'mesh elsewhere': (
        'sphere: {radius: 0.1}',
        'mesh: {file: "http://a.b/c.stl"}',
        'bob',
        'not a file of a mesh.*expected a path, or package://',
    ),
    'mesh with NUL': (
        'sphere: {radius: 0.1}',
        'mesh: {file: "a\\0.stl"}',
        'bob',
        r"not a path, got 'a.x00.stl'",
    ),
    'mesh of nobody': (
        'sphere: {radius: 0.1}',
        'mesh: {file: "~no-such-user/a.stl"}',
        'bob',
        "not a path, got '~no-such-user",
    ),
    'mesh with escapes': (
        'sphere: {radius: 0.1}',
        'mesh: {file: "a\\e[2J.stl"}',
        'bob',
        r"not a file of a mesh, got 'a.x1b\[2J.stl'",
    ),
    'vector of an effect': ('[0, -9.81]', '[0, 0, -9.81]', 'gravity', 'expected a list of 2'),
    'point of initial': ('{B: [1.0', '{Bee: [1.0', 'velocities', "no such point, got 'Bee'"),
    'fixed initial': ('{A: [0, ~]}', '{O: [0, ~]}', 'positions', "this point is fixed, got 'O'"),
    'initial': ('velocities:', 'velocity:', 'velocity', "did you mean 'velocities'"),
    'step': ('step: 1e-3', 'step: 0', 'solver', 'solver.step: .*from 1e-12'),
    'integrator': ('rk4', 'rk5', 'solver', "unknown integrator, got 'rk5'; did you mean 'rk4'"),
    'iterations': ('iterations: 5', 'iterations: 2.5', 'solver', 'not a whole number'),
    'no iterations': ('iterations: 5', 'iterations: 0', 'solver', 'from 1 to 1000'),
    'solver key': ('iterations', 'iteration', 'solver', "did you mean 'iterations'"),
    'parameter of scene': (
        'effects:',
        'parameters: {M: 1}\neffects:',
        'M: 1',
        'no such parameter',
    ),
    'scene name': ('effects:', 'name: a/b\neffects:', 'name:', "not a name, got 'a/b'"),
}


@pytest.mark.parametrize(('old', 'new', 'blame', 'message'), MISTAKES.values(), ids=MISTAKES)
@pytest.mark.parametrize(
    'loader', [yaml_document._Loader, yaml.SafeLoader], ids=['libyaml', 'python']
)
def test_mistake(
    loader: type, old: str, new: str, blame: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(yaml_document, '_Loader', loader)
    assert SCENE.count(old) == 1, 'the case is ambiguous'
    text = SCENE.replace(old, new)
    with pytest.raises(InputError, match=message) as caught:
        scene_from_text(text, file='my.yaml')
    error = caught.value
    assert '\n' not in str(error)
    assert str(error).startswith(f'my.yaml:{error.line}: ')
    assert error.exit_code == 2
    if 'not YAML' not in message:  # a scanner notices a mistake where it can go on no longer
        assert error.line is not None
        assert blame in text.split('\n')[error.line - 1]


def test_the_scene_of_the_mistakes_is_right() -> None:
    assert scene_from_text(SCENE).mechanism.bodies[1].local[2] == (0.5, 1.0)


TOKENS = (
    '0 -1 1e999 1e308 1e-320 nan ~ true [] {} "" O A B crank ground [0] [[]] <k> rod point slider '
    '9**9**9 1/0 &a *a !!int --- : # " \' \u00e9 \u2028 % | > ?'
).split(' ') + ['[0, 0]', '{k: [0, 3]}', '- ', '\t']


TWO_WITH_ONE_NAME = """mechanism:
  alf: 1
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [1, 0, 0]}}
  bodies:
    a: {points: [O, A], mass: 1, inertia: {about_com: [1, 1, 1]}, com: [0, 0, 0]}
    b: {points: [A], mass: 1, inertia: {about_com: [1, 1, 1]}, com: [0, 0, 0]}
  joints:
    u: {type: universal, between: [ground, a], at: O, axes: [[1, 0, 0], [0, 1, 0]]}
    u_first: {type: revolute, between: [a, b], at: A, axis: [0, 1, 0]}
"""


def test_two_joint_coordinates_of_one_name() -> None:
    """Commands and joint states would have one of them."""
    scene_from_text(TWO_WITH_ONE_NAME.replace('u_first', 'u_third'))
    message = ":10: .*joints.u_first: a coordinate of u has the same name.*, got 'u_first'"
    with pytest.raises(InputError, match=message):
        scene_from_text(TWO_WITH_ONE_NAME)


@pytest.mark.parametrize(
    ('before', 'after', 'told'),
    [
        (', pitch: [0, 1, 0]', '', 'hip.angles: not three axes, got .yaw, roll.; expected three'),
        ('pitch: [0, 1, 0]', 'pitch: [1, 1, 0]', 'hip.angles: each axis is at a right angle'),
        ('pitch: [0, 1, 0]', 'first: [0, 1, 0]', 'a coordinate of hip has the same name as one'),
        ('pitch: [0, 1, 0]', 'pin: [0, 1, 0]', 'a coordinate of pin has the same name as one'),
        ('pitch: [0, 1, 0]', 'a b: [0, 1, 0]', 'a b: not a name, got .a b.'),
        ('pitch: [0, 1, 0]', 'pitch: [0, 0, 0]', 'pitch: '),
        ('joint: pin', 'joint: roll', 'roll'),
    ],
)
def test_angles_of_balls(before: str, after: str, told: str) -> None:
    assert BALLS.count(before) == 1
    with pytest.raises(InputError, match=told) as caught:
        scene_from_text(BALLS.replace(before, after))
    assert '\n' not in str(caught.value)


def _mutant(text: str, random: random.Random) -> str:
    for _ in range(random.randint(1, 3)):
        lines = text.split('\n')
        i, j = random.randrange(len(lines)), random.randrange(len(lines))
        at = random.randrange(len(text) + 1)
        kind = random.randrange(7)
        if kind == 0:
            text = text[:at] + text[at + 1 :]
        elif kind == 1:
            text = text[:at] + random.choice(TOKENS) + text[at:]
        elif kind == 2:
            lines[i], lines[j] = lines[j], lines[i]
            text = '\n'.join(lines)
        elif kind == 3:
            text = '\n'.join(lines[:i] + lines[i + 1 :])
        elif kind == 4:
            text = '\n'.join([*lines[:i], lines[j], *lines[i:]])
        else:
            words = list(re.finditer(r'[\w.<>*+-]+', text))
            if words:
                word = random.choice(words)
                other = random.choice((*TOKENS, random.choice(words).group()))
                text = text[: word.start()] + other + text[word.end() :]
    return text


@pytest.mark.parametrize('seed', range(8))
def test_mutated_files_load_or_are_refused(seed: int) -> None:
    """Whatever is done to a file, it loads (and so does its text) or is refused in one line."""
    rng = random.Random(seed)
    sources = [SCENE, *(load_scene(n).text for n in ('four_bar', 'n_four_bar', 'double_four_bar'))]
    loaded = 0
    for _ in range(100):
        text = _mutant(rng.choice(sources), rng)
        try:
            scene = scene_from_text(text)
        except InputError as error:
            assert '\n' not in str(error)
        else:
            assert scene_from_text(scene.text) == scene
            loaded += 1
    assert 0 < loaded < 100


BALL_AND_CROSS = """
mechanism:
  alf: 1
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [1, 0, 0]}, B: {at: [2, 1, 0]}}
  bodies:
    arm: {points: [O, A], mass: 1, inertia: {about_com: [1, 1, 1]}}
    hand: {points: [A, B], mass: 1, inertia: {about_com: [1, 1, 1]}}
  joints:
    ball: {type: spherical, between: [ground, arm], at: O}
    cross: {type: universal, between: [arm, hand], at: A, axes: [[0, 1, 0], [0, 0, 1]]}
"""


@pytest.mark.parametrize(
    ('joint', 'message'),
    [
        ('ball', "a joint without a coordinate, got 'ball'"),
        ('cross', "several coordinates, got 'cross'; expected cross_first or cross_second"),
        ('crux', "unknown name, got 'crux'; known: cross_first, cross_second"),
    ],
)
@pytest.mark.parametrize(
    'section',
    [
        'sensors: {{encoder: {{joint: {}}}}}',
        'effects: {{motor: {{joint: {}, effort: 1}}}}',
        'effects: {{tendon: {{joints: [[{}, 1]], stiffness: 1}}}}',
    ],
    ids=['sensor', 'effect', 'factors'],
)
def test_a_joint_is_no_coordinate(section: str, joint: str, message: str) -> None:
    """Only the name of a joint with a single coordinate is one."""
    with pytest.raises(InputError, match=message):
        scene_from_text(BALL_AND_CROSS + section.format(joint))
