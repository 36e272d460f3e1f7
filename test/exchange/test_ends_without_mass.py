"""Ends of imported robots that move no mass: they are left out, fixed, or named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import Simulation
from alf_ros.errors import AssemblyError, InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved, simulate


def told(text: str, kind: str) -> str:
    """The line of the report about a kind of loss; '' if there is none."""
    return next((line for line in text.splitlines() if line.startswith(f'#   {kind}: ')), '')


def mimic(name: str, parent: str, child: str, of: str) -> str:
    plain = robots.hinge(name, parent, child, 0.1, 0.0)
    return plain.replace('</joint>', f'<mimic joint="{of}" multiplier="0.5"/></joint>')


def arm(*more: str) -> str:
    return robots.robot(
        '<link name="base"/>',
        robots.rod('arm', 1.0, 1.0),
        robots.hinge('shoulder', 'base', 'arm', 0.0, 0.0),
        *more,
    )


def swing(text: str) -> float:
    """rad, of the shoulder after 0.2 s."""
    simulation = simulate(text)
    simulation.step(200)
    return simulation.sample().joints['shoulder'].position


def test_fingers_without_mass_are_left_out_with_their_couplings(tmp_path: Path) -> None:
    """One finger drives the others, and none has mass: the arm swings as without them."""
    fingers = arm(
        '<link name="one"/><link name="two"/><link name="three"/>',
        robots.hinge('drive', 'arm', 'one', 1.0, 0.0),
        mimic('second', 'one', 'two', 'drive'),
        mimic('third', 'arm', 'three', 'second'),
    )
    text = imported(saved(tmp_path, 'it.urdf', fingers), scene=True)
    assert told(text, 'joints of massless ends').endswith(': second, third, drive')
    assert 'couplings' not in text and not told(text, 'mass: there is none')
    assert swing(text) == pytest.approx(
        swing(imported(saved(tmp_path, 'arm.urdf', arm()), scene=True)), abs=1e-12
    )


def test_a_link_without_mass_that_mimics_a_heavy_one_stays(tmp_path: Path) -> None:
    """Also over another one without mass: both follow the shoulder."""
    following = arm(
        '<link name="one"/><link name="two"/>',
        mimic('first', 'arm', 'one', 'shoulder'),
        mimic('second', 'arm', 'two', 'first'),
    )
    text = imported(saved(tmp_path, 'it.urdf', following), scene=True)
    assert not told(text, 'joints of massless ends')
    simulation = simulate(text)
    simulation.step(100)
    joints = simulation.sample().joints
    assert abs(joints['shoulder'].position) > 0.02
    assert joints['second'].position == pytest.approx(joints['shoulder'].position / 4, abs=1e-9)


def test_a_point_mass_on_its_axis_is_fixed(tmp_path: Path) -> None:
    """Its angle moves no mass; the arm swings as with the mass on it. Two in a row become one."""
    nothing = (0.0,) * 6
    head = (
        robots.link('neck', (0.0, 0.0, 0.0), 0.2, nothing),
        robots.link('head', (0.0, 0.0, 0.0), 0.3, nothing),
    )
    turns = arm(
        *head,
        robots.hinge('roll', 'arm', 'neck', 1.0, 0.0),
        robots.hinge('yaw', 'neck', 'head', 0.0, 0.0).replace('0 -1 0', '0 0 1'),
        '<transmission name="t"><joint name="yaw"/></transmission>',
    )
    text = imported(saved(tmp_path, 'it.urdf', turns), scene=True)
    line = told(text, 'joints without inertia')
    assert 'fixed as drawn' in line and line.endswith(': yaw, roll')
    assert 'motor:' not in text
    welded = turns.replace('type="continuous"', 'type="fixed"').replace(
        'name="shoulder" type="fixed"', 'name="shoulder" type="continuous"'
    )
    expected = swing(imported(saved(tmp_path, 'welded.urdf', welded), scene=True))
    assert swing(text) == pytest.approx(expected, abs=1e-12)
    offset = turns.replace(head[1], robots.link('head', (0.1, 0.0, 0.0), 0.3, nothing))
    kept = imported(saved(tmp_path, 'kept.urdf', offset), scene=True)
    assert not told(kept, 'joints without inertia')  # yaw moves the mass of the head


def test_a_robot_that_moves_no_mass_is_refused(tmp_path: Path) -> None:
    wheel = robots.robot(
        '<link name="base"/>',
        robots.link('wheel', (0.0, 0.0, 0.0), 1.0, (0.0,) * 6),
        robots.hinge('axle', 'base', 'wheel', 0.0, 0.0),
    )
    with pytest.raises(InputError, match='can move: joints axle move no mass; expected mass'):
        imported(saved(tmp_path, 'it.urdf', wheel))


def neck() -> str:
    """A point mass at the end of three axes that meet: it moves on a sphere, and its turn about
    the line to the centre moves no mass."""
    ends = [robots.link(name, (0.0,) * 3, 0.1, (0.0,) * 6) for name in ('a', 'b')]
    return robots.robot(
        '<link name="base"/>',
        *ends,
        robots.link('head', (0.1, 0.0, 0.2), 1.0, (0.0,) * 6),
        robots.hinge('pitch', 'base', 'a', 0.0, 0.0),
        robots.hinge('roll', 'a', 'b', 0.0, 0.0).replace('0 -1 0', '1 0 0'),
        robots.hinge('yaw', 'b', 'head', 0.0, 0.0).replace('0 -1 0', '0 0 1'),
    )


def test_what_no_inertia_holds_is_named(tmp_path: Path) -> None:
    """By the report of the import, and where the run stops."""
    text = imported(saved(tmp_path, 'it.urdf', neck()), scene=True)
    line = told(text, 'no mass in a free direction')
    assert 'a run stops: give these bodies mass and inertia' in line
    assert line.endswith(': b, head (joints roll, yaw)')
    assert told(text, 'inertia: there is none').endswith(': a, b, head')
    with pytest.raises(AssemblyError) as caught:
        Simulation(scene_from_text(text))
    message = str(caught.value)
    assert 'neither mass nor constraint: bodies b, head, joints roll, yaw' in message
    assert 'expected mass and inertia of these bodies, a weld in place of one of the' in message
    assert 'or a rotor on one (`armature` of a motor)' in message


@pytest.mark.parametrize('moment', [1e-12, 1e-11])
def test_inertia_that_rounding_hides_is_named_too(moment: float, tmp_path: Path) -> None:
    """A run does not start with so little, although it is not zero: the report, the reason at the
    solver and the error name the same bodies and joints."""
    point = robots.link('head', (0.1, 0.0, 0.2), 1.0, (0.0,) * 6)
    light = robots.link('head', (0.1, 0.0, 0.2), 1.0, (moment,) * 3 + (0.0,) * 3)
    text = imported(saved(tmp_path, 'it.urdf', neck().replace(point, light)), scene=True)
    assert told(text, 'no mass in a free direction').endswith(': b, head (joints roll, yaw)')
    named = 'hardly any mass and no constraint: bodies b, head, joints roll, yaw'
    assert named in ' '.join(text.replace('\n#', '').split())
    with pytest.raises(AssemblyError, match=named):
        Simulation(scene_from_text(text))


def test_light_parts_that_run_are_not_listed(tmp_path: Path) -> None:
    point = robots.link('head', (0.1, 0.0, 0.2), 1.0, (0.0,) * 6)
    light = robots.link('head', (0.1, 0.0, 0.2), 1.0, (1e-9,) * 3 + (0.0,) * 3)
    text = imported(saved(tmp_path, 'it.urdf', neck().replace(point, light)), scene=True)
    assert not told(text, 'no mass in a free direction')
    simulation = Simulation(scene_from_text(text))
    simulation.step(5)
    assert simulation.sample().diagnostics.position_violation < 1e-12


@pytest.mark.parametrize('joint', ['roll', 'yaw'])
@pytest.mark.parametrize('cure', ['inertia', 'fixed', 'rotor'])
def test_each_cure_that_the_message_names_lets_it_run(
    cure: str, joint: str, tmp_path: Path
) -> None:
    source = neck()
    if cure == 'fixed':
        one = f'<joint name="{joint}" type="continuous">'
        assert one in source
        source = source.replace(one, f'<joint name="{joint}" type="fixed">')
    elif cure == 'inertia':
        head = robots.link('head', (0.1, 0.0, 0.2), 1.0, (0.0,) * 6)
        ball = robots.link('head', (0.1, 0.0, 0.2), 1.0, (1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0))
        source = source.replace(head, ball)
    text = imported(saved(tmp_path, 'it.urdf', source), scene=True)
    if cure == 'rotor':
        motor = f'effects:\n  motor: {{rotor: {{joint: {joint}, armature: 1e-3}}}}\n'
        text = text.replace('effects:\n', motor)
    else:
        assert not told(text, 'no mass in a free direction')
    simulation = Simulation(scene_from_text(text))
    simulation.step(50)
    assert simulation.sample().diagnostics.position_violation < 1e-12


def test_rows_for_balls_are_not_listed_as_links_without_mass(tmp_path: Path) -> None:
    ball = arm(
        '<link name="one"/><link name="two"/>',
        robots.link('bob', (0.1, 0.0, -0.5), 1.0, (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)),
        robots.hinge('x', 'arm', 'one', 1.0, 0.0).replace('0 -1 0', '1 0 0'),
        robots.hinge('y', 'one', 'two', 0.0, 0.0),
        robots.hinge('z', 'two', 'bob', 0.0, 0.0).replace('0 -1 0', '0 0 1'),
    )
    path = saved(tmp_path, 'it.urdf', ball)
    kept = imported(path, balls=False)
    assert told(kept, 'mass: there is none').endswith(': one, two')
    _, readings = kept.split('Changes of readings only')  # as in the file: the motion is the same
    assert told(readings, 'mass: there is none')
    text = imported(path)
    assert told(text, 'rows of joints that are balls') and not told(text, 'mass: there is none')
    assert np.isfinite(swing(imported(path, scene=True)))


@pytest.mark.parametrize(
    ('floating', 'message'), [(True, 'no part that can move has mass'), (False, 'no part of it')]
)
def test_a_robot_without_any_mass_is_refused(floating: bool, message: str, tmp_path: Path) -> None:
    """Of two hinges in a row its bodies at both ends go first."""
    source = '<robot name="r"><link name="base"/><link name="arm"/><link name="hand"/>'
    for name, parent, child in (('pin', 'base', 'arm'), ('wrist', 'arm', 'hand')):
        source += robots.hinge(name, parent, child, 0.1, 0.0)
    source += '</robot>'
    path = saved(tmp_path, 'it.urdf', source)
    with pytest.raises(InputError, match=f'{message}.*; expected mass and inertia of'):
        imported(path, floating=floating)
