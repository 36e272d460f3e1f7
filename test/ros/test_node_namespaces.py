"""Simulators in namespaces, and with topics of other names."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from alf_ros import load_scene
from alf_ros.exchange.urdf_export import urdf
from alf_ros.logs import comparison
from alf_ros.logs.log import load
from alf_ros.logs.report.gather import gather
from alf_ros.ros.recording.fork import fork
from support.ros_node import SimulatorProcess, journal, read_log, wrench

BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_two_simulators_in_namespaces(tmp_path, peer):
    clocks = {
        side: peer.listen(f'/{side}/clock', Clock, BEST_EFFORT) for side in ('left', 'right')
    }
    joints = {side: peer.listen(f'/{side}/joint_states', JointState) for side in clocks}
    markers = peer.listen('/left/simulator/markers', MarkerArray)
    told = peer.listen('/diagnostics', DiagnosticArray)

    def options(side, scene):
        ros = ['--ros-args', '-r', f'__ns:=/{side}', '-p', f'frame_prefix:={side}/']
        return ['--scene', scene, *ros, '-p', 'publish.reactions:=on']

    def accepted(task):
        of_task = (status for m in told for status in m.status if status.name == task)
        return {e.value for status in of_task for e in status.values if e.key == 'accepted'}

    with (
        SimulatorProcess(tmp_path, *options('left', 'slider_crank')) as left,
        SimulatorProcess(tmp_path / 'r', *options('right', 'four_bar')) as right,
    ):
        left.wait_running(), right.wait_running()
        peer.until(lambda: all(len(heard) > 50 for heard in joints.values()), 'both move')
        assert list(joints['left'][-1].name) == ['crank_pin', 'knee', 'guide']
        assert list(joints['right'][-1].name) == ['crank_pin', 'knee', 'wrist', 'rocker_pin']
        peer.until(lambda: all(clocks.values()), 'both have a clock')
        topics = dict(peer.node.get_topic_names_and_types())
        assert '/clock' not in topics and '/tf' not in topics and '/joint_states' not in topics

        # who comes late gets the URDF of the one asked for, and the markers come at their own rate
        description = peer.listen('/left/robot_description', String, LATCHED)
        peer.until(lambda: description, 'the URDF')
        assert description[0].data == urdf(load_scene('slider_crank').mechanism, 'left/')
        stamps = [m.markers[0].header.stamp for m in markers]
        assert len(stamps) > 2
        apart = {
            round((b.sec - a.sec) * 1e3 + (b.nanosec - a.nanosec) * 1e-6)
            for a, b in zip(stamps[1:], stamps[2:], strict=False)
        }
        assert apart == {34}  # 17 ticks of 2 ms: the nearest to 30 Hz

        # a command and a pause reach one of them
        push = peer.talk('/left/simulator/wrench/crank', WrenchStamped)
        push.publish(wrench(torque=0.5, frame='left/crank'))
        # topics and services do not wait for each other: a pause may overtake the command
        peer.until(lambda: '1' in accepted('left/simulator: commands'), 'the command')
        assert peer.call(SetBool, '/left/simulator/pause', data=True).success
        count = len(joints['right'])
        peer.until(lambda: len(joints['right']) > count + 50, 'the other goes on')
        tasks = {'left/simulator: solver', 'right/simulator: solver'}
        peer.until(
            lambda: tasks <= {status.name for message in told for status in message.status},
            'diagnostics of both',
        )
        before = clocks['right'][-1].clock
        assert peer.call(Trigger, '/left/simulator/reset').success
        peer.until(lambda: clocks['right'][-1].clock != before, 'time of the other')
        times = [c.clock.sec * 10**9 + c.clock.nanosec for c in clocks['right']]
        assert times == sorted(times)
        assert left.stop() == 0 and right.stop() == 0
        assert 'second node' not in left.output + right.output

    def commands(node):
        log = read_log(node.logs[0])
        (topic,) = (topic for topic in log if topic.endswith('/inputs'))
        return [e for e in journal({'/simulator/inputs': log[topic]}) if e['kind'] == 'wrench']

    assert [entry['frame'] for entry in commands(left)] == ['body'] and commands(right) == []


@pytest.mark.parametrize(
    'renamed',
    [
        ['~/inputs:=/journal', '~/scene:=scene_text'],
        ['~/energy:=/E', '/diagnostics:=diag', 'joint_states:=/all'],
    ],
)
def test_a_log_of_remapped_topics_is_the_log_of_its_run(renamed, tmp_path):
    """Such logs were said to be not as written: the names of some topics were guessed."""
    remaps = [word for rule in ('__ns:=/left', *renamed) for word in ('-r', rule)]
    with SimulatorProcess(tmp_path, '--duration', '1.2', '--ros-args', *remaps) as node:
        assert node.wait() == 0, node.output
    log = load(node.logs[0].parent)
    assert log.node == '/left/simulator'
    targets = {rule.partition(':=')[2] for rule in renamed}
    names = {target if target[0] == '/' else f'/left/{target}' for target in targets}
    assert names <= log.survey.counts.keys()
    found = comparison.compare(log)
    assert found.equal and not found.faults, found
    assert 'solver' in gather(log).reports.levels
    child = load(fork(log, 0.5, {'crank.mass': '2'}, tmp_path / 'forks'))
    assert comparison.compare(child).equal
    assert child.inputs and child.topic('~/inputs') == log.topic('~/inputs')
