"""The server of the view under those who mean ill: all ends in bounded time, and is refused."""

from __future__ import annotations

import http.client
import json
import resource
import socket
import threading
import time
from typing import Any

import pytest

from alf_ros.errors import AlfError
from alf_ros.ros.view import server as served
from alf_ros.ros.view.server import Broadcast, Server
from support.browser import CHROMIUM, Browser

LIMIT = 60.0  # s; only what fails waits that long
JSON = 'application/json'


def obey(command):
    if command != {'do': 'well'}:
        raise AlfError('no')
    return 'done'


@pytest.fixture
def server(monkeypatch):
    monkeypatch.setattr(served, 'REQUEST_TIME', 1.0)
    monkeypatch.setattr(served._Request, 'timeout', 0.5)
    with Server(0, Broadcast(), obey, lambda name: None) as made:
        yield made


def connected(server):
    return socket.create_connection(('127.0.0.1', server.server_port), LIMIT)


def until(condition, what):
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def closed(connection):
    """Whether the other end closes it, whatever it says before."""
    connection.settimeout(LIMIT)
    try:
        while connection.recv(1 << 16):
            pass
    except ConnectionError:
        pass
    return True


def serves(server):
    """Whether the server answers the request of a browser with the page."""
    connection = http.client.HTTPConnection('localhost', server.server_port, timeout=LIMIT)
    try:
        connection.request('GET', '/')
        return connection.getresponse().status == 200
    except OSError:
        return False
    finally:
        connection.close()


def test_idle_sockets_are_few_and_end(server, capfd):
    before = threading.active_count()
    idle = [connected(server) for _ in range(200)]
    most = served.MOST_CONNECTIONS
    until(lambda: threading.active_count() > before, 'a thread')
    assert threading.active_count() <= before + most
    assert all(map(closed, idle))
    until(lambda: serves(server), 'the page')
    until(lambda: threading.active_count() <= before + 1 and not server._open, 'no threads')
    assert capfd.readouterr().err == ''


def test_a_request_of_a_byte_now_and_then_ends(server):
    slow = connected(server)
    with pytest.raises(ConnectionError):
        for _ in range(int(LIMIT / 0.1)):
            slow.sendall(b'G')
            time.sleep(0.1)
    assert serves(server)


@pytest.mark.parametrize(
    'request_',
    [
        b'GET /' + b'a' * (1 << 22) + b' HTTP/1.0\r\n\r\n',
        b'GET / HTTP/1.0\r\nX: ' + b'a' * (1 << 22) + b'\r\n\r\n',
        b'GET / HTTP/1.0\r\n' + b'X: y\r\n' * 1_000_000 + b'\r\n',
        b'\0' * (1 << 22),
        b'\n' * (1 << 22),
        b'POST /command HTTP/1.0\r\nHost: localhost:{port}\r\nContent-Type: application/json\r\n'
        b'Content-Length: 65536\r\n\r\n[',
        b'POST /command HTTP/1.0\r\nHost: localhost:{port}\r\nContent-Type: application/json\r\n'
        b'Content-Length: 99999999999999999999999\r\n\r\n' + b'[' * (1 << 22),
        b'POST /command HTTP/1.0\r\nHost: localhost:{port}\r\nContent-Type: application/json\r\n'
        b'Transfer-Encoding: chunked\r\n\r\nffffffff\r\n' + b'[' * (1 << 22),
        b'GET / HTTP/9.9\r\nHost: localhost:{port}\r\n\r\n',
        b'GET\r\n\r\n',
        b'\xff\xfe\x00\r\n\r\n',
    ],
    ids=[
        'line',
        'header',
        'headers',
        'zeros',
        'lines',
        'body',
        'size',
        'chunks',
        'version',
        'bare',
        'binary',
    ],
)
def test_oversized_and_broken_requests_are_not_taken_in(server, request_, capfd):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    connections = [connected(server) for _ in range(20)]
    for connection in connections:
        connection.settimeout(LIMIT)
        try:
            connection.sendall(request_.replace(b'{port}', str(server.server_port).encode()))
        except ConnectionError:
            pass  # it has seen enough
    assert all(map(closed, connections))
    assert serves(server)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 40_000, f'{grown} kB'  # 20 requests of 4 MB would be 80
    assert 'Traceback' not in capfd.readouterr().err


def status(server, method, path, **headers):
    connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=LIMIT)
    given = {'Host': f'localhost:{server.server_port}', **headers}
    connection.request(method, path, headers={k.replace('_', '-'): v for k, v in given.items()})
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders())
    connection.close()
    return found


@pytest.mark.parametrize('method', ['PUT', 'DELETE', 'OPTIONS', 'TRACE', 'HEAD', 'CONNECT', 'X'])
@pytest.mark.parametrize('path', ['/', '/events', '/command'])
def test_other_methods_do_nothing(server, method, path):
    code, headers = status(server, method, path, Origin='http://elsewhere.example')
    assert code == 501
    assert not any(key.lower().startswith('access-control') for key in headers)
    assert 'Python' not in headers.get('Server', '')


@pytest.mark.parametrize(
    'headers',
    [
        {'Host': 'elsewhere.example'},
        {'Host': ''},
        {'Host': 'localhost'},
        {'Host': 'localhost:1'},
        {'Origin': 'http://elsewhere.example'},
        {'Origin': 'null'},
        {'Origin': 'http://localhost:1'},
        {'Origin': 'https://localhost:{port}'},
        {'Origin': ''},
    ],
)
@pytest.mark.parametrize('path', ['/', '/events', '/view.js'])
def test_strangers_get_nothing(server, path, headers):
    given = {key: value.format(port=server.server_port) for key, value in headers.items()}
    assert status(server, 'GET', path, **given)[0] == 403


def test_readers_of_pictures_are_few(server):
    streams = []
    for _ in range(50):
        connection = http.client.HTTPConnection('localhost', server.server_port, timeout=LIMIT)
        connection.request('GET', '/events')
        streams.append((connection, connection.getresponse()))
        if streams[-1][1].status == 200:
            streams[-1][1].readline()  # it is counted from its first event on
    codes = [answer.status for _, answer in streams]
    assert codes.count(200) == served.MOST_READERS and codes.count(503) == 50 - codes.count(200)
    assert serves(server)  # whoever opens the page still gets it
    server.broadcast.put({'run': 1}, {'t': 0.0})
    for connection, answer in streams:
        if answer.status == 200:
            while not answer.readline().startswith(b'data: {"t"'):
                pass
        answer.close()
        connection.close()
    until(lambda: server.broadcast.readers == 0, 'nobody')


def test_a_reader_who_takes_nothing_is_left(server):
    """Its socket is full; the server does not wait for ever, nor keep what it does not take."""
    stuck = connected(server)
    stuck.sendall(f'GET /events HTTP/1.0\r\nHost: localhost:{server.server_port}\r\n\r\n'.encode())
    until(lambda: server.broadcast.readers == 1, 'a reader')
    end = time.monotonic() + LIMIT
    while server.broadcast.readers:
        server.broadcast.put({'run': 1}, {'t': time.monotonic(), 'x': 'y' * 100_000})
        assert time.monotonic() < end
        time.sleep(0.005)
    assert serves(server)


@pytest.mark.parametrize('body', ['[' * 30_000, '{"do": ' * 9000, '1' * 60_000, '"\\ud800"', ''])
def test_deep_and_long_commands_are_told(server, body, capfd):
    connection = http.client.HTTPConnection('localhost', server.server_port, timeout=LIMIT)
    connection.request('POST', '/command', body, {'Content-Type': JSON})
    answer = connection.getresponse()
    assert answer.status == 200 and json.loads(answer.read())['done'] is False
    assert capfd.readouterr().err == ''


HOSTILE = '</script><img src=x onerror="window.owned=1"><script>window.owned=1</script>'


@pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')
def test_names_of_strangers_stay_text(tmp_path):
    """Whatever a node says of its scene, joints and state is written, and never read as HTML."""
    about: dict[str, Any] = {
        'simulator': HOSTILE,
        'state': HOSTILE,
        'run': 1,
        'scene': HOSTILE,
        'spatial': False,
        'joints': [HOSTILE, '__proto__', 'constructor'],
        'units': [HOSTILE, 'rad', ''],
        'driven': ['constructor'],
        'balls': ['toString'],
        'drives': [HOSTILE],
        'drive_units': [HOSTILE],
        'reacting': [HOSTILE],
        'reports': [[HOSTILE, 2, HOSTILE]],
        'scenes': [HOSTILE],
    }
    picture = {
        't': 0.0,
        'position': [1.0, 2.0, 3.0],
        'velocity': [1.0, 2.0, 3.0],
        'effort': [0.0, 0.0, 0.0],
        'force': [1.0],
        'drives': [1.0],
        'energy': 1.0,
        'violation': [0.0, 0.0],
        'links': [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        'joints': [0.0, 0.0, 0.0],
    }
    said = []

    def obey(command):
        said.append(command)
        raise AlfError(HOSTILE)

    with Server(0, Broadcast(), obey, lambda name: None) as server:
        server.broadcast.put(about, picture)
        with Browser(server.url, tmp_path / 'profile') as page:
            page.until("document.querySelectorAll('.joint b').length === 4")
            names = "[...document.querySelectorAll('.joint b')].map((b) => b.textContent)"
            assert page.run(names) == [*about['joints'], HOSTILE]
            assert page.run("document.getElementById('scene').textContent") == HOSTILE
            page.run(f"ask('scene', {json.dumps(HOSTILE)})")
            page.until("document.getElementById('reports').textContent.includes('onerror')")
            assert said == [{'do': 'scene', 'value': HOSTILE}]
            assert page.run('window.owned') is None
            assert page.run("document.querySelectorAll('img').length") == 0
            assert page.run("document.querySelectorAll('script:not([src])').length") == 0
            assert page.run('({}).owned') is None
            assert page.complaints == []
