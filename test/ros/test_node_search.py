"""The search for an accuracy runs beside the node, which answers and makes ticks."""

import dataclasses
import signal

import pytest
import yaml
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool

from alf_ros import Simulation, load_scene
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from support.ros_node import Peer, SimulatorProcess

SCENE = 'excavator'  # searches for seconds
ACCURACY = 1e-12  # m
NEXT = 1e-9


class Requests:
    """Services of the node, asked without waiting."""

    def __init__(self, peer):
        self.peer = peer
        name = '/simulator/set_parameters_atomically'
        self._set = peer.client(SetParametersAtomically, name)
        self._get = peer.client(GetParameters, '/simulator/get_parameters')
        self._pause = peer.client(SetBool, '/simulator/pause')

    def set(self, name, value, **others):
        values = {name: value} | {name.replace('__', '.'): value for name, value in others.items()}
        asked = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        return self._set.call_async(SetParametersAtomically.Request(parameters=asked))

    def get(self, *names):
        values = self.answer(self._get.call_async(GetParameters.Request(names=names))).values
        return [parameter_value_to_python(value) for value in values]

    def pause(self, pause):
        return self.answer(self._pause.call_async(SetBool.Request(data=pause))).success

    def answer(self, asked):
        self.peer.until(asked.done, 'an answer')
        return asked.result()


@pytest.fixture
def peer():
    with Peer() as peer:
        yield peer


def test_requests_are_answered_and_ticks_made_while_it_searches(peer, tmp_path):
    with SimulatorProcess(tmp_path, '--scene', SCENE).wait_running() as node:
        ask = Requests(peer)
        before = ask.get('solver.integrator', 'solver.tolerance')
        ended = []
        first = ask.set('accuracy', ACCURACY)
        first.add_done_callback(lambda _: ended.append('first'))
        peer.until(lambda: 'searching settings' in node.output, 'the beginning of the search')
        second = ask.set('accuracy', NEXT)  # waits for its turn
        second.add_done_callback(lambda _: ended.append('second'))
        assert ask.get('solver.integrator', 'solver.tolerance', 'accuracy') == [*before, 0.0]
        assert ask.answer(ask.set('display_rate', 7.0)).result.successful
        assert ask.pause(True) and ask.pause(False)
        assert node.output.count('searching settings') == 1 and not ended
        assert ask.answer(first).result.successful
        assert ask.answer(second).result.successful
        peer.until(lambda: len(ended) == 2, 'both callbacks')
        assert ended == ['first', 'second']
        assert ask.get('accuracy', 'display_rate') == [NEXT, 7.0]
        assert node.stop() == 0, node.output
    said = node.output
    assert said.count('searching settings') == 2 and said.count('settings for 1e-') == 2
    log = load(node.logs[-1])
    changed = [entry for entry in log.inputs if entry['kind'] == 'settings']
    assert 0 < changed[0]['step'] < changed[1]['step']  # ticks were made between them
    for entry, accuracy in zip(changed, (ACCURACY, NEXT), strict=True):
        alone = Simulation(load_scene(SCENE), accuracy=accuracy)
        assert entry['solver'] == dataclasses.asdict(alone.solver)
    assert compare(log).equal


def test_a_scene_that_asks_for_an_accuracy_is_loaded_beside_the_run(peer, tmp_path):
    path = tmp_path / 'exact.yaml'
    scene = yaml.safe_load(load_scene(SCENE).text)
    scene['solver'] = {'step': 0.005, 'accuracy': ACCURACY}
    path.write_text(yaml.safe_dump(scene, sort_keys=False))
    with SimulatorProcess(tmp_path, '--scene', SCENE).wait_running() as node:
        ask = Requests(peer)
        loading = ask.set('scene', str(path))
        peer.until(lambda: 'searching settings' in node.output, 'the beginning of the search')
        assert ask.get('scene') == [SCENE]
        assert not loading.done()
        assert ask.answer(loading).result.successful, loading.result()
        assert ask.get('scene', 'accuracy') == [str(path), ACCURACY]
        assert node.stop() == 0, node.output


def test_no_accuracy_leaves_what_is_said_beside_it_or_in_a_scene(peer, tmp_path):
    path = tmp_path / 'exact.yaml'
    solver = {'step': 1e-3, 'accuracy': 1e-3}
    path.write_text(yaml.safe_dump({'mechanism': 'four_bar', 'solver': solver}))
    with SimulatorProcess(tmp_path, '--scene', 'pendulum', start_paused=True) as node:
        node.wait_running()
        ask = Requests(peer)
        said = {'solver__integrator': 'rk4', 'solver__tolerance': 1e-5}
        assert ask.answer(ask.set('accuracy', 0.0, **said)).result.successful
        names = ['accuracy', 'solver.integrator', 'solver.tolerance', 'solver.step']
        assert ask.get(*names)[:3] == [0.0, 'rk4', 1e-5]
        assert ask.answer(ask.set('scene', str(path), accuracy=0.0)).result.successful
        drawn = load_scene(path).solver
        assert ask.get(*names) == [0.0, drawn.integrator, drawn.tolerance, 1e-3]
        asked = ask.set('scene', str(path), accuracy=0.0, solver__integrator='dop853')
        assert ask.answer(asked).result.successful
        assert ask.get(*names) == [0.0, 'dop853', drawn.tolerance, 1e-3]
        assert 'searching settings' not in node.output
        assert ask.answer(ask.set('scene', str(path))).result.successful
        assert ask.get('accuracy') == [1e-3] and 'settings for 0.001 m' in node.output
        assert node.stop() == 0, node.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_search_and_the_node(peer, tmp_path, number):
    with SimulatorProcess(tmp_path, '--scene', SCENE).wait_running() as node:
        ask = Requests(peer)
        ask.set('accuracy', ACCURACY)
        peer.until(lambda: 'searching settings' in node.output, 'the beginning of the search')
        ask.get('accuracy')
        assert node.stop(number) == 0, node.output
    assert 'search given up' in node.output and 'settings for 1e-' not in node.output
    assert 'Traceback' not in node.output
    assert compare(load(node.logs[-1])).equal
