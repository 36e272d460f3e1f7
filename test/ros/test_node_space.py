"""A mechanism in space as a node: its messages, and wrenches with all six components."""

import yaml
from geometry_msgs.msg import WrenchStamped
from visualization_msgs.msg import MarkerArray

from alf_ros import Simulation
from alf_ros.scene.scene import scene_from_text
from support.effect_scenes import TOP
from support.ros_node import Diagnostics, SimulatorProcess, journal, read_log, wrench


def test_a_wrench_in_space_acts_and_times_out(tmp_path, peer):
    (tmp_path / 'top.yaml').write_text(yaml.safe_dump(TOP, sort_keys=False))
    found, markers = Diagnostics(peer), peer.listen('/simulator/markers', MarkerArray)
    options = ['--scene', str(tmp_path / 'top.yaml'), '--ros-args', '-p', 'command_timeout:=0.3']
    with SimulatorProcess(tmp_path, *options).wait_running() as node:
        push = peer.talk('/simulator/wrench/top', WrenchStamped)
        push.publish(wrench(1.0, 2.0, 0.5, frame='top', forcez=-3.0, torquex=0.25, torquey=0.125))
        peer.until(lambda: found.value('commands', 'accepted') == '1', 'a command')
        peer.until(lambda: found.value('commands', 'timed_out') == '1', 'its end')
        count = len(markers)
        peer.until(lambda: len(markers) > count + 2, 'motion without it')
        assert node.stop() == 0, node.output
    assert 'Traceback' not in node.output
    log = read_log(node.logs[0])
    start, applied, zeroed = journal(log)
    assert (applied['force'], applied['torque']) == ([1.0, 2.0, -3.0], [0.25, 0.125, 0.5])
    assert (zeroed['cause'], zeroed['force']) == ('timeout', [0.0, 0.0, 0.0])
    # the log repeats it bit for bit
    simulation = Simulation(scene_from_text(log['/simulator/scene'][0][1].data), **start['solver'])
    for entry in (applied, zeroed):
        simulation.step(entry['step'] - simulation.step_index)
        keys = ('name', 'force', 'torque', 'frame')
        simulation.apply_wrench(**{key: entry[key] for key in keys})
    stamp, last = log['/simulator/reactions'][-1]
    simulation.step(round(stamp * 1e-9 / simulation.h) - simulation.step_index)
    force = last.wrench[0].force
    assert [force.x, force.y, force.z] == simulation.sample().reaction_forces[0].tolist()
