"""The node with steps that are too long: a warning in the diagnostics, the log and its report."""

import math

from alf_ros.logs import load
from alf_ros.logs.report.diagnostic_levels import Reports
from support.ros_node import Diagnostics, Peer, SimulatorProcess

LONG = {'solver__step': 0.05, 'solver__integrator': 'rk4', 'rate': 20.0}


def test_steps_that_are_too_long(tmp_path):
    with Peer() as peer:
        found = Diagnostics(peer)
        with SimulatorProcess(tmp_path, **LONG, real_time_factor=10.0) as node:
            node.wait_running()
            peer.until(lambda: 'too long' in str(found.status('solver')), 'a warning')
            level, message, values = found.status('solver')
            assert level == b'\1' and 'steps of 0.05 s are too long' in message
            assert float(values['step_error']) > 0.001
            assert f'take {float(values["adequate_step_s"]):g} s or less' in message
            assert node.stop() == 0
        assert node.output.count('steps of 0.05 s are too long') == 1
    log = load(str(node.logs[0]))
    told = Reports('simulator: ')
    series = log.read('/diagnostics')
    told.add(log.time(series.stamp), series.messages)
    assert any('steps of 0.05 s are too long' in text for _, _, text in told.texts)
    assert ('step_error', 'sum over 1000 steps') in told.numbers
    assert not math.isnan(told.texts[0][0])
