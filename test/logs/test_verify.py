"""`verify` on runs of the real node with commands from another process, and on spoilt logs.

A few scenes of the library; all of them with

    make thorough ARGS=test/logs/test_verify.py
"""

import math
import random
import re
import time

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from alf_ros import gradient, load_scene
from alf_ros.__main__ import main
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.logs.report.html import page
from alf_ros.logs.report.summary import account
from alf_ros.ros.recording.fork import fork
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.ros.replay.sources import Recorded
from alf_ros.simulation import setup as settings
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.identification.recording_reader import read_recording
from support.log_files import JOURNAL, Retold, make, push, rewritten
from support.paths import ROOT
from support.ros_node import START_LIMIT, SimulatorProcess
from support.thorough import LONG, thinned

LIBRARY = sorted(path.stem for path in (ROOT / 'config/scenes').glob('*.yaml'))
SAMPLE = ['slider_crank', 'stewart_platform']
SCENES = LIBRARY if LONG else SAMPLE
SECONDS = 2.0 if LONG else 1.0
LOSSY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
COORDINATES = ('A.x', 'A.y', 'B.x', 'B.y')
TOPICS = 4  # wrenches on so many bodies or points, and efforts on all joints


def random_commands(peer, scene, seconds, seed):
    """Wrenches and efforts at 1 kHz, of the order of the weight."""
    chance = random.Random(seed)
    model = Simulation(scene).model
    planar = model.layout.dimension == 2
    weight = 10.0 * model.mass_scale
    names = [*model.body_names, *(p.name for p in scene.mechanism.points if not p.fixed)]
    names = [name for name in names if re.fullmatch(r'[A-Za-z_]\w*', name)]
    chosen = chance.sample(names, min(TOPICS, len(names)))
    wrenches = {name: peer.talk(f'/simulator/wrench/{name}', WrenchStamped) for name in chosen}
    joints = peer.talk('/joint_commands', JointState) if model.coordinate_names else None
    taken = [c.name for c in model.coordinates if c.freedom.alone and turning(model, c)]
    sent, start, ticks = 0, time.monotonic(), peer.listen('/clock', Clock, LOSSY)
    while time.monotonic() < start + seconds or len(ticks) < 100:
        peer.executor.spin_once(timeout_sec=0.0)
        assert time.monotonic() < start + START_LIMIT
        if joints and taken and chance.random() < 0.3:
            name = chance.choice(taken)
            joints.publish(JointState(name=[name], effort=[chance.gauss(0.0, 0.1 * weight)]))
        else:
            name, publisher = chance.choice(list(wrenches.items()))
            message = WrenchStamped()
            turns = name in model.body_names and model.layout.turns(name)
            force, torque = message.wrench.force, message.wrench.torque
            force.x, force.y = chance.gauss(0.0, weight), chance.gauss(0.0, weight)
            force.z = 0.0 if planar else chance.gauss(0.0, weight)
            if turns:
                torque.z = chance.gauss(0.0, 0.1 * weight)
                message.header.frame_id = chance.choice(['', name])
            publisher.publish(message)
        sent += 1
        time.sleep(max(0.0, start + sent * 1e-3 - time.monotonic()))


def turning(model, coordinate):
    ends = {coordinate.joint.child, coordinate.joint.parent} - {'ground'}
    return not coordinate.is_angle or all(model.layout.turns(name) for name in ends)


@pytest.mark.parametrize('name', SCENES)
def test_a_run_with_random_commands_comes_out_again_bit_for_bit(peer, tmp_path, name, capsys):
    with SimulatorProcess(tmp_path, scene=name).wait_running() as node:
        random_commands(peer, load_scene(name), SECONDS, seed=name)
        assert node.stop() == 0, node.output
    log = load(node.logs[0])
    assert len(log.inputs) > 50
    assert main(['verify', str(node.logs[0].parent)]) == 0, capsys.readouterr().out
    said = capsys.readouterr().out
    compared = sum(log.survey.counts[t] for t in log.survey.counts if t not in OTHERS)
    assert f'EQUAL: {compared} messages' in said and f'{len(log.inputs) - 1} inputs' in said


OTHERS = ('/simulator/scene', JOURNAL, '/diagnostics')


def test_settings_resets_timeouts_and_restored_states_come_out_again(peer, tmp_path):
    heard = peer.listen('/joint_states', JointState)

    def wait(ticks):
        count = len(heard)
        peer.until(lambda: len(heard) > count + ticks, 'motion')

    def set_to(name, kind, **value):
        parameter = Parameter(name=name, value=ParameterValue(type=kind, **value))
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[parameter])
        assert answer.results[0].successful, answer.results[0].reason

    double = ParameterType.PARAMETER_DOUBLE
    with SimulatorProcess(tmp_path, command_timeout=0.05).wait_running() as node:
        crank = peer.talk('/simulator/wrench/crank', WrenchStamped)
        message = WrenchStamped()
        message.wrench.force.x = 1.0 / 3.0
        crank.publish(message)
        wait(60)
        gravity = {'double_array_value': [0.3, -1.62]}
        set_to('effects.gravity.acceleration', ParameterType.PARAMETER_DOUBLE_ARRAY, **gravity)
        wait(10)
        set_to('solver.step', double, double_value=0.0005)
        wait(10)
        set_to('rate', double, double_value=250.0)
        wait(10)
        for service in ('save_state', 'reset_state', 'restore_state', 'reset'):
            crank.publish(message)
            assert peer.call(Trigger, f'/simulator/{service}').success
            wait(200)  # on a busy machine the first ones were sent before
        assert node.stop() == 0, node.output
    logs = [load(path) for path in node.logs]
    assert len(logs) == 4
    kinds = {entry['kind'] for log in logs for entry in log.inputs}
    causes = {entry.get('cause') for log in logs for entry in log.inputs}
    assert kinds == {'start', 'wrench', 'settings'} and 'timeout' in causes
    assert sum('state' in log.info for log in logs) == 1 and any(log.ahead for log in logs)
    for log in logs:
        result = compare(log)
        assert result.equal and result.compared > 100, (result.first, result.faults)


def test_works_come_out_again_also_in_a_fork(tmp_path, capsys):
    path, simulation = make(tmp_path, 'slider_crank', ledger=True)
    log = load(path)
    work = log.read('~/work')
    assert dict(zip(work.names, work.columns['position'][-1], strict=True)) == (
        simulation.state.works
    )
    assert simulation.state.works['inputs'] != 0.0
    assert main(['verify', str(path)]) == 0, capsys.readouterr().out
    forked = fork(log, 0.5, {}, tmp_path, 'forked')
    again = load(forked).read('~/work').columns['position']
    assert again.tobytes() == work.columns['position'][-len(again) :].tobytes()
    assert 0 < len(again) < len(work)
    assert main(['verify', str(forked)]) == 0, capsys.readouterr().out
    spoilt = rewritten(path, tmp_path, change=last_bit_of('/simulator/work'))
    capsys.readouterr()
    assert main(['verify', str(spoilt)]) == 1
    assert 'work.position.drives' in capsys.readouterr().out


def last_bit_of(topic):
    """Of the last position of every message."""

    def change(name, data):
        if name != topic:
            return data
        message = deserialize_message(data, JointState)
        message.position[-1] = np.nextafter(message.position[-1], 1.0)
        return serialize_message(message)

    return change


@pytest.fixture(scope='module')
def pushed(tmp_path_factory):
    """A log with eight pushes at steps 100, 200 ..."""
    setup = settings.made(load_scene('slider_crank'), {})
    run = LogRun(tmp_path_factory.mktemp('pushed'), setup)
    run.send()
    for tick in range(1, 451):
        setup.simulation.step(setup.steps)
        run.send()
        if tick % 50 == 0 and tick < 450:
            push(run, 'coupler', math.sin(tick) / 3.0)
    run.close()
    return run.recorder.path


def one_bit_more(entry, bit=0):
    force = np.array(entry['force'])
    force[0] = (force[:1].view(np.uint64) ^ np.uint64(1 << bit)).view(float)[0]
    return {**entry, 'force': force.tolist()}


@pytest.mark.parametrize('bit', thinned([0, 1, 20, 51, 63], keep=[0, 51, 63]))
def test_one_changed_bit_of_an_input_is_found_and_located(pushed, tmp_path, bit, capsys):
    edit = Retold(lambda k, entry: one_bit_more(entry, bit) if k == 3 else entry)
    spoilt = rewritten(pushed, tmp_path, change=edit)
    assert main(['verify', str(spoilt)]) == 1
    said = capsys.readouterr().out
    assert 'wrong: input at step 300, wrench coupler: changed after it was written' in said
    assert said.count('wrong:') == 1


@pytest.mark.parametrize('bit', [0, 20, 63])
def test_a_changed_input_that_was_sealed_anew_shows_in_the_motion(pushed, tmp_path, bit):
    edit = Retold(lambda k, entry: one_bit_more(entry, bit) if k == 3 else entry, seal=True)
    result = compare(load(rewritten(pushed, tmp_path, change=edit)))
    assert result.faults == [] and not result.equal
    assert 300 < result.first.step <= 400
    assert result.first.cause == 'step 300, wrench coupler'


def test_any_bit_of_the_journal_is_found(pushed, tmp_path):
    chance = random.Random(3)
    for _ in range(12 if LONG else 5):
        place = {'k': -1, 'of': chance.randrange(1, 9), 'bit': chance.randrange(8)}
        where = chance.random()

        def change(topic, data, place=place, where=where):
            place['k'] += topic == JOURNAL
            if topic != JOURNAL or place['k'] != place['of']:
                return data
            text = bytearray(deserialize_message(data, String).data.encode())
            # ASCII stays ASCII; a tab and a line end would be another text for the same entry
            text[int(where * len(text))] ^= 1 << place['bit'] % 5
            place['k'] += 100
            return serialize_message(String(data=text.decode()))

        result = compare(load(rewritten(pushed, tmp_path, change=change)))
        assert not result.equal
        # the seal of the next entry is on the present one
        assert re.search(rf'step (-1|\d+), .*|{place["of"]}', result.faults[0])


def test_a_damaged_record_is_one_line_or_a_fault(pushed, tmp_path, capsys):
    """`verify` reports every change of a metadata record that matters for a re-run.

    Metadata records have no checksum.
    """
    whole = rewritten(pushed, tmp_path).read_bytes()
    start = whole.index(b'alf_ros', 30)
    end = whole.index(b'rosbag2', start) - 20
    spoilt, chance, codes = tmp_path / 'spoilt.mcap', random.Random(1), []
    for _ in range(30 if LONG else 12):
        data = bytearray(whole)
        data[chance.randrange(start, end)] ^= 1 << chance.randrange(8)
        spoilt.write_bytes(data)
        codes.append(main(['verify', str(spoilt)]))
        said = capsys.readouterr()
        assert 'Traceback' not in said.err
        assert (codes[-1] == 2) == (len(said.err.strip().splitlines()) == 1)
    assert {1, 2} <= set(codes) and codes.count(0) == 0


def test_a_missing_input_is_found(pushed, tmp_path):
    edit = Retold(lambda k, entry: None if k == 4 else entry)
    result = compare(load(rewritten(pushed, tmp_path, change=edit)))
    assert result.faults[0] == '1 inputs are missing before step 500, wrench coupler'
    assert 400 < result.first.step < 410


@pytest.mark.parametrize('topic', ['/simulator/state', '/joint_states', '/simulator/reactions'])
def test_one_changed_bit_of_an_output_is_found_and_located(pushed, tmp_path, topic, capsys):
    seen = []

    def change(name, data):
        seen.append(name)
        if name != topic or seen.count(topic) != 124:
            return data
        number = load(pushed).read(topic)
        value = next(iter(number.columns.values()))[123].ravel()[1]
        at = data.index(value.tobytes())
        return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]

    assert main(['verify', str(rewritten(pushed, tmp_path, change=change))]) == 1
    said = capsys.readouterr().out
    assert 'first: step 246, t = 0.246 s: ' in said and 'differs 1 times' in said
    assert topic.rpartition('/')[2] in said.partition('first:')[2]
    assert 'last input before it: step 200, wrench coupler' in said


def test_another_version_is_said(pushed, tmp_path, capsys):
    log = load(pushed)
    log.info['versions']['numpy'] = '1.0'
    result = compare(log)
    assert result.versions == {'numpy': ('1.0', np.__version__)}
    assert result.faults == ['its two descriptions of the start differ'] and result.first is None


def test_another_solver_shows_where_and_how_much(pushed):
    log = load(pushed)
    log.info['solver']['penalty'] = 3.3e8
    result = compare(log)
    assert result.first.step <= 10 and result.first.size < 1e-9
    moved = {key: v for key, v in result.variables.items() if key.startswith('state.')}
    assert moved.keys() <= {
        f'state.{f}.{c}' for f in ('position', 'velocity') for c in COORDINATES
    }
    assert 0.0 < max(v.worst.size for v in moved.values()) < 1e-9


def test_a_cut_log_is_verified_as_far_as_it_goes(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 1500)
    whole = rewritten(path, tmp_path)
    cut = tmp_path / 'cut_0.mcap'
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert main(['verify', str(cut)]) == 0
    said = capsys.readouterr().out
    assert 'not closed: ' in said and 'EQUAL: ' in said


OTHER_TYPES = (  # two topics, each with the type of the other one
    ('/joint_states', '/simulator/energy'),
    ('/simulator/state', '/simulator/reactions'),
    ('/simulator/inputs', '/simulator/constraints'),
)


@pytest.mark.parametrize('pair', OTHER_TYPES)
def test_a_topic_of_another_type_is_one_line(pushed, tmp_path, pair, capsys):
    """All of it, not each message, by every command that would read it."""
    log = load(rewritten(pushed, tmp_path, rename=dict([pair, pair[::-1]]).get))
    was, now = (load(pushed).survey.types[topic] for topic in pair)
    said = f'{pair[0]}: written as {now}, and its run writes {was}'
    result, shown = compare(log), account(log)
    assert [fault for fault in result.faults if pair[0] in fault] == [said]
    assert said in shown.faults and page([shown]).count(said)
    assert main(['verify', str(log.path)]) == 1
    assert said in capsys.readouterr().out
    if pair[0] != '/joint_states':
        with pytest.raises(InputError, match=re.escape(said)):
            fork(log, 0.4, {}, tmp_path / 'fork')
        with pytest.raises(InputError, match=re.escape(said)):
            gradient(log, 'final(energy)', ['coupler.mass'])
    if pair[0] == '/simulator/state':
        with pytest.raises(InputError, match='no states of a run'):
            _ = log.states


def test_a_topic_of_two_types_is_one_line(pushed, tmp_path, capsys):
    """It was published as one of them, and counted as one of them."""
    both = {'/simulator/energy': '/joint_states'}
    log = load(rewritten(pushed, tmp_path, rename=both.get))
    names = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64'
    said = f'/joint_states: written as ({"|".join(map(", ".join, (names, names[::-1])))})'
    assert re.search(said, compare(log).faults[0])
    for read in (
        lambda: Recorded(log),
        lambda: read_recording(log.path, load_scene('slider_crank')),
    ):
        with pytest.raises(InputError, match='written as .*, .*; expected one type of each topic'):
            read()
    with pytest.raises(InputError, match='its content changes'):
        log.read('joint_states')
    for _ in range(2):  # it leaves no folder
        assert main(['recover', str(log.path), '-o', str(tmp_path / 'whole')]) == 2
        assert re.search(said, capsys.readouterr().err)


def test_what_cannot_be_verified_is_one_line(tmp_path, capsys):
    for arguments in (['verify'], ['verify', str(tmp_path)], ['verify', '--what', 'x']):
        assert main(arguments) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
