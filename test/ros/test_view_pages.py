"""Several pages of one live view, whose commands come at once."""

import threading
import time
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from alf_ros.ros.view.operator import Operator
from alf_ros.ros.view.view_node import ViewNode
from support.ros_node import LIMIT


class Simulator:
    """The services of a simulator, which answer at once: the ticks of each step in `made`."""

    def __init__(self):
        self.count, self.made = 1, []

    def create_client(self, kind, name):
        act = {SetParameters: self.set_count, Trigger: self.step}.get(kind)
        return SimpleNamespace(srv_name=name, service_is_ready=lambda: True, call_async=act)

    def create_publisher(self, *_):
        return None

    def set_count(self, request):
        self.count = request.parameters[0].value.integer_value
        return answered(SetParameters.Response(results=[SetParametersResult(successful=True)]))

    def step(self, _):
        self.made.append(self.count)
        return answered(Trigger.Response(success=True, message=f'{self.count}'))


def answered(response):
    future: Future[Any] = Future()
    future.set_result(response)
    return future


def test_each_page_steps_by_its_own_count():
    """One stepped by the count of the other, which had set it in between."""
    simulator = Simulator()
    operator = Operator(cast(ViewNode, simulator), 'simulator')
    said = {}

    def page(count):
        said[count] = operator.obey({'do': 'step', 'value': count})

    pages = [threading.Thread(target=page, args=(count,)) for count in (3, 7)]
    for each in pages:
        each.start()
    end = time.monotonic() + LIMIT
    while any(each.is_alive() for each in pages) and time.monotonic() < end:
        time.sleep(0.1)  # both have sent what they may send by now
        operator.work()
    assert said == {3: '3', 7: '7'}
    assert sorted(simulator.made) == [3, 7]
