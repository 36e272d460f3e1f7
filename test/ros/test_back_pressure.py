"""Readers of a run and a replay as fast as possible: they lose nothing, or are named."""

import os
import signal
import subprocess
import sys
import time
from subprocess import DEVNULL

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from alf_ros.logs import load
from alf_ros.ros.reliable_readers import ReliableReaders
from alf_ros.ros.replay.sources import Recorded
from support.log_files import make
from support.paths import ROOT
from support.ros_node import SimulatorProcess

DEEP = QoSProfile(depth=10_000)
READER = """
import rclpy
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node('reader')
said = []
def heard(_):
    if not said:
        said.append(print('heard', flush=True))
node.create_subscription(JointState, 'joint_states', heard, 10)
rclpy.spin(node)
"""
ENVIRONMENT = {**os.environ, 'PYTHONPATH': str(ROOT)}


def stamps(heard):
    return [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in heard]


def test_a_reader_of_a_free_run_and_of_its_replay_loses_nothing(tmp_path, peer):
    heard = peer.listen('joint_states', JointState, DEEP)
    options = {'real_time_factor': 0.0, 'rate': 1000.0, 'solver.step': 1e-3, 'duration': 2.0}
    with SimulatorProcess(tmp_path, start_paused='true', **options).wait_running() as node:
        peer.until(lambda: heard, 'the state at the start')
        peer.call(SetBool, '/simulator/pause', data=False)
        peer.until(lambda: stamps(heard)[-1] == 2_000_000_000, 'the end')
        assert node.wait() == 0, node.output
    ticks = [stamp for stamp in dict.fromkeys(stamps(heard)) if stamp > 1]
    assert ticks == [k * 1_000_000 for k in range(1, 2001)]


def test_a_reader_of_a_replay_at_rate_0_loses_nothing(tmp_path, peer):
    path, _ = make(tmp_path, 'slider_crank', 2000)
    heard = peer.listen('/joint_states', JointState, DEEP)
    command = [sys.executable, '-m', 'alf_ros', 'replay', str(path.parent), '--paused']
    process = subprocess.Popen([*command, '--rate', '0'], env=ENVIRONMENT)
    try:
        peer.until(lambda: peer.node.count_publishers('/joint_states'), 'the replay')
        peer.call(SetBool, '/replay/pause', data=False)
        peer.until(lambda: len(heard) >= 2001, 'the end')
    finally:
        process.wait(60)
    assert len(heard) == 2001 and stamps(heard) == sorted(stamps(heard))


def test_queues_of_a_replay_hold_what_a_socket_does(tmp_path):
    """The middleware asks readers also after so many bytes. In a queue of a thousand messages they
    were waited for up to three seconds then, each time: rate 0 was slower than the run."""
    path, _ = make(tmp_path, 'slider_crank', 100)
    source = Recorded(load(path.parent))
    sizes = [len(item.data) for item in source.items(0) if item.topic == '/joint_states']
    _, qos = source.topics['/joint_states']
    assert 1 << 15 < qos.depth * max(sizes) < 1 << 16


def test_a_reader_of_a_replay_that_stands_still_is_named(tmp_path):
    """The replay continues without it, and a signal ends it."""
    path, _ = make(tmp_path, 'slider_crank', 500)
    reader = subprocess.Popen(
        [sys.executable, '-c', READER], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )
    command = [
        sys.executable,
        '-m',
        'alf_ros',
        'replay',
        str(path.parent),
        '--rate',
        '0',
        '--loop',
    ]
    replay = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
    try:
        assert reader.stdout is not None and reader.stdout.readline() == 'heard\n'
        os.kill(reader.pid, signal.SIGSTOP)
        assert replay.stdout is not None
        assert replay.stdout.readline().startswith('replay of')
        named = 'readers lose messages of /joint_states: they do not follow\n'
        assert replay.stdout.readline() == named
        replay.send_signal(signal.SIGINT)
        assert replay.wait(60) == 0
        assert replay.stdout.read().startswith('stopped at')  # it was said once
    finally:
        replay.kill()
        replay.wait()
        os.kill(reader.pid, signal.SIGCONT)
        reader.kill()
        reader.wait()


def test_a_reader_that_stands_still_is_named(tmp_path, peer):
    reports = peer.listen('/diagnostics', DiagnosticArray, DEEP)
    reader = subprocess.Popen(
        [sys.executable, '-c', READER], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )
    try:
        options = {'real_time_factor': 0.0, 'rate': 1000.0, 'solver.step': 1e-3}
        with SimulatorProcess(tmp_path, '--no-record', **options).wait_running():
            assert reader.stdout is not None and reader.stdout.readline() == 'heard\n'
            os.kill(reader.pid, signal.SIGSTOP)

            def named():
                return any(
                    status.name.endswith(': timing')
                    and status.message == 'readers lose messages of joint_states'
                    for report in reports
                    for status in report.status
                )

            peer.until(named, 'the name of the reader')
    finally:
        os.kill(reader.pid, signal.SIGCONT)
        reader.kill()
        reader.wait()


class Watched:
    """A publisher that counts how often its readers were waited for."""

    def __init__(self, publisher):
        self._publisher, self.waits = publisher, 0

    def wait_for_all_acked(self, duration):
        self.waits += duration.nanoseconds > 0
        return self._publisher.wait_for_all_acked(duration)


def publish(publisher, readers, count, hold):
    for _ in range(count):
        readers.await_room(hold)
        publisher.publish(JointState())
        readers.note(hold)


@pytest.fixture
def publisher(peer):
    """With a reader in another process."""
    reader = subprocess.Popen([sys.executable, '-c', READER], env=ENVIRONMENT, stdout=DEVNULL)
    try:
        publisher = peer.node.create_publisher(JointState, 'joint_states', 10)
        peer.until(publisher.get_subscription_count, 'the reader')
        yield publisher
    finally:
        reader.kill()
        reader.wait()


def test_a_step_behind_a_pause_does_not_wait_for_what_was_read_before(publisher):
    """Readers tell every few seconds only what they have of a steady stream: the node stood still
    until then."""
    watched = Watched(publisher)
    readers = ReliableReaders(watched, 10)
    for _ in range(3):
        publish(publisher, readers, 35, hold=False)
        publish(publisher, readers, 1, hold=True)
    assert watched.waits == 0


def test_readers_that_told_by_themselves_are_not_waited_for(peer, publisher):
    """Steps of a few ticks with pauses between them took up to three seconds for each topic: the
    readers had told of some messages already, and are not asked for so few."""
    watched = Watched(publisher)
    readers = ReliableReaders(watched, 10)
    for count in (10, 7, 7):
        publish(publisher, readers, count, hold=True)
        peer.until(lambda: publisher.wait_for_all_acked(Duration()), 'the word of the reader')
        time.sleep(0.02)  # so long that readers are looked at
    assert watched.waits == 0
