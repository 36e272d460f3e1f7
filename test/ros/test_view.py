"""The live view: simulator, view and a browser as real processes; and who may not command."""

import http.client
import json
import signal
import socket
import threading
from itertools import pairwise

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from alf_ros.errors import AlfError
from alf_ros.ros.view.server import FILES, PAGE, Broadcast, Server
from support.browser import CHROMIUM, Browser
from support.ros_node import LIMIT, START_LIMIT, Diagnostics, SimulatorProcess
from support.thorough import thinned
from support.view_process import ViewProcess, view

# ------------------------------------------------------------------------------------- the page


def obey(command):
    if command != {'do': 'well'}:
        raise AlfError('no')
    return 'done'


@pytest.fixture
def server():
    with Server(0, Broadcast(), obey, lambda name: None) as server:
        yield server


def ask(server, method, path, body=None, **headers):
    """(status, text) of a request."""
    connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=LIMIT)
    given = {key.replace('_', '-'): value for key, value in headers.items()}
    connection.request(method, path, body, given)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def test_the_page_needs_nothing_from_elsewhere(server):
    for path in FILES:
        status, text = ask(server, 'GET', path)
        assert status == 200
        assert 'http:' not in text and 'https:' not in text and '//cdn' not in text
    assert ask(server, 'GET', '/../view.py')[0] == 404
    served = {path for path, _ in FILES.values()}
    assert all(path.is_file() for path in served) and set(PAGE.iterdir()) <= served


def test_it_listens_at_one_address_of_this_machine(server):
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(('127.0.0.2', server.server_port), LIMIT)


JSON = 'application/json'


@pytest.mark.parametrize(
    ('status', 'headers'),
    [
        (200, {}),
        (200, {'Origin': 'http://localhost:{port}'}),
        # another page in the same browser
        (403, {'Origin': 'http://elsewhere.example'}),
        (403, {'Origin': 'null'}),
        # a name that was made to point here
        (403, {'Host': 'elsewhere.example:{port}'}),
        # what a form of another page can send without asking
        (404, {'Content_Type': 'text/plain'}),
    ],
)
def test_only_the_page_itself_commands(server, status, headers):
    given = {'Content_Type': JSON, **headers}
    given = {key: value.format(port=server.server_port) for key, value in given.items()}
    found, text = ask(server, 'POST', '/command', '{"do": "well"}', **given)
    assert found == status
    assert status != 200 or json.loads(text) == {'done': True, 'said': 'done'}


def test_what_is_no_command_is_told(server):
    for body in ('{"do": "ill"}', '[1', '3', ''):
        status, text = ask(server, 'POST', '/command', body, Content_Type=JSON)
        assert status == 200 and json.loads(text)['done'] is False
    huge = {'Content_Type': JSON, 'Content_Length': str(1 << 30)}
    assert ask(server, 'POST', '/command', **huge)[0] == 413


def test_a_slow_reader_gets_the_newest_picture_and_no_old_one():
    broadcast = Broadcast()
    events = broadcast.read()
    assert not broadcast.wanted
    assert next(events) == ':\n\n' and broadcast.wanted
    for n in range(100):
        broadcast.put({'run': 1}, {'t': n})
    assert next(events) == 'event: about\ndata: {"run": 1}\n\nevent: picture\ndata: {"t": 99}\n\n'
    waiting = threading.Timer(0.1, broadcast.put, [{'run': 1}, {'t': 100}])
    waiting.start()
    assert next(events) == 'event: picture\ndata: {"t": 100}\n\n'
    events.close()
    assert not broadcast.wanted


# ---------------------------------------------------------------------------------- the command


def test_a_port_that_is_taken_is_one_line(server):
    done = view('--port', str(server.server_port))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith('alf_ros view: --port: cannot be opened')


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--port', '70000'], '--port'),
        (['--simulator', 'a b'], "--simulator: not the name of a node, got 'a b'"),
        (['--simulator', ''], "--simulator: not the name of a node, got ''"),
        (['--simulator', '/left/simulator'], 'a namespace by --ros-args -r __ns:=/left'),
        (['--port', '0', '--ros-args', '-p', 'rate:=3'], "parameter of the node, got 'rate'"),
    ],
)
def test_what_cannot_be_is_one_line(options, said):
    done = view(*options)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and said in line


@pytest.mark.parametrize('number', thinned([signal.SIGINT, signal.SIGTERM], keep=[signal.SIGINT]))
def test_a_signal_ends_it(number):
    with ViewProcess(new=True) as process:
        assert process.stop(number) == 0


# ---------------------------------------------------------------------------------- the browser

INK = """(() => {
    const stage = document.getElementById('stage');
    const dots = stage.getContext('2d').getImageData(0, 0, stage.width, stage.height).data;
    let found = 0;
    for (let n = 0; n < dots.length; n += 4)
        if (dots[n + 3] > 200 && Math.abs(dots[n] - dots[n + 2]) > 60) found++;
    return found;
})()"""  # dots with a colour: the arrows; lines and grid are grey


OPTIONS = """(() => {
    const stage = document.querySelector('.stage');
    stage.style.width = '400px';
    const ends = [...stage.querySelectorAll('label')].map((x) => x.getBoundingClientRect().right);
    stage.style.width = '';
    return Math.max(...ends) - stage.getBoundingClientRect().left;
})()"""  # px, the farthest end in a stage of 400 px
NUMBERS = """[...document.querySelector('.joint .numbers').children].map((part) => {
    part.textContent = '-0.001185 rad/s';
    return part;
}).map((part) => {
    const range = document.createRange();
    range.selectNodeContents(part);
    const {left, right} = range.getBoundingClientRect();
    return [left, right];
})"""


@pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')
def test_the_page_shows_the_simulator_and_commands_it(tmp_path, peer):
    heard = peer.listen('joint_states', JointState)
    found = Diagnostics(peer)

    def ticks():
        """Stamps in ticks of 2 ms."""
        stamp = heard[-1].header.stamp
        return stamp.sec * 500 + stamp.nanosec // 2_000_000

    def text(name):
        return page.run(f'document.getElementById({name!r}).textContent')

    def state(wanted, limit=LIMIT):
        page.until(f"document.getElementById('state').textContent === {wanted!r}", limit)

    simulator = SimulatorProcess(tmp_path / 'first').wait_running()
    with simulator, ViewProcess() as process, Browser(process.url, tmp_path / 'profile') as page:
        # it draws, and what is drawn moves
        page.until("document.getElementById('scene').textContent === 'slider_crank'")
        state('playing')
        page.until(f'{INK} > 50')
        first = page.run("document.getElementById('stage').toDataURL()"), text('time')
        page.until(f"document.getElementById('stage').toDataURL() !== '{first[0]}'")
        page.until(f"document.getElementById('time').textContent !== '{first[1]}'")
        names = "[...document.querySelectorAll('.joint b')].map((b) => b.textContent)"
        assert page.run(names) == ['crank_pin', 'knee', 'guide']
        page.until("document.querySelector('.joint .numbers').textContent.includes('rad/s')")
        page.until("document.querySelector('.reaction').textContent.endsWith(' N')")
        page.until('record.length > 10')
        page.screenshot(tmp_path / 'playing.png')
        # texts have room: options on a phone, and long numbers beside each other
        assert page.run(OPTIONS) <= 400
        ends = page.run(NUMBERS)
        assert all(end + 7.0 < begin for (_, end), (begin, _) in pairwise(ends))

        # pause stands still, step makes as many ticks as it says
        page.click('#pause')
        state('paused')
        peer.until(lambda: found.value('solver', 'state') == 'paused', 'a pause')
        before = round(500 * float(found.value('solver', 'simulated_time_s')))
        peer.until(lambda: ticks() == before, 'all that came before')
        page.until(f"document.getElementById('time').textContent === '{before / 500:.3f} s'")
        page.run("document.getElementById('ticks').value = 25")
        page.click('#step')
        peer.until(lambda: ticks() == before + 25, '25 ticks')
        page.until(
            f"document.getElementById('time').textContent === '{(before + 25) / 500:.3f} s'"
        )

        # a slider sets an effort, held while the simulator stands still
        page.click('.joint:nth-child(2) input', along=0.75)
        effort = float(page.run("document.querySelectorAll('.joint input')[1].value"))
        assert effort > 1.0
        peer.until(lambda: list(heard[-1].effort) == [0.0, effort, 0.0], 'the effort')
        # another number of an effect is no new run
        run, energy = page.run('about.run'), page.run('picture.energy')
        gravity = Parameter('effects.gravity.acceleration', value=[0.0, -1.62])
        request = {'parameters': [gravity.to_parameter_msg()]}
        assert (
            peer.call(SetParameters, '/simulator/set_parameters', **request).results[0].successful
        )
        page.until(f'picture.energy !== {energy}')
        assert page.run('about.run') == run
        assert float(page.run("document.querySelectorAll('.joint input')[1].value")) == effort
        page.click('#zero')
        peer.until(lambda: list(heard[-1].effort) == [0.0, 0.0, 0.0], 'no effort')

        # what is refused is told
        page.run("ask('effort', {kneee: 1})")
        page.until("document.getElementById('reports').textContent.includes('kneee')")
        page.run("ask('scene', '/etc/passwd')")
        page.until("document.getElementById('reports').textContent.includes('no such scene')")

        # reset begins anew, at the pace that is asked for
        page.click('#reset')
        page.until("document.getElementById('time').textContent === '0.000 s'")
        page.run("$('speed').value = 0.1; $('speed').onchange()")
        peer.until(lambda: found.value('timing', 'wanted_real_time_factor') == '0.1', 'a pace')
        page.click('#pause')
        state('playing')

        # another scene, in space
        page.run("$('scenes').value = 'spatial_slider_crank'; $('scenes').onchange()")
        page.until("about.scene === 'spatial_slider_crank' && about.spatial", START_LIMIT)
        state('paused')
        page.until('picture?.links?.length > 0')
        page.screenshot(tmp_path / 'space.png')

        # another simulator
        assert simulator.stop() == 0, simulator.output
        state('no simulator')
        assert page.run("document.getElementById('reports').classList.contains('gone')")
        with SimulatorProcess(tmp_path / 'second').wait_running() as other:
            state('playing')
            page.until("about.scene === 'slider_crank' && picture?.links")
            assert page.complaints == []
            page.close()

            # nobody looks: nothing is asked for
            def readers():
                infos = peer.node.get_subscriptions_info_by_topic('/simulator/markers')
                return [info for info in infos if info.node_name == 'view']

            peer.until(lambda: not readers(), 'no subscription')
            assert process.stop() == 0
            assert other.stop() == 0
