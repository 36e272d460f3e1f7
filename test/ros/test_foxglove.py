"""Foxglove gets the simulator's messages, and only on the topics that it subscribes to."""

import base64
import json
import os
import re
import socket
import struct
from typing import Any

import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from support.paths import ROOT
from support.ros_node import LIMIT, Diagnostics, SimulatorProcess
from support.view_process import ViewProcess, view

LAYOUT = json.loads((ROOT / 'config/foxglove/simulator.json').read_text('utf-8'))


class Socket:
    """A client of a websocket: text frames as mappings, binary ones as bytes."""

    def __init__(self, port, protocol):
        self._socket = socket.create_connection(('127.0.0.1', port), LIMIT)
        self._file = self._socket.makefile('rb')
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            'GET / HTTP/1.1',
            f'Host: 127.0.0.1:{port}',
            'Upgrade: websocket',
            'Connection: Upgrade',
            f'Sec-WebSocket-Key: {key}',
            'Sec-WebSocket-Version: 13',
            f'Sec-WebSocket-Protocol: {protocol}',
        ]
        self._socket.sendall('\r\n'.join([*lines, '', '']).encode())
        assert b'101' in self._file.readline()
        while self._file.readline().strip():
            pass

    def close(self):
        self._file.close()
        self._socket.close()

    def send(self, message):
        data = json.dumps(message).encode()
        # the mask of zeros leaves the data as it is
        self._socket.sendall(struct.pack('>BBH4x', 0x81, 0xFE, len(data)) + data)

    def receive(self):
        kind, size = self._file.read(2)
        if size == 126:
            (size,) = struct.unpack('>H', self._file.read(2))
        elif size == 127:
            (size,) = struct.unpack('>Q', self._file.read(8))
        data = self._file.read(size)
        return json.loads(data) if kind & 0xF == 1 else data

    def until(self, wanted):
        """The first frame for which `wanted(frame)` is true."""
        for _ in range(5000):
            if wanted(frame := self.receive()):
                return frame
        raise AssertionError('not among 5000 frames')


def operation(name):
    return lambda frame: isinstance(frame, dict) and frame['op'] == name


def data_of(subscription):
    """Message data: 1, the subscription, the time in ns, the message."""
    return lambda frame: (
        isinstance(frame, bytes) and frame[:5] == struct.pack('<BI', 1, subscription)
    )


def test_messages_are_those_of_the_simulator(tmp_path, peer):
    pytest.importorskip('foxglove', reason='pip install -r requirements/view.txt')
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path).wait_running(), ViewProcess('--foxglove', '0') as process:
        port = int(process.said.readline().rpartition(':')[2])
        client = Socket(port, 'foxglove.sdk.v1')
        assert client.until(operation('serverInfo'))['capabilities'] == ['time']
        channels: dict[str, Any] = {}
        while not {'/joint_states', '/simulator/markers', '/diagnostics'} <= set(channels):
            for channel in client.until(operation('advertise'))['channels']:
                channels[channel['topic']] = channel
        used = set(re.findall(r'"(/[\w/]+)', json.dumps(LAYOUT['configById'])))
        assert used <= set(channels)
        joints = channels['/joint_states']
        assert (joints['encoding'], joints['schemaName']) == ('cdr', 'sensor_msgs/msg/JointState')
        assert joints['schemaEncoding'] == 'ros2msg'

        def readers(topic):
            infos = peer.node.get_subscriptions_info_by_topic(topic)
            return [info for info in infos if info.node_name == 'view_foxglove']

        # nothing is asked of the simulator before somebody in Foxglove asks
        peer.until(lambda: readers('/simulator/scene'), 'the bridge on the graph')
        assert not readers('/simulator/markers') and not readers('/clock')
        wanted = [channels[name]['id'] for name in ('/joint_states', '/simulator/markers')]
        numbers = [{'id': n + 1, 'channelId': channel} for n, channel in enumerate(wanted)]
        client.send({'op': 'subscribe', 'subscriptions': numbers})
        frame = client.until(data_of(1))
        message = deserialize_message(frame[13:], JointState)
        assert list(message.name) == ['crank_pin', 'knee', 'guide']
        (at,) = struct.unpack_from('<Q', frame, 5)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        # the simulated time, up to the clock's last message
        assert abs(at - stamp) < 10**9
        drawn = deserialize_message(client.until(data_of(2))[13:], MarkerArray)
        assert {marker.ns for marker in drawn.markers} >= {'links', 'joints', 'reactions'}

        # a run that begins anew is another session
        assert peer.call(Trigger, '/simulator/reset').success
        client.until(operation('serverInfo'))
        client.send({'op': 'unsubscribe', 'subscriptionIds': [1, 2]})
        peer.until(lambda: not readers('/simulator/markers'), 'no subscription')
        peer.until(lambda: not readers('/clock'), 'no clock')
        client.close()
        peer.until(lambda: found.value('solver', 'state') == 'playing', 'the simulator goes on')
        assert process.stop() == 0


def test_a_port_that_is_taken_is_one_line():
    pytest.importorskip('foxglove', reason='pip install -r requirements/view.txt')
    with socket.create_server(('127.0.0.1', 0)) as taken:
        done = view('--port', '0', '--foxglove', str(taken.getsockname()[1]))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith('alf_ros view: --foxglove: ')


def test_every_panel_of_the_layout_stands_once():
    def panels(part):
        if isinstance(part, str):
            return [part]
        return panels(part['first']) + panels(part['second'])

    found = panels(LAYOUT['layout'])
    assert sorted(found) == sorted(LAYOUT['configById'])
