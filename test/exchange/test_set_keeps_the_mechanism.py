"""--set chooses the position at which an imported robot starts, and not another mechanism."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import InputError, Simulation, load_scene
from alf_ros.exchange.export import exported
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.thorough import thinned

SET = {'crank_pin': 0.4}  # rad


def lengths(simulation: Simulation) -> dict[tuple[str, str], float]:
    """m, between all points of each body; the ground is one."""
    places = simulation.sample().points
    fixed = [point.name for point in simulation.scene.mechanism.points if point.fixed]
    bodies = [fixed, *(list(body.points) for body in simulation.scene.mechanism.bodies)]
    return {
        (one, other): float(np.linalg.norm(np.subtract(places[one], places[other])))
        for body in bodies
        for one, other in itertools.combinations(body, 2)
    }


def simulation_of(text: str) -> Simulation:
    return Simulation(scene_from_text(text))


def positions_told(text: str) -> dict[str, float]:
    """Of the joints, as the report has them, for --set."""
    line = next(line for line in text.splitlines() if 'zero of joints' in line)
    return {name: float(x) for name, x in re.findall(r'(\w+) at ([-+.\de]+)', line)}


LOOPS = {
    'gazebo': (robots.BY_GAZEBO, ''),
    'gazebo, axis of the model': (
        robots.BY_GAZEBO.replace(
            '<xyz>', '<use_parent_model_frame>1</use_parent_model_frame><xyz>'
        ),
        '',
    ),
    'gazebo, universal': (
        robots.BY_GAZEBO.replace('"revolute"', '"universal"').replace(
            '</axis>', '</axis><axis2><xyz>1 0 0</xyz></axis2>'
        ),
        '',
    ),
    'constraint': (robots.BY_CONSTRAINT, ''),
    'constraint, universal': (
        robots.BY_CONSTRAINT.replace('"revolute"', '"universal"').replace(
            '<child_axis xyz="0 -1 0"/>', '<child_axis xyz="1 0 0"/>'
        ),
        '',
    ),
    'at a place': ('', robots.BY_FILE),
    'loop_closures': (
        '',
        """closures:
- {link_a: coupler, link_b: rocker, point: POINT, axis: [0, -1, 0]}
""",
    ),
}


@pytest.mark.parametrize(
    ('inside', 'beside'),
    thinned(
        [pytest.param(*each, id=name) for name, each in LOOPS.items()],
        keep=lambda inside, beside: (inside, beside) in list(LOOPS.values())[::2],
    ),
)
def test_a_four_bar_keeps_its_lengths(inside: str, beside: str, tmp_path: Path) -> None:
    """With the crank set, and again with all positions of that report."""
    rocker = robots.four_bar_angles()[2]
    x, z = robots.GROUND + robots.ROCKER * math.cos(rocker), robots.ROCKER * math.sin(rocker)
    source = saved(tmp_path, 'it.urdf', robots.four_bar(inside))
    side = (
        saved(tmp_path, 'loops.yaml', beside.replace('POINT', f'[{x}, 0, {z}]'))
        if beside
        else None
    )
    expected = lengths(simulation_of(imported(source, loops=side, scene=True)))
    text = imported(source, loops=side, scene=True, positions=SET)
    assert 'wrist (' in text or 'coupler_rocker (' in text  # Newton's method closed it
    moved = simulation_of(text)
    assert lengths(moved) == pytest.approx(expected, abs=1e-12)
    crank = next(body for body in moved.scene.mechanism.bodies if body.name == 'crank')
    one, other = (moved.sample().points[name] for name in crank.points)
    angle = math.atan2(other[2] - one[2], other[0] - one[0])
    assert angle == pytest.approx(robots.four_bar_angles()[0] + 0.4, abs=1e-12)
    told = positions_told(text)
    assert set(told) == {'crank_pin', 'knee', 'rocker_pin'}
    again = simulation_of(imported(source, loops=side, scene=True, positions=told))
    assert again.sample().points.keys() == moved.sample().points.keys()
    for name, place in again.sample().points.items():
        np.testing.assert_allclose(place, moved.sample().points[name], rtol=0.0, atol=1e-11)


def test_the_initial_value_of_ros2_control_moves_no_bolt(tmp_path: Path) -> None:
    control = (
        '<ros2_control><joint name="crank_pin"><state_interface name="position">'
        '<param name="initial_value">0.4</param></state_interface></joint></ros2_control>'
    )
    plain = saved(tmp_path, 'it.urdf', robots.four_bar(robots.BY_GAZEBO))
    source = saved(tmp_path, 'moved.urdf', robots.four_bar(robots.BY_GAZEBO, control))
    expected = lengths(simulation_of(imported(plain, scene=True)))
    text = imported(source, scene=True)
    assert lengths(simulation_of(text)) == pytest.approx(expected, abs=1e-12)


def test_positions_of_a_side_file_make_way_for_those_that_are_set(tmp_path: Path) -> None:
    """A file that places all joints, as `export` writes it; they are one bolt and one start."""
    source = saved(tmp_path, 'it.urdf', robots.four_bar())
    drawn = 'positions: {crank_pin: 0, knee: 0, rocker_pin: 0}\n'
    side = saved(tmp_path, 'loops.yaml', drawn + robots.BY_FILE)
    expected = lengths(simulation_of(imported(source, loops=side, scene=True)))
    text = imported(source, loops=side, scene=True, positions=SET)
    assert positions_told(text)['crank_pin'] == 0.4
    assert lengths(simulation_of(text)) == pytest.approx(expected, abs=1e-12)
    everything = SET | {'knee': 0.0, 'rocker_pin': 0.0}
    with pytest.raises(InputError, match='wrist cannot be closed: all joints are held') as caught:
        imported(source, loops=side, positions=everything)
    assert 'is not in --set, nor in `positions` of a side file' in str(caught.value)


SLIDES = {
    'prismatic': 'block_rail: {type: prismatic, between: [base, block], at: [0.4, 0, 0], '
    'axis: [1, 0, 0]}',
    'cylindrical': 'block_rail: {type: cylindrical, between: [base, block], at: [0.4, 0, 0], '
    'axis: [1, 0, 0]}',
    'planar': 'block_rail: {type: planar, between: [base, block], at: [0.4, 0, 0], '
    'axis: [0, 0, 1]}',
}
CONSTRAINT = """<constraint name="block_rail" type="prismatic">
 <parent link="base"/><parent_origin xyz="{x} 0 0" rpy="0.3 0 0"/><parent_axis xyz="1 0 0"/>
 <child link="block"/><child_origin xyz="0 0 0"/><child_axis xyz="{sign}1 0 0"/></constraint>"""


@pytest.mark.parametrize('kind', [*SLIDES, 'constraint', 'constraint, turned round'])
def test_a_slider_stays_on_its_rail(kind: str, tmp_path: Path) -> None:
    """A slider crank along x, drawn straight: the slide is the loop."""
    inside, side = '', None
    if kind in SLIDES:
        side = saved(tmp_path, 'loops.yaml', f'loops: {{{SLIDES[kind]}}}')
    else:
        inside = CONSTRAINT.format(x=0.1, sign='-' if 'round' in kind else '')
    urdf = robots.robot(
        '<link name="base"/>',
        robots.rod('crank', 0.1, 1.0),
        robots.rod('rod', 0.3, 1.0),
        robots.link('block', (0.0, 0.0, 0.0), 1.0, (0.01, 0.01, 0.01, 0.0, 0.0, 0.0)),
        robots.hinge('crank_pin', 'base', 'crank', 0.0, 0.0),
        robots.hinge('knee', 'crank', 'rod', 0.1, 0.0),
        robots.hinge('wrist', 'rod', 'block', 0.3, 0.0),
        inside,
    )
    source = saved(tmp_path, 'it.urdf', urdf)
    assert 'wrist' not in positions_told_or_none(imported(source, loops=side))
    text = imported(source, loops=side, scene=True, positions=SET)
    told = positions_told(text)
    across = math.asin(0.1 * math.sin(0.4) / 0.3)
    assert told['knee'] == pytest.approx(-0.4 - across, abs=1e-9)
    assert told['wrist'] == pytest.approx(across, abs=1e-9)
    moved = simulation_of(text)
    place = moved.sample().points['wrist_at']
    expected = [0.1 * math.cos(0.4) + 0.3 * math.cos(across), 0.0, 0.0]
    np.testing.assert_allclose(place, expected, atol=1e-9)
    assert moved.sample().diagnostics.position_violation < 1e-9
    moved.step(50)
    assert moved.sample().points['wrist_at'][2] == pytest.approx(0.0, abs=1e-9)


def positions_told_or_none(text: str) -> dict[str, float]:
    return positions_told(text) if 'zero of joints' in text else {}


@pytest.mark.parametrize(('name', 'joint'), [('delta_robot', 'motor0'), ('bricard', 'j0')])
def test_an_exported_mechanism_starts_elsewhere(name: str, joint: str, tmp_path: Path) -> None:
    """Loops through links on `floating` joints, and a loop whose joints all have positions."""
    urdf, side, _ = exported(load_scene(name))
    source, loops = saved(tmp_path, 'it.urdf', urdf), saved(tmp_path, 'loops.yaml', side)
    drawn = simulation_of(imported(source, loops=loops, scene=True))
    text = imported(source, loops=loops, scene=True, positions={joint: 0.1})
    assert positions_told(text)[joint] == 0.1
    moved = simulation_of(text)
    assert lengths(moved) == pytest.approx(lengths(drawn), abs=1e-9)
    assert moved.sample().diagnostics.position_violation < 1e-9


def test_a_planar_joint_follows(tmp_path: Path) -> None:
    """A block in the x-z plane, pinned to a crank at a place beside its origin."""
    side = (
        'loops: {pin: {type: revolute, between: [crank, block], at: [0.1, 0, 0], axis: [0, 1, 0]}}'
    )
    block = robots.link('block', (0.0, 0.0, 0.0), 1.0, (0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
    eyes = (
        '<link name="{0}_eye"/><joint name="{0}_end" type="fixed"><parent link="{0}"/>'
        '<child link="{0}_eye"/><origin xyz="{1} 0 {2}"/></joint>'
    )
    urdf = robots.robot(
        '<link name="base"/>',
        robots.rod('crank', 0.1, 1.0),
        block,
        robots.hinge('crank_pin', 'base', 'crank', 0.0, 0.0),
        '<joint name="plane" type="planar"><parent link="base"/><child link="block"/>'
        '<origin xyz="0.3 0 0.1"/><axis xyz="0 1 0"/></joint>',
        eyes.format('crank', 0.1, 0),
        eyes.format('block', -0.2, -0.1),
    )
    source, loops = saved(tmp_path, 'it.urdf', urdf), saved(tmp_path, 'loops.yaml', side)
    expected = lengths(simulation_of(imported(source, loops=loops, scene=True)))
    text = imported(source, loops=loops, scene=True, positions=SET)
    moved = simulation_of(text)
    assert lengths(moved) == pytest.approx(expected, abs=1e-9)
    assert moved.sample().diagnostics.position_violation < 1e-9
