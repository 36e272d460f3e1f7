"""Shapes of URDF, SDF and MJCF come along, at the places where the files have them."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.exchange.export import exported
from alf_ros.exchange.import_file import imported
from alf_ros.inspection.missing_meshes import shown_parts
from alf_ros.mechanism import GROUND, VisualShape
from alf_ros.scene.scene import Scene
from alf_ros.simulation.display_geometry import poses

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial>'
)


Frames = dict[str, tuple[Floats, Floats]]


def frames(scene: Scene) -> Frames:
    """(3,) and (3, 3) place and axes of the ground and of each body as drawn."""
    found: Frames = {GROUND: (np.zeros(3), np.eye(3))}
    for body, x in zip(scene.mechanism.bodies, poses(Simulation(scene).sample()), strict=True):
        found[body.name] = x[:3], Rotation.from_quat(x[3:]).as_matrix()
    return found


def drawn(frame: tuple[Floats, Floats], shape: VisualShape) -> tuple[Floats, Floats]:
    """Place and axes of a shape in the world."""
    place, axes = frame
    return place + axes @ shape.at, axes @ shape.turn


def saved(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text, 'utf-8')
    return str(folder / name)


def mechanism_of(folder: Path, text: str) -> Scene:
    return load_scene({'mechanism': saved(folder, 'imported.yaml', text)})


ARM = f"""<robot name="arm">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base">
    <visual><origin xyz="0 0.1 0" rpy="0 0 0.5"/><geometry><box size="0.4 0.3 0.1"/></geometry>
      <material name="blue"/></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <link name="upper">{INERTIAL}
    <visual><origin xyz="0.1 0 0.25" rpy="0.1 0.2 0.3"/><geometry>
      <cylinder radius="0.05" length="0.5"/></geometry>
      <material name="glass"><color rgba="1 0 0 0.5"/></material></visual>
    <visual><geometry>
      <mesh filename="package://arm/meshes/upper.stl" scale="1 2 -0.5"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/u p.dae"/></geometry></visual>
    <visual><geometry><mesh filename="file:///opt/a%20b.obj"/></geometry></visual>
  </link>
  <link name="tool">{INERTIAL}
    <visual><origin xyz="0.1 0 0"/><geometry><sphere radius="0.06"/></geometry></visual></link>
  <link name="camera"><visual><geometry><box size="0.02 0.03 0.04"/></geometry></visual></link>
  <link name="eye"><visual><geometry>
    <capsule radius="0.02" length="0.1"/></geometry></visual></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.05" rpy="0 0 0.4"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="tool"/>
    <origin xyz="0 0 0.5" rpy="0.3 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="mount" type="fixed"><parent link="tool"/><child link="camera"/>
    <origin xyz="0.2 0 0.1" rpy="0 0 1"/></joint>
  <joint name="pan" type="continuous"><parent link="camera"/><child link="eye"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 0 1"/></joint>
</robot>"""


def chain(*poses: tuple[tuple[float, ...], tuple[float, ...]]) -> tuple[Floats, Floats]:
    """Place and axes of the last of frames, each with xyz and rpy in the one before it."""
    place: Floats = np.zeros(3)
    axes: Floats = np.eye(3)
    for xyz, rpy in poses:
        place = place + axes @ xyz
        axes = axes @ Rotation.from_euler('xyz', rpy).as_matrix()
    return place, axes


def test_visuals_of_a_urdf_are_where_its_links_are(tmp_path: Path) -> None:
    source = saved(tmp_path, 'arm.urdf', ARM)
    scene = mechanism_of(tmp_path, imported(source, positions={'shoulder': 0.3}))
    upper = (((0, 0, 0.05), (0, 0, 0.4)), ((0, 0, 0), (0, 0.3, 0)))
    tool = (*upper, ((0, 0, 0.5), (0.3, 0, 0)))
    camera = (*tool, ((0.2, 0, 0.1), (0, 0, 1)))
    expected: dict[str, list[tuple[str, tuple[float, ...], Any]]] = {
        GROUND: [('box', (0.4, 0.3, 0.1), (((0, 0.1, 0), (0, 0, 0.5)),))],
        'upper': [
            ('cylinder', (0.05, 0.5), (*upper, ((0.1, 0, 0.25), (0.1, 0.2, 0.3)))),
            ('mesh', (1, 2, -0.5), upper),
            ('mesh', (1, 1, 1), upper),
            ('mesh', (1, 1, 1), upper),
        ],
        'tool': [
            ('sphere', (0.06,), (*tool, ((0.1, 0, 0), (0, 0, 0)))),
            ('box', (0.02, 0.03, 0.04), camera),
            ('capsule', (0.02, 0.1), (*camera, ((0, 0, 0.1), (0, 0, 0)))),
        ],
    }
    shown = dict(shown_parts(scene.mechanism))
    assert shown.keys() == expected.keys()
    for name, frame in frames(scene).items():
        assert [(s.kind, s.size) for s in shown[name]] == [e[:2] for e in expected[name]]
        for shape, (_, _, placed) in zip(shown[name], expected[name], strict=True):
            for found, wanted in zip(drawn(frame, shape), chain(*placed), strict=True):
                assert found == pytest.approx(wanted, abs=3e-9)
    assert shown[GROUND][0].color == (0, 0, 1, 1)
    cylinder, *meshes = shown['upper']
    assert cylinder.color == (1, 0, 0, 0.5) and meshes[0].color is None
    files = ['package://arm/meshes/upper.stl', f'{tmp_path}/meshes/u p.dae', '/opt/a b.obj']
    assert [mesh.file for mesh in meshes] == files


HOSTILE = (
    '<mesh filename="/dev/zero"/>',
    '<mesh filename="http://a.example/x.stl"/>',
    '<mesh filename="package://../x.stl"/>',
    '<mesh filename="a&#9;b.stl"/>',
    '<mesh filename="&#x202e;lts.exe.stl"/>',
    '<mesh filename="file:///a%00b.stl"/>',
    '<mesh filename="a&lt;k&gt;.stl"/>',
    '<mesh filename=""/>',
    '<mesh filename="a.stl" scale="0 1 1"/>',
    '<mesh filename="a.stl" scale="1e300 1 1"/>',
    '<sphere radius="nan"/>',
    '<sphere radius="-1"/>',
    '<sphere/>',
    '<box size="1 2"/>',
    '<box size="x y z"/>',
    '<torus radius="1"/>',
)


FAR = '<visual><origin xyz="1e99 0 0"/><geometry><sphere radius="1"/></geometry></visual>'


def test_what_cannot_be_shown_is_counted_and_stops_nothing(tmp_path: Path) -> None:
    visuals = ''.join(f'<visual><geometry>{each}</geometry></visual>' for each in HOSTILE)
    more = f'<link name="upper"><visual/>{FAR}{visuals}'
    text = imported(saved(tmp_path, 'arm.urdf', ARM.replace('<link name="upper">', more)))
    assert f'# Left out without an effect on the motion: shapes {len(HOSTILE) + 2}\n' in text
    assert len(mechanism_of(tmp_path, text).mechanism.body['upper'].shapes) == 4


def test_shapes_come_back_from_a_urdf_that_was_exported(tmp_path: Path) -> None:
    """A capsule as a cylinder with two spheres."""
    first = mechanism_of(tmp_path, imported(saved(tmp_path, 'arm.urdf', ARM)))
    text, side, _ = exported(first)
    again, loops = saved(tmp_path, 'again.urdf', text), saved(tmp_path, 'side.yaml', side)
    second = mechanism_of(tmp_path, imported(again, loops=loops))
    there, back = (dict(shown_parts(scene.mechanism)) for scene in (first, second))
    assert there.keys() == back.keys()
    old, new = frames(first), frames(second)
    for name in there:
        whole = [part for shape in there[name] for part in shape.without_capsule]
        for one, other in zip(whole, back[name], strict=True):
            assert (other.kind, other.size, other.color) == (one.kind, one.size, one.color)
            assert other.file == one.file
            for found, wanted in zip(drawn(new[name], other), drawn(old[name], one), strict=True):
                assert found == pytest.approx(wanted, abs=1e-8)
    assert [shape.kind for shape in back['tool'][-3:]] == ['cylinder', 'sphere', 'sphere']
    assert back['tool'][-1].at == pytest.approx(
        2 * np.array(back['tool'][-3].at) - back['tool'][-2].at, abs=1e-9
    )


SDF = """<sdf version="1.10"><model name="arm"><pose>0 0 1 0 0 0</pose>
  <link name="base"><pose>0.1 0 0 0 0 0.5</pose>
    <visual name="v"><pose>0 0 0.2 0.3 0 0</pose><geometry><box><size>1 2 3</size></box></geometry>
      <material><diffuse>0.1 0.2 0.3</diffuse></material></visual></link>
  <link name="bar"><pose>0 0.5 0 0.2 0 0</pose>
    <inertial><mass>1</mass></inertial>
    <visual name="a"><pose relative_to="base">0.3 0 0 0 0.4 0</pose><geometry>
      <capsule><radius>0.1</radius><length>0.6</length></capsule></geometry></visual>
    <visual name="b"><geometry><mesh><uri>model://hand/meshes/palm.dae</uri><scale>2 2 2</scale>
      </mesh></geometry></visual>
    <visual name="c"><geometry>
      <mesh><uri>model://hand/meshes/lost.dae</uri></mesh></geometry></visual>
    <visual name="d"><geometry><plane><normal>0 0 1</normal></plane></geometry></visual>
    <visual name="e"><pose>here</pose>
      <geometry><sphere><radius>1</radius></sphere></geometry></visual>
  </link>
  <joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>
  <joint name="pin" type="revolute"><parent>base</parent><child>bar</child>
    <axis><xyz>1 0 0</xyz></axis></joint></model></sdf>"""


def test_visuals_of_an_sdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tmp_path / 'models/hand/meshes/palm.dae'
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    monkeypatch.setenv('GZ_SIM_RESOURCE_PATH', str(tmp_path / 'models'))
    text = imported(saved(tmp_path, 'arm.sdf', SDF))
    assert '# Left out without an effect on the motion: shapes 3\n' in text
    scene = mechanism_of(tmp_path, text)
    (box,), (capsule, palm) = scene.mechanism.shapes, scene.mechanism.body['bar'].shapes
    assert (box.kind, box.size, box.color) == ('box', (1, 2, 3), (0.1, 0.2, 0.3, 1))
    assert (capsule.kind, capsule.size) == ('capsule', (0.1, 0.6))
    assert (palm.file, palm.size) == (str(mesh), (2, 2, 2))
    frame, up = frames(scene), ((0, 0, 1), (0, 0, 0))
    base, bar = (up, ((0.1, 0, 0), (0, 0, 0.5))), (up, ((0, 0.5, 0), (0.2, 0, 0)))
    for name, shape, wanted in (
        (GROUND, box, (*base, ((0, 0, 0.2), (0.3, 0, 0)))),
        ('bar', capsule, (*base, ((0.3, 0, 0), (0, 0.4, 0)))),
        ('bar', palm, bar),
    ):
        for found, expected in zip(drawn(frame[name], shape), chain(*wanted), strict=True):
            assert found == pytest.approx(expected, abs=3e-9)


MJCF = """<mujoco model="arm"><compiler meshdir="parts" angle="radian"/>
  <asset><mesh name="wedge" file="wedge.stl" scale="0.5 1 1"/>
    <material name="red" rgba="1 0 0 1"/></asset>
  <worldbody><geom type="plane" size="1 1 1"/>
    <body name="bar" pos="0 0 1" euler="0.3 0 0"><joint name="pin" axis="1 0 0"/>
      <geom type="mesh" mesh="wedge" pos="0.1 0 0" euler="0 0.2 0" material="red"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" rgba="0 1 0 0.5" group="2"/>
      <geom type="cylinder" size="0.1 0.2" pos="0 0.3 0"/>
      <geom type="box" size="0.1 0.2 0.3" group="3"/>
      <geom type="box" size="0.1 0.2 0.3" rgba="0 0 0 0"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="sphere" size="0.05"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0 0 0.1"/>
    </body></worldbody></mujoco>"""


def test_geoms_of_an_mjcf(tmp_path: Path) -> None:
    """MuJoCo turns a mesh into its axes of inertia; viewers read the file as it is."""
    pytest.importorskip('mujoco')
    corners = np.array([[1, 0, 0], [2, 0, 0], [1, 3, 0], [1, 0, 1]], dtype='<f4')
    faces = corners[[(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]]
    (tmp_path / 'parts').mkdir()
    (tmp_path / 'parts/wedge.stl').write_bytes(
        bytes(80)
        + struct.pack('<I', 4)
        + b''.join(bytes(12) + face.tobytes() + bytes(2) for face in faces)
    )
    text = imported(saved(tmp_path, 'arm.xml', MJCF))
    assert '# Left out without an effect on the motion: shapes 4\n' in text
    scene = mechanism_of(tmp_path, text)
    assert not scene.mechanism.shapes  # a plane has no end
    mesh, capsule, cylinder, sphere, box = scene.mechanism.body['bar'].shapes
    assert mesh.file == str(tmp_path / 'parts/wedge.stl') and mesh.size == (0.5, 1, 1)
    assert mesh.color == (1, 0, 0, 1) and capsule.color == (0, 1, 0, 0.5) and box.color is None
    assert (capsule.kind, *capsule.size) == ('capsule', 0.03, 0.4)
    assert (cylinder.kind, *cylinder.size) == ('cylinder', 0.1, 0.4)
    assert (sphere.kind, sphere.size, box.kind) == ('sphere', (0.05,), 'box')
    assert box.size == (0.2, 0.4, 0.6)
    frame, bar = frames(scene)['bar'], ((0, 0, 1), (0.3, 0, 0))
    for shape, pose in (
        (mesh, ((0.1, 0, 0), (0, 0.2, 0))),
        (cylinder, ((0, 0.3, 0), (0, 0, 0))),
        (box, ((0, 0, 0.1), (0, 0, 0))),
    ):
        for found, expected in zip(drawn(frame, shape), chain(bar, pose), strict=True):
            assert found == pytest.approx(expected, abs=1e-6)
    place, axes = drawn(frame, capsule)
    there, along = chain(bar, ((0, 0, -0.2), (0, 0, 0)))
    assert place == pytest.approx(there, abs=1e-8)
    assert abs(axes[:, 2] @ along[:, 2]) == pytest.approx(1.0)
