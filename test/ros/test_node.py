"""The node as a user meets it: start, stop, time, services, parameters, diagnostics."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger

from alf_ros import Simulation, load_scene
from alf_ros.ros.messages.topics import TF
from alf_ros.ros.simulator import parameters
from alf_ros.ros.simulator.parameters import OFFERED
from alf_ros.simulation.setup import default_rate, steps_per_tick
from support.paths import ROOT
from support.ros_node import (
    Diagnostics,
    SimulatorProcess,
    journal,
    read_cut_log,
    read_log,
)

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def test_a_run_of_given_duration_ends_by_itself_with_all_of_it_in_the_log(tmp_path):
    with SimulatorProcess(tmp_path, '--duration', '0.5', '--scene', 'slider_crank') as node:
        assert node.wait() == 0, node.output
    log = read_log(node.logs[0])
    assert set(log) == {
        '/joint_states',
        '/simulator/reactions',
        '/simulator/constraints',
        '/simulator/state',
        '/simulator/energy',
        '/simulator/scene',
        '/simulator/inputs',
        '/diagnostics',
    }
    stamps = [t for t, _ in log['/joint_states']]
    # 500 Hz by default; the state at t = 0 is stamped 1 ns because zero is no time
    assert stamps == [1] + [2_000_000 * k for k in range(1, 251)]
    for topic in ('reactions', 'constraints', 'state', 'energy'):
        assert [t for t, _ in log[f'/simulator/{topic}']] == stamps
    simulation = Simulation(load_scene('slider_crank'))
    for (_, joints), (_, energy), (_, rows), (_, wrenches) in zip(
        *(
            log[t]
            for t in ['/joint_states']
            + [f'/simulator/{t}' for t in ('energy', 'constraints', 'reactions')]
        ),
        strict=True,
    ):
        sample = simulation.sample()
        assert list(joints.position) == list(sample.joint_positions)
        assert list(joints.velocity) == list(sample.joint_velocities)
        assert list(rows.effort) == list(sample.lam)
        assert energy.data == sample.energy
        forces = [(wrench.force.x, wrench.force.y) for wrench in wrenches.wrench]
        assert forces == [tuple(force) for force in sample.reaction_forces]
        simulation.step(2)


def test_the_log_says_what_is_needed_to_repeat_the_run(tmp_path):
    options = ['--duration', '0.01', '--scene', 'double_four_bar']
    with SimulatorProcess(tmp_path, *options, solver__penalty=1e8) as node:
        assert node.wait() == 0, node.output
    scene = load_scene('double_four_bar')
    log = read_log(node.logs[0])
    assert [message.data for _, message in log['/simulator/scene']] == [scene.text]
    (start,) = journal(log)
    assert (start['kind'], start['step'], start['scene_sha256']) == ('start', 0, scene.hash)
    assert start['solver']['penalty'] == 1e8 and start['solver']['step'] == scene.solver.step
    assert {'alf_ros', 'python', 'numpy', 'numba', 'cpu'} <= set(start['versions'])
    with open(node.logs[0], 'rb') as stream:
        records = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
    assert records['alf_ros']['scene_text'] == scene.text
    assert records['alf_ros']['scene_sha256'] == scene.hash


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_the_log_closed(tmp_path, number):
    with SimulatorProcess(tmp_path).wait_running() as node:
        assert node.stop(number) == 0, node.output
    with open(node.logs[0], 'rb') as stream:
        assert make_reader(stream).get_summary().statistics.message_count > 0
    assert (node.logs[0].parent / 'metadata.yaml').is_file()
    assert 'Traceback' not in node.output and 'stopped at' in node.output


def test_a_kill_loses_at_most_a_second(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    with SimulatorProcess(tmp_path).wait_running() as node:
        peer.until(lambda: heard and seconds(heard[-1].header.stamp) > 2.0, '2 s of motion')
        node.stop(signal.SIGKILL)
    last = seconds(heard[-1].header.stamp)
    kept = read_cut_log(node.logs[0])['/joint_states']
    assert kept[-1][0] * 1e-9 > last - 1.0
    # and nothing is missing before
    assert [t for t, _ in kept] == [1] + [2_000_000 * k for k in range(1, len(kept))]


@pytest.mark.parametrize(
    ('options', 'parameters', 'says'),
    [
        (['--scene', 'slider_krank'], {}, "did you mean 'slider_crank'"),
        (['--scene', 'no/such.yaml'], {}, 'no/such.yaml'),
        (['--duration', 'long'], {}, "invalid float value: 'long'"),
        (['--frobnicate'], {}, '--frobnicate'),
        ([], {'solver.stepp': 0.001}, "did you mean 'solver.step'"),
        ([], {'rate': 300.0}, 'whole number of solver steps'),
        ([], {'real_time_factor': -1.0}, 'from 0 to 1000'),
        ([], {'duration': '.nan'}, 'from 0 to 1e+09'),
        ([], {'start_paused': 'maybe'}, 'true or false'),
        ([], {'publish.energy': 'sometimes'}, 'auto'),
        pytest.param(
            [],
            {'publish.tf': 'auto'},
            'needs tf2_msgs',
            marks=pytest.mark.skipif(TF in OFFERED, reason='tf2_msgs is installed'),
        ),
        ([], {'qos_overrides./simulator/energy.publisher.depth': -1}, 'depth'),
        ([], {'effects.gravity.acceleration': '[0.0, 1.0, 2.0]'}, 'a list of 2'),
        ([], {'record.topics': '[joint_state]'}, "did you mean 'joint_states'"),
        ([], {'solver.integrator': 'rk5'}, "did you mean 'rk4'"),
        (['--log-folder', '/proc/nowhere'], {}, 'record.folder: cannot write a log'),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path, options, parameters, says):
    with SimulatorProcess(tmp_path, *options, **parameters) as node:
        assert node.wait() == 2, node.output
    lines = [line for line in node.output.splitlines() if not line.startswith('scene ')]
    assert len(lines) == 1 and says in lines[0], node.output


def test_arguments_that_ros_cannot_parse_are_told_in_one_line(tmp_path):
    with SimulatorProcess(tmp_path, '--ros-args', '-p') as node:
        assert node.wait() == 2, node.output
    assert len(node.output.splitlines()) == 1 and '--ros-args' in node.output


def test_help_starts_no_node():
    done = subprocess.run(
        [sys.executable, '-m', 'alf_ros', 'simulator', '--help'], capture_output=True, text=True
    )
    assert done.returncode == 0 and '--no-record' in done.stdout


def test_rate_and_step_must_fit():
    assert steps_per_tick(1000.0, 1e-3) == 1
    assert steps_per_tick(1.0, 1e-3) == 1000
    assert steps_per_tick(1.0 / (7 * 3e-4), 3e-4) == 7


def test_pause_step_play_and_reset(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    with SimulatorProcess(tmp_path, start_paused='true').wait_running() as node:
        # the state at the start is there for who comes late
        peer.until(lambda: heard, 'the state at the start')
        assert {seconds(m.header.stamp) for m in heard} == {1e-9}
        first = list(heard[0].position)
        step = peer.call(Trigger, '/simulator/step')
        assert step.success and 'step 2' in step.message
        peer.until(lambda: seconds(heard[-1].header.stamp) == 0.002, 'the tick')
        simulation = Simulation(load_scene('slider_crank'))
        assert first == list(simulation.sample().joint_positions)
        simulation.step(2)
        assert list(heard[-1].position) == list(simulation.sample().joint_positions)

        assert peer.call(SetBool, '/simulator/pause', data=True).message == 'already paused'
        assert peer.call(SetBool, '/simulator/pause', data=False).success
        peer.until(lambda: seconds(heard[-1].header.stamp) > 0.2, 'motion')
        refused = peer.call(Trigger, '/simulator/step')
        assert not refused.success and 'pause first' in refused.message
        assert peer.call(SetBool, '/simulator/pause', data=True).success
        # what was under way has arrived once a state was said twice
        peer.until(lambda: heard[-1] == heard[-2], 'standing still')
        still = heard[-1].header.stamp
        assert peer.call(Trigger, '/simulator/step').success
        peer.until(lambda: heard[-1].header.stamp != still, 'one more tick')
        assert seconds(heard[-1].header.stamp) == pytest.approx(seconds(still) + 0.002, abs=1e-9)

        assert peer.call(Trigger, '/simulator/reset').success
        peer.until(lambda: seconds(heard[-1].header.stamp) == 1e-9, 'the start again')
        assert list(heard[-1].position) == first
        assert node.stop() == 0
    # each run has a log of its own, and both are whole
    assert len(node.logs) == 2
    before, after = (read_log(path)['/joint_states'] for path in node.logs)
    assert before[0][1].position == after[0][1].position
    assert [t for t, _ in before] == sorted({t for t, _ in before})
    assert [t for t, _ in after] == [1]


def test_topics_come_with_one_stamp_and_only_when_asked_for(tmp_path, peer):
    topics = {
        '/joint_states': JointState,
        '/simulator/reactions': MultiDOFJointState,
        '/simulator/constraints': JointState,
    }
    heard = {topic: peer.listen(topic, kind) for topic, kind in topics.items()}
    clock = peer.listen('/clock', Clock, QoSProfile(depth=1000, reliability=2))
    energy = peer.listen('/simulator/energy', Float64)
    options = {'publish.constraints': 'off', 'record.topics': '[~/constraints]', 'rate': 100.0}
    with SimulatorProcess(tmp_path, **options).wait_running() as node:
        peer.until(lambda: len(energy) > 20 and len(clock) > 20, 'topics')
        scene = peer.listen('/simulator/scene', String, LATCHED)
        peer.until(lambda: scene, 'the latched scene')
        assert scene[0].data == load_scene('slider_crank').text
        assert heard['/simulator/constraints'] == []
        changed = Parameter('publish.constraints', value='on').to_parameter_msg()
        peer.call(SetParameters, '/simulator/set_parameters', parameters=[changed])
        peer.until(lambda: heard['/simulator/constraints'], 'what was switched on')
        assert node.stop() == 0
    joints = {seconds(m.header.stamp): m for m in heard['/joint_states']}
    wrenches = {seconds(m.header.stamp) for m in heard['/simulator/reactions']}
    # the same ticks, but for those at the ends
    assert len(wrenches & set(joints)) > 15
    assert {round(t * 100) for t in joints} >= {round(seconds(m.clock) * 100) for m in clock[2:15]}
    assert set(read_log(node.logs[0])) == {
        '/simulator/constraints',
        '/simulator/scene',
        '/simulator/inputs',
    }


def test_parameters_are_described_ranged_and_refused_with_a_reason(tmp_path, peer):
    def change(name, value):
        parameter = Parameter(name, value=value).to_parameter_msg()
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[parameter])
        return answer.results[0]

    with SimulatorProcess(tmp_path, '--no-record', duration=100).wait_running() as node:
        names = ['scene', 'solver.step', 'rate', 'real_time_factor', 'publish.energy', 'duration']
        described = peer.call(
            DescribeParameters, '/simulator/describe_parameters', names=names
        ).descriptors
        assert all(descriptor.description for descriptor in described)
        assert [d.read_only for d in described] == [False, False, False, False, False, True]
        assert described[3].floating_point_range[0].to_value == 1000.0
        values = peer.call(GetParameters, '/simulator/get_parameters', names=names).values
        assert values[1].double_value == 1e-3 and values[2].double_value == 500.0
        # a whole number given for a number is taken
        assert values[5].double_value == 100.0

        refused = change('publish.energy', 'sometimes')
        assert not refused.successful and 'expected auto, on or off' in refused.reason
        assert not change('duration', 100.0).successful
        assert not change('real_time_factor', -2.0).successful
        assert change('real_time_factor', 4.0).successful
        found = Diagnostics(peer)
        peer.until(
            lambda: 3.5 < float(found.value('timing', 'real_time_factor') or 0.0) < 4.5,
            'four times as fast',
        )
        assert node.stop() == 0


def test_diagnostics_tell_health_once_a_second(tmp_path, peer):
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path).wait_running() as node:
        # Costs are measured once a second. A report with the costs of the one before tells at once
        # that something has changed, as a busy machine does to the timing.
        arrived: list[float] = []
        costs: list[str | None] = [None]
        while len(arrived) < 6:
            peer.until(lambda: len(found.heard) >= len(costs), 'a report')
            costs.append(found.value('timing', 'steps_s_per_tick'))
            if costs[-1] != costs[-2]:
                arrived.append(time.monotonic())
        tasks = ['solver', 'constraints', 'energy', 'timing', 'commands']
        tasks += ['trajectory', 'record']
        assert [s.name for s in found.heard[-1].status] == [f'simulator: {t}' for t in tasks]
        assert {s.hardware_id for s in found.heard[-1].status} == {'slider_crank'}
        # of most: a busy machine delivers one or the other late, and none early
        assert np.median(np.diff(arrived)) > 0.7
        level, _, values = found.status('constraints')
        assert float(values['position_violation_m']) < 1e-9 and values['rank'] == '3'
        assert abs(float(found.value('energy', 'change_j'))) < 1e-5
        assert int(found.value('record', 'written_messages')) > 0
        assert found.value('record', 'dropped_messages') == '0'
        assert node.stop() == 0
    assert '/diagnostics' in read_log(node.logs[0])


def test_a_step_that_fails_pauses_the_node_and_says_what_to_do(tmp_path, peer):
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path).wait_running() as node:
        commands = peer.talk('joint_commands', JointState)
        peer.until(lambda: found.status('solver'), 'a first report')
        # more than any step can follow
        commands.publish(JointState(name=['crank_pin'], effort=[1e12]))
        peer.until(lambda: found.value('solver', 'state') == 'failed', 'an error')
        level, message, values = found.status('solver')
        assert level == b'\2' and values['reason'] in message and values['remedy'] in message
        t = values['simulated_time_s']
        answer = peer.call(Trigger, '/simulator/step')
        assert not answer.success and values['reason'] in answer.message
        peer.until(lambda: len(found.heard) > 3, 'reports that go on')
        assert found.value('solver', 'simulated_time_s') == t
        # to play tries again, and says that it failed again
        answer = peer.call(SetBool, '/simulator/pause', data=False)
        assert not answer.success and values['reason'] in answer.message
        assert found.value('solver', 'state') == 'failed'
        assert not peer.call(Trigger, '/simulator/step').success  # no request to pause either
        # it played before, so it plays on from the start
        assert peer.call(Trigger, '/simulator/reset').success
        peer.until(lambda: found.value('solver', 'state') == 'playing', 'health after a reset')
        # paused on purpose while it has failed, it stays paused
        commands.publish(JointState(name=['crank_pin'], effort=[1e12]))
        peer.until(lambda: found.value('solver', 'state') == 'failed', 'another error')
        assert peer.call(SetBool, '/simulator/pause', data=True).success
        assert peer.call(Trigger, '/simulator/reset').success
        peer.until(lambda: found.value('solver', 'state') == 'paused', 'a pause')
        assert found.value('solver', 'step_index') == '0'
        assert node.stop() == 0
    failed, anew, _ = node.logs
    assert journal(read_log(failed))[-1]['effort'] == 1e12
    assert len(read_log(anew)['/joint_states']) > 1


def test_the_parameter_file_lists_every_parameter_with_its_default(tmp_path):
    path = ROOT / 'config/simulator.yaml'
    text = path.read_text('utf-8')
    given = yaml.safe_load(text)['/**']['ros__parameters']
    for group in ('trajectory', 'record', 'record.rate', 'publish', 'state'):
        given |= {f'{group}.{key}': value for key, value in given.pop(group).items()}
    solver = load_scene('slider_crank').solver
    specs = [parameters.SCENE, *parameters.node_specs(default_rate(solver.step))]
    defaults = {spec.name: spec.default for spec in specs}
    # these two are there as comments, because their defaults come from the scene
    assert {**given, 'rate': 500.0} == defaults
    for spec in (*specs, *parameters.solver_specs(solver)):
        assert f'{spec.name.rpartition(".")[2]}:' in text
    options = ['--duration', '0.01', '--ros-args', '--params-file', str(path)]
    with SimulatorProcess(tmp_path, *options) as node:
        assert node.wait() == 0, node.output
