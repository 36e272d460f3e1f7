"""Parameters of a running node: their effect, refused values, and a dump that repeats the run."""

import pytest
import yaml
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from alf_ros import Simulation
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.scene.effect_values import with_effect_values
from alf_ros.scene.scene import scene_from_text
from support.ros_node import Diagnostics, Peer, SimulatorProcess, journal, read_log

SCENE = """
mechanism: slider_crank
effects:
  gravity: {acceleration: [0, -9.81]}
  constant_wrench:
    push: {on: coupler, force: [0, 5.0], at: A}
    twist: {on: crank, torque: 0.1}
initial: {velocities: {B: [-4.0, 0]}}
solver: {step: 1.0e-3}
"""


@pytest.fixture(scope='module')
def peer():
    peer = Peer()
    yield peer
    peer.close()


def change(peer, values):
    """Set parameters at once; returns the reason of a refusal, '' for success."""
    parameters = [Parameter(key, value=value).to_parameter_msg() for key, value in values.items()]
    answer = peer.call(
        SetParametersAtomically, '/simulator/set_parameters_atomically', parameters=parameters
    )
    assert answer.result.successful == (answer.result.reason == '')
    return answer.result.reason


def dumped(peer):
    """All parameters by name, as `ros2 param dump` asks for them."""
    names = peer.call(ListParameters, '/simulator/list_parameters').result.names
    values = peer.call(GetParameters, '/simulator/get_parameters', names=names).values
    plain = (parameter_value_to_python(value) for value in values)
    return {
        name: value if isinstance(value, (bool, int, float, str)) else list(value)
        for name, value in zip(names, plain, strict=True)
    }


@pytest.fixture(scope='module')
def changed(tmp_path_factory, peer):
    """A run with changes on the way: its dump, its log, and the reasons of the refused changes."""
    folder = tmp_path_factory.mktemp('changed')
    (folder / 'pushed.yaml').write_text(SCENE)
    heard = peer.listen('joint_states', JointState)
    options = {'start_paused': 'true', 'step_count': 50, 'use_sim_time': 'false'}
    scene = ['--scene', str(folder / 'pushed.yaml')]
    with SimulatorProcess(folder, *scene, **options).wait_running() as node:

        def step():
            assert peer.call(Trigger, '/simulator/step').success

        step()
        reasons = [
            change(peer, values)
            for values in (
                {'solver.step': 3e-3},  # a tick of 2 ms is no whole number of these
                {'solver.step': 3e-4, 'rate': 1.0 / 3e-4},  # nor is the time of 0.1 s
                {'solver.integrator': 'rk5'},
                {'solver.iterations': 0},
                {'effects.gravity.acceleration': [0.0]},
                {'effects.constant_wrench.twist.torque': 1e200},
                {'real_time_factor': 2.0, 'rate': 300.0},
                {'publish.energy': 'never'},
            )
        ]
        unchanged = dumped(peer)
        assert change(peer, {'effects.gravity.acceleration': [0.0, -1.62]}) == ''
        step()
        assert change(peer, {'effects.constant_wrench.push.force': [1.5, -2.0]}) == ''
        step()
        assert change(peer, {'solver.step': 5e-4, 'solver.integrator': 'dop853'}) == ''
        step()
        assert change(peer, {'rate': 250.0, 'effects.constant_wrench.twist.torque': -0.3}) == ''
        step()
        described = peer.call(
            DescribeParameters, '/simulator/describe_parameters', names=sorted(unchanged)
        ).descriptors
        dump = dumped(peer)
        last = peer.until(lambda: heard[-1] if heard else None, 'a state')
        peer.until(
            lambda: heard[-1].header.stamp.nanosec == 600_000_000, f'the last step, not {last}'
        )
        assert node.stop() == 0, node.output
    return folder, reasons, unchanged, dump, described, read_log(node.logs[0])


def test_what_cannot_be_is_refused_with_the_reason_and_changes_nothing(changed):
    _, reasons, unchanged, _, _, _ = changed
    says = [
        'whole number of solver steps',
        'not a whole number of such steps',
        "did you mean 'rk4'",
        'range',
        'a list of 1 given',
        'range',
        'whole number of solver steps',
        'auto, on or off',
    ]
    for reason, part in zip(reasons, says, strict=True):
        assert part in reason
    assert unchanged['real_time_factor'] == 1.0 and unchanged['solver.step'] == 1e-3
    assert unchanged['effects.gravity.acceleration'] == [0.0, -9.81]


def test_every_parameter_is_described_and_every_number_has_a_range(changed):
    *_, described, _ = changed
    by_rclpy = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')
    ours = [d for d in described if not d.name.startswith(by_rclpy)]
    assert len(ours) > 25
    for descriptor in ours:
        assert descriptor.description, descriptor.name
        if descriptor.type == 3:
            (found,) = descriptor.floating_point_range
            assert found.from_value < found.to_value
        if descriptor.type == 2:
            assert descriptor.integer_range
    read_only = {d.name for d in ours if d.read_only}
    assert {name for name in read_only if not name.startswith('record.rate.')} == {
        'ledger',
        'start_paused',
        'trust_scenes',
        'duration',
        'status_line',
        'frame_prefix',
        'state.folder',
        'record.enabled',
        'record.folder',
        'record.topics',
        'record.sensors',
        'record.max_size',
        'record.max_duration',
    }


def test_changes_act_from_the_step_at_which_the_journal_has_them(changed):
    *_, log = changed
    start, *entries = journal(log)
    scene = scene_from_text(log['/simulator/scene'][0][1].data)
    simulation = Simulation(scene, **start['solver'])
    positions = {1: list(simulation.sample().joint_positions)}
    steps_per_tick = start['steps_per_tick']
    stops = [(entry['t'], entry) for entry in entries] + [(0.6, None)]
    for t, entry in stops:
        while simulation.t < t - 1e-9:
            simulation.step(steps_per_tick)
            found = list(simulation.sample().joint_positions)
            positions[round(simulation.t * 1e9)] = found
        if entry is not None:
            assert entry['kind'] == 'settings'
            scene = with_effect_values(scene, entry['effects'])
            state = simulation.state
            simulation = Simulation(scene, **entry['solver'])
            simulation.restore(state)  # at its time, which its own steps count
            steps_per_tick = entry['steps_per_tick']
    assert len(entries) == 4
    logged = {stamp: list(message.position) for stamp, message in log['/joint_states']}
    assert logged == positions
    assert len(log['/simulator/scene']) == 4  # at the start, and for each change of an effect
    assert log['/simulator/scene'][-1][1].data == scene.text


def test_a_dump_makes_the_same_run_again(changed):
    folder, _, _, dump, _, log = changed
    file = folder / 'dump.yaml'
    runs = {**dump, 'duration': 0.1, 'start_paused': False, 'real_time_factor': 0.0}
    # as `ros2 param dump` writes it; folders and times of the run apart
    file.write_text(yaml.safe_dump({'/simulator': {'ros__parameters': runs}}))
    with SimulatorProcess(folder / 'again', '--ros-args', '--params-file', str(file)) as node:
        assert node.wait() == 0, node.output
    again = read_log(node.logs[0])
    assert len(again['/joint_states']) == 26
    # the scene as it was in the end
    (text,) = (message.data for _, message in again['/simulator/scene'])
    assert text == log['/simulator/scene'][-1][1].data
    scene, start = scene_from_text(text), journal(again)[0]
    assert start['solver'] == {**start['solver'], 'integrator': 'dop853', 'step': 5e-4}
    simulation = Simulation(scene, **start['solver'])
    for stamp, message in again['/joint_states'][1:]:
        simulation.step(8)
        assert (stamp, list(message.position)) == (
            round(simulation.t * 1e9),
            list(simulation.sample().joint_positions),
        )


def test_a_misspelt_name_in_a_file_is_refused(tmp_path):
    file = tmp_path / 'p.yaml'
    text = '{effects.gravity.acceleratoin: [0.0, 0.0]}'
    file.write_text(f'/simulator: {{ros__parameters: {text}}}\n')
    with SimulatorProcess(tmp_path, '--ros-args', '--params-file', str(file)) as node:
        assert node.wait() == 2
    assert "did you mean 'effects.gravity.acceleration'" in node.output.splitlines()[-1]


def test_pause_is_not_needed_for_a_change(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    with SimulatorProcess(tmp_path).wait_running() as node:
        peer.until(lambda: len(heard) > 20, 'motion')
        assert change(peer, {'effects.gravity.acceleration': [0.0, 0.0]}) == ''
        assert change(peer, {'solver.penalty': 1e7}) == ''
        count = len(heard)
        peer.until(lambda: len(heard) > count + 50, 'motion')
        assert peer.call(SetBool, '/simulator/pause', data=True).success
        assert node.stop() == 0
    log = read_log(node.logs[0])
    stamps = [stamp for stamp, _ in log['/joint_states']]
    assert stamps == [1] + [2_000_000 * k for k in range(1, len(stamps))]
    kinds = [(entry['kind'], entry.get('effects')) for entry in journal(log)]
    assert kinds[1:] == [
        ('settings', {'effects.gravity.acceleration': [0.0, 0.0]}),
        ('settings', {}),
    ]


def test_an_accuracy_picks_says_what_and_repeats(peer, tmp_path):
    health = Diagnostics(peer)

    def told(key, value):
        peer.until(lambda: health.value('solver', key) == value, f'{key} {value}')

    parameters = {'accuracy': 1e-9, 'start_paused': 'true', 'publish.diagnostics': 'on'}
    with SimulatorProcess(tmp_path, **parameters).wait_running() as node:
        dump = dumped(peer)
        assert (dump['accuracy'], dump['solver.integrator']) == (1e-9, 'dop853')
        told('accuracy_asked_m', '1e-09')
        assert float(health.value('solver', 'accuracy_estimate_m')) < 1e-9
        assert health.value('solver', 'accuracy_horizon_s') == '10.0'
        assert peer.call(Trigger, '/simulator/step').success
        assert change(peer, {'accuracy': 1e-15}) == ''
        told('accuracy_asked_m', '1e-15')
        assert 'not met' in health.status('solver')[1]
        assert peer.call(Trigger, '/simulator/step').success
        assert change(peer, {'accuracy': 1e-6}) == ''
        assert dumped(peer)['solver.integrator'] == 'rk4'
        assert 'an accuracy picks' in change(peer, {'accuracy': 1e-7, 'solver.tolerance': 1e-3})
        assert change(peer, {'solver.integrator': 'dop853'}) == ''
        assert dumped(peer)['accuracy'] == 0.0  # given up
        assert peer.call(Trigger, '/simulator/step').success
        assert change(peer, {'accuracy': 1e-6}) == ''
        assert change(peer, {'accuracy': 0.0}) == ''
        assert dumped(peer)['solver.integrator'] == 'rk4'  # as it was
        assert node.stop() == 0, node.output
    log = load(node.logs[0])
    assert log.info['solver']['accuracy'] == 1e-9 and log.info['solver']['integrator'] == 'dop853'
    kept = [entry['solver']['accuracy'] for entry in log.inputs if entry['kind'] == 'settings']
    assert kept == [1e-15, 1e-6, None, 1e-6, None]
    assert compare(log).equal
    # what the dump of the beginning says runs the same, picked before
    given = {key: dump[key] for key in ('accuracy', 'solver.integrator', 'solver.tolerance')}
    again = SimulatorProcess(tmp_path / 'again', '--duration', '0.01', **given)
    with again as node:
        assert node.wait() == 0, node.output
    assert load(node.logs[0]).info['solver'] == log.info['solver']


def test_a_value_of_an_unknown_type_is_refused_and_ends_nothing(peer, tmp_path):
    """rclpy alone raises ValueError there, which ends the node."""
    asked = ParameterMessage(name='rate', value=ParameterValue(type=255, double_value=5.0))
    known = Parameter('step_count', value=7).to_parameter_msg()
    with SimulatorProcess(tmp_path, '--no-record', start_paused='true').wait_running() as node:
        told = peer.call(SetParameters, '/simulator/set_parameters', parameters=[asked, known])
        whole = peer.call(
            SetParametersAtomically,
            '/simulator/set_parameters_atomically',
            parameters=[asked, known],
        )
        assert [each.successful for each in told.results] == [False, True]
        assert not whole.result.successful
        for reason in (told.results[0].reason, whole.result.reason):
            assert 'rate: not a value of a parameter' in reason and reason.isprintable()
        assert dumped(peer)['step_count'] == 7
        assert node.stop() == 0
