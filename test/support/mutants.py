"""Scene files with mistakes in them: a strategy of hypothesis that mutates whole, good ones.

A file is taken apart to lists of (key, value), lists of values, and scalars as written, changed
there (values, keys, references, order), written again, and sometimes damaged as text.
"""

from __future__ import annotations

import re
from random import Random
from typing import Any

from hypothesis import strategies

from alf_ros.scene.scene import load_scene
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry
from support.paths import ROOT

CONFIG = ROOT / 'config'

# Every effect and the remaining joints, which the library does not have.
PLANE = """
mechanism:
  alf: 1
  parameters: {L: 1.0, m: 2.0}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0, L]}
    B: {at: [L, L]}
    C: {at: [L/2, 2*L]}
    D<k>: {for: {k: [1, 2]}, at: [k*L, -L]}
  bodies:
    crank: {points: [O, A], mass: m, inertia: rod}
    plate: {points: [A, B, C], mass: m, inertia: {about_com: 0.1}, com: [L/2, 0]}
    bob: {points: [C], mass: 0.5, inertia: point, shapes: [{sphere: {radius: L/9}, at: [0, 0]}]}
    bar: {points: [D1, D2], length: L, mass: m, inertia: rod}
    slab: {points: [D2], mass: m, inertia: point}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    knee: {type: revolute, between: [crank, plate], at: A}
    hook: {type: revolute, between: [plate, bob], at: C}
    rail: {type: prismatic, between: [ground, bar], at: D1, axis: [1, 0]}
    glue: {type: weld, between: [bar, slab], at: D2}
  shapes:
    - {box: {size: [L, 0.1, 0.2]}, rpy: [0, 0, pi/4], color: [0.1, 0.2, 0.3, 0.5]}
    - {mesh: {file: parts/base.stl, scale: [1, 1, -1]}, at: [0, 0, -0.1]}
  drives:
    slide: {joint: rail, length: 0.5*t + 0.1*t**3}
    reach: {points: [O, C], length: {table: [[0, "hypot(L/2, 2*L)"], [1, 2*L]]}}
effects:
  gravity: {acceleration: [0, -9.81]}
  constant_wrench: {push: {on: plate, force: [1, 0], at: B}, twist: {on: bar, torque: 0.1}}
  joint_effort: {joint: pin, effort: 0.5}
  spring: [{between: [crank, ground], at: [A, [2, 2]], stiffness: 50, free_length: 0.3}]
  damper: {between: [A, B], table: [[-1, -9], [0, 0], [1, 2]]}
  torsion_spring: {joint: knee, stiffness: 3, free_position: pi/2, damping: 0.1}
  joint_stop: {joint: pin, lower: -pi, upper: 9.5, stiffness: 1e4, damping: 0.3}
  joint_friction:
    worn: {joint: knee, viscous: 0.02, dynamic: 0.1, static: 0.2, load: 20, radius: 0.01}
    true: {joint: pin, dynamic: 0.1, radius: 0.01}
  ground_contact: {on: bar, at: D1, radius: 0.1, through: [0, -2], stiffness: 1e5, friction: 0.3}
  motor:
    {joint: pin, position: [[0, 0], [1, 5]], position_gain: 9, limit: 3, armature: 1}
  drag: {on: bob, linear: 0.05, quadratic: 0.1, wind: [3, 0]}
  user_table: {joint: rail, table: [[0, 0], [1, 2], [2, 0]], interpolation: cubic}
initial:
  positions: {A: [0, ~]}
  velocities: {A: [1.0, ~], D1: [0.5, 0]}
solver: {step: 1e-3, integrator: esdirk43, formulation: alf2, penalty: 1e8, iterations: 5}
"""
SPACE = """
mechanism:
  alf: 1
  space: spatial
  parameters: {L: 1.0}
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [L, 0, 0]}
    B: {at: [2*L, 0, 0]}
    C: {at: [2*L, L, 0]}
    E: {at: [0, 3*L, 0], fixed: true}
  vectors:
    up: {along: [0, 0, 1], fixed: true}
    side: {along: [0, 1, 0]}
  bodies:
    arm: {points: [O, A], vectors: [up, side], mass: 1, inertia: {about_com: [0.1, 0.2, 0.2]}}
    link: {points: [A, B], mass: 1, inertia: rod}
    slider: {points: [C], mass: 1, inertia: {about_com: [0.1, 0.1, 0.1, 0.01, 0, 0]}}
    ball: {points: [E], mass: 1, inertia: {about_com: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}
  joints:
    pin: {type: revolute, between: [ground, arm], at: O, axis: up}
    hinge: {type: universal, between: [arm, link], at: A, axes: [up, side]}
    bar: {type: distance, between: [link, slider], points: [B, C]}
    tube: {type: cylindrical, between: [ground, slider], at: C, axis: [0, 1, 0]}
    socket: {type: spherical, between: [ground, ball], at: E}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  constant_wrench: {on: ball, torque: [0.1, 0, 0], frame: body}
  spring: {between: [link, ground], at: [B, [2, 2, 2]], stiffness: 50}
  torsion_spring: {joint: tube_length, stiffness: 3, damping: 0.1}
  drag: {on: slider, linear: 0.05, spin: 0.1, wind: [3, 0, 0]}
  user_table: {on: arm, at: A, table: [[0, 0, 0, 0], [1, 2, 0, 0]], frame: body}
initial: {velocities: {A: [0, 1, 0]}}
solver: {step: 1e-3, integrator: dop853_adaptive, tolerance: 1e-6}
"""
NUMBER = re.compile(r'[-+]?[0-9(]')
NUMBERS = (
    '0 1 -1 2 0.5 3.7 -0.001 1e-3 1e3 1e-9 1e-20 1e-60 1e-100 1e-320 1e6 1e9 1e15 1e30 1e60 -1e60 '
    '1e99 -1e99 1e100 1e308 1e999'
).split()
FACTORS = '- 2* 1.001* 1e-3* 1e3* 1e-9+ 1e9* 1e-9* 1e40* 1e-40* 0*'.split()
VALUES = (
    '0 1 -1 2 0.5 -0.001 1e-9 1e-100 1e-320 1e9 1e99 -1e99 1e100 1e308 1e999 0x10 1_0 nan .nan '
    'inf -.inf true false yes ~ null [] {} "" [0] [0,0] [1,0,0] [[]] [[0,0],[1,1]] {k:1} <k> L pi '
    '1/0 9**9**9 sqrt(-1) é ∞ 世界 "\\u00e9" name.csv rod point ground world x x.yaml /dev/zero '
    'effect.py alf1 alf2_as_printed canonical penalty baumgarte lagrange_canonical independent '
    'dop853 dop853_adaptive spatial planar revolute prismatic weld slider spherical body cubic'
).split() + ['a' * 300, '{for: {k: [0, 3]}}', '[1, 2, 3, 4, 5]', '{about_com: 1}', '- -', '"a b"']
FLOW = '    '  # indented so far a mapping is on one line
KEYS = 'x é 1 on for at mass length com vectors table joint drives <k> "" [a] ? & *a !!str'.split()


def taken_apart(entry: Entry) -> Any:
    """A mapping as a list of [key, value], a list as a tuple of one list, a scalar as text."""
    if isinstance(entry.value, dict):
        return [[key, taken_apart(value)] for key, value in entry.value.items()]
    if isinstance(entry.value, tuple):
        return ([taken_apart(item) for item in entry.value],)
    return entry.value if entry.plain and entry.value else f'"{entry.value}"'


def written(tree: Any, indent: str = '') -> str:
    """The text of it: a line for each key of the two outer levels."""
    if isinstance(tree, str):
        return tree
    inner = indent + '  '
    if isinstance(tree, tuple):
        return f'[{", ".join(written(item, FLOW) for item in tree[0])}]'
    if len(indent) < len(FLOW) and tree:
        return ''.join(f'\n{indent}{key}: {written(item, inner)}' for key, item in tree)
    pairs = [f'{key}: {written(item, FLOW)}' for key, item in tree]
    return f'{{{", ".join(pairs)}}}'


def _places(tree: Any) -> list[tuple[Any, int]]:
    """Every (list, index) at which something stands, mappings and lists alike."""
    items = tree[0] if isinstance(tree, tuple) else tree
    if isinstance(items, str):
        return []
    found = [(items, i) for i in range(len(items))]
    for item in items:
        found += _places(item[1] if isinstance(tree, list) else item)
    return found


def _is_pair(place: tuple[Any, int]) -> bool:
    return isinstance(place[0][place[1]], list) and len(place[0][place[1]]) == 2


def disturb(tree: Any, random: Random) -> None:
    """Another number somewhere, in place: most such files can still be read."""
    numbers = [place for place in _places(tree) if NUMBER.match(_scalar(place) or '')]
    if not numbers:
        return
    items, i = random.choice(numbers)
    pair = _is_pair((items, i))
    old = items[i][1] if pair else items[i]
    new = random.choice(NUMBERS) if random.randrange(2) else random.choice(FACTORS) + f'({old})'
    items[i] = [items[i][0], new] if pair else new


def change(tree: Any, random: Random) -> None:
    """One mistake of another kind, in place."""
    places = _places(tree)
    if not places:
        return
    items, i = random.choice(places)
    others, j = random.choice(places)
    pair = _is_pair((items, i))
    kind = random.randrange(10)
    if kind == 0:
        del items[i]
    elif kind == 1:
        items.insert(i, items[i])
    elif kind == 2 and pair == _is_pair((others, j)):  # moved, or what it stands in is
        if not _inside(others, items[i]):
            others.insert(j, items.pop(i))
    elif kind == 3 and pair == _is_pair((others, j)):  # another subtree
        if not _inside(items, others[j]):
            items[i] = others[j]
    elif kind == 4 and pair:
        items[i] = [random.choice(KEYS), items[i][1]]
    elif kind == 5 and pair and items[i][0]:
        at = random.randrange(len(items[i][0]))
        items[i] = [items[i][0][:at] + items[i][0][at + 1 :], items[i][1]]
    else:
        value = items[i][1] if pair else items[i]
        if kind in (6, 7):
            scalars = [each for each in map(_scalar, places) if each is not None]
            value = random.choice(scalars or ['x'])
        else:
            value = random.choice(VALUES)
        items[i] = [items[i][0], value] if pair else value


def _scalar(place: tuple[Any, int]) -> str | None:
    value = place[0][place[1]]
    value = value[1] if _is_pair(place) else value
    return value if isinstance(value, str) else None


def _inside(items: Any, tree: Any) -> bool:
    """Whether a list is a part of the tree, which then must not be put into it."""
    return any(each is items for each, _ in _places([tree] if isinstance(tree, list) else tree))


def damaged(text: str, random: Random) -> str:
    """A line cut, doubled, swapped or indented, or a character less."""
    lines = text.split('\n')
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    kind = random.randrange(6)
    if kind == 0:
        del lines[i]
    elif kind == 1:
        lines.insert(j, lines[i])
    elif kind == 2:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 3:
        lines[i] = ' ' + lines[i]
    elif kind == 4:
        lines[i] = lines[i][: random.randrange(len(lines[i]) + 1)]
    else:
        at = random.randrange(len(lines[i]) + 1)
        lines[i] = lines[i][:at] + lines[i][at + 1 :]
    return '\n'.join(lines)


def sources() -> list[str]:
    """The scenes of the library, each one text, and the two above."""
    names = sorted(path.stem for path in (CONFIG / 'scenes').glob('*.yaml'))
    return [*(load_scene(name).text for name in names), *[PLANE, SPACE] * 6]


SOURCES = sources()


@strategies.composite
def mutants(draw: Any) -> str:
    """The text of a scene with one to three mistakes."""
    text = draw(strategies.sampled_from(SOURCES))
    random = draw(strategies.randoms(use_true_random=False))
    tree = taken_apart(yaml_document.parse(text, None))
    for _ in range(random.choice((1, 1, 2, 3))):
        (disturb if random.randrange(3) else change)(tree, random)
    text = written(tree)
    return damaged(text, random) if random.randrange(12) == 0 else text
