"""Messages for viewers: markers, tf and URDF against the points and bodies of the sample."""

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros import Simulation, load_scene
from alf_ros.exchange.urdf_export import urdf
from alf_ros.ros.messages.markers import markers
from alf_ros.ros.messages.tf import transforms
from alf_ros.simulation.display_geometry import Display, standard_scale
from support.effect_scenes import TOP

# Coupler with three points, hung upside down: its joint to the crank is at its second point.
BENT = {
    'name': 'bent',
    'mechanism': {
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0.5, 0.2], 'fixed': True},
            'A': {'at': [0.5, 1.2]},
            'B': {'at': [1.7, 0.9]},
            'C': {'at': [1.2, 1.9]},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
            'plate': {'points': ['B', 'A', 'C'], 'mass': 2, 'com': [0.3, 0.2], 'inertia': 'point'},
            'bob': {'points': ['C'], 'mass': 0.5, 'inertia': 'point'},
        },
        'joints': {
            'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
            'elbow': {'type': 'revolute', 'between': ['plate', 'crank'], 'at': 'A'},
            'hook': {'type': 'revolute', 'between': ['plate', 'bob'], 'at': 'C'},
        },
    },
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
    'initial': {'velocities': {'A': [1.5, 0.0]}},
}


def moved(scene, steps=700):
    simulation = Simulation(load_scene(scene))
    simulation.step(steps)
    return simulation


def drawn(simulation, display=None):
    """Markers by namespace."""
    write = markers(simulation.model, display or Display())
    message = deserialize_message(write(simulation.sample(), 5_000_000_001), MarkerArray)
    assert {(m.header.stamp.sec, m.header.stamp.nanosec) for m in message.markers} == {(5, 1)}
    assert {m.header.frame_id for m in message.markers} == {'world'}
    assert {(m.action, len(m.points) > 0) for m in message.markers} <= {
        (Marker.ADD, True),
        (Marker.DELETE, False),
    }
    return {m.ns: m for m in message.markers}


def places(marker):
    return np.array([(p.x, p.y, p.z) for p in marker.points])


def test_links_and_joints_are_drawn_where_the_points_are():
    simulation = moved(BENT)
    points = {name: (*place, 0.0) for name, place in simulation.sample().points.items()}
    found = drawn(simulation)
    # a rod is a line, a body of three points a triangle
    ends = ['O', 'A', 'B', 'A', 'A', 'C', 'C', 'B']
    assert np.array_equal(places(found['links']), [points[name] for name in ends])
    assert np.array_equal(places(found['joints']), [points[name] for name in 'OAC'])
    assert found['joints'].type == Marker.SPHERE_LIST


def test_arrows_are_the_forces_to_scale_at_the_places_where_they_act():
    simulation = moved(BENT)
    simulation.apply_wrench('plate', [3.0, 1.0], frame='body')
    simulation.apply_wrench('C', [0.0, -7.0])
    simulation.apply_wrench('crank', [2.0, 0.0], at='A')
    sample, display = simulation.sample(), Display(force_scale=0.25)
    found = drawn(simulation, display)

    arrows = places(found['reactions']).reshape(-1, 6, 3)
    forces = [sample.reactions[name].force for name in ('pin', 'elbow', 'hook')]
    assert arrows[:, 1, :2] - arrows[:, 0, :2] == pytest.approx(0.25 * np.array(forces))
    # both barbs start at the tip
    assert np.array_equal(arrows[:, 2], arrows[:, 1]) and np.array_equal(
        arrows[:, 4], arrows[:, 1]
    )

    arrows = places(found['applied']).reshape(-1, 6, 3)[..., :2]
    b, a, c = (sample.points[name] for name in 'BAC')
    x = (a - b) / np.linalg.norm(a - b)
    y = np.array([-x[1], x[0]])
    expected = [(b + 0.3 * x + 0.2 * y, 3.0 * x + y), (c, [0.0, -7.0]), (a, [2.0, 0.0])]
    for arrow, (tail, force) in zip(arrows, expected, strict=True):
        assert arrow[0] == pytest.approx(tail, abs=1e-12)
        assert arrow[1] - arrow[0] == pytest.approx(0.25 * np.array(force), abs=1e-12)

    simulation.clear_inputs()
    assert drawn(simulation)['applied'].action == Marker.DELETE


def test_the_standard_arrow_of_its_weight_is_a_quarter_of_the_mechanism():
    mechanism = load_scene(BENT).mechanism
    assert standard_scale(mechanism) * 3.5 * 9.81 == pytest.approx(0.25 * 1.7)


def read_transforms(data: bytes) -> list[Any]:
    """Of a message, as an independent reader sees it."""
    found: Any = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, 'tf2_msgs/msg/TFMessage')
    return list(found.transforms)


def test_tf_is_the_frame_of_every_body_as_an_independent_reader_sees_it():
    simulation = moved(BENT)
    write = transforms(simulation.model, Display(frame_prefix='left/'))
    write(simulation.sample(), 1)
    data = write(simulation.sample(), 3_000_000_007)
    found = read_transforms(data)
    assert [t.child_frame_id for t in found] == ['left/crank', 'left/plate', 'left/bob']
    for transform, (x, y, angle) in zip(found, simulation.sample().body_poses, strict=True):
        assert transform.header.frame_id == 'world'
        stamp = transform.header.stamp
        assert (stamp.sec, stamp.nanosec) == (3, 7)
        p, r = transform.transform.translation, transform.transform.rotation
        assert (p.x, p.y, p.z, r.x, r.y) == (x, y, 0.0, 0.0, 0.0)
        turn = [r.w**2 - r.z**2, 2 * r.w * r.z]
        assert turn == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-15)


def link_poses(text, values):
    """(x, y, angle) of every link, by the rules of URDF, for joint positions by name."""
    robot = ElementTree.fromstring(text)
    above = {joint.find('child').get('link'): joint for joint in robot.iter('joint')}
    assert len(above) == len(list(robot.iter('joint'))), 'a link with two parents'

    def pose(link):
        if link not in above:
            return np.zeros(2), 0.0
        joint = above[link]
        place, angle = pose(joint.find('parent').get('link'))
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s], [s, c]])
        x, y, z = map(float, joint.find('origin').get('xyz').split())
        place = place + turn @ (x, y)
        if joint.get('type') == 'continuous':
            axis = joint.find('axis').get('xyz').split()
            assert list(map(float, axis[:2])) == [0.0, 0.0]
            angle = angle + float(axis[2]) * values[joint.get('name')]
        elif joint.get('type') == 'prismatic':
            along = np.array(list(map(float, joint.find('axis').get('xyz').split()))[:2])
            place = place + turn @ along * values[joint.get('name')]
        else:
            assert joint.get('type') == 'fixed'
        return place, angle

    return {link.get('name'): pose(link.get('name')) for link in robot.iter('link')}


@pytest.mark.parametrize(
    'scene', [BENT, 'slider_crank', 'four_bar', 'double_four_bar', 'n_four_bar', 'change_point']
)
def test_joint_states_move_the_urdf_as_the_bodies_move(scene):
    simulation = moved(scene)
    sample = simulation.sample()
    values = dict(zip(simulation.model.joint_names, sample.joint_positions, strict=True))
    found = link_poses(urdf(simulation.scene.mechanism), values)
    for name, (x, y, angle) in zip(simulation.model.body_names, sample.body_poses, strict=True):
        place, turned = found[name]
        assert place == pytest.approx([x, y], abs=1e-9)
        assert np.cos(turned - angle) == pytest.approx(1.0, abs=1e-12)
    poses = dict(zip(simulation.model.body_names, sample.body_poses, strict=True))
    for joint in simulation.scene.mechanism.joints:
        if joint.kind == 'slider':
            x, y, angle = poses[joint.child]
            u, v = joint.frames[1].origin
            c, s = np.cos(angle), np.sin(angle)
            at = [x + c * u - s * v, y + s * u + c * v]
            assert found[f'{joint.name}_slide'][0] == pytest.approx(at, abs=1e-9)


def test_a_body_that_only_a_slider_holds_is_named_as_left_out():
    mechanism = load_scene('slider_crank').mechanism
    kept = type(mechanism)(
        mechanism.name, mechanism.points, mechanism.bodies[1:], mechanism.joints[2:]
    )
    text = urdf(kept, 'left/')
    assert 'held by no joint that URDF knows: coupler' in text
    assert list(link_poses(text, {'guide': 0.5})) == ['world', 'left/guide_slide']


def test_inertia_and_shape_are_those_of_the_body():
    robot = ElementTree.fromstring(urdf(load_scene('four_bar').mechanism))
    link = robot.find("link[@name='coupler']")
    mass = 0.54 * 0.3
    assert float(link.find('inertial/mass').get('value')) == pytest.approx(mass)
    izz = float(link.find('inertial/inertia').get('izz'))
    assert izz == pytest.approx(mass * 0.3**2 / 12)
    assert float(link.find('visual/geometry/cylinder').get('length')) == pytest.approx(0.3)


def test_a_body_in_space_is_shown_as_it_is():
    simulation = moved(TOP, 300)
    simulation.apply_wrench('top', [3.0, 1.0, -2.0], frame='body')
    sample = simulation.sample()
    data = transforms(simulation.model, Display())(sample, 1)
    (frame,) = read_transforms(data)
    p, r = frame.transform.translation, frame.transform.rotation
    origin, turn = np.array([p.x, p.y, p.z]), Rotation.from_quat([r.x, r.y, r.z, r.w])
    body = simulation.scene.mechanism.bodies[0]
    for name, local in zip(body.points, body.local, strict=True):
        assert origin + turn.apply(local) == pytest.approx(sample.points[name], abs=1e-9)
    found = drawn(simulation, Display(force_scale=0.25))
    assert np.array_equal(places(found['joints']), [sample.points['O']])
    arrow = places(found['applied'])
    assert arrow[0] == pytest.approx(origin + turn.apply(body.com), abs=1e-9)
    force = turn.apply([3.0, 1.0, -2.0])
    assert arrow[1] - arrow[0] == pytest.approx(0.25 * force, abs=1e-9)


def test_rims_of_wheels_touch_the_ground_and_turn():
    """A coin of 12.9 mm: every end of a line of its rim at that distance, the lowest on the
    ground; the mark turns with the body."""
    marks = []
    for steps in (0, 300):
        simulation = moved('coin', steps)
        *rim, inner, outer = places(drawn(simulation)['wheels'])
        centre = (np.array(inner) - 0.7 * np.array(outer)) / 0.3
        assert np.linalg.norm(rim - centre, axis=1) == pytest.approx(0.0129, rel=1e-9)
        assert -1e-9 < min(place[2] for place in rim) < 1e-4
        assert np.allclose(rim[1:-1:2], rim[2::2])  # each piece begins where the last one ended
        pose = simulation.sample().body_poses[0]
        x, y, z, w = pose[3:]
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        marks.append(R.T @ (outer - centre))
    assert marks[0] == pytest.approx(marks[1], abs=1e-9)
    assert 'wheels' not in drawn(moved(BENT, 1))
