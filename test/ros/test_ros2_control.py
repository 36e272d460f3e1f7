"""A motor under ros2_control: the bytes of its plugin for topics, controllers, tolerances."""

import math
import struct
from typing import Any
from xml.etree import ElementTree

import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from alf_ros import Simulation, load_scene, resources
from alf_ros.exchange.urdf_export import urdf
from alf_ros.logs import load
from alf_ros.logs.cdr import STAMP, Encoder
from alf_ros.logs.comparison import compare
from alf_ros.ros.simulator.command_messages import Refused, read_joints
from alf_ros.simulation import input_checks as check
from support.paths import ROOT
from support.ros_node import Diagnostics, SimulatorProcess, journal, read_log

FOLDER = ROOT / 'config/ros2_control'
MECHANISMS = sorted(resources.library('ros2_control'))
# moved alone: the last motor, to here, rad or m
GOALS = {
    'actuator_leg': 0.03,
    'delta_robot': 0.2,
    'excavator': 0.2,
    'four_axis_delta': 0.2,
    'slider_crank': 0.9,
    'spring_leg': -1.6,
    'two_finger_gripper': 0.1,
}
NAN = math.nan
P, V, PV, NO = (True, False), (False, True), (True, True), (False, False)


def scene_of(mechanism):
    """Its scene with motors, as launch/ros2_control.launch.py chooses it."""
    controlled = f'{mechanism}_controlled'
    return controlled if controlled in resources.library('scenes') else mechanism


# ------------------------------------------------------------------ which joints values belong to


@pytest.mark.parametrize(
    ('controlled', 'message', 'commands'),
    [
        # as many values as names: each has its own, NaN is none
        ({'a': P, 'b': NO}, {'position': [1.0, NAN]}, {'a': {'position': 1.0}}),
        ({'a': P, 'b': P}, {'position': [NAN, NAN], 'effort': [NAN, NAN]}, {}),
        # interfaces that joints lack are left out
        ({'a': NO, 'b': P}, {'position': [1.0]}, {'b': {'position': 1.0}}),
        ({'a': P, 'b': NO, 'c': P}, {'position': [1.0, NAN]}, {'a': {'position': 1.0}}),
        (
            {'a': P, 'b': V},
            {'position': [1.0], 'velocity': [2.0]},
            {'a': {'position': 1.0}, 'b': {'velocity': 2.0}},
        ),
        (
            {'a': PV, 'b': V},  # b alone has no position
            {'position': [1.0], 'velocity': [2.0]},
            {'a': {'position': 1.0}, 'b': {'velocity': 2.0}},
        ),
        ({'a': NO, 'b': PV}, {'effort': [3.0]}, {'b': {'effort': 3.0}}),
    ],
)
def test_values_go_to_the_joints_that_have_the_interface(controlled, message, commands):
    names = list(controlled)
    assert read_joints(JointState(name=names, **message), names, controlled) == commands


@pytest.mark.parametrize(
    ('controlled', 'message'),
    [
        ({'a': P, 'b': P}, {'position': [1.0]}),
        ({'a': NO, 'b': NO}, {'effort': [1.0]}),
        ({'a': P}, {'position': [1.0, 2.0]}),
        # the effort of the motor that has a position already, or that of the joint without motor
        ({'a': P, 'b': NO}, {'position': [1.0], 'effort': [2.0]}),
    ],
)
def test_what_stays_open_is_refused(controlled, message):
    names = list(controlled)
    with pytest.raises(Refused, match='NaN means: no command') as refused:
        read_joints(JointState(name=names, **message), names, controlled)
    assert refused.value.reason == 'wrong_length'


# ------------------------------------------------------------------------------------ the plugin


class Padded(Encoder):
    """An encoder with something else than zeros where nothing is written."""

    def __init__(self, padding):
        super().__init__()
        self.padding = padding

    def align(self, size):
        before = len(self.data)
        after = super().align(size)
        self.data[before:] = bytes([self.padding]) * (after - before)
        return after


class Plugin:
    """The write() of topic_based_ros2_control, by the `<ros2_control>` block of a mechanism.

    It names every joint of the block; each command interface gets a value, NaN until a controller
    commands it; a joint without the interface has no value.
    """

    def __init__(self, mechanism):
        block = ElementTree.parse(FOLDER / f'{mechanism}.xml').getroot()
        assert block.findtext('hardware/plugin') == 'topic_based_ros2_control/TopicBasedSystem'
        self.topics = {p.get('name'): p.text for p in block.findall('hardware/param')}
        self.joints = {
            joint.get('name'): [each.get('name') for each in joint.findall('command_interface')]
            for joint in block.findall('joint')
        }
        self.states = [
            (joint.get('name'), each.get('name'))
            for joint in block.findall('joint')
            for each in joint.findall('state_interface')
        ]
        self.motors = [name for name, interfaces in self.joints.items() if interfaces]

    def values(self, commands):
        """Values by field; `commands` of joints to positions."""
        return {
            field: [commands.get(name, NAN) for name, has in self.joints.items() if field in has]
            for field in ('position', 'velocity', 'effort')
        }

    def data(self, commands, ns, padding=0):
        """The message as Fast CDR writes it, which leaves what it finds between the numbers."""
        message = Padded(padding)
        at = message.stamp()
        STAMP.pack_into(message.data, at, *divmod(ns, 1_000_000_000))
        message.text('')
        message.integer(len(self.joints))
        for name in self.joints:
            message.text(name)
        for numbers in self.values(commands).values():
            message.integer(len(numbers))
            if numbers:
                at = message.numbers(len(numbers))
                struct.pack_into(f'<{len(numbers)}d', message.data, at, *numbers)
        return bytes(message.data)

    def message(self, commands, ns):
        seconds, nanoseconds = divmod(ns, 1_000_000_000)
        header = Header(stamp=Time(sec=seconds, nanosec=nanoseconds))
        return JointState(header=header, name=list(self.joints), **self.values(commands))


@pytest.mark.parametrize('mechanism', MECHANISMS)
def test_the_bytes_are_those_of_the_middleware(mechanism):
    plugin, first = Plugin(mechanism), {'motor0': 0.25, 'crank_pin': -1.5}
    for commands in ({}, first):
        ours, other = (plugin.data(commands, 1_500_000_000, padding) for padding in (0, 255))
        theirs = bytes(serialize_message(plugin.message(commands, 1_500_000_000)))
        said = [n for n, (a, b) in enumerate(zip(ours, other, strict=True)) if a == b]
        assert bytes(theirs[n] for n in said) == bytes(ours[n] for n in said)
        assert 0 <= len(theirs) - len(ours) <= 8  # room for empty arrays of numbers, unused
        assert deserialize_message(ours, JointState).name == list(plugin.joints)


@pytest.mark.parametrize('mechanism', MECHANISMS)
def test_the_block_and_the_controllers_fit_the_scene(mechanism, tmp_path):
    plugin, scene = Plugin(mechanism), load_scene(scene_of(mechanism))
    known = check.controlled(Simulation(scene).model, scene.effects)
    robot = ElementTree.fromstring(urdf(scene.mechanism, keep=plugin.joints.keys()))
    assert plugin.joints.keys() <= {joint.get('name') for joint in robot.iter('joint')}
    for name, interfaces in plugin.joints.items():
        if interfaces:
            assert interfaces == ['position'] and known[name][0]
    file = FOLDER / f'{mechanism}.yaml'
    controller = yaml.safe_load(file.read_text())['/**/joint_trajectory_controller']
    joints = controller['ros__parameters']['joints']
    assert joints == plugin.motors
    # read by the node that reads it, in a namespace too
    context = rclpy.Context()
    arguments = ['--ros-args', '--params-file', str(file), '-r', '__ns:=/left']
    context.init(args=arguments)
    found: dict[str, Any] = {}
    for name in ('controller_manager', 'joint_trajectory_controller'):
        node = rclpy.create_node(
            name, context=context, automatically_declare_parameters_from_overrides=True
        )
        found |= {key: value.value for key, value in node.get_parameters_by_prefix('').items()}
        node.destroy_node()
    context.shutdown()
    assert found['update_rate'] == 100 and list(found['joints']) == joints
    assert all(found[f'constraints.{joint}.goal'] > 0.0 for joint in joints)


def test_the_plugin_moves_the_motors_of_each_mechanism(tmp_path, peer):
    """One node, which loads one scene after the other."""
    heard, found = peer.listen('joint_states', JointState), Diagnostics(peer)
    scene = ['--scene', scene_of(MECHANISMS[0])]
    with SimulatorProcess(tmp_path, *scene, start_paused='true').wait_running() as node:
        commands = peer.talk('joint_commands', JointState)
        for mechanism in MECHANISMS:
            if mechanism != MECHANISMS[0]:
                scene = Parameter('scene', value=scene_of(mechanism)).to_parameter_msg()
                asked = peer.call(SetParameters, '/simulator/set_parameters', parameters=[scene])
                assert asked.results[0].successful, asked.results[0].reason
            moved_by_plugin(Plugin(mechanism), GOALS[mechanism], peer, commands, heard, found)
        assert node.stop() == 0, node.output
    assert len(node.logs) == len(MECHANISMS)
    for mechanism, log in zip(MECHANISMS, node.logs, strict=True):
        (entry,) = journal(read_log(log))[1:]
        moved = Plugin(mechanism).motors[-1]
        goal = ('target', moved, GOALS[mechanism])
        assert (entry['kind'], entry['name'], entry['position']) == goal
        assert compare(load(log)).equal


def moved_by_plugin(plugin, goal, peer, commands, heard, found):
    """First no controller is active, then one commands the last motor.

    All before it moves: legs that nothing commands fall, and then it matters when a command comes.
    """
    assert set(plugin.topics.values()) >= {'joint_states', 'joint_commands'}

    def value(name, field='position', at=-1):
        return getattr(heard[at], field)[list(heard[at].name).index(name)]

    def near():
        return any(abs(value(moved, at=n) - goal) < 0.02 for n in range(began, len(heard)))

    peer.until(lambda: set(plugin.joints) <= set(heard[-1].name), 'the states of its joints')
    assert all(math.isfinite(value(*state)) for state in plugin.states)
    before = peer.until(lambda: found.value('commands', 'accepted'), 'diagnostics')
    commands.publish(plugin.data({}, 1))
    peer.until(lambda: found.value('commands', 'accepted') != before, 'nothing commanded')
    assert found.value('commands', 'held') == '0'
    moved, began = plugin.motors[-1], len(heard) - 1
    before = found.value('commands', 'accepted')
    commands.publish(plugin.data({moved: goal}, 2))
    peer.until(lambda: found.value('commands', 'accepted') != before, 'the command')
    assert not near()
    assert peer.call(SetBool, '/simulator/pause', data=False).success
    peer.until(near, 'the position')
    assert found.value('commands', 'last_trouble') == ''


# -------------------------------------------------------------------------------------- tolerances


def test_trajectories_of_several_joints_report_their_tolerances(tmp_path, peer):
    found = Diagnostics(peer)
    motors = ['motor0', 'motor1', 'motor2']
    options = {'trajectory.path_tolerance': 0.5, 'trajectory.goal_tolerance': 0.02}
    scene = ['--scene', 'delta_robot_controlled']
    with SimulatorProcess(tmp_path, *scene, **options).wait_running() as node:
        publisher = peer.talk('/simulator/joint_trajectory', JointTrajectory)
        peer.until(lambda: found.status('trajectory'), 'a report')
        level, _, values = found.status('trajectory')
        assert (level, values['state'], values['joints']) == (b'\0', 'none', '0')

        def follow(*goals):
            points = []
            for seconds, positions in enumerate(goals, 1):
                point = JointTrajectoryPoint(positions=positions, velocities=[0.0] * 3)
                point.time_from_start.nanosec = 400_000_000 * seconds
                points.append(point)
            publisher.publish(JointTrajectory(joint_names=motors, points=points))

        follow([0.1, 0.2, -0.1], [0.2, 0.1, 0.0])
        peer.until(lambda: found.value('trajectory', 'state') == 'reached', 'the goal')
        level, message, first = found.status('trajectory')
        assert (level, message, first['joints']) == (b'\0', 'reached', '3')
        # nothing follows within a picometre
        tight = [Parameter(f'trajectory.{k}_tolerance', value=1e-12) for k in ('path', 'goal')]
        asked = [parameter.to_parameter_msg() for parameter in tight]
        results = peer.call(SetParameters, '/simulator/set_parameters', parameters=asked).results
        assert all(result.successful for result in results)
        follow([0.0, 0.3, 0.1])
        peer.until(lambda: found.value('trajectory', 'state') == 'missed', 'the goal, missed')
        level, message, last = found.status('trajectory')
        assert level == b'\1' and 'off its path' in message and 'off its goal' in message
        assert last['path_error_joint'] in motors and last['goal_error_joint'] in message
        assert node.stop() == 0, node.output
    # what is reported is what the log says
    log = read_log(node.logs[0])
    states = dict(log['/joint_states'])
    targets = [entry for entry in journal(log) if entry['kind'] == 'target']
    assert [entry['name'] for entry in targets] == 2 * motors
    for report, curves in ((first, targets[:3]), (last, targets[3:])):
        start, end = curves[0]['t'], float(report['end_s'])
        errors = [
            abs(state.position[list(state.name).index(curve['name'])] - at(curve['position'], t))
            for stamp, state in states.items()
            for curve in curves
            if start < (t := stamp * 1e-9) < end - 1e-9
        ]
        assert float(report['path_error']) == pytest.approx(max(errors), rel=1e-9)


def at(pieces, t):
    """The value of a curve in the journal at t (s)."""
    begin, *c = [piece for piece in pieces if piece[0] <= t][-1]
    return sum(c[k] * (t - begin) ** k for k in range(len(c)))


def test_the_launch_file_finds_both_files_and_the_scene():
    blocks = {path.stem for path in FOLDER.glob('*.xml')}
    assert blocks == set(MECHANISMS) == set(GOALS)
    assert "'delta_robot'" in (ROOT / 'launch/ros2_control.launch.py').read_text()  # its default
    for mechanism in MECHANISMS:
        block = ElementTree.parse(FOLDER / f'{mechanism}.xml').getroot()
        assert block.get('name') == mechanism == load_scene(scene_of(mechanism)).mechanism.name
