"""The node keeps the work ledger; at its start it lists effects, outputs and their cost."""

import re

from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from alf_ros import Simulation, effects, load_scene
from alf_ros.__main__ import main
from alf_ros.inspection.effect_costs import call_costs
from alf_ros.logs import load
from alf_ros.ros.simulator import startup_report
from alf_ros.scene.scene import scene_from_text
from support.ros_node import Diagnostics, SimulatorProcess, wrench


def test_works_are_published_recorded_diagnosed_and_kept(tmp_path, peer):
    heard, found = peer.listen('/simulator/work', JointState), Diagnostics(peer)
    with SimulatorProcess(tmp_path, ledger=True).wait_running() as node:
        assert 'ledger on' in node.output
        push = peer.talk('/simulator/wrench/coupler', WrenchStamped)
        push.publish(wrench(x=1.0))
        peer.until(lambda: heard and heard[-1].position[1] != 0.0, 'work of the push')
        assert list(heard[-1].name) == ['gravity', 'inputs', 'drives']
        peer.until(lambda: float(found.value('work', 'inputs_j') or 0.0) != 0.0, 'diagnostics')
        assert abs(float(found.value('work', 'missing_j'))) < 1e-5
        gains = Parameter('effects.gravity.acceleration', value=[0.0, -5.0]).to_parameter_msg()
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[gains])
        assert answer.results[0].successful
        other = Parameter('solver.formulation', value='alf1').to_parameter_msg()
        answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[other])
        assert 'only alf2 keeps a ledger' in answer.results[0].reason
        for service in ('save_state', 'reset', 'restore_state'):
            assert peer.call(Trigger, f'/simulator/{service}').success
        assert node.stop() == 0, node.output
    logs = [load(path) for path in node.logs]
    for log, path in zip(logs, node.logs, strict=True):
        assert main(['verify', str(path)]) == 0
        assert len(log.read('~/work')) == len(log.read('~/state'))
    starts = sorted(abs(log.read('~/work').columns['position'][0]).sum() for log in logs)
    assert len(logs) == 3 and starts[:2] == [0.0, 0.0] and starts[2] > 0.0  # the restored one


def test_it_says_what_is_on(tmp_path):
    options = {'publish.markers': 'off', 'publish.clock': 'on', 'record.topics': '[~/energy]'}
    with SimulatorProcess(tmp_path, duration=0.01, **options) as node:
        assert node.wait() == 0, node.output
    said = node.output
    cost = re.search(r'effects on, per step: gravity (\S+) µs; ledger off\n', said)
    assert 0.0 < float(cost[1]) < 100.0
    off = re.search(r'effects off: (.*)\n', said)[1].split(', ')
    assert off == [kind for kind in effects.kinds() if kind != 'gravity']
    on, waiting, never = re.search(
        r'outputs on: (.*); when subscribed: (.*); off: (.*)', said
    ).groups()
    assert on == '~/energy, clock' and 'joint_states' in waiting and '~/work' not in waiting
    assert never.split(', ')[0] == '~/markers'


def test_every_effect_has_a_cost():
    """Of the scene, friction under its load too."""
    text = 'mechanism: slider_crank\neffects:\n  gravity: {acceleration: [0, -9.81]}\n'
    text += '  joint_friction: {joint: knee, dynamic: 0.1, radius: 0.01}\n'
    costs = call_costs(Simulation(scene_from_text(text)))
    assert list(costs) == ['gravity', 'joint_friction']
    assert all(0.0 < cost < 1000.0 for cost in costs.values())


def test_long_lists_are_short_lines():
    simulation = Simulation(load_scene('slider_crank'))
    outputs = {'on': [f'topic_{n}' for n in range(20)], 'subscribed': [], 'off': []}
    assert startup_report.lines(simulation, outputs, {}, 0.01)[2].endswith(
        'topic_13 and 6 more; when subscribed: none; off: none'
    )
