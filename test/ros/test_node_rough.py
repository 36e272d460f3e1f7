"""Rough handling: floods, a reader that hangs, resets at any time, signals at any time."""

import os
import random
import re
import signal
import struct
import subprocess
import sys
import time

import pytest
from geometry_msgs.msg import WrenchStamped
from mcap.reader import make_reader
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from support.journal_run import repeat
from support.ros_node import (
    Diagnostics,
    NewSimulatorProcess,
    SimulatorProcess,
    journal,
    read_log,
    wrench,
)
from support.thorough import combined, thinned

BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
READER = """
import rclpy, sys
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node('reader')
heard = lambda message: print('heard', flush=True)
node.create_subscription(JointState, 'joint_states', heard, 1000)
rclpy.spin(node)
"""


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def check_whole(path):
    """The log has its end, and no tick is missing. Returns the stamps of its states."""
    with open(path, 'rb') as stream:
        assert make_reader(stream).get_summary().statistics.message_count > 0
    assert (path.parent / 'metadata.yaml').is_file()
    stamps = [stamp for stamp, _ in read_log(path)['/joint_states']]
    assert stamps == [1] + [2_000_000 * k for k in range(1, len(stamps))]
    return stamps


def test_a_flood_of_commands_stops_neither_the_clock_nor_a_command(tmp_path, peer):
    clock = peer.listen('/clock', Clock, BEST_EFFORT)
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path).wait_running() as node:
        push = peer.talk('/simulator/wrench/crank', WrenchStamped)
        joints = peer.talk('joint_commands', JointState)
        peer.until(lambda: clock and found.heard, 'time')
        # every torque is another one: it stands in the last eight bytes
        command = bytes(serialize_message(wrench()))[:-8]
        effort = serialize_message(JointState(name=['knee'], effort=[0.01]))
        started, first, sent = time.monotonic(), ns(clock[-1].clock), 0
        # 10 kHz, as far as one core sends that
        while (now := time.monotonic()) - started < 1.0:
            while sent < 10_000 * (now - started):
                push.publish(command + struct.pack('<d', 1e-6 * sent))
                joints.publish(effort)
                sent += 2
        assert sent > 1_000
        # what a full buffer of the system has dropped is sent again after seconds
        assert push.wait_for_all_acked(Duration(seconds=60))
        peer.until(lambda: int(found.value('commands', 'accepted')) > 100, 'commands taken')
        assert peer.call(Trigger, '/simulator/save_state').success
        count = len(found.heard)
        peer.until(lambda: len(found.heard) > count + 1, 'diagnostics after the flood')
        # how far the clock comes meanwhile is the machine's matter: it goes on, and so do commands
        assert ns(clock[-1].clock) > first
        accepted, refused = (int(found.value('commands', k)) for k in ('accepted', 'refused'))
        assert node.stop() == 0, node.output
    check_whole(node.logs[0])
    log = read_log(node.logs[0])
    entries = journal(log)[1:]
    # at many steps, not all at the end: how many is the machine's matter, too
    assert len({entry['step'] for entry in entries}) > 3
    # what acts was sent, in the order in which it was sent, and the last one acts in the end
    torques = [round(1e6 * entry['torque']) for entry in entries if entry['kind'] == 'wrench']
    assert torques == sorted(set(torques)) and set(torques) <= set(range(0, sent, 2))
    assert torques[-1] == sent - 2
    assert len(entries) <= accepted <= sent and refused == 0
    repeated = repeat(log)
    for stamp, state in log['/joint_states']:
        assert list(state.position) == repeated[stamp]


def test_a_reader_that_hangs_does_not_stop_the_clock(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    reader = subprocess.Popen([sys.executable, '-c', READER], stdout=subprocess.PIPE)
    try:
        with SimulatorProcess(tmp_path).wait_running() as node:
            assert reader.stdout.readline() == b'heard\n'
            os.kill(reader.pid, signal.SIGSTOP)
            peer.until(lambda: heard, 'motion')
            first = ns(heard[-1].header.stamp)
            # more than its queue and the socket's buffer hold
            peer.until(lambda: ns(heard[-1].header.stamp) - first > 3 * 10**9, '3 s of motion')
            assert node.stop() == 0, node.output
    finally:
        reader.kill()
        reader.wait()
        reader.stdout.close()
    check_whole(node.logs[0])


def test_resets_at_any_time_leave_whole_logs(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    chance = random.Random(20)
    with SimulatorProcess(tmp_path).wait_running() as node:
        for _ in range(6):
            count, more = len(heard), chance.randrange(1, 60)
            peer.until(lambda count=count, more=more: len(heard) >= count + more, 'motion')
            assert peer.call(Trigger, '/simulator/reset').success
        assert node.stop() == 0, node.output
    # a call that is answered too late on a busy machine is made again
    assert len(node.logs) >= 7
    states = [read_log(path)['/joint_states'] for path in node.logs]
    shortest = min(len(check_whole(path)) for path in node.logs)
    for log in states:
        # every run is the same run
        for (_, message), (_, first) in zip(log[:shortest], states[0][:shortest], strict=True):
            assert list(message.position) == list(first.position)


# ALF_ROS_SIGNALS=25 makes fifty of the six.
@pytest.mark.parametrize(
    ('seed', 'number'),
    combined(
        range(int(os.environ.get('ALF_ROS_SIGNALS', '3'))),
        [signal.SIGINT, signal.SIGTERM, signal.SIGHUP],
    ),
)
def test_a_signal_at_any_instant_leaves_a_whole_log(tmp_path, number, seed):
    # real_time_factor 0: there is always a tick under way
    factor = 1.0 if seed % 3 == 0 else 0.0
    with SimulatorProcess(tmp_path, real_time_factor=factor).wait_running() as node:
        time.sleep(random.Random(seed + 10 * number).uniform(0.0, 0.4))
        os.killpg(node.process.pid, number)
        assert node.stop(number) == 0, node.output  # impatient: once more
    assert 'Traceback' not in node.output
    check_whole(node.logs[0])


@pytest.mark.parametrize(
    'number', thinned([signal.SIGINT, signal.SIGTERM, signal.SIGHUP], keep=[signal.SIGTERM])
)
def test_a_signal_while_it_prepares_ends_it_without_a_word(tmp_path, number):
    with NewSimulatorProcess(tmp_path) as node:
        while 'preparing' not in node.output:
            assert node.process.poll() is None
            time.sleep(0.001)
        assert node.stop(number) == 0
    assert 'Traceback' not in node.output
    assert all(path.stat().st_size for path in node.logs)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_tick_of_an_hour(tmp_path, number):
    """After a whole step of it; the log is whole up to the tick before."""
    options = {'solver__step': 1e-6, 'rate': 0.001, 'real_time_factor': 0.0}
    with SimulatorProcess(tmp_path, **options).wait_running() as node:
        time.sleep(0.5)
        assert node.stop(number) == 0, node.output
    assert 'Traceback' not in node.output and 'failed' not in node.output
    check_whole(node.logs[0])
    t, step = re.search(r'stopped at t = (\S+) s, step (\d+)', node.output).groups()
    assert float(t) == pytest.approx(int(step) * 1e-6, rel=1e-8)
