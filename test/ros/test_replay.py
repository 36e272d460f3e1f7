"""`replay` as another process: what it publishes, against the log; pause, rate, seek, loop."""

import os
import re
import signal
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.ros.recording.recorder import Split
from alf_ros.ros.replay import replay_node
from alf_ros.ros.replay.replay_node import Replay
from alf_ros.ros.replay.sources import Recorded
from alf_ros.ros.terminal import StatusLine
from support.forked import started
from support.log_files import make, read_by_others
from support.paths import ROOT
from support.ros_node import LIMIT, START_LIMIT

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    """1 s of slider-crank with a push at 0.198 s."""
    path, _ = make(tmp_path_factory.mktemp('log'), 'slider_crank', 500)
    return load(path.parent)


class Replayed:
    """The command `replay` in a process of its own, paused at first."""

    def __init__(self, peer, log, *options):
        self.peer, self.options = peer, options
        self.heard = peer.listen('/joint_states', JointState)
        self.clock = peer.listen('/clock', Clock, LOSSY)
        self.inputs = peer.listen('/simulator/inputs', String)
        self.scene = peer.listen('/simulator/scene', String, LATCHED)
        command = ['-m', 'alf_ros', 'replay', str(log.path), '--paused', *options]
        environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
        reader, writer = os.pipe()
        self.said = open(reader)
        with open(writer, 'w') as output:
            self.process = started(command, ROOT, environment, output)

    def __enter__(self):
        names = ('/joint_states', '/clock', '/simulator/inputs', '/simulator/scene')

        def matched():
            assert self.process.poll() is None, self.said.read()
            return all(map(self.peer.node.count_publishers, names))

        self.peer.until(matched, 'the topics', START_LIMIT)
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.said.close()

    def play(self, on=True):
        answer = self.peer.call(SetBool, '/replay/pause', data=not on)
        assert answer.success
        return answer.message

    def set_to(self, name, value, kind=ParameterType.PARAMETER_DOUBLE):
        field = 'double_value' if kind == ParameterType.PARAMETER_DOUBLE else 'integer_value'
        parameter = Parameter(name=name, value=ParameterValue(type=kind, **{field: value}))
        answer = self.peer.call(SetParameters, '/replay/set_parameters', parameters=[parameter])
        return answer.results[0]

    @property
    def stamps(self):
        return [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in self.heard]

    def wait(self):
        self.peer.until(lambda: self.process.poll() is not None, 'the end', LIMIT)
        return self.process.returncode


def check_heard(replayed, log):
    """The received messages equal the messages in the log, to the last bit."""
    series = log.read('joint_states')
    assert replayed.stamps == series.stamp.tolist()
    for key, column in series.columns.items():
        heard = np.array([getattr(message, key) for message in replayed.heard])
        assert heard.tobytes() == column.tobytes(), key
    ticks = [m.clock.sec * 10**9 + m.clock.nanosec for m in replayed.clock]
    assert ticks == sorted(ticks) and set(ticks) <= set(series.stamp.tolist())
    assert len(ticks) > 0.9 * len(series)
    assert [message.data for message in replayed.scene] == [log.scene_text]


@pytest.mark.parametrize('options', [[], ['--redrive']])
def test_everything_comes_again(peer, log, options):
    slowly = ('--rate', '0.25')  # in real time a busy reader loses messages, as any does
    with Replayed(peer, log, *options, *slowly) as replayed:
        assert replayed.play().startswith('playing at t = 0 s')
        assert replayed.wait() == 0
        peer.until(lambda: len(replayed.heard) == 501, 'the last of them')
        said = replayed.said.read()
    check_heard(replayed, log)
    others = read_by_others(log.files[0])['/simulator/inputs']
    assert [m.data for m in replayed.inputs] == [message.data for _, message in others]
    count = sum(log.survey.counts.values())
    assert f'stopped at t = 1 s, {count} messages' in said and 'Traceback' not in said


def test_it_pauses_seeks_changes_its_rate_and_loops(peer, log):
    with Replayed(peer, log, '--loop', '--rate', '0.02', '--start', '0.6') as replayed:
        heard = replayed.heard
        replayed.play()
        peer.until(lambda: len(heard) > 20, 'motion')
        assert replayed.stamps[0] == 600_000_000
        (paused,) = re.findall(r'^paused at t = ([\d.]+) s', replayed.play(False))
        assert 0.6 < float(paused) < 1.0
        peer.until(lambda: True, '')
        count = len(heard)
        assert replayed.set_to('seek', 0.1).successful
        assert replayed.set_to('rate', 0.5).successful  # a busy reader loses none
        assert len(heard) - count < 10  # what was under way
        replayed.play()
        peer.until(lambda: 100_000_000 in replayed.stamps, 'the place')
        at = replayed.stamps.index(100_000_000)
        assert all(stamp > 600_000_000 for stamp in replayed.stamps[1:at])
        peer.until(lambda: 1 in replayed.stamps, 'the beginning again')
        again = replayed.stamps.index(1)
        assert replayed.stamps[again - 1] == 1_000_000_000
        peer.until(lambda: len(heard) > again + 10, 'motion')
        tail = replayed.stamps[again : again + 10]
        assert tail == log.read('joint_states').stamp[:10].tolist()
        for name, value in (('seek', 1.5), ('seek', -1.0), ('rate', -1.0)):
            result = replayed.set_to(name, value)
            assert not result.successful and result.reason
        assert replayed.set_to('rate', 2, ParameterType.PARAMETER_INTEGER).successful
        for name, said in (('rat', "did you mean 'rate'"), ('loop', 'expected true or false')):
            result = replayed.set_to(name, 1.0)
            assert not result.successful and said in result.reason
        os.killpg(replayed.process.pid, signal.SIGINT)
        assert replayed.wait() == 0


@pytest.fixture
def by_hand(peer, log, monkeypatch):
    """The node in this process, a tick each two seconds, and a function that lets time go by."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(replay_node, 'time', SimpleNamespace(monotonic=lambda: clock.now))
    given = [rclpy.parameter.Parameter('rate', value=0.001)]
    node = Replay(log, Recorded(log), given, StatusLine(enabled=False))
    peer.executor.add_node(node)

    def pass_by(seconds):
        clock.now += seconds
        node.work()
        return round(node.t * 500)  # of the last tick

    yield node, pass_by
    peer.executor.remove_node(node)
    node.destroy_node()


def pause(peer, on):
    return peer.call(SetBool, '/replay/pause', data=on).message


def test_requests_more_often_than_messages_do_not_hold_it(peer, by_hand):
    node, pass_by = by_hand
    assert pass_by(0.0) == 0
    for _ in range(5):
        assert pause(peer, False).startswith('playing')
        tick = pass_by(0.5)
    assert tick == 1  # after 2.5 s
    for n in range(4):
        node.set_parameters([rclpy.parameter.Parameter('rate', value=0.001 + n * 1e-6)])
        tick = pass_by(0.5)
    assert tick == 2  # after 4.5 s


def test_a_pause_takes_no_time_away_and_adds_none(peer, by_hand):
    _, pass_by = by_hand
    for n in range(5):
        assert pass_by(1.2) == (n + 1) * 12 // 20
        assert pause(peer, True).startswith('paused')
        assert pass_by(7.0) == (n + 1) * 12 // 20
        pause(peer, True)
        pause(peer, False)


def test_what_is_late_at_a_pause_comes_in_no_burst(peer, by_hand):
    node, pass_by = by_hand
    pass_by(0.0)
    pass_by(1e3)  # as far as one call comes
    late = round(node.t * 500)
    assert 0 < late < 500
    pause(peer, True)
    pause(peer, False)
    assert pass_by(0.0) <= late + 1
    assert pass_by(2.1) <= late + 2


@pytest.mark.parametrize('options', [[], ['--redrive'], ['--rate', '0']])
def test_a_log_of_one_instant_comes_ten_times_a_second(options, peer, tmp_path):
    path, _ = make(tmp_path, 'slider_crank', 0)
    with Replayed(peer, load(path.parent), '--loop', *options) as replayed:
        begin = time.monotonic()
        replayed.play()
        peer.until(lambda: len(replayed.heard) > 4, 'five of them')
        assert time.monotonic() - begin >= 0.1 * (len(replayed.heard) - 1)
        assert set(replayed.stamps) == {1}
        os.killpg(replayed.process.pid, signal.SIGINT)
        assert replayed.wait() == 0


def test_a_redriven_log_begins_where_it_is_asked_to(peer, log):
    with Replayed(peer, log, '--redrive', '--start', '0.5') as replayed:
        replayed.play()
        assert replayed.wait() == 0
        peer.until(lambda: replayed.stamps[-1:] == [1_000_000_000], 'the last of them')
    series = log.read('joint_states')
    assert replayed.stamps == series.stamp[250:].tolist()
    heard = np.array([message.position for message in replayed.heard])
    assert heard.tobytes() == series.columns['position'][250:].tobytes()


def test_raw_bytes_are_those_of_the_log(peer, log):
    raw: list[Any] = []
    peer.node.create_subscription(
        JointState, '/joint_states', raw.append, QoSProfile(depth=1000), raw=True
    )
    with Replayed(peer, log) as replayed:
        replayed.play()
        assert replayed.wait() == 0
        peer.until(lambda: len(raw) == len(replayed.heard) == 501, 'all')
    assert [deserialize_message(data, JointState) for data in raw] == replayed.heard


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--start', '7'], '--start: bad value'),
        (['--rate', '-1'], 'rate'),
        (['--what'], '--what'),
        (['--trust'], '--trust: has no meaning without --redrive'),
        (['--ros-args', '-p', 'rat:=0.5'], "'rat'; did you mean 'rate'"),
    ],
)
def test_what_cannot_be_is_one_line(log, options, said, capsys):
    assert main(['replay', str(log.path), *options]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.strip().splitlines()) == 1


@pytest.mark.parametrize('options', [[], ['--redrive']])
def test_a_file_that_is_not_there_is_said(options, tmp_path, capsys):
    """Before the topics, so also if the node cannot start."""
    path, _ = make(tmp_path, 'slider_crank', 400, split=Split(duration=0.2))
    sorted(path.parent.glob('*.mcap'))[-1].unlink()
    assert main(['replay', str(path.parent), '--start', '7', *options]) == 2
    said = 'the log is not whole: it is the run until t = 0.6 s (1 of its 4 files are not there)'
    assert capsys.readouterr().err.splitlines()[0] == f'alf_ros replay: {said}'
