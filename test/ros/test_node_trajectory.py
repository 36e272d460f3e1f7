"""Trajectories and targets from another process: followed, replaced, counted, and repeatable."""

import sys

import pytest
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from alf_ros.__main__ import main
from support.journal_run import repeat
from support.ros_node import Diagnostics, SimulatorProcess, journal, read_log
from support.trajectory_messages import message, point

SCENE = """
mechanism: four_bar
effects:
  motor: {joint: crank_pin, position: 1, position_gain: 5, velocity_gain: 0.2}
  tendon: {belt: {joints: [[knee, 2]], position: 0, position_gain: 1.0e-4}}
solver: {step: 1.0e-3, integrator: rk4}
"""
NAN = float('nan')


@pytest.fixture
def started(tmp_path, peer):
    """(node, joint states heard, diagnostics)"""
    (tmp_path / 'driven.yaml').write_text(SCENE)
    heard, found = peer.listen('joint_states', JointState), Diagnostics(peer)
    options = ['--scene', str(tmp_path / 'driven.yaml')]
    with SimulatorProcess(tmp_path, *options, command_timeout=1.0).wait_running() as node:
        peer.until(lambda: heard and found.value('commands', 'accepted') == '0', 'the node')
        yield node, heard, found


def test_trajectories(started, peer):
    node, heard, found = started
    crank = list(heard[-1].name).index('crank_pin')

    def stands_at(angle):
        state = heard[-1]
        return abs(state.position[crank] - angle) < 2e-3 and abs(state.velocity[crank]) < 2e-3

    publisher = peer.talk('/simulator/joint_trajectory', JointTrajectory)
    first = message(
        point(0.4, [1.2], [0.5], [0.0]), point(0.8, [1.3], [0.0], [0.0]), names=['crank_pin']
    )
    publisher.publish(first)
    peer.until(lambda: stands_at(1.3), 'the end of the first')
    # the newest counts: this one turns back under way
    publisher.publish(message(point(3.0, [1.9], [0.0]), names=['crank_pin']))
    peer.until(lambda: heard[-1].position[crank] > 1.35, 'the second under way')
    publisher.publish(message(point(0.5, [0.7], [0.0]), names=['crank_pin']))
    peer.until(lambda: stands_at(0.7), 'the end of the third')
    assert max(state.position[crank] for state in heard) < 1.9

    publisher.publish(message(point(0.1, [1.0]), names=['knee']))
    publisher.publish(message(point(0.1, [1.0]), names=['crank_pin'], start=0.001))
    for reason in ('not_controlled', 'wrong_time'):
        peer.until(lambda r=reason: found.value('commands', f'refused_{r}') == '1', reason)
    # an effort is held after its end no longer than the timeout, a position for good
    publisher.publish(message(point(0.2, effort=[1e-3]), names=['rocker_pin']))
    peer.until(lambda: found.value('commands', 'timed_out') == '1', 'a timeout')
    assert found.value('commands', 'accepted') == '4' and stands_at(0.7)
    assert node.stop() == 0, node.output

    log = read_log(node.logs[0])
    kinds = [(entry['kind'], entry.get('cause')) for entry in journal(log)[1:]]
    assert kinds == [('target', 'trajectory')] * 3 + [
        ('effort', 'trajectory'),
        ('effort', 'timeout'),
    ]
    repeated = repeat(log)
    for stamp, state in log['/joint_states']:
        assert list(state.position) == repeated[stamp]


def test_targets_as_ros2_control_sends_them(started, peer):
    node, heard, found = started
    names = list(heard[-1].name)
    crank = names.index('crank_pin')
    publisher = peer.talk('joint_commands', JointState)
    values = [0.4 if name == 'crank_pin' else NAN for name in names]
    nothing = [NAN] * len(names)
    publisher.publish(JointState(name=names, position=values, velocity=nothing, effort=nothing))
    peer.until(lambda: abs(heard[-1].position[crank] - 0.4) < 1e-2, 'the position')
    publisher.publish(JointState(name=['belt'], position=[1.5]))  # a tendon, by its name
    peer.until(lambda: found.value('commands', 'held') == '2', 'the tendon')
    assert found.value('commands', 'last_trouble') == ''
    assert node.stop() == 0, node.output
    log = read_log(node.logs[0])
    entry, second = journal(log)[1:]
    assert (second['kind'], second['name'], second['position']) == ('target', 'belt', 1.5)
    assert (entry['kind'], entry['name']) == ('target', 'crank_pin')
    assert (entry['position'], entry['velocity']) == (0.4, None)
    assert repeat(log)[log['/joint_states'][-1][0]] == list(log['/joint_states'][-1][1].position)


def test_finite_numbers_however_large_end_no_node_and_leave_logs_that_verify(started, peer):
    node, _, found = started
    trajectories = peer.talk('/simulator/joint_trajectory', JointTrajectory)
    trajectories.publish(message(point(1e-9, [1e308]), point(2e-9, [-1e308]), names=['crank_pin']))
    peer.until(lambda: found.value('commands', 'refused_not_finite') == '1', 'a refusal')
    commands = peer.talk('joint_commands', JointState)
    commands.publish(JointState(name=['knee'], effort=[sys.float_info.max]))
    peer.until(lambda: found.value('solver', 'state') == 'failed', 'a step that fails')
    assert node.stop() == 0, node.output
    assert journal(read_log(node.logs[0]))[-1]['effort'] == sys.float_info.max
    assert main(['verify', str(node.logs[0])]) == 0
