"""What node tests share: the simulator in its own process, a peer in this one, reading logs."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.reader import read_ros2_messages
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSProfile

ROOT = Path(__file__).resolve().parents[1]
# A cold cache makes the node compile for most of a minute; everything after that is quick.
START_LIMIT = 180.0
# Only what fails waits that long.
LIMIT = 30.0


class SimulatorProcess:
    """`python -m alf_ros simulator` in a session of its own, logging below `folder`."""

    def __init__(self, folder, *options, **parameters):
        self.folder = Path(folder)
        arguments = ['--log-folder', str(self.folder), *options]
        if parameters:
            arguments.append('--ros-args')
            for name, value in parameters.items():
                arguments += ['-p', f'{name.replace("__", ".")}:={value}']
        self.output_path = self.folder / 'output.txt'
        self.folder.mkdir(parents=True, exist_ok=True)
        # A sourced ROS 2 is on PYTHONPATH too.
        paths = [str(ROOT), os.environ.get('PYTHONPATH', '')]
        with open(self.output_path, 'w') as output:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'alf_ros', 'simulator', *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=self.folder,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, paths))},
                start_new_session=True,
            )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.stop()

    @property
    def output(self):
        return self.output_path.read_text()

    def wait_running(self):
        """Wait until the node says that it runs."""
        end = time.monotonic() + START_LIMIT
        while 'running:' not in self.output:
            assert self.process.poll() is None, self.output
            assert time.monotonic() < end, f'did not start: {self.output}'
            time.sleep(0.02)
        return self

    def wait(self, limit=START_LIMIT):
        """Wait for the end; returns the exit code."""
        try:
            return self.process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise AssertionError(f'did not end: {self.output}') from None

    def stop(self, number=signal.SIGINT):
        """Send a signal to the session and return the exit code."""
        os.killpg(self.process.pid, number)
        return self.wait(LIMIT)

    @property
    def logs(self):
        """Log files, oldest first."""
        return sorted(self.folder.glob('*/*.mcap'), key=lambda path: path.stat().st_ctime_ns)


class Peer:
    """A node in this process, as any other program on the graph."""

    def __init__(self):
        rclpy.init()
        self.node = rclpy.create_node('peer')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def until(self, condition, what, limit=LIMIT):
        """Spin until `condition()` is true and return what it gave; fail after `limit` seconds.

        A condition may look at the last message of a topic before there is one, or ask for a node
        that is not found yet: it does not hold then.
        """

        def holds():
            try:
                return condition()
            except (IndexError, NodeNameNonExistentError):
                return None

        end = time.monotonic() + limit
        while not (value := holds()):
            assert time.monotonic() < end, f'not within {limit} s: {what}'
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def listen(self, topic, kind, qos=None):
        """A list that grows with every message on `topic`."""
        heard = []
        self.node.create_subscription(kind, topic, heard.append, qos or QoSProfile(depth=1000))
        return heard

    def talk(self, topic, kind):
        """A publisher that the simulator has found."""
        publisher = self.node.create_publisher(kind, topic, 10)
        self.until(publisher.get_subscription_count, f'a subscription to {topic}')
        return publisher

    def call(self, kind, service, **request):
        """Call a service, once, and return its response."""
        client = self.client(kind, service)
        asked = client.call_async(kind.Request(**request))
        self.until(asked.done, f'an answer of {service}')
        self.node.destroy_client(client)
        return asked.result()

    def client(self, kind, service):
        """A client that its server knows.

        A server carries a request out and then drops its answer if it has not discovered the
        client by then, which happens on a busy machine. Clients are announced in order: a server
        that answers a younger one knows this one. The younger one asks for no parameters, which
        may be asked again.
        """
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f'the service {service}')
        parameters = f'{service.rpartition("/")[0]}/get_parameters'
        younger = self.node.create_client(GetParameters, parameters)
        self.until(younger.service_is_ready, f'the service {parameters}')
        began, asked = time.monotonic(), []

        def answered():
            if time.monotonic() >= began + len(asked):
                asked.append(younger.call_async(GetParameters.Request()))
            return any(future.done() for future in asked)

        self.until(answered, f'an answer of {parameters}')
        self.node.destroy_client(younger)
        return client


class Diagnostics:
    """The latest status of each task."""

    def __init__(self, peer):
        self.heard = peer.listen('/diagnostics', DiagnosticArray)

    def status(self, task):
        """(level, message, values by key) of the latest report of `task`, or None."""
        for status in self.heard[-1].status if self.heard else ():
            if status.name == f'simulator: {task}':
                values = {entry.key: entry.value for entry in status.values}
                return status.level, status.message, values
        return None

    def value(self, task, key):
        status = self.status(task)
        return status[2][key] if status else None


def wrench(x=0.0, y=0.0, torque=0.0, frame='', **rest):
    """A WrenchStamped; `rest` sets any other component: forcez=1.0."""
    message = WrenchStamped()
    message.header.frame_id = frame
    message.wrench.force.x, message.wrench.force.y = x, y
    message.wrench.torque.z = torque
    for name, value in rest.items():
        setattr(getattr(message.wrench, name[:-1]), name[-1], value)
    return message


def read_log(path):
    """Messages of a log by topic: lists of (log time in ns, message)."""
    found = {}
    for message in read_ros2_messages(str(path)):
        found.setdefault(message.channel.topic, []).append((message.log_time_ns, message.ros_msg))
    return found


def read_cut_log(path):
    """What a log that is still being written holds by now."""
    found, channels, schemas = {'/simulator/inputs': []}, {}, {}
    factory = DecoderFactory()
    with open(path, 'rb') as stream:
        try:
            for record in StreamReader(stream).records:
                kind = type(record).__name__
                if kind == 'Schema':
                    schemas[record.id] = record
                elif kind == 'Channel':
                    channels[record.id] = record
                elif kind == 'Message':
                    channel = channels[record.channel_id]
                    decode = factory.decoder_for('cdr', schemas[channel.schema_id])
                    message = (record.log_time, decode(record.data))
                    found.setdefault(channel.topic, []).append(message)
        except Exception as cut:
            assert 'Unexpected' in f'{cut}' or 'EndOfFile' in type(cut).__name__, cut
    return found


def journal(log):
    """The entries of ~/inputs."""
    return [json.loads(message.data) for _, message in log['/simulator/inputs']]
