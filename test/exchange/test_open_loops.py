"""Loops of a URDF whose ends are apart as drawn: three formats of side files, and triangles."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError, Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.urdf_with_loops import side_file
from alf_ros.scene.scene import scene_from_text

FIRST, SECOND, GROUND_BAR, ROD = 0.2, 0.2, 0.25, 0.3  # m


def link(name: str, length: float) -> str:
    mass, J = 1.0, length**2 / 12.0
    return (
        f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="1e-3" iyy="{J + 1e-3}" izz="{J + 1e-3}" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link>'
    )


def joint(name: str, parent: str, child: str, x: float, more: str = '', kind: str = '') -> str:
    return (
        f'<joint name="{name}" type="{kind or "continuous"}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>{more}</joint>'
    )


def five_bar(elbow: str = '', mimic: str = '') -> str:
    """Two arms on the ground, all along x as drawn; the tips of their rods are frames."""
    kind = 'revolute' if elbow else 'continuous'
    return (
        '<robot name="five_bar"><link name="base"/>'
        + link('a', FIRST)
        + link('b', ROD)
        + link('c', SECOND)
        + link('d', ROD)
        + '<link name="tip_b"/><link name="tip_d"/>'
        + joint('mot1', 'base', 'a', 0.0)
        + joint('e1', 'a', 'b', FIRST, elbow, kind)
        + joint('mot2', 'base', 'c', GROUND_BAR)
        + joint('e2', 'c', 'd', SECOND, mimic)
        + joint('f1', 'b', 'tip_b', ROD, kind='fixed')
        + joint('f2', 'd', 'tip_d', ROD, kind='fixed')
        + '</robot>'
    )


def written(folder: Path, urdf: str, side: str) -> tuple[str, str]:
    """The paths of a URDF and its side file."""
    paths = folder / 'robot.urdf', folder / 'robot.yaml'
    for path, text in zip(paths, (urdf, side), strict=True):
        path.write_text(text, 'utf-8')
    return str(paths[0]), str(paths[1])


GEPETTO = "closed_loop: [['tip_b', 'tip_d']]\ntype: ['3d']\nname_mot: ['mot1', 'mot2']\n"
OWN = 'loops: {tip: {type: revolute, between: [tip_b, tip_d], axis: [0, 0, 1]}}\n'
ELBOW = '<limit lower="-3" upper="0" effort="1" velocity="1"/>'


def tip(m1: float, m2: float) -> Floats:
    """Where both rods meet, on the side on which the first elbow turns clockwise."""
    A = FIRST * np.array([math.cos(m1), math.sin(m1)])
    C = np.array([GROUND_BAR, 0.0]) + SECOND * np.array([math.cos(m2), math.sin(m2)])
    half, between = 0.5 * (A + C), C - A
    size = float(np.linalg.norm(between))
    rise = math.sqrt(ROD**2 - 0.25 * size**2)
    return np.asarray(half + rise / size * np.array([-between[1], between[0]]))


@pytest.mark.parametrize('side', [GEPETTO, OWN], ids=['gepetto', 'own'])
def test_newton_closes_a_five_bar_within_the_limits(tmp_path: Path, side: str) -> None:
    """The motors stay where they are set; the elbows follow, the first one below zero."""
    urdf, loops = written(tmp_path, five_bar(ELBOW), side)
    text = imported(urdf, loops=loops, positions={'mot1': 1.9, 'mot2': 1.1})
    assert 'posture' in text
    scene = scene_from_text('mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n')))
    simulation = Simulation(scene)
    sample = simulation.sample()
    points = [name for name in sample.points if name.startswith('tip')]
    np.testing.assert_allclose(sample.points[points[0]][:2], tip(1.9, 1.1), atol=1e-12)
    assert sample.diagnostics.position_violation < 1e-12
    assert simulation.model.n - sample.diagnostics.rank == 2


def tips(x: Floats) -> Floats:
    """(2,) m from one tip to the other, of mot1, e1, mot2, e2."""
    turned = [np.array([math.cos(angle), math.sin(angle)]) for angle in x + [0, x[0], 0, x[2]]]
    one = FIRST * turned[0] + ROD * turned[1]
    return np.asarray(one - SECOND * turned[2] - ROD * turned[3] - [GROUND_BAR, 0.0])


def test_the_posture_is_the_nearest_that_the_loop_allows(tmp_path: Path) -> None:
    """Stretched arms close from a random start only. What this start turned without need is turned
    back: along the free motion of the loop the posture comes no nearer to the drawing, and a
    joint that does not move the loop stays where it is drawn."""
    swivel = (
        link('hub', 0.01)
        + joint('swivel', 'b', 'hub', ROD)
        + joint('f1', 'hub', 'tip_b', 0.0, kind='fixed')
    )
    fixed = joint('f1', 'b', 'tip_b', ROD, kind='fixed')
    assert fixed in five_bar()
    urdf, loops = written(tmp_path, five_bar().replace(fixed, swivel), GEPETTO)
    text = imported(urdf, loops=loops, scene=True)
    (line,) = (line for line in text.splitlines() if line.startswith('#   zero of joints: '))
    at = {name: float(x) for name, x in re.findall(r'(\w+) at (-?[\d.e-]+)', line)}
    x = np.array([at[name] for name in ('mot1', 'e1', 'mot2', 'e2')])
    assert np.abs(tips(x)).max() < 1e-9
    slope = np.array([(tips(x + 1e-6 * e) - tips(x - 1e-6 * e)) / 2e-6 for e in np.eye(4)]).T
    free = np.linalg.svd(slope)[2][2:]
    assert np.abs(free @ x).max() < 1e-6
    assert abs(at.get('swivel', 0.0)) < 1e-9


def test_motors_of_the_side_file_are_imported(tmp_path: Path) -> None:
    urdf, loops = written(tmp_path, five_bar(), GEPETTO)
    scene = scene_from_text(imported(urdf, loops=loops, scene=True))
    motors = [effect for effect in scene.effects if 'motor' in str(effect)]
    assert len(motors) == 2


def test_loops_that_do_not_reach_are_refused(tmp_path: Path) -> None:
    urdf, loops = written(tmp_path, five_bar(), GEPETTO)
    with pytest.raises(InputError) as caught:
        imported(urdf, loops=loops, positions={'mot1': math.pi, 'mot2': 0.0, 'e1': 0.0})
    assert 'tip_b_tip_d cannot be closed: 0.65 m stay open' in str(caught.value)
    assert '--set JOINT=NUMBER' in str(caught.value)


def test_hinges_of_scikit_robot_replace_mimics(tmp_path: Path) -> None:
    """A parallelogram, closed at zero; its <mimic> says the same as the loop."""
    side = (
        'closures:\n'
        '- {link_a: b, link_b: c, point: [0.2, 0.3, 0.0], axis: [0.0, 0.0, 1.0]}\n'
        'dependent: [e1, mot2]\nindependent: [mot1]\n'
    )
    urdf = (
        '<robot name="parallelogram"><link name="base"/>'
        + link('a', 0.2)
        + link('b', 0.3)
        + link('c', 0.2)
        + '<joint name="up" type="fixed"><parent link="base"/><child link="stand"/>'
        + '<origin xyz="0 0.3 0" rpy="0 0 0"/></joint><link name="stand"/>'
        + joint('mot1', 'base', 'a', 0.0)
        + joint('e1', 'a', 'b', 0.2, '<mimic joint="mot1" multiplier="-1"/>')
        + joint('mot2', 'stand', 'c', 0.0, '<mimic joint="mot1"/>')
        + '</robot>'
    )
    paths = written(tmp_path, urdf, side)
    text = imported(paths[0], loops=paths[1], positions={'mot1': 0.4})
    assert 'mimic that loops imply' in text
    assert 'couplings' not in text
    scene = scene_from_text('mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n')))
    sample = Simulation(scene).sample()
    place = sample.points[next(name for name in sample.points if name.startswith('b_c'))]
    np.testing.assert_allclose(
        place, [0.2 * math.cos(0.4), 0.3 + 0.2 * math.sin(0.4), 0.0], atol=1e-12
    )


@pytest.mark.parametrize('kind', ['SPHERICAL', 'UJOINT_XY', 'FIXED'])
def test_joints_of_another_type(tmp_path: Path, kind: str) -> None:
    """A rod on a ball or on a cross, or fixed to its arm; three hinges stay."""
    side = f'closed_loop: []\njoint_name: [e1]\njoint_type: [{kind}]\n'
    urdf, loops = written(tmp_path, five_bar(), side)
    text = imported(urdf, loops=loops)
    assert ('e1: {type: spherical' in text) == (kind == 'SPHERICAL')
    assert ('e1_X' in text and 'e1_Y' in text) == (kind == 'UJOINT_XY')
    freedoms = {'SPHERICAL': 3 + 3, 'UJOINT_XY': 3 + 2, 'FIXED': 3}[kind]
    scene = scene_from_text('mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n')))
    simulation = Simulation(scene)
    assert simulation.model.n - simulation.sample().diagnostics.rank == freedoms


def test_losses_of_joints_of_another_type_are_listed(tmp_path: Path) -> None:
    """A hinge that becomes a ball or a cross has lost its damping without a word."""
    damped = five_bar().replace('</joint>', '<dynamics damping="0.1"/></joint>')
    for kind, listed in (('SPHERICAL', True), ('UJOINT_XY', True), ('FIXED', False)):
        side = f'closed_loop: []\njoint_name: [e1]\njoint_type: [{kind}]\n'
        for source in (damped, damped.replace('damping="0.1"', 'damping="0"')):
            urdf, loops = written(tmp_path, source, side)
            told = 'springs, armature: these joints have none: e1'
            text = imported(urdf, loops=loops, scene=True)
            assert (told in text) == (listed and source is damped)


REFUSED = {
    "type: ['5d']": "type[0]: unknown name, got '5d'",
    'joint_name: [e1]': 'without joint_type',
    'joint_name: [elbow]\njoint_type: [FIXED]': "names a joint that it lacks, got 'elbow'",
    'name_mot: [motor]': "unknown name, got 'motor'",
}


@pytest.mark.parametrize(('line', 'message'), REFUSED.items(), ids=list(REFUSED.values()))
def test_wrong_side_files_are_refused(tmp_path: Path, line: str, message: str) -> None:
    kept = [each for each in GEPETTO.splitlines() if each.split(':')[0] not in line]
    urdf, loops = written(tmp_path, five_bar(), '\n'.join([*kept, line, '']))
    with pytest.raises(InputError) as caught:
        imported(urdf, loops=loops)
    assert message in str(caught.value)


def test_the_file_beside_a_urdf_is_found(tmp_path: Path) -> None:
    """By its name and keys; a file of another kind is not one."""
    urdf, loops = (Path(path) for path in written(tmp_path, five_bar(), GEPETTO))
    assert side_file(urdf) == loops
    told = 'loops (see --loops): they are open: the file that closes them is not given: robot.yaml'
    assert f'#   {told}' in imported(str(urdf)).splitlines()
    assert 'they are open' not in imported(str(urdf), loops=str(loops))
    loops.write_text('[1, 2', 'utf-8')
    assert side_file(urdf) is None
    beside = tmp_path / 'loop_closures.yaml'
    beside.write_text('closures: []\n', 'utf-8')
    assert side_file(urdf) == beside


# two elbows, one of which mimics the other: -1 times it, on the other side of the symmetric robot
MIRRORED = """<robot name="tongs"><link name="base"/>{bars}{joints}</robot>"""


def tongs(limits: str, multiplier: float = -1.0, offset: float = 0.0, own: str = '') -> str:
    """A symmetric five-bar of which the second motor mimics the first; its slide follows."""
    mimic = f'<mimic joint="mot1" multiplier="{multiplier}" offset="{offset}"/>'
    one = 'revolute' if own else 'continuous'
    bars = link('a', FIRST) + link('b', ROD) + link('c', FIRST) + link('d', ROD)
    joints = (
        joint('mot1', 'base', 'a', -0.1, own, one)
        + joint('e1', 'a', 'b', FIRST)
        + joint('mot2', 'base', 'c', 0.1, mimic + limits, 'revolute')
        + joint('e2', 'c', 'd', FIRST)
        + '<link name="tip_b"/><link name="tip_d"/>'
        + joint('f1', 'b', 'tip_b', ROD, kind='fixed')
        + joint('f2', 'd', 'tip_d', ROD, kind='fixed')
    )
    return MIRRORED.format(bars=bars, joints=joints)


def limit(lower: float, upper: float) -> str:
    return f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'


def closed_at(folder: Path, urdf: str, **positions: float) -> tuple[dict[str, float], str]:
    """Positions (rad) of the joints where the tips meet, and the report."""
    path, loops = written(folder, urdf, OWN)
    text = imported(path, loops=loops, positions=positions)
    line = next(line for line in text.splitlines() if 'zero of joints' in line)
    words = (each.rsplit(' at ', 1) for each in line.split('drawn: ')[1].split(', '))
    return {name: float(x) for name, x in words}, text


@pytest.mark.parametrize(
    ('lower', 'upper', 'offset'),
    [(-2.5, -1.2, 0.0), (0.6, 1.1, 0.0), (-1.5, -1.0, 0.4), (2.0, 2.6, math.pi)],
)
def test_a_joint_that_mimics_stays_within_its_limits(
    tmp_path: Path, lower: float, upper: float, offset: float
) -> None:
    """The other one has none, and would close the loop elsewhere."""
    found, text = closed_at(tmp_path, tongs(limit(lower, upper), offset=offset))
    assert lower <= found['mot2'] <= upper
    assert found['mot2'] == pytest.approx(offset - found.get('mot1', 0.0), abs=1e-11)
    ends = []
    for x, one, other in ((-0.1, 'mot1', 'e1'), (0.1, 'mot2', 'e2')):
        first = found.get(one, 0.0)
        second = first + found.get(other, 0.0)
        reach = (FIRST * math.cos(first) + ROD * math.cos(second), FIRST * math.sin(first))
        ends.append((x + reach[0], reach[1] + ROD * math.sin(second)))
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)
    assert 'limits of mimics' not in text


def test_limits_of_mimics_that_leave_no_room_are_listed(tmp_path: Path) -> None:
    """Both from 0.2 to 1, though one is minus the other."""
    both = limit(0.2, 1.0)
    found, text = closed_at(tmp_path, tongs(both, own=both))
    assert 0.2 <= found['mot1'] <= 1.0
    assert (
        '#   limits of mimics: they contradict those of the joints that are mimicked: loops were '
        'closed beyond them: mot2 of mot1\n' in text
    )
