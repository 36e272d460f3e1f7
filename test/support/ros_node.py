"""Shared parts of node tests: the simulator in its own process, a peer in this one, readers."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.reader import read_ros2_messages
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSProfile

from alf_ros.ros import unborn_ports
from support.forked import Process, started
from support.paths import ROOT

T = TypeVar('T')
# by topic: times in ns, messages
Messages = dict[str, list[tuple[int, Any]]]
# A cold cache makes the node compile for most of a minute; everything after that is quick.
START_LIMIT = 180.0
# Only what fails waits that long.
LIMIT = 120.0


def stacks(process: Process) -> str:
    """End a process, which writes to its output where each of its threads stands; what to look for
    there. Needs `SPEAKS` in its environment."""
    os.kill(process.pid, signal.SIGABRT)
    process.wait(LIMIT)
    return 'did not start; where its threads stood:'


SPEAKS = {'PYTHONFAULTHANDLER': '1'}


def own_lines(stderr: str) -> list[str]:
    """The lines that a process wrote, without those that Fast DDS adds on its own: it reports the
    ports that a killed process has left locked."""
    return [line for line in stderr.splitlines() if 'RTPS_' not in line]


class SimulatorProcess:
    """`python -m alf_ros simulator` in a session of its own, logging below `folder`."""

    imports = False  # whether it imports the package itself

    def __init__(self, folder: Path | str, *options: str, **parameters: object) -> None:
        self.folder = Path(folder)
        logging = [] if '--log-folder' in options else ['--log-folder', str(self.folder)]
        arguments = [*logging, *options]
        if parameters:
            arguments.append('--ros-args')
            for name, value in parameters.items():
                arguments += ['-p', f'{name.replace("__", ".")}:={value}']
        self.output_path = self.folder / 'output.txt'
        self.folder.mkdir(parents=True, exist_ok=True)
        # A sourced ROS 2 is on PYTHONPATH too.
        paths = [str(ROOT), os.environ.get('PYTHONPATH', '')]
        with open(self.output_path, 'w') as output:
            self.process = started(
                ['-m', 'alf_ros', 'simulator', *arguments],
                self.folder,
                {**os.environ, **SPEAKS, 'PYTHONPATH': os.pathsep.join(filter(None, paths))},
                output,
                new=self.imports,
            )

    def __enter__(self) -> SimulatorProcess:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.stop()

    @property
    def output(self) -> str:
        return self.output_path.read_text()

    def wait_running(self) -> SimulatorProcess:
        """Wait until the node says that it runs."""
        end = time.monotonic() + START_LIMIT
        while 'running:' not in self.output:
            assert self.process.poll() is None, self.output
            assert time.monotonic() < end, stacks(self.process) + self.output
            time.sleep(0.02)
        return self

    def wait(self, limit: float = START_LIMIT) -> int:
        """Wait for the end; returns the exit code."""
        try:
            return self.process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise AssertionError(f'did not end: {self.output}') from None

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal to the session and return the exit code."""
        os.killpg(self.process.pid, number)
        return self.wait(LIMIT)

    @property
    def logs(self) -> list[Path]:
        """Log files, oldest first."""
        return sorted(self.folder.glob('*/*.mcap'), key=lambda path: path.stat().st_ctime_ns)


class NewSimulatorProcess(SimulatorProcess):
    """The same, as a shell starts it."""

    imports = True


class Peer:
    """A node in this process, as any other program on the graph."""

    def __init__(self) -> None:
        unborn_ports.remove()
        rclpy.init()
        self.node = rclpy.create_node('peer')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def until(self, condition: Callable[[], T], what: str, limit: float = LIMIT) -> T:
        """Spin until `condition()` is true and return what it gave; fail after `limit` seconds.

        A condition may look at the last message of a topic before there is one, or ask for a node
        that is not found yet: it does not hold then.
        """

        def holds() -> T | None:
            try:
                return condition()
            except (IndexError, NodeNameNonExistentError):
                return None

        end = time.monotonic() + limit
        while not (value := holds()):
            assert time.monotonic() < end, f'not within {limit} s: {what}'
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def listen(self, topic: str, kind: type, qos: QoSProfile | None = None) -> list[Any]:
        """A list that grows with every message on `topic`."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, qos or QoSProfile(depth=1000))
        return heard

    def talk(self, topic: str, kind: type) -> Any:
        """A publisher that the simulator has found."""
        publisher = self.node.create_publisher(kind, topic, 10)
        self.until(publisher.get_subscription_count, f'a subscription to {topic}')
        return publisher

    def call(self, kind: Any, service: str, **request: Any) -> Any:
        """Call a service, once, and return its response."""
        client = self.client(kind, service)
        asked = client.call_async(kind.Request(**request))
        self.until(asked.done, f'an answer of {service}')
        self.node.destroy_client(client)
        return asked.result()

    def client(self, kind: Any, service: str) -> Any:
        """A client that its server knows: else it carries a request out and drops its answer."""
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f'the service {service}')
        self.known_to(service.rpartition('/')[0])
        return client

    def known_to(self, node: str) -> None:
        """Wait until `node` has found every client, reader and publisher made here so far.

        That a node is found here does not say that it has found these: on a busy machine it
        publishes a message before it knows of a reader, who misses it then. They are announced in
        order: a node that answers the youngest client knows all the others. It is asked for no
        parameters, which may be asked again until an answer comes.
        """
        service = f'{node}/get_parameters'
        youngest = self.node.create_client(GetParameters, service)
        self.until(youngest.service_is_ready, f'the service {service}')
        began = time.monotonic()
        asked: list[Any] = []

        def answered() -> bool:
            if time.monotonic() >= began + len(asked):
                asked.append(youngest.call_async(GetParameters.Request()))
            return any(future.done() for future in asked)

        self.until(answered, f'an answer of {service}')
        self.node.destroy_client(youngest)


class Diagnostics:
    """The latest status of each task."""

    def __init__(self, peer: Peer) -> None:
        self.heard = peer.listen('/diagnostics', DiagnosticArray)

    def status(self, task: str) -> tuple[bytes, str, dict[str, str]] | None:
        """(level, message, values by key) of the latest report of `task`, or None."""
        for status in self.heard[-1].status if self.heard else ():
            if status.name == f'simulator: {task}':
                values = {entry.key: entry.value for entry in status.values}
                return status.level, status.message, values
        return None

    def value(self, task: str, key: str) -> str | None:
        status = self.status(task)
        return status[2][key] if status else None


def wrench(
    x: float = 0.0, y: float = 0.0, torque: float = 0.0, frame: str = '', **rest: float
) -> WrenchStamped:
    """A WrenchStamped; `rest` sets any other component: forcez=1.0."""
    message = WrenchStamped()
    message.header.frame_id = frame
    message.wrench.force.x, message.wrench.force.y = x, y
    message.wrench.torque.z = torque
    for name, value in rest.items():
        setattr(getattr(message.wrench, name[:-1]), name[-1], value)
    return message


def read_log(path: Path) -> Messages:
    """Messages of a log by topic: lists of (log time in ns, message)."""
    found: Messages = {}
    for message in read_ros2_messages(str(path)):
        found.setdefault(message.channel.topic, []).append((message.log_time_ns, message.ros_msg))
    return found


def read_cut_log(path: Path) -> Messages:
    """The messages so far of a log that is still being written."""
    found: Messages = {'/simulator/inputs': []}
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    factory = DecoderFactory()
    with open(path, 'rb') as stream:
        try:
            for record in StreamReader(stream).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    decode = factory.decoder_for('cdr', schemas[channel.schema_id])
                    assert decode is not None
                    message = (record.log_time, decode(record.data))
                    found.setdefault(channel.topic, []).append(message)
        except Exception as cut:
            assert 'Unexpected' in f'{cut}' or 'EndOfFile' in type(cut).__name__, cut
    return found


def journal(log: Messages) -> list[dict[str, Any]]:
    """The entries of ~/inputs."""
    return [json.loads(message.data) for _, message in log['/simulator/inputs']]
