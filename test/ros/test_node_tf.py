"""tf from a running node. Needs tf2_msgs: a ROS 2 installation."""

import math

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from alf_ros import Simulation, load_scene
from support.ros_node import SimulatorProcess, read_log

TFMessage = pytest.importorskip('tf2_msgs.msg', reason='comes with a ROS 2 installation').TFMessage


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def test_frames_come_when_asked_for_and_are_those_of_the_bodies(tmp_path, peer):
    heard, joints = peer.listen('/tf', TFMessage), peer.listen('joint_states', JointState)
    options = {'record.topics': '[tf]', 'display_rate': 50.0, 'frame_prefix': 'a/'}
    with SimulatorProcess(tmp_path, **options).wait_running() as node:
        peer.until(lambda: len(joints) > 20, 'motion')
        assert heard == []  # off until asked for
        changed = Parameter('publish.tf', value='auto').to_parameter_msg()
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[changed])
        assert answer.results[0].successful
        peer.until(lambda: len(heard) > 10, 'frames')
        assert node.stop() == 0, node.output
    simulation, last = Simulation(load_scene('slider_crank')), 0
    logged = read_log(node.logs[0])['/tf']
    assert len(logged) > len(heard)
    for message in (*(m for _, m in logged), *heard):
        crank, coupler = message.transforms
        stamp = ns(crank.header.stamp)
        assert stamp == 1 or stamp % 20_000_000 == 0
        step = round(stamp * 1e-6)
        if step < last:
            simulation.reset()
        simulation.step(step - simulation.step_index)
        last = step
        for transform, name, pose in (
            (crank, 'a/crank', simulation.sample().body_poses[0]),
            (coupler, 'a/coupler', simulation.sample().body_poses[1]),
        ):
            assert (transform.header.frame_id, transform.child_frame_id) == ('world', name)
            place, turn = transform.transform.translation, transform.transform.rotation
            assert (place.x, place.y, place.z) == (pose[0], pose[1], 0.0)
            angle = 2.0 * math.atan2(turn.z, turn.w)
            assert math.cos(angle - pose[2]) == pytest.approx(1.0, abs=1e-12)


def test_frames_in_space_are_those_of_the_bodies(tmp_path, peer):
    heard = peer.listen('/tf', TFMessage)
    scene = 'stewart_platform'
    options = {'publish.tf': 'auto', 'display_rate': 50.0}
    with SimulatorProcess(tmp_path, '--no-record', '--scene', scene, **options).wait_running():
        peer.until(lambda: len(heard) > 10, 'frames')
    simulation = Simulation(load_scene(scene))
    for message in heard:
        stamp = ns(message.transforms[0].header.stamp)
        simulation.step(round(stamp * 1e-9 / simulation.h) - simulation.step_index)
        names = [transform.child_frame_id for transform in message.transforms]
        assert names == list(simulation.model.body_names)
        for transform, pose in zip(
            message.transforms, simulation.sample().body_poses, strict=True
        ):
            place, turn = transform.transform.translation, transform.transform.rotation
            told = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
            assert told == tuple(pose)
