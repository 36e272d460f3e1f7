"""URDF out: links move as the bodies do; and back in: the same mechanism moves the same."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Sample, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.commands.export import main
from alf_ros.errors import InputError
from alf_ros.exchange.export import exported
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.urdf_export import urdf
from alf_ros.mechanism import GROUND
from alf_ros.model.joints import type_of
from alf_ros.scene.scene import scene_from_text
from support.ball_scene import BALLS, NAMES
from support.paths import ROOT
from support.some_scenes import SOME_SCENES
from support.thorough import thinned

SCENES = sorted(path.stem for path in ROOT.glob('config/scenes/*.yaml'))


def link_poses(text: str, values: dict[str, float]) -> dict[str, tuple[Floats, Floats]]:
    """(place, axes) of every link, by the rules of URDF, for joint positions by name."""
    robot = ElementTree.fromstring(text)
    above = {joint.find('child').get('link'): joint for joint in robot.iter('joint')}
    assert len(above) == len(list(robot.iter('joint'))), 'a link with two parents'

    def numbers(element: ElementTree.Element, key: str) -> Floats:
        return np.array(list(map(float, element.get(key).split())))

    def pose(link: str) -> tuple[Floats, Floats]:
        if link not in above:
            return np.zeros(3), np.eye(3)
        joint = above[link]
        place, axes = pose(joint.find('parent').get('link'))
        origin = joint.find('origin')
        place = place + axes @ numbers(origin, 'xyz')
        axes = axes @ Rotation.from_euler('xyz', numbers(origin, 'rpy')).as_matrix()
        if joint.get('type') == 'fixed':
            return place, axes
        move = numbers(joint.find('axis'), 'xyz') * values[joint.get('name')]
        if joint.get('type') == 'prismatic':
            return place + axes @ move, axes
        assert joint.get('type') == 'continuous'
        return place, axes @ Rotation.from_rotvec(move).as_matrix()

    return {link.get('name'): pose(link.get('name')) for link in robot.iter('link')}


@pytest.mark.parametrize('name', thinned(SCENES, keep=SOME_SCENES))
def test_joint_states_move_the_links_as_the_bodies_move(name: str) -> None:
    simulation = Simulation(load_scene(name))
    simulation.step(300)
    sample, mechanism = simulation.sample(), simulation.scene.mechanism
    assert compare(sample, urdf(mechanism)) or all(
        type_of(joint).urdf is None for joint in mechanism.joints if joint.parent == GROUND
    )


def compare(sample: Sample, text: str) -> int:
    """How many points of bodies are where a URDF moves them with the joint states."""
    values = {joint: state.position for joint, state in sample.joints.items()}
    values |= {name: angle for name, (angle, _) in sample.ball_angles.items()}
    found, compared = link_poses(text, values), 0
    for body in sample.model.mechanism.bodies:
        if body.name not in found:
            continue
        place, axes = found[body.name]
        for point, local in zip(body.points, body.local, strict=True):
            at = place + axes[:, : len(local)] @ local
            assert at[: len(local)] == pytest.approx(sample.points[point], abs=1e-9)
            compared += 1
    return compared


def test_balls_with_angles_are_rows_of_joints_that_come_back(tmp_path: Path) -> None:
    """One of them is written from the other body."""
    scene = scene_from_text(BALLS)
    simulation = Simulation(scene)
    simulation.step(300)
    text = urdf(scene.mechanism)
    assert compare(simulation.sample(), text) == 6
    (tmp_path / 'it.urdf').write_text(text)
    source = str(tmp_path / 'it.urdf')
    back = Simulation(scene_from_text(imported(source, scene=True)))
    rows = Simulation(scene_from_text(imported(source, scene=True, balls=False)))
    assert set(back.sample().ball_angles) == set(NAMES[1:])
    assert set(rows.sample().joints) == set(NAMES) and not rows.sample().ball_angles


def test_the_tree_has_the_joints_to_be_kept() -> None:
    """Cylinders, which close loops of the tree that is nearest to the ground."""
    simulation = Simulation(load_scene('excavator'))
    simulation.step(300)
    sample, mechanism = simulation.sample(), simulation.scene.mechanism
    cylinders = {'boom_cylinder', 'stick_cylinder', 'bucket_cylinder'}

    def joints(text: str) -> set[str | None]:
        return {joint.get('name') for joint in ElementTree.fromstring(text).iter('joint')}

    text = urdf(mechanism, keep=cylinders)
    assert cylinders <= joints(text) and not cylinders & joints(urdf(mechanism))
    assert compare(sample, text) == sum(len(body.points) for body in mechanism.bodies)
    loop = {'boom_foot', 'boom_base', 'boom_cylinder', 'boom_eye'}
    with pytest.raises(InputError, match='no tree of excavator has all the joints to be kept'):
        urdf(mechanism, keep=loop)
    with pytest.raises(InputError, match='crank_pin'):
        urdf(mechanism, keep={'crank_pin'})


WHOLE = (
    'bricard',
    'delta_robot',
    'double_pendulum',
    'four_bar',
    'jansen_leg',
    'slider_crank',
    'spatial_four_bar',
    'stewart_platform',
)


@pytest.mark.parametrize('name', WHOLE)
def test_there_and_back_it_moves_the_same(name: str, tmp_path: Path) -> None:
    """From rest, in a slanting gravity of the x-y plane."""
    text, side, left_out = exported(load_scene({'mechanism': name}))
    assert all(line.startswith('effects: ') for line in left_out)
    saved = {'it.urdf': text, 'loops.yaml': side}
    for file, content in saved.items():
        (tmp_path / file).write_text(content, encoding='utf-8')
    back = imported(str(tmp_path / 'it.urdf'), loops=str(tmp_path / 'loops.yaml'))
    (tmp_path / 'back.yaml').write_text(back, encoding='utf-8')
    motions = []
    for source in (name, str(tmp_path / 'back.yaml')):
        mechanism = load_scene({'mechanism': source}).mechanism
        gravity = (2.0, -9.0, 3.0)[: mechanism.dimension]
        scene = load_scene(
            {'mechanism': source, 'effects': {'gravity': {'acceleration': gravity}}}
        )
        simulation = Simulation(scene, integrator='dop853', step=1e-3)
        samples = [simulation.sample()]
        for _ in range(4):
            simulation.step(50)
            samples.append(simulation.sample())
        values = [{n: s.position for n, s in sample.joints.items()} for sample in samples]
        motions.append({n: [v[n] - values[0][n] for v in values] for n in values[0]})
    ours, theirs = motions
    both = ours.keys() & theirs.keys()
    assert len(both) >= len(ours) / 2
    assert max(abs(value) for each in both for value in ours[each]) > 1e-2
    for each in both:
        assert theirs[each] == pytest.approx(ours[each], abs=1e-8)


def test_what_does_not_go_is_listed(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['planetary_gear', '-o', 'it.urdf', '--loops', 'it.yaml']) == 0
    out, said = capsys.readouterr()
    assert out == ''
    assert 'not carried over: joints: mesh0 (gear)\n' in said
    assert '# Not carried over: joints: mesh0 (gear)\n' in Path('it.yaml').read_text()
    assert main(['spatial_four_bar']) == 0
    out, said = capsys.readouterr()
    assert 'held by no joint that URDF knows: coupler' in out
    assert 'not carried over: bodies (see --loops): coupler\n' in said
    assert 'not carried over: loops (see --loops): knee\n' in said


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['four_barr'], "got 'four_barr'; did you mean 'four_bar'"),
        (['four_bar', '-o', 'no/where'], '-o: No such file'),
        (['four_bar', '-o', 'it.urdf', '--loops', 'no/where'], '--loops: No such file'),
        (['four_bar', '--set', 'a'], "--set: not a pair, got 'a'"),
    ],
)
def test_mistakes_of_the_command(arguments, message, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        main(arguments)
