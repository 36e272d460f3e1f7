"""Sensors of a scene as topics: real subscribers, the log, and nothing for what nobody asks."""

import io
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import Imu, JointState, Range

from alf_ros import Simulation, load_scene
from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.ros.simulator.node import Simulator, Stop
from alf_ros.ros.simulator.reporting import LOOKS_PER_DIAGNOSIS
from alf_ros.ros.terminal import StatusLine
from alf_ros.simulation.sensors import Sensors
from support.ros_node import SimulatorProcess

SCENE = """
mechanism: slider_crank
effects: {gravity: {acceleration: [0, -9.81]}}
sensors:
  imu: {rod: {body: coupler, rate: 100}}
  encoder: {joint: crank_pin, resolution: 2*pi/4096}
  force_torque: {crank: {joint: crank_pin}}
  range: {at: A, to: O, max_range: 5}
  odometry: {body: coupler}
  pose: {body: coupler}
  twist: {body: coupler, axes: body}
  acceleration: {body: coupler}
initial: {velocities: {B: [-4, 0]}}
solver: {integrator: dop853, step: 1.0e-3}
"""
TYPES = {
    'imu/rod': Imu,
    'encoder': JointState,
    'force_torque/crank': WrenchStamped,
    'range': Range,
    'odometry': Odometry,
    'pose': PoseStamped,
    'twist': TwistStamped,
    'acceleration': AccelStamped,
}
FRAMES = {
    'imu/rod': 'a/imu/rod',
    'encoder': 'world',
    'force_torque/crank': 'a/force_torque/crank',
    'range': 'a/range',
    'twist': 'a/coupler',
}


def xyz(vector) -> list[float]:
    return [vector.x, vector.y, vector.z]


def numbers(message) -> list[float]:
    """The numbers of a message in the order of the quantities of its measurement."""
    if isinstance(message, Imu):
        turn = message.orientation
        rest = xyz(message.angular_velocity) + xyz(message.linear_acceleration)
        return [*xyz(turn), turn.w, *rest]
    if isinstance(message, JointState):
        return [message.position[0], message.velocity[0]]
    if isinstance(message, WrenchStamped):
        return xyz(message.wrench.force) + xyz(message.wrench.torque)
    if isinstance(message, Range):
        return [message.range]
    if isinstance(message, TwistStamped):
        return xyz(message.twist.linear) + xyz(message.twist.angular)
    if isinstance(message, AccelStamped):
        return xyz(message.accel.linear) + xyz(message.accel.angular)
    pose = message.pose.pose if isinstance(message, Odometry) else message.pose
    found = [*xyz(pose.position), *xyz(pose.orientation), pose.orientation.w]
    if isinstance(message, Odometry):
        twist = message.twist.twist
        found += xyz(twist.linear) + xyz(twist.angular)
    return found


def test_sensors_are_published_and_recorded(tmp_path: Path, peer, capfd) -> None:
    (tmp_path / 'scene.yaml').write_text(SCENE)
    heard: dict[str, list[Any]] = {
        label: peer.listen(f'/simulator/{label}', kind) for label, kind in TYPES.items()
    }
    options = {'scene': str(tmp_path / 'scene.yaml'), 'frame_prefix': 'a/', 'rate': 500.0}
    with SimulatorProcess(tmp_path, **options).wait_running() as node:
        assert 'sensors, per message: imu/rod ' in node.output
        peer.until(lambda: all(len(each) > 20 for each in heard.values()), 'all sensors')
        assert node.stop() == 0, node.output
    for label, frame in FRAMES.items():
        assert heard[label][-1].header.frame_id == frame
    assert heard['odometry'][-1].child_frame_id == 'a/coupler'

    scene = load_scene(tmp_path / 'scene.yaml')
    simulation, sensors = Simulation(scene), Sensors(scene)
    (folder,) = {path.parent for path in node.logs}
    seen: dict[str, list[int]] = {label: [] for label in TYPES}
    with AnyReader([folder]) as reader:
        recorded: dict[int, dict[str, Any]] = {}
        for connection, stamp, data in reader.messages():
            label = connection.topic.removeprefix('/simulator/')
            if label in TYPES:
                read: Any = reader.deserialize(data, connection.msgtype)
                assert read.header.stamp.sec * 10**9 + read.header.stamp.nanosec == stamp
                seen[label].append(stamp)
                recorded.setdefault(stamp, {})[label] = read
    periods = {label: np.diff(stamps) for label, stamps in seen.items()}
    assert set(periods.pop('imu/rod')[1:]) == {10_000_000}
    for gaps in periods.values():
        assert set(gaps[1:]) == {2_000_000}
    for label, messages in heard.items():
        for message in messages[:10]:
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            simulation.reset()
            simulation.step(round(stamp * 1e-6))
            wanted = dict(sensors.read(simulation.sample(), (label,))[label])
            if label == 'encoder':
                del wanted['velocity']  # depends on the message before
            exact = np.concatenate(list(wanted.values()))
            exact = exact.astype(np.float32) if label == 'range' else exact
            assert np.array_equal(numbers(message)[: exact.size], exact)
            there = recorded[stamp][label]
            if label == 'encoder':
                assert math.isnan(there.effort[0])
                assert [there.position[0], there.velocity[0]] == numbers(message)
    assert main(['verify', str(node.logs[0])]) == 0
    assert main(['fork', str(node.logs[0]), '--at', '0.01', '-o', str(tmp_path / 'fork')]) == 0
    told = 'alf_ros fork: the new log has no messages of sensors ('
    (line,) = [each for each in capfd.readouterr().err.splitlines() if 'of sensors' in each]
    assert line.startswith(told) and all(label in line for label in TYPES)


def test_nothing_is_recorded_that_was_switched_off(tmp_path: Path, capfd) -> None:
    (tmp_path / 'scene.yaml').write_text(SCENE)
    options = {'record.sensors': False, 'duration': 0.05}
    scene = str(tmp_path / 'scene.yaml')
    with SimulatorProcess(tmp_path, scene=scene, **options) as node:
        assert node.wait() == 0, node.output
    waiting = node.output.partition('when subscribed: ')[2]
    assert '~/imu/rod' in waiting
    assert 'rate above' not in node.output
    with AnyReader([node.logs[0].parent]) as reader:
        topics = {connection.topic for connection in reader.connections}
    assert not {f'/simulator/{label}' for label in TYPES} & topics
    assert main(['verify', str(node.logs[0])]) == 0
    assert main(['fork', str(node.logs[0]), '--at', '0.01', '-o', str(tmp_path / 'fork')]) == 0
    said = capfd.readouterr()
    assert 'of sensors' not in said.out + said.err


def test_rates_above_the_ticks_are_told(tmp_path: Path) -> None:
    """The imu sent 50 messages a second in place of 100, without a word."""
    (tmp_path / 'scene.yaml').write_text(SCENE)
    options = {'duration': 0.05, 'rate': 50.0, 'record.enabled': False}
    scene = str(tmp_path / 'scene.yaml')
    with SimulatorProcess(tmp_path, scene=scene, **options) as node:
        assert node.wait() == 0, node.output
    told = 'sensors with a rate above the 50 Hz of ticks: imu/rod (100 Hz)'
    assert told in node.output


def test_encoders_begin_with_their_run(tmp_path: Path, peer) -> None:
    """A delayed encoder told the position of the run before, where a later state was restored, and
    a velocity of the way between both runs."""
    encoders = '{late: {joint: crank_pin, delay: 0.02}, plain: {joint: crank_pin}}'
    text = f'mechanism: slider_crank\nsensors: {{encoder: {encoders}}}\n'
    (tmp_path / 'scene.yaml').write_text(text + 'initial: {velocities: {B: [-4, 0]}}\n')
    given = {
        'scene': str(tmp_path / 'scene.yaml'),
        'start_paused': True,
        'status_line': False,
        'rate': 1000.0,
        'record.folder': str(tmp_path / 'logs'),
        'state.folder': str(tmp_path / 'states'),
    }
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = Simulator(StatusLine(stream=io.StringIO()), Stop(), overrides)
    try:
        node.begin()
        control = node._control
        for _ in range(100):
            control.run.tick()
        control.save('later')
        position = control.run.simulation.sample().joints['crank_pin'].position
        control.reset(keep_time=True)
        for _ in range(30):
            control.run.tick()
        control.restore('later')
        for _ in range(25):
            control.run.tick()
        recorder = control.run.recorder
        assert recorder is not None
    finally:
        node.close()
        node.destroy_node()
    seen: dict[str, list[JointState]] = {'late': [], 'plain': []}
    with AnyReader([recorder.folder]) as reader:
        for connection, _, data in reader.messages():
            label = connection.topic.rpartition('/')[2]
            if label in seen:
                seen[label].append(reader.deserialize(data, connection.msgtype))
    late = [each.position[0] for each in seen['late']]
    assert late[:21] == [position] * 21 and late[21] != position
    plain = [each.position[0] for each in seen['plain']]
    assert plain[:5] == late[20:25]
    assert seen['plain'][0].velocity[0] == seen['late'][0].velocity[0] == 0.0


def simulator(folder: Path, text: str, **given: Any) -> Simulator:
    """A node in this process, paused at the start of a scene, without a log."""
    (folder / 'scene.yaml').write_text(text)
    given = {
        'scene': str(folder / 'scene.yaml'),
        'start_paused': True,
        'status_line': False,
        'record.enabled': False,
        **given,
    }
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = Simulator(StatusLine(stream=io.StringIO()), Stop(), overrides)
    node.begin()
    return node


def test_the_velocity_of_an_encoder_does_not_depend_on_its_readers(tmp_path: Path, peer) -> None:
    """A late reader had the mean velocity since the start, and in a pause 0."""
    encoders = '{plain: {joint: crank_pin}, late: {joint: crank_pin, delay: 0.01, rate: 50}}'
    text = f'mechanism: slider_crank\nsensors: {{encoder: {encoders}}}\n'
    node = simulator(tmp_path, text + 'initial: {velocities: {B: [-4, 0]}}\n', rate=100.0)
    topics = [f'/simulator/encoder/{name}' for name in ('plain', 'late')]
    try:
        run = node._control.run
        for _ in range(9):
            run.tick()
        plain, late = (peer.listen(topic, JointState) for topic in topics)
        peer.until(
            lambda: all(node.count_subscribers(topic) for topic in topics), 'the subscriptions'
        )
        run.tick(whole=True)
        run.send(record=False, whole=True)
        peer.until(lambda: len(plain) == 2 and late, 'both encoders')
    finally:
        node.close()
        node.destroy_node()
    motion = Simulation(load_scene(tmp_path / 'scene.yaml')).run(0.1, every=10)
    position = [sample.joints['crank_pin'].position for sample in motion]
    assert math.isclose(plain[0].velocity[0], (position[10] - position[9]) / 0.01, rel_tol=1e-12)
    assert plain[1].header == plain[0].header and plain[1].velocity == plain[0].velocity
    assert math.isclose(late[0].velocity[0], (position[9] - position[7]) / 0.02, rel_tol=1e-12)


def test_a_late_reader_hears_the_first_ticks_of_periods_only(tmp_path: Path, peer) -> None:
    """The first message was one of the middle of a period, if nobody had read before."""
    text = 'mechanism: slider_crank\nsensors: {pose: {body: coupler, rate: 100}}\n'
    node = simulator(tmp_path, text, rate=500.0)
    try:
        run = node._control.run
        for _ in range(7):
            run.tick()
        heard = peer.listen('/simulator/pose', PoseStamped)
        peer.until(lambda: node.count_subscribers('/simulator/pose'), 'the subscription')
        for _ in range(8):
            run.tick(whole=True)
        run.send(record=False, whole=True)  # as in a pause
        peer.until(lambda: len(heard) == 3, 'three messages')
    finally:
        node.close()
        node.destroy_node()
    assert [each.header.stamp.nanosec for each in heard] == [20_000_000, 30_000_000, 30_000_000]


def test_a_report_in_the_middle_of_a_tick_measures_nothing(tmp_path: Path, peer) -> None:
    """While a paused node made a long tick, it published states that the log has not. The encoder
    told its velocity since the last of them, as if each second of real time were a tick."""
    text = 'mechanism: slider_crank\nsensors: {encoder: {joint: crank_pin}}\n'
    text += 'initial: {velocities: {B: [-4, 0]}}\nsolver: {integrator: rk4, step: 1.0e-4}\n'
    folder = str(tmp_path / 'logs')
    given: dict[str, Any] = {'record.enabled': True, 'record.folder': folder}
    node = simulator(tmp_path, text, rate=0.05, **given)
    try:
        control = node._control
        step = control.step(1)
        step.send(None)
        assert control.run.under_way
        for _ in range(LOOKS_PER_DIAGNOSIS):
            node._reporting.look()
        while control.run.under_way:
            control.advance(time.monotonic())
        step.close()
        recorder = control.run.recorder
        assert recorder is not None
    finally:
        node.close()
        node.destroy_node()
    read = load(recorder.folder).read('~/encoder')
    assert read.stamp.tolist() == [1, 20 * 10**9]
    motion = Simulation(load_scene(tmp_path / 'scene.yaml')).run(20.0, every=200_000)
    begun, ended = [sample.joints['crank_pin'].position for sample in motion]
    assert math.isclose(read.columns['velocity'][1, 0], (ended - begun) / 20.0, rel_tol=1e-12)


def test_readers_of_sensors_that_do_not_follow_are_named(tmp_path: Path, peer) -> None:
    text = 'mechanism: slider_crank\nsensors: {encoder: {joint: crank_pin}}\n'
    node = simulator(tmp_path, text)
    try:
        sensors = node._outputs._sensors
        assert sensors is not None and node._outputs.lagging == []
        sensors.outputs['~/encoder'].readers.lagging = True
        assert node._outputs.lagging == ['~/encoder']
    finally:
        node.close()
        node.destroy_node()


def test_a_scene_whose_messages_are_missing_is_refused_and_the_node_lives(
    tmp_path: Path, peer, monkeypatch
) -> None:
    (tmp_path / 'scene.yaml').write_text(SCENE)
    given = {'start_paused': True, 'record.enabled': False, 'status_line': False}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = Simulator(StatusLine(stream=io.StringIO()), Stop(), overrides)
    try:
        node.begin()
        monkeypatch.setitem(sys.modules, 'nav_msgs.msg', None)
        asked = Parameter('scene', value=str(tmp_path / 'scene.yaml'))
        answer = node.set_parameters_atomically([asked])
        assert not answer.successful and 'nav_msgs' in answer.reason
        node._control.run.tick()
        assert node._control.run.failure is None
        monkeypatch.undo()
        assert node.set_parameters_atomically([asked]).successful
        node._control.run.tick()
    finally:
        node.close()
        node.destroy_node()
