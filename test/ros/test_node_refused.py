"""Commands that cannot be taken: refused, counted by reason, told, and nothing changes."""

import math

import pytest
from geometry_msgs.msg import Wrench as PlainWrench
from sensor_msgs.msg import JointState

from support.ros_node import Diagnostics, Peer, SimulatorProcess, journal, read_cut_log, wrench


@pytest.fixture(scope='module')
def peer():
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture(scope='module')
def paused(tmp_path_factory, peer):
    """A paused node, and its diagnostics."""
    folder = tmp_path_factory.mktemp('paused')
    found = Diagnostics(peer)
    with SimulatorProcess(folder, start_paused='true').wait_running() as node:
        peer.until(lambda: found.status('commands'), 'diagnostics')
        yield node, found
        assert node.stop() == 0, node.output


REFUSED_WRENCHES = {
    'not a number': ('crank', wrench(math.nan), 'not_finite', 'finite'),
    'infinite torque': ('crank', wrench(torque=math.inf), 'not_finite', 'finite'),
    'infinite out of the plane': ('A', wrench(forcez=-math.inf), 'not_finite', 'finite'),
    'out of the plane': ('coupler', wrench(forcez=1.0), 'out_of_plane', 'force.z'),
    'torque about x': ('crank', wrench(torquex=1.0), 'out_of_plane', 'torque.x'),
    'torque on a point': ('A', wrench(torque=1.0), 'no_orientation', 'no orientation'),
    'a frame that is not': ('crank', wrench(1.0, frame='base_link'), 'unknown_frame', 'base_link'),
    'frame of another body': ('crank', wrench(1.0, frame='coupler'), 'unknown_frame', 'coupler'),
    'frame of a body on a point': ('A', wrench(1.0, frame='crank'), 'unknown_frame', 'crank'),
    'unknown body': ('crnak', wrench(1.0), 'unknown_name', "did you mean 'crank'"),
    'fixed point': ('O', wrench(1.0), 'unknown_name', "'O'"),
}
REFUSED_EFFORTS = {
    'unknown joint': (JointState(name=['kne'], effort=[1.0]), 'unknown_name', "mean 'knee'"),
    'infinite': (JointState(name=['knee'], effort=[math.inf]), 'not_finite', 'finite'),
    'one bad of two': (
        JointState(name=['guide', 'knee'], effort=[1.0, math.inf]),
        'not_finite',
        'finite',
    ),
    'too few efforts': (
        JointState(name=['knee', 'guide'], effort=[1.0]),
        'wrong_length',
        '2 names',
    ),
    'positions alone': (
        JointState(name=['knee'], position=[1.0]),
        'not_controlled',
        'no motor controls the position',
    ),
    'velocities alone': (
        JointState(name=['knee'], velocity=[1.0]),
        'not_controlled',
        'no motor controls the velocity',
    ),
    'a joint twice': (
        JointState(name=['knee', 'knee'], effort=[1.0, 2.0]),
        'repeated_name',
        'twice',
    ),
}
REFUSED = {
    **{f'wrench: {k}': (f'/simulator/wrench/{v[0]}', *v[1:]) for k, v in REFUSED_WRENCHES.items()},
    **{f'effort: {k}': ('joint_commands', *v) for k, v in REFUSED_EFFORTS.items()},
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_refused_command_is_counted_told_and_changes_nothing(paused, peer, case):
    node, found = paused
    topic, message, reason, says = REFUSED[case]
    before = int(found.value('commands', f'refused_{reason}'))
    accepted = found.value('commands', 'accepted')
    publisher = peer.talk(topic, type(message))
    publisher.publish(message)
    peer.until(
        lambda: int(found.value('commands', f'refused_{reason}')) > before, f'a refusal: {reason}'
    )
    level, text, values = found.status('commands')
    assert level == b'\1' and says in values['last_trouble'] and says in text
    assert int(values[f'refused_{reason}']) == before + 1
    assert (values['accepted'], values['held']) == (accepted, '0')
    log = [entry['kind'] for entry in journal(read_cut_log(node.logs[-1]))]
    assert set(log) <= {'start'}
    peer.node.destroy_publisher(publisher)


def test_a_topic_of_another_type_is_counted(paused, peer):
    _, found = paused
    publisher = peer.node.create_publisher(PlainWrench, '/simulator/wrench/guide', 10)
    peer.until(lambda: found.value('commands', 'refused_wrong_type') == '1', 'a wrong type')
    assert 'geometry_msgs/msg/Wrench, not' in found.value('commands', 'last_trouble')
    peer.node.destroy_publisher(publisher)
