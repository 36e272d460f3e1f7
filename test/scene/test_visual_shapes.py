"""Shapes of bodies in mechanism files, the files of meshes, and motions without shapes."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from alf_ros import Simulation, load_scene
from alf_ros import __main__ as program
from alf_ros.errors import InputError
from alf_ros.exchange.urdf_export import urdf
from alf_ros.inspection.missing_meshes import missing_meshes
from alf_ros.inspection.soundness import examine
from alf_ros.mechanism import VisualShape
from alf_ros.mechanism.visual_shapes import roll_pitch_yaw
from alf_ros.scene import json_schema
from alf_ros.scene.scene import scene_from_text, whole_scene
from support.paths import ROOT

PENDULUM = """\
alf: 1
parameters: {L: 0.5}
points:
  O: {at: [0, 0], fixed: true}
  P<k>: {for: {k: [1, 2]}, at: [k*L, 0]}
bodies:
  B1: {points: [O, P1], mass: 1.0, inertia: rod, shapes: &all
    [{box: {size: [L, 0.04, 0.02]}, at: [L/2, 0], color: [0.2, 0.4, 0.8]},
     {cylinder: {radius: L/10, length: 0.1}, rpy: [0, pi/2, 0]},
     {capsule: {radius: 0.02, length: L}, at: [L/2, 0, 0.1], color: [1, 0, 0, 0.5]},
     {sphere: {radius: 0.06}, at: [L, 0]}]}
  B<k>: {for: {k: [2, 2]}, points: ["P<k-1>", "P<k>"], mass: 1.0, inertia: rod,
    shapes: [{mesh: {file: "meshes/link<k>.stl", scale: k/2}, at: [L/k, 0]}]}
joints:
  pin: {type: revolute, between: [ground, B1], at: O}
  elbow: {type: revolute, between: [B1, B2], at: P1}
shapes:
  - {mesh: {file: "package://bench/meshes/base.DAE", scale: [1, 1, -2]}, at: [0, 0, -0.1]}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / 'pendulum.yaml'
    path.write_text(PENDULUM, 'utf-8')
    return path


def test_every_kind_is_read(file: Path) -> None:
    mechanism = load_scene({'mechanism': str(file)}).mechanism
    box, cylinder, capsule, sphere = mechanism.body['B1'].shapes
    assert box == VisualShape('box', (0.5, 0.04, 0.02), (0.25, 0, 0), color=(0.2, 0.4, 0.8, 1))
    assert cylinder == VisualShape('cylinder', (0.05, 0.1), rpy=(0, np.pi / 2, 0))
    assert capsule == VisualShape('capsule', (0.02, 0.5), (0.25, 0, 0.1), color=(1, 0, 0, 0.5))
    assert sphere == VisualShape('sphere', (0.06,), (0.5, 0, 0))
    (mesh,) = mechanism.body['B2'].shapes
    assert mesh.file == str(file.parent / 'meshes/link2.stl') and mesh.size == (1, 1, 1)
    assert mesh.uri == f'file://{mesh.file}'
    (base,) = mechanism.shapes
    assert base.uri == base.file == 'package://bench/meshes/base.DAE'
    assert base.size == (1, 1, -2)


def test_the_text_of_a_scene_names_the_same_files_anywhere(file: Path) -> None:
    scene = load_scene({'mechanism': str(file)})
    assert scene_from_text(scene.text, '/elsewhere/scene.yaml') == scene
    assert whole_scene(yaml.safe_load(scene.text)).mechanism == scene.mechanism
    text = scene.text.replace(f'{file.parent}/', '')
    with pytest.raises(InputError, match=r'a file elsewhere, got .*expected an absolute path'):
        whole_scene(yaml.safe_load(text))


def test_a_space_in_a_path_is_escaped_in_its_uri() -> None:
    assert VisualShape('mesh', (1, 1, 1), file='/a b/100%.stl').uri == 'file:///a%20b/100%25.stl'


def test_axes_and_angles_are_those_of_urdf() -> None:
    random = np.random.default_rng(1)
    for rpy in random.uniform(-3.0, 3.0, (50, 3)):
        turn = Rotation.from_euler('xyz', rpy).as_matrix()
        shape = VisualShape('sphere', (1.0,), rpy=tuple(rpy.tolist()))
        assert shape.turn == pytest.approx(turn, abs=1e-14)
        again = VisualShape('sphere', (1.0,), rpy=roll_pitch_yaw(turn)).turn
        assert again == pytest.approx(turn, abs=1e-14)


def test_the_schema_knows_shapes() -> None:
    judge = jsonschema.Draft7Validator(json_schema.mechanism_schema())
    document = yaml.safe_load(PENDULUM)
    judge.validate(document)
    for wrong in ('{}', '{box: {size: [1, 1, 1]}, sphere: {radius: 1}}', '{ball: {radius: 1}}'):
        assert not judge.is_valid({**document, 'shapes': [yaml.safe_load(wrong)]})


def test_no_bit_of_a_motion_depends_on_shapes(file: Path) -> None:
    effects = {'gravity': {'acceleration': [0, -9.81]}}
    shown = load_scene({'mechanism': str(file), 'effects': effects})
    bare = re.sub(r',? shapes: (&all)?\s*\[.*?\]\}(?=\n)', '}', PENDULUM, flags=re.S)
    file.write_text(bare.partition('shapes:')[0], 'utf-8')
    hidden = load_scene({'mechanism': str(file), 'effects': effects})
    assert shown.mechanism.body['B1'].shapes and not hidden.mechanism.body['B1'].shapes
    assert shown.mechanism.geometry == hidden.mechanism.geometry
    ends = []
    for scene in (shown, hidden):
        simulation = Simulation(scene)
        simulation.step(50)
        ends.append((simulation.state.q.tobytes(), simulation.state.qd.tobytes()))
    assert ends[0] == ends[1]


def test_what_computes_motions_does_not_know_shapes() -> None:
    for package in ('kernel', 'model', 'effects', 'simulation'):
        for path in (ROOT / 'alf_ros' / package).rglob('*.py'):
            text = path.read_text('utf-8')
            assert 'visual_shapes' not in text and '.shapes' not in text, path


def test_no_mesh_is_opened(file: Path) -> None:
    """Not even one that exists: a log may name any file."""
    mesh = file.parent / 'meshes/link2.stl'
    mesh.parent.mkdir()
    mesh.touch()
    opened: list[str] = []
    hearing = [True]

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if hearing and event == 'open':
            opened.append(str(arguments[0]))

    sys.addaudithook(hook)
    try:
        scene = load_scene({'mechanism': str(file)})
        examine(scene_from_text(scene.text))
        urdf(scene.mechanism)
        Simulation(scene).step(2)
    finally:
        hearing.clear()
    assert str(file) in opened and not [path for path in opened if 'meshes' in path]


def test_files_that_are_not_there_are_told(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(file.parent / 'opt'))
    mechanism = load_scene({'mechanism': str(file)}).mechanism
    link, base = file.parent / 'meshes/link2.stl', 'package://bench/meshes/base.DAE'
    assert missing_meshes(mechanism) == [
        f'ground: no package bench in AMENT_PREFIX_PATH: {base}',
        f'B2: no such file: {link}',
    ]
    assert program.main(['check', str(file), '--folder', str(file.parent)]) == 0
    said = re.sub(r'\s+', '', capsys.readouterr().out)
    assert f'notemeshesnotdrawn:ground:nopackagebenchinAMENT_PREFIX_PATH:{base}' in said
    share = file.parent / 'opt/share/bench'
    share.mkdir(parents=True)
    assert missing_meshes(mechanism)[0] == f'ground: no such file: {base}'
    for path in (share / 'meshes/base.DAE', link):
        path.parent.mkdir()
        path.touch()
    assert missing_meshes(mechanism) == []
    link.unlink()
    link.mkdir()
    assert missing_meshes(mechanism) == [f'B2: no such file: {link}']
