"""Loops that repeat another one at its place: redundant constraints, and the same motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros.exchange.import_file import imported
from support.imported_motions import check_four_bar, saved, simulate
from support.thorough import combined, thinned

CONNECT = '<connect name="wrist" body1="coupler" body2="rocker" anchor="0.3 0 0"/>'
AXES = {
    'revolute': 'axis: [0, -1, 0]',
    'spherical': '',
    'weld': '',
    'universal': 'axes: [[0, 1, 0], [1, 0, 0]]',
    'cylindrical': 'axis: [0, -1, 0]',
    'prismatic': 'axis: [1, 0, 0]',
}


def again(text: str) -> str:
    return text + text.replace('wrist', 'wrist_again')


@pytest.mark.parametrize(
    ('kind', 'positions'),
    combined(
        ['gazebo', 'constraint', 'mjcf'],
        [pytest.param({}, id='drawn'), pytest.param({'crank_pin': 0.0}, id='set')],
    ),
)
def test_a_four_bar_that_is_closed_twice(
    kind: str, positions: dict[str, float], tmp_path: Path
) -> None:
    if kind == 'mjcf':
        source = saved(tmp_path, 'it.xml', robots.four_bar_mjcf().replace(CONNECT, again(CONNECT)))
    else:
        closed_by = robots.BY_GAZEBO if kind == 'gazebo' else robots.BY_CONSTRAINT
        source = saved(tmp_path, 'it.urdf', robots.four_bar(again(closed_by)))
    check_four_bar(imported(source, scene=True, positions=positions))


@pytest.mark.parametrize('kind', thinned(AXES, keep=['revolute', 'cylindrical', 'weld']))
def test_each_type_may_be_repeated(kind: str, tmp_path: Path) -> None:
    """The bars move as with one loop, and the shares of the load are flagged as indeterminate."""
    source = saved(tmp_path, 'it.urdf', robots.four_bar())
    fields = f'{{type: {kind}, between: [coupler, rocker], at: [0.3, 0, 0], {AXES[kind]}}}'
    found = []
    for count in (1, 3):
        loops = ''.join(f'  wrist{n}: {fields}\n' for n in range(count))
        side = saved(tmp_path, 'loops.yaml', f'loops:\n{loops}')
        simulation = simulate(imported(source, loops=side, scene=True))
        simulation.step(100)
        sample = simulation.sample()
        assert sample.diagnostics.position_violation < 1e-12
        found.append(sample)
    for name in ('knee_at', 'rocker_pin_at', 'wrist0_at'):
        one, three = (sample.points[name] for sample in found)
        np.testing.assert_allclose(three, one, rtol=0.0, atol=1e-10)
    assert all(found[1].reactions[f'wrist{n}'].indeterminate for n in range(3))


PIN = '<joint name="{}" type="{}"><parent>{}</parent><child>{}</child>{}</joint>'
ROD = """<link name="{0}"><pose>0 0 0 0 0.3 0</pose><inertial><pose>0.2 0 0.1 0 0 0</pose>
<mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.15</izz></inertia></inertial></link>
<link name="bob_{0}"><pose relative_to="{0}">0.4 0 0 0 0 0</pose></link>
<joint name="tip_{0}" type="ball"><parent>{0}</parent><child>bob_{0}</child></joint>"""


@pytest.mark.parametrize('axis', ['', '<axis><xyz>0 1 0.2</xyz></axis>'], ids=['balls', 'pins'])
def test_a_circle_of_joints_at_one_place(axis: str, tmp_path: Path) -> None:
    """Three rods on one pin, joined in pairs: two joints say all, the third repeats them."""
    kind = 'revolute' if axis else 'ball'
    pairs = (('world', 'a'), ('a', 'b'), ('b', 'c'), ('a', 'c'))
    ends = []
    for joints in (pairs[:3], pairs):
        text = ''.join(
            PIN.format(f'{one}_{other}', kind, one, other, axis) for one, other in joints
        )
        rods = ''.join(ROD.format(name) for name in 'abc')
        source = f'<sdf version="1.9"><model name="m">{rods}{text}</model></sdf>'
        simulation = simulate(imported(saved(tmp_path, 'it.sdf', source), scene=True))
        simulation.step(100)
        sample = simulation.sample()
        assert sample.diagnostics.position_violation < 1e-12
        ends.append([sample.points[f'tip_{name}_at'] for name in 'abc'])
        if joints is pairs:
            assert sample.reactions['a_c'].indeterminate
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-10)


def test_a_length_on_the_ground_is_no_gap_that_vanishes() -> None:
    """A distance between the pin of a rod and another point of the ground: constant, not zero."""
    scene = """mechanism:
  alf: 1
  name: rod
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, Q: {at: [0, 0.5, 0], fixed: true}, B: {at: [1, 0, 0]}}
  bodies:
    rod: {points: [O, B], mass: 1, com: [0.5, 0, 0], inertia: {about_com: [1, 1, 1, 0, 0, 0]}}
  joints:
    pin: {type: revolute, between: [ground, rod], at: O, axis: [0, 1, 0]}
    far: {type: distance, between: [ground, rod], points: [Q, O], length: 0.5}
effects: {gravity: {acceleration: [0, 0, -9.81]}}
"""
    simulation = simulate(scene)
    simulation.step(1)
    speed = simulation.sample().joints['pin'].velocity
    assert speed == pytest.approx(1e-3 * 9.81 * 0.5 / 1.25, rel=1e-5)
