"""A controller in a process of its own balances two four-bars upright, at 500 Hz over topics."""

import math
import os
import subprocess
import sys

from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from alf_ros import Simulation, load_scene
from support.journal_run import repeat
from support.paths import ROOT
from support.ros_node import Diagnostics, SimulatorProcess, journal, read_log

# The inertia of all that moves is 3 kg m² about a pin, gravity pulls it over with 34.3 N m/rad.
KP, KV = 140.0, 36.0


def test_without_it_they_fall_over():
    simulation = Simulation(load_scene('double_four_bar'))
    simulation.step(1000)
    assert abs(simulation.sample().joints['pin0'].position - math.pi / 2) > 1.0


def test_a_controller_balances_them(tmp_path, peer):
    heard, found = peer.listen('joint_states', JointState), Diagnostics(peer)
    options = ['--scene', 'double_four_bar']
    slow = {'real_time_factor': 0.25}  # the controller has time to answer, on a busy machine too
    balance = [sys.executable, str(ROOT / 'test/support/balance.py'), 'pin0', str(math.pi / 2)]
    with SimulatorProcess(tmp_path, *options, start_paused='true', **slow).wait_running() as node:
        controller = subprocess.Popen([*balance, str(KP), str(KV)], env=os.environ)
        try:
            # The state is said again while it stands still, and answered.
            peer.until(lambda: found.value('commands', 'held') == '1', 'the controller')
            assert peer.call(SetBool, '/simulator/pause', data=False).success
            peer.until(lambda: heard[-1].header.stamp.sec >= 4, 'four seconds', limit=120.0)
        finally:
            controller.terminate()
            assert controller.wait(10.0) == 0
        assert node.stop() == 0, node.output
    log = read_log(node.logs[0])
    states = [(t, m.position[0], m.velocity[0]) for t, m in log['/joint_states']]
    swing = max(abs(angle - math.pi / 2) for _, angle, _ in states)
    # pushed at 1 rad/s, it gives way, and comes back to stand
    assert 0.02 < swing < 0.3
    settled = [(angle, rate) for t, angle, rate in states if 3e9 < t < 4e9]
    assert max(abs(angle - math.pi / 2) for angle, _ in settled) < 2e-3
    assert max(abs(rate) for _, rate in settled) < 2e-2
    efforts = [entry for entry in journal(log) if entry['kind'] == 'effort']
    # a busy machine may make several ticks at once: they have one answer
    assert len({entry['step'] for entry in efforts}) > 0.1 * len(states)
    repeated = repeat(log)
    for stamp, state in log['/joint_states']:
        assert list(state.position) == repeated[stamp]
