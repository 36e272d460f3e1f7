"""Ticks of many steps: the node answers during them, and their log verifies."""

import time

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from support.ros_node import Peer, SimulatorProcess, journal, read_log

SCENE = 'mechanism: slider_crank\neffects: {gravity: {acceleration: [0, -9.81]}}\n'
GRAVITY = 'effects.gravity.acceleration'


@pytest.fixture(scope='module')
def ended(tmp_path_factory):
    """A run whose ticks of a million seconds were ended by requests: its log, and the answers."""
    folder = tmp_path_factory.mktemp('long')
    (folder / 'falls.yaml').write_text(SCENE)
    said = []
    options = {'start_paused': 'true', 'real_time_factor': 0.0, 'rate': 1e-6}
    with Peer() as peer:
        node = SimulatorProcess(folder, '--scene', str(folder / 'falls.yaml'), **options)
        with node.wait_running():
            setting = peer.client(SetParametersAtomically, '/simulator/set_parameters_atomically')
            pausing = peer.client(SetBool, '/simulator/pause')
            stepping = peer.client(Trigger, '/simulator/step')

            def ask(client, **request):
                asked = client.call_async(client.srv_type.Request(**request))
                peer.until(asked.done, client.srv_name)
                return asked.result()

            def change(name, value):
                message = Parameter(name, value=value).to_parameter_msg()
                return ask(setting, parameters=[message]).result

            def wait():
                until = time.monotonic() + 1.0  # s, in which steps are made
                while time.monotonic() < until:
                    peer.executor.spin_once(timeout_sec=0.05)

            said.append(change('solver.step', 1e-12).reason)
            ask(pausing, data=False)
            wait()
            assert change(GRAVITY, [0.0, -1.62]).successful
            wait()
            ask(pausing, data=True)
            asked = stepping.call_async(Trigger.Request())
            wait()
            ask(pausing, data=True)
            peer.until(asked.done, 'the end of the step')
            said.append(asked.result().message)
            assert node.stop() == 0, node.output
    return node.logs[-1], said


def test_requests_are_answered_while_a_tick_takes_minutes(ended):
    _, said = ended  # all requests were answered, or there would be no log
    assert 'out of range' in said[0]  # stamps count ns
    assert said[1].startswith('stopped after 0 of 1, at t = ')


def test_a_tick_that_was_ended_is_logged_with_the_steps_that_it_made(ended):
    path, _ = ended
    log = load(path)
    found = compare(log)
    assert found.equal, found
    messages = read_log(path)
    assert len(messages['/joint_states']) == 4  # the start, and three ends
    begun, changed = (entry['step'] for entry in journal(messages))
    assert begun == 0 < changed
