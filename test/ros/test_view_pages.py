"""Several pages of one live view, whose commands come at once."""

import http.client
import json
import threading
from typing import Any
from urllib.parse import urlsplit

from sensor_msgs.msg import JointState

from support.ros_node import LIMIT, SimulatorProcess
from support.view_process import ViewProcess


def test_each_page_steps_by_its_own_count(tmp_path, peer):
    """One stepped by the count of the other, which had set it in between."""
    heard = peer.listen('joint_states', JointState)
    said: dict[int, list[dict[str, Any]]] = {3: [], 7: []}

    def ticks():
        """Stamps in ticks of 2 ms."""
        stamp = heard[-1].header.stamp
        return stamp.sec * 500 + stamp.nanosec // 2_000_000

    def ask(connection, act, value=None):
        headers = {'Content-Type': 'application/json'}
        command = json.dumps({'do': act, 'value': value})
        connection.request('POST', '/command', command, headers)
        return json.loads(connection.getresponse().read())

    def page(connection, count):
        for _ in range(8):
            said[count].append(ask(connection, 'step', count))

    simulator = SimulatorProcess(tmp_path, start_paused='true').wait_running()
    with simulator, ViewProcess() as process:
        port = urlsplit(process.url).port
        each = {n: http.client.HTTPConnection('127.0.0.1', port, timeout=LIMIT) for n in said}
        peer.until(lambda: ask(each[3], 'step', 1)['done'], 'services that the view has found')
        pages = [threading.Thread(target=page, args=(each[n], n)) for n in said]
        for thread in pages:
            thread.start()
        peer.until(lambda: not any(map(threading.Thread.is_alive, pages)), 'all answers')
        peer.until(lambda: ticks() >= 1 + 8 * (3 + 7), 'all ticks')
        for connection in each.values():
            connection.close()
    assert all(answer['done'] for answers in said.values() for answer in answers)
    assert ticks() == 1 + 8 * (3 + 7)
