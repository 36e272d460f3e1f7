"""Commands from another process: what they do, and that the log repeats it bit for bit."""

import math
import time
from functools import partial
from itertools import groupby, pairwise

import pytest
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from alf_ros import Simulation, load_scene
from alf_ros.ros.simulator.inputs import CommandSubscriber
from alf_ros.simulation.input_values import Target
from support.journal_run import repeat
from support.ros_node import Diagnostics, Peer, SimulatorProcess, journal, read_log, wrench


def applied(heard: list[JointState], n: int, effort: float, since: int = -1) -> bool:
    return any(message.effort[n] == effort for message in heard[since:])


def longer(heard: list[JointState], count: int) -> bool:
    return len(heard) > count


@pytest.fixture(scope='module')
def driven(tmp_path_factory):
    """The log of a run with wrenches in both frames, on a point too, and efforts."""
    folder = tmp_path_factory.mktemp('driven')
    with Peer() as peer, SimulatorProcess(folder).wait_running() as node:
        heard = peer.listen('joint_states', JointState)
        crank = peer.talk('/simulator/wrench/crank', WrenchStamped)
        coupler = peer.talk('/simulator/wrench/coupler', WrenchStamped)
        point = peer.talk('/simulator/wrench/A', WrenchStamped)
        joints = peer.talk('joint_commands', JointState)

        for k in range(1, 41):
            crank.publish(wrench(0.1 * k, -1.0 / k, 0.05 * k, frame='crank' if k % 2 else 'world'))
            coupler.publish(wrench(torque=math.sin(k)))
            point.publish(wrench(1.0 / 3.0, 0.7 * k))
            joints.publish(JointState(name=['knee', 'guide'], effort=[0.2, -0.1 * k]))
            peer.until(partial(applied, heard, 2, -0.1 * k), f'effort {k}')
            peer.until(partial(longer, heard, len(heard) + 5), 'motion')
        assert node.stop() == 0, node.output
    return read_log(node.logs[0])


def test_commands_from_another_process_act_as_in_python_bit_for_bit(driven):
    entries = journal(driven)[1:]
    # every round was seen to act before the next one was sent; a wrench may come after its effort
    assert 38 * 5 < len(entries) <= 40 * 5
    assert len({entry['step'] for entry in entries}) >= 40
    repeated = repeat(driven)
    assert len(repeated) > 200
    for stamp, message in driven['/joint_states']:
        assert list(message.position) == repeated[stamp]


def test_without_its_commands_the_motion_is_another(driven):
    quiet = {**driven, '/simulator/inputs': driven['/simulator/inputs'][:1]}
    last, message = driven['/joint_states'][-1]
    assert list(message.position) != repeat(quiet)[last]


def test_journal_entries_stand_where_they_act(driven):
    entries, h = journal(driven), 1e-3
    stamps = [stamp for stamp, _ in driven['/simulator/inputs']]
    assert stamps == [max(1, round(entry['step'] * h * 1e9)) for entry in entries]
    assert all(entry['t'] == entry['step'] * h for entry in entries)
    first = [entry for entry in entries if entry['kind'] == 'wrench'][0]
    assert first['cause'] == 'command' and first['frame'] in ('world', 'body')


def test_efforts_show_in_joint_states(driven):
    efforts = [list(message.effort) for _, message in driven['/joint_states']]
    assert efforts[0] == [0.0, 0.0, 0.0] and efforts[-1] == [0.0, 0.2, -4.0]


def test_a_stale_command_becomes_zero(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    found = Diagnostics(peer)
    times = 36  # a tenth of a second each: renewed, commands last longer than the timeout
    with SimulatorProcess(tmp_path, command_timeout=3.0).wait_running() as node:
        joints = peer.talk('joint_commands', JointState)
        crank = peer.talk('/simulator/wrench/crank', WrenchStamped)
        for k in range(times):
            acts = False
            while not acts:  # on a machine that stands still the timeout may come first
                before, end = len(heard), time.monotonic() + 6.0
                crank.publish(wrench(torque=0.25))
                joints.publish(JointState(name=['knee'], effort=[0.5 + k]))
                while not acts and time.monotonic() < end:
                    peer.until(partial(longer, heard, before), 'motion')
                    acts, before = applied(heard, 1, 0.5 + k, before), len(heard)
            peer.until(partial(longer, heard, len(heard) + 50), 'a tenth of a second')
        peer.until(lambda: heard[-1].effort[1] == 0.0, 'the end of the effort')
        peer.until(lambda: found.value('commands', 'held') == '0', 'nothing held')
        level, text, values = found.status('commands')
        assert level == b'\1' and 'not renewed for 3 s' in text
        assert node.stop() == 0
    log = read_log(node.logs[0])
    ends = [entry for entry in journal(log) if entry.get('cause') == 'timeout']
    assert values['timed_out'] == str(len(ends))
    assert repeat(log)[log['/joint_states'][-1][0]] == list(log['/joint_states'][-1][1].position)
    commands = [entry for entry in journal(log) if entry.get('cause') == 'command']
    efforts = groupby(entry['effort'] for entry in commands if entry['kind'] == 'effort')
    assert [effort for effort, _ in efforts] == [0.5 + k for k in range(times)]
    for kind in ('effort', 'wrench'):
        entries = [entry for entry in journal(log) if entry['kind'] == kind]
        assert entries[-1]['cause'] == 'timeout'
        # only behind a command that nothing has renewed: as the last one, or where this process
        # itself was held up
        for earlier, entry in pairwise(entries):
            if entry['cause'] == 'timeout':
                assert earlier['cause'] == 'command' and 2.5 < entry['t'] - earlier['t'] < 6.0


def test_a_stale_velocity_beside_a_position_becomes_zero(peer):
    """The position stays. With the old velocity the motor held the joint beside it, for ever."""
    entries: list[dict[str, object]] = []
    simulation = Simulation(load_scene('slider_crank_controlled'))
    inputs = CommandSubscriber(peer.node, simulation, entries.append, lambda: None, lambda: 0)
    inputs.timeout = 1.0
    inputs._on_joints(JointState(name=['crank_pin'], position=[1.0], velocity=[2.0]))
    inputs.apply()
    now = time.monotonic()
    for later in (0.5, 1.5, 3.0):
        inputs.expire(now + later)
        assert inputs.timed_out == (later > 1.0) and inputs.held == 1
    assert [entry['velocity'] for entry in entries] == [2.0, 0.0]
    assert entries[1]['cause'] == 'timeout' and entries[1]['position'] == 1.0
    assert inputs.last_trouble.startswith('velocity of crank_pin not renewed for 1 s')
    assert simulation.state.inputs.targets['crank_pin'] == Target(1.0, 0.0)
    inputs._on_joints(JointState(name=['crank_pin'], position=[1.0]))
    inputs.apply()
    inputs.expire(now + 9.0)
    assert inputs.timed_out == 1 and entries[-1]['velocity'] is None


def test_a_reset_forgets_what_was_held(tmp_path, peer):
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path, start_paused='true').wait_running() as node:
        peer.talk('joint_commands', JointState).publish(JointState(name=['knee'], effort=[0.5]))
        peer.until(lambda: found.value('commands', 'held') == '1', 'a command held')
        assert peer.call(Trigger, '/simulator/reset').success
        assert peer.call(Trigger, '/simulator/step').success
        peer.until(lambda: found.value('commands', 'held') == '0', 'nothing held')
        assert node.stop() == 0
    assert all(m.effort[1] == 0.0 for _, m in read_log(node.logs[1])['/joint_states'])


def test_a_large_mechanism_subscribes_when_somebody_publishes(tmp_path, peer):
    scene = tmp_path / 'many.yaml'
    scene.write_text(
        'mechanism: n_four_bar\nparameters: {N: 20}\n'
        'effects:\n  gravity: {acceleration: [0, -9.81]}\ninitial:\n  velocities: {B0: [1, 0]}\n'
    )
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path, '--scene', str(scene)).wait_running() as node:
        assert peer.call(SetBool, '/simulator/pause', data=True).success
        topics = dict(peer.node.get_topic_names_and_types())
        assert '/joint_commands' in topics
        assert not any(topic.startswith('/simulator/wrench/') for topic in topics)
        peer.talk('/simulator/wrench/crank7', WrenchStamped).publish(wrench(torque=1.0))
        peer.until(lambda: found.value('commands', 'accepted') == '1', 'a command taken')
        assert node.stop() == 0
    entry = journal(read_log(node.logs[0]))[-1]
    assert (entry['name'], entry['torque']) == ('crank7', 1.0)
