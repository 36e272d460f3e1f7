"""Time and state as other programs see them: steps, resets, saved states, another scene."""

import json
import math
import time
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from alf_ros import InputError, Simulation, load_scene
from alf_ros.logs import load
from alf_ros.ros.recording.fork import fork
from support.ros_node import LIMIT, Diagnostics, SimulatorProcess, journal, read_log

BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def change(peer, **values):
    """Set parameters at once; returns the reason of a refusal, '' for success."""
    parameters = [
        Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
        for name, value in values.items()
    ]
    answer = peer.call(
        SetParametersAtomically, '/simulator/set_parameters_atomically', parameters=parameters
    )
    assert answer.result.successful == (answer.result.reason == '')
    return answer.result.reason


def act(peer, service):
    """Call a service of the simulator that must succeed; returns what it says."""
    answer = peer.call(Trigger, f'/simulator/{service}')
    assert answer.success, answer.message
    return answer.message


def test_time_goes_back_only_on_the_reset_that_asks_for_it(tmp_path, peer):
    clock = peer.listen('/clock', Clock, BEST_EFFORT)
    heard = peer.listen('joint_states', JointState)
    with SimulatorProcess(tmp_path, start_paused='true').wait_running() as node:
        peer.until(lambda: heard and clock, 'the state at the start')
        first = list(heard[0].position)

        # n steps are published when the answer comes; the motion is that of the library
        assert change(peer, step_count=250) == ''
        assert 'step 500' in act(peer, 'step')
        peer.until(lambda: ns(heard[-1].header.stamp) == 500_000_000, 'half a second')
        simulation = Simulation(load_scene('slider_crank'))
        simulation.step(500)
        assert list(heard[-1].position) == list(simulation.sample().joint_positions)

        # the state of t = 0.5 s is kept, in memory and on disk
        assert change(peer, state__name='half') == ''
        act(peer, 'save_state')
        kept = tmp_path / 'states/slider_crank/half.json'
        assert json.loads(kept.read_text())['t'] == 0.5
        act(peer, 'step')
        simulation.step(500)
        peer.until(lambda: ns(heard[-1].header.stamp) == 1_000_000_000, 'a second')
        after = list(heard[-1].position)
        assert after == list(simulation.sample().joint_positions)

        # restored, the motion is the same bit for bit, and the stamps go on
        act(peer, 'restore_state')
        act(peer, 'step')
        peer.until(lambda: ns(heard[-1].header.stamp) == 1_502_000_000, 'the same half second')
        assert list(heard[-1].position) == after

        # the state alone, and then the state and the time
        act(peer, 'reset_state')
        peer.until(lambda: ns(heard[-1].header.stamp) == 1_504_000_000, 'the first state')
        assert list(heard[-1].position) == first
        stamps = [ns(message.header.stamp) for message in heard]
        ticks = [ns(message.clock) for message in clock]
        assert stamps == sorted(stamps) and ticks == sorted(ticks)
        act(peer, 'reset')
        peer.until(lambda: ns(heard[-1].header.stamp) == 1, 'time zero')
        peer.until(lambda: ns(clock[-1].clock) == 1, 'clock zero')
        assert node.stop() == 0
    logs = [read_log(path) for path in node.logs]
    assert len(logs) == 4
    for log in logs:
        times = [t for t, _ in log['/joint_states']]
        assert times == sorted(times)
    starts = [journal(log)[0] for log in logs]
    assert [start['stamps_ahead_ns'] for start in starts] == [0, 502_000_000, 1_504_000_000, 0]
    assert [start['step'] for start in starts] == [0, 500, 0, 0]
    # what the log of the restored run says is enough to repeat it
    assert starts[1]['state']['q'] == json.loads(kept.read_text())['state']['q']


def test_a_state_on_disk_serves_another_process_and_a_wrong_one_is_refused(tmp_path, peer):
    states = f'state.folder:={tmp_path}/states'
    heard = peer.listen('joint_states', JointState)
    ros = ['--ros-args', '-p', states, '-p', 'start_paused:=true', '-p', 'step_count:=100']
    with SimulatorProcess(tmp_path / 'a', '--no-record', *ros).wait_running():
        act(peer, 'step')
        act(peer, 'save_state')
        act(peer, 'step')
        peer.until(lambda: heard and ns(heard[-1].header.stamp) == 400_000_000, 'two steps')
    expected = list(heard[-1].position)
    with SimulatorProcess(tmp_path / 'b', '--no-record', *ros).wait_running():
        act(peer, 'restore_state')
        act(peer, 'step')
        peer.until(lambda: ns(heard[-1].header.stamp) == 202_000_000, 'the second step')
        assert list(heard[-1].position) == expected

        assert change(peer, state__name='nothing') == ''
        refused = peer.call(Trigger, '/simulator/restore_state')
        assert not refused.success and 'no state saved' in refused.message
        assert "'../x'" in change(peer, state__name='../x')
        kept = tmp_path / 'states/slider_crank/default.json'
        Path(kept.with_name('bad.json')).write_text(kept.read_text().replace('"q"', '"p"'))
        assert change(peer, state__name='bad') == ''
        refused = peer.call(Trigger, '/simulator/restore_state')
        assert not refused.success and 'not a state of this scene' in refused.message


def moved(document: dict[str, Any], factor: float) -> dict[str, Any]:
    """A state with other positions, for whose lengths there is no place."""
    state = document['state']
    return {
        'q': [factor * x for x in document['q']],
        'state': state | {'q': [factor * x for x in state['q']]},
    }


def test_a_refused_state_changes_nothing(tmp_path, peer):
    """One that no step can start from was refused, but the run continued from it. One whose
    lengths are others was accepted, and the first step put the bodies somewhere."""
    heard, found = peer.listen('joint_states', JointState), Diagnostics(peer)
    states = {'state.folder': f'{tmp_path}/states', 'start_paused': True, 'step_count': 50}
    with SimulatorProcess(tmp_path, '--no-record', **states).wait_running() as node:
        commands = peer.talk('/joint_commands', JointState)
        commands.publish(JointState(name=['crank_pin'], effort=[0.7]))
        peer.until(lambda: found.value('commands', 'held') == '1', 'the command')
        act(peer, 'step')
        act(peer, 'save_state')
        kept = tmp_path / 'states/slider_crank/default.json'
        good = json.loads(kept.read_text())
        assert good['state']['inputs']['efforts'] == {'crank_pin': 0.7}
        state = good['state']
        far = {'q': [1e80 * x for x in state['q']]}
        wrong = {
            'damaged': {'q': [1e80 * x for x in good['q']], 'state': state | far},
            'other': {'mechanism_sha256': '0'},
            'between': {'step_s': 1.0007e-3},
            'order': {'q': good['q'][::-1]},
            'unknown': {
                'state': state | {'inputs': state['inputs'] | {'efforts': {'nothing': 1.0}}}
            },
            'short': {'state': state | {'qd': []}},
            'zero': moved(good, 0.0),
            'stretched': moved(good, 1.0001),
        }
        told = dict.fromkeys(('zero', 'stretched'), 'its positions violate the constraints by ')
        for name, change_of in wrong.items():
            kept.with_name(f'{name}.json').write_text(json.dumps(good | change_of))
            assert change(peer, state__name=name) == ''
            refused = peer.call(Trigger, '/simulator/restore_state')
            assert not refused.success and 'Error' not in refused.message, name
            assert told.get(name, '') in refused.message
            assert change(peer, state__name=f'after_{name}') == ''
            act(peer, 'save_state')
            assert json.loads(kept.with_name(f'after_{name}.json').read_text()) == good, name
        act(peer, 'step')
        peer.until(lambda: ns(heard[-1].header.stamp) == 200_000_000, 'the next steps')
        assert found.value('commands', 'held') == '1'
        assert 'Traceback' not in node.output
    simulation = Simulation(load_scene('slider_crank'))
    simulation.apply_effort('crank_pin', 0.7)
    simulation.step(200)
    assert list(heard[-1].position) == list(simulation.sample().joint_positions)


def test_a_run_whose_log_cannot_be_written_begins_completely(tmp_path, peer):
    """Its energy was compared with the run before, and diagnostics did not mention the log."""
    found = Diagnostics(peer)
    folder = tmp_path / 'logs'
    settings = {'state.folder': f'{tmp_path}/states', 'start_paused': True, 'step_count': 50}
    with SimulatorProcess(folder, **settings).wait_running() as node:
        commands = peer.talk('/joint_commands', JointState)
        commands.publish(JointState(name=['crank_pin'], effort=[5.0]))
        peer.until(lambda: found.value('commands', 'held') == '1', 'the command')
        act(peer, 'step')
        act(peer, 'save_state')
        act(peer, 'reset')
        folder.rename(tmp_path / 'gone')
        folder.write_text('no folder')
        refused = peer.call(Trigger, '/simulator/restore_state')
        assert not refused.success and 'cannot write a log' in refused.message
        peer.until(lambda: 'cannot write a log' in (found.status('record') or '  ')[1], 'the log')
        assert float(found.value('energy', 'change_j')) == 0.0
        assert float(found.value('energy', 'energy_j')) > 1.0
        assert found.value('commands', 'held') == '1'
        folder.unlink()
        act(peer, 'reset')
        peer.until(lambda: found.status('record')[1].endswith('.mcap'), 'the next log')
        assert node.process.poll() is None


def test_another_scene_is_loaded_without_a_restart(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path).wait_running() as node:
        peer.until(lambda: len(heard) > 10, 'motion')
        assert "did you mean 'four_bar'" in change(peer, scene='four_baar')
        assert list(heard[-1].name) == ['crank_pin', 'knee', 'guide']
        assert change(peer, scene='four_bar') == ''
        names = ['crank_pin', 'knee', 'wrist', 'rocker_pin']
        peer.until(lambda: list(heard[-1].name) == names, 'joints of the other scene')
        assert ns(heard[-1].header.stamp) == 1
        peer.until(lambda: found.heard[-1].status[0].hardware_id == 'four_bar', 'its diagnostics')
        assert found.value('solver', 'state') == 'paused'
        # its solver and its commands are there
        joints = peer.talk('joint_commands', JointState)
        joints.publish(JointState(name=['wrist'], effort=[0.01]))
        peer.until(lambda: heard[-1].effort[2] == 0.01, 'a command')
        assert change(peer, step_count=10) == ''
        act(peer, 'step')
        simulation = Simulation(load_scene('four_bar'))
        simulation.apply_effort('wrist', 0.01)
        simulation.step(40)
        peer.until(lambda: ns(heard[-1].header.stamp) == 20_000_000, 'ten ticks')
        assert list(heard[-1].position) == list(simulation.sample().joint_positions)
        assert node.stop() == 0
    assert [journal(read_log(path))[0]['scene'] for path in node.logs] == [
        'slider_crank',
        'four_bar',
    ]


def test_steps_that_are_under_way_can_be_stopped(tmp_path, peer):
    options = {'start_paused': 'true', 'step_count': 10**9, 'real_time_factor': 0.01}
    with SimulatorProcess(tmp_path, '--no-record', **options).wait_running():
        heard = peer.listen('joint_states', JointState)
        client = peer.client(Trigger, '/simulator/step')
        waiting = client.call_async(Trigger.Request())
        # as fast as they can, whatever the real-time factor
        peer.until(lambda: heard and ns(heard[-1].header.stamp) > 10**9, 'a second')
        busy = peer.call(Trigger, '/simulator/step')
        assert not busy.success and 'still to be made' in busy.message
        assert peer.call(SetBool, '/simulator/pause', data=True).message == 'paused'
        answer = peer.until(lambda: waiting.done() and waiting.result(), 'the answer')
        assert not answer.success and 'stopped after' in answer.message


# a busy machine makes less: it is given seconds to try again
@pytest.mark.parametrize(('factor', 'low', 'high'), [(0.01, 0.005, 0.02), (0.0, 1.5, 1e6)])
def test_slow_motion_and_as_fast_as_it_can(tmp_path, peer, factor, low, high):
    clock = peer.listen('/clock', Clock, BEST_EFFORT)
    options = {'real_time_factor': factor, 'rate': 1000.0}
    with SimulatorProcess(tmp_path, '--no-record', **options).wait_running():
        peer.until(lambda: clock, 'time')
        for _ in range(20):
            started, first = time.monotonic(), ns(clock[-1].clock)
            peer.until(lambda start=started: time.monotonic() - start > 1.0, 'a second')
            made = (ns(clock[-1].clock) - first) * 1e-9 / (time.monotonic() - started)
            assert made < high
            if made > low:
                break
    assert made > low


def test_a_run_ends_where_the_stamps_of_ros_end(tmp_path):
    """They have 31 bits for the seconds; the node and `fork` ended with a traceback."""
    scene = tmp_path / 'slow.yaml'
    scene.write_text(
        'mechanism: {alf: 1, points: {O: {at: [0, 0], fixed: true}, P: {at: [1, 0]}}, bodies: '
        '{rod: {points: [O, P], mass: 1, inertia: rod}}, joints: {pin: {type: revolute, between: '
        '[ground, rod], at: O}}}\n'
        'sensors: {imu: {body: rod}}\n'
        'initial: {velocities: {P: [0, 1.0e-7]}}\nsolver: {step: 1.0e+6, integrator: rk4}\n'
    )
    fast = {'rate': '1.0e-6', 'real_time_factor': '0.0'}
    with SimulatorProcess(tmp_path, scene=str(scene), **fast).wait_running() as node:
        end = time.monotonic() + LIMIT
        while 'the stamps of ROS end at 2147483647 s' not in node.output:
            assert time.monotonic() < end, node.output
            time.sleep(0.05)
        assert node.stop() == 0, node.output
        assert 't = 2.147e+09 s: the stamps' in node.output and 'Traceback' not in node.output
    folder = node.logs[0].parent
    states = load(folder).states
    assert states.t[-1] == pytest.approx(2.147e9)
    assert states.q[-1, 0] == pytest.approx(math.cos(214.7), abs=1e-5)
    with pytest.raises(InputError, match='the stamps of ROS end'):
        fork(load(folder), 2.147e9, {}, tmp_path, 'further', duration=2e6)
    assert not (tmp_path / 'further').exists()
