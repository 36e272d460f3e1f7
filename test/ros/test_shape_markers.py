"""Shapes in `~/markers` and `robot_description`, as a viewer reads them."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.ros.messages.markers import markers
from alf_ros.ros.messages.topics import LATCHED
from alf_ros.simulation.display_geometry import Display, poses
from support.ros_node import Peer, SimulatorProcess

PLANE = """\
mechanism:
  alf: 1
  name: crank
  points: {O: {at: [0.1, 0.2], fixed: true}, P: {at: [0.1, 0.7]}, Q: {at: [0.5, 0.7]}}
  bodies:
    crank: {points: [O, P], mass: 1.0, inertia: rod, shapes: [
      {box: {size: [0.5, 0.04, 0.02]}, at: [0.25, 0], color: [0.2, 0.4, 0.8]},
      {capsule: {radius: 0.02, length: 0.3}, at: [0.1, 0.2, 0.3], rpy: [0.3, 0.4, 0.5]}]}
    arm: {points: [P, Q], mass: 1.0, inertia: rod, shapes: [
      {cylinder: {radius: 0.1, length: 0.03}, rpy: [pi/2, 0, 0]},
      {sphere: {radius: 0.06}, at: [0.2, 0.1]},
      {mesh: {file: "meshes/h and.stl", scale: [1, 2, -0.5]}, at: [0.4, 0]},
      {mesh: {file: "package://bench/hand.dae"}, color: [1, 0, 0, 0.5]}]}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    elbow: {type: revolute, between: [crank, arm], at: P}
  shapes: [{box: {size: [1, 1, 0.1]}, at: [0, 0, -0.1]}]
effects: {gravity: {acceleration: [0, -9.81]}}
"""
SPACE = {
    'name': 'top',
    'mechanism': {
        'alf': 1,
        'space': 'spatial',
        'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'P': {'at': [0.3, 0.1, 0.4]}},
        'bodies': {
            'top': {
                'points': ['O', 'P'],
                'mass': 1.0,
                'inertia': {'about_com': [0.01, 0.02, 0.025]},
                'shapes': [
                    {
                        'cylinder': {'radius': 0.1, 'length': 0.3},
                        'at': [0.1, 0.2, -0.1],
                        'rpy': [0.5, -0.7, 1.1],
                    }
                ],
            }
        },
        'joints': {'pin': {'type': 'spherical', 'between': ['ground', 'top'], 'at': 'O'}},
    },
    'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
    'initial': {'velocities': {'P': [0.1, 1.0, None]}},
}


@pytest.fixture
def plane(tmp_path: Path) -> Path:
    path = tmp_path / 'crank.yaml'
    path.write_text(PLANE, 'utf-8')
    return path


def drawn(simulation: Simulation) -> list[Marker]:
    write = markers(simulation.model, Display())
    message = deserialize_message(write(simulation.sample(), 5_000_000_001), MarkerArray)
    assert {(m.header.stamp.sec, m.header.frame_id) for m in message.markers} == {(5, 'world')}
    return [marker for marker in message.markers if marker.ns == 'shapes']


def pose_of(marker: Marker) -> tuple[Floats, Floats]:
    p, r = marker.pose.position, marker.pose.orientation
    return np.array([p.x, p.y, p.z]), Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix()


def test_each_shape_is_a_marker_at_the_pose_of_its_body(plane: Path) -> None:
    simulation = Simulation(load_scene(plane))
    simulation.step(400)
    found = drawn(simulation)
    assert [marker.id for marker in found] == list(range(9))
    assert {marker.action for marker in found} == {Marker.ADD}
    frames = [(x[:3], Rotation.from_quat(x[3:]).as_matrix()) for x in poses(simulation.sample())]
    crank, arm = frames
    axis = Rotation.from_euler('xyz', [0.3, 0.4, 0.5]).as_matrix()
    capsule, turned = np.array([0.1, 0.2, 0.3]), Rotation.from_euler('x', np.pi / 2).as_matrix()
    expected = [
        (Marker.CUBE, (1, 1, 0.1), (np.zeros(3), np.eye(3)), (0, 0, -0.1), np.eye(3)),
        (Marker.CUBE, (0.5, 0.04, 0.02), crank, (0.25, 0, 0), np.eye(3)),
        (Marker.CYLINDER, (0.04, 0.04, 0.3), crank, capsule, axis),
        (Marker.SPHERE, (0.04, 0.04, 0.04), crank, capsule - 0.15 * axis[:, 2], axis),
        (Marker.SPHERE, (0.04, 0.04, 0.04), crank, capsule + 0.15 * axis[:, 2], axis),
        (Marker.CYLINDER, (0.2, 0.2, 0.03), arm, (0, 0, 0), turned),
        (Marker.SPHERE, (0.12, 0.12, 0.12), arm, (0.2, 0.1, 0), np.eye(3)),
        (Marker.MESH_RESOURCE, (1, 2, -0.5), arm, (0.4, 0, 0), np.eye(3)),
        (Marker.MESH_RESOURCE, (1, 1, 1), arm, (0, 0, 0), np.eye(3)),
    ]
    for marker, (kind, size, (place, axes), at, turn) in zip(found, expected, strict=True):
        assert marker.type == kind
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == pytest.approx(size)
        there, along = pose_of(marker)
        assert there == pytest.approx(place + axes @ at, abs=1e-12)
        assert along == pytest.approx(axes @ turn, abs=1e-12)
    blue, grey = found[1].color, found[2].color
    assert (blue.r, blue.g, blue.b, blue.a) == pytest.approx((0.2, 0.4, 0.8, 1.0))
    assert grey.a == 1.0
    own, given = found[7], found[8]
    assert own.mesh_resource == f'file://{plane.parent}/meshes/h%20and.stl'
    assert own.mesh_use_embedded_materials and own.color.a == 0.0
    assert given.mesh_resource == 'package://bench/hand.dae'
    assert not given.mesh_use_embedded_materials
    assert (given.color.r, given.color.a) == pytest.approx((1.0, 0.5))


def test_shapes_turn_with_a_body_in_space() -> None:
    simulation = Simulation(load_scene(SPACE))
    simulation.step(300)
    (marker,) = drawn(simulation)
    (frame,) = poses(simulation.sample())
    body = Rotation.from_quat(frame[3:]).as_matrix()
    place, axes = pose_of(marker)
    assert place == pytest.approx(frame[:3] + body @ [0.1, 0.2, -0.1], abs=1e-12)
    turn = Rotation.from_euler('xyz', [0.5, -0.7, 1.1]).as_matrix()
    assert axes == pytest.approx(body @ turn, abs=1e-12)


def test_a_viewer_forgets_the_shapes_of_another_scene(
    plane: Path, tmp_path: Path, peer: Peer
) -> None:
    """Markers stay until they are deleted. Meshes that are not there stop nothing."""
    heard = peer.listen('/simulator/markers', MarkerArray)
    told = peer.listen('robot_description', String, LATCHED)
    with SimulatorProcess(tmp_path / 'log', '--scene', str(plane)).wait_running() as node:
        assert (
            f'meshes not drawn: arm: no such file: {plane.parent}/meshes/h and.stl' in node.output
        )

        def shown() -> int:
            return sum(marker.ns == 'shapes' for marker in heard[-1].markers)

        peer.until(lambda: shown() == 9, 'shapes')
        assert not any(m.action == Marker.DELETEALL for each in heard for m in each.markers)
        peer.until(lambda: told, 'robot_description')
        robot = ElementTree.fromstring(told[-1].data)
        kinds = [shape[0].tag for shape in robot.iterfind('link/visual/geometry')]
        assert kinds == ['box', 'box', 'cylinder', 'sphere', 'sphere', 'cylinder', 'sphere'] + (
            2 * ['mesh']
        )
        other = Parameter('scene', value='four_bar').to_parameter_msg()
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[other])
        assert answer.results[0].successful, answer
        peer.until(lambda: shown() == 0 and heard[-1].markers[0].ns == 'links', 'the other scene')
        actions = [each.markers[0].action for each in heard]
        cleared = actions.index(Marker.DELETEALL)
        assert len(heard[cleared].markers) == 1 and cleared > 0
        assert all(m.ns != 'shapes' for each in heard[cleared:] for m in each.markers)
        assert node.stop() == 0
