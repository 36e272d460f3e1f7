"""The node `close` as another process: what it publishes, against closed forms; bad messages."""

from __future__ import annotations

import math
import os
import re
import signal
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import ListParameters
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from alf_ros import Closure, InputError
from alf_ros.ros.closing.active_input import ActiveInput, renamed
from alf_ros.ros.closing.closing_messages import WARN, joint_state
from alf_ros.ros.messages.topics import BEST_EFFORT, RELIABLE
from support.forked import ended, started
from support.paths import ROOT
from support.ros_node import LIMIT, SPEAKS, START_LIMIT, Peer, own_lines, stacks

INPUT = '/active_joint_states'


class ClosingProcess:
    """`python -m alf_ros close` in a session of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.output_path = folder / 'output.txt'
        paths = [str(ROOT), os.environ.get('PYTHONPATH', '')]
        with open(self.output_path, 'w') as output:
            self.process = started(
                ['-m', 'alf_ros', 'close', *arguments],
                folder,
                {**os.environ, **SPEAKS, 'PYTHONPATH': os.pathsep.join(filter(None, paths))},
                output,
            )

    def __enter__(self) -> ClosingProcess:
        end = time.monotonic() + START_LIMIT
        while 'running:' not in self.output:
            assert self.process.poll() is None, self.output
            assert time.monotonic() < end, stacks(self.process) + self.output
            time.sleep(0.02)
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    @property
    def output(self) -> str:
        return self.output_path.read_text()

    def stop(self, number: int = signal.SIGINT) -> int:
        os.killpg(self.process.pid, number)
        return self.process.wait(LIMIT)


def message(ns: int, velocities: list[float] | None = None, **positions: float) -> JointState:
    said = JointState(name=list(positions), position=[float(x) for x in positions.values()])
    said.velocity = velocities or []
    said.header.stamp.sec, said.header.stamp.nanosec = divmod(ns, 1_000_000_000)
    return said


def values(report: DiagnosticArray, task: str) -> tuple[bytes, str, dict[str, str]]:
    (status,) = (each for each in report.status if each.name == f'close: {task}')
    return status.level, status.message, {each.key: each.value for each in status.values}


def check_interface(peer: Peer) -> None:
    """The tables of doc/ros_interface.md and the security policy are what the node has."""
    text = (ROOT / 'doc/ros_interface.md').read_text('utf-8')
    section = text.partition('\n## Closing loops\n')[2].partition('\n## ')[0]
    rows = [line.strip('|').split('|') for line in section.splitlines() if line[:3] == '| `']
    own = {'/parameter_events', '/rosout'}

    def said(name: str) -> str:
        return f'/close{name[1:]}' if name.startswith('~') else f'/{name.lstrip("/")}'

    def graph(what: str) -> dict[str, list[str]]:
        ask = getattr(peer.node, f'get_{what}_names_and_types_by_node')
        return {name: kinds for name, kinds in ask('close', '/') if name not in own}

    topics = {said(row[0].split('`')[1]): row[1].strip() for row in rows if '/msg/' in row[1]}
    topics.pop('/tf')  # only when asked for
    has = {name: kinds[0] for name, kinds in (graph('publisher') | graph('subscriber')).items()}
    assert has == topics
    names = [re.findall(r'`([^`]+)`', row[0]) for row in rows]
    documented = {name for row in names for name in row}
    parameters = peer.call(ListParameters, '/close/list_parameters').result.names
    assert {
        n for n in parameters if n not in ('use_sim_time', 'start_type_description_service')
    } <= documented
    policy = ElementTree.parse(ROOT / 'config/security/simulator.policy.xml')
    (profile,) = policy.findall("enclaves/enclave[@path='/alf_ros/close']/profiles/profile")
    may = {said(topic.text or '') for topic in profile.iter('topic')}
    assert may == {*has, *own, '/tf'}
    assert set(graph('service')) <= {said(item.text or '') for item in profile.iter('service')}


def test_a_slider_goes_through_its_dead_point(tmp_path: Path, peer: Peer) -> None:
    """With stamps, names of the encoder, velocities, the map, reports, bad messages, Ctrl-C."""
    arguments = ['--active', 'guide', '--ros-args', '-p', 'names:=["encoder=guide"]']
    with ClosingProcess(tmp_path, *arguments) as node:
        joints = peer.listen('/joint_states', JointState)
        maps = peer.listen('/close/effort_map', Float64MultiArray)
        reports = peer.listen('/close/diagnostics', DiagnosticArray)
        talker = peer.talk(INPUT, JointState)
        peer.known_to('/close')
        peer.until(lambda: reports, 'a report')
        assert values(reports[0], 'loops')[1] == f'waiting for guide on {INPUT}'

        # the rods have 1 m each: the guide is at 2 cos(crank)
        sent, ns = [], 1_000_000_000
        for step in range(60):
            angle = 0.75 - 0.025 * step
            rate = 2.0 * math.sin(angle) * 2.5  # the crank turns at -2.5 rad/s
            ns += 10_000_000
            talker.publish(message(ns, [rate], encoder=2.0 * math.cos(angle)))
            sent.append((ns, angle))
            peer.until(lambda: len(joints) == len(sent), f'answer {len(sent)}')
        for (stamp, angle), heard in zip(sent, joints, strict=True):
            assert list(heard.name) == ['crank_pin', 'knee', 'guide']
            assert heard.header.stamp.sec * 10**9 + heard.header.stamp.nanosec == stamp
            assert list(heard.position) == pytest.approx(
                [angle, -2.0 * angle, 2.0 * math.cos(angle)], abs=1e-5
            )
            if abs(angle) > 0.1:
                assert heard.velocity[0] == pytest.approx(-2.5, abs=1e-3)
        slope = -1.0 / (2.0 * math.sin(sent[-1][1]))  # of the crank angle over the guide
        last = peer.until(
            lambda: abs(maps[-1].data[0] - slope) < 1e-3 and maps[-1], 'the last map'
        )
        assert [dim.label for dim in last.layout.dim] == ['guide', 'crank_pin,knee,guide']
        assert [(dim.size, dim.stride) for dim in last.layout.dim] == [(1, 3), (3, 3)]
        assert list(last.data) == pytest.approx([slope, -2.0 * slope, 1.0], rel=1e-4)

        travel = peer.listen('/close/travel', Float64MultiArray)
        peer.until(lambda: travel, 'the travel')
        limits = travel[-1]
        assert [dim.label for dim in limits.layout.dim] == ['guide', 'lower,upper']
        assert list(limits.data) == pytest.approx([-2.0, 2.0], abs=1e-8)

        check_interface(peer)
        # what cannot be used is counted, and changes nothing
        before = len(joints)
        talker.publish(message(ns + 1, encoder=math.nan))
        talker.publish(message(ns + 2, guide=1.0))
        talker.publish(JointState(name=['encoder'], position=[1.0, 2.0]))
        talker.publish(JointState(name=['encoder'], position=[]))
        talker.publish(JointState(name=['encoder'], position=[1.0], effort=[1.0, 2.0]))
        talker.publish(message(ns + 3, encoder=1e8))
        keys = {'not_finite': '1', 'unknown_names': '1', 'wrong_lengths': '3', 'refused': '1'}
        peer.until(lambda: keys.items() <= values(reports[-1], 'input')[2].items(), 'the counts')
        assert len(joints) == before
        late = re.compile(r'no usable input for .* too far away')
        peer.until(lambda: late.match(values(reports[-1], 'loops')[1]), 'the reason')
        # out of reach: as far as the loops allow, and said
        talker.publish(message(ns + 10_000_000, encoder=2.5))
        peer.until(
            lambda: values(reports[-1], 'loops')[1].startswith('the loops miss'), 'the miss'
        )
        assert float(values(reports[-1], 'loops')[2]['missed_by']) == pytest.approx(0.5, abs=1e-6)
        peer.until(lambda: 'no input for' in values(reports[-1], 'loops')[1], 'old input')
        assert node.stop() == 0, node.output
        assert 'Traceback' not in node.output and 'stopped after 61 postures' in node.output


def test_a_branch_that_is_a_guess_is_said(tmp_path: Path, peer: Peer) -> None:
    """The slider rests in its dead point for long: nothing tells the direction of the crank."""
    with ClosingProcess(tmp_path, '--active', 'guide', '--ros-args', '-p', 'timeout:=60.0'):
        joints = peer.listen('/joint_states', JointState)
        reports = peer.listen('/close/diagnostics', DiagnosticArray)
        talker = peer.talk(INPUT, JointState)
        peer.known_to('/close')
        peer.until(lambda: reports, 'a report')
        for step in range(8):
            angle, pause = 0.7 - 0.1 * step, 100_000_000_000 if step > 6 else 0
            place = 2.0 * math.cos(angle - 0.1 * (step > 6))
            stamp = 1_000_000_000 + 10_000_000 * step + pause
            talker.publish(message(stamp, guide=place))
            peer.until(lambda: len(joints) > step, f'answer {step}')  # noqa: B023
        peer.until(lambda: values(reports[-1], 'loops')[2].get('ambiguous') == 'True', 'a guess')
        level, text, _ = values(reports[-1], 'loops')
        assert level == WARN
        assert text == 'the branch is a guess: start again where it is known'


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['--active', 'giude'], "--active: no such joint coordinate, got 'giude'; did you mean"),
        (['--scene', 'delta_robot', '--active', 'motor0'], '2 freedoms are left: motor1, motor2'),
        (['--ros-args', '-p', 'activ:=[a]'], "unknown parameter of the node, got 'activ'"),
        (
            ['--active', 'guide', '--ros-args', '-p', 'names:=["guide"]'],
            "names: not a pair of names, got 'guide'; expected name_in_messages=joint",
        ),
    ],
)
def test_a_wrong_start_is_refused_in_one_line(
    arguments: list[str], said: str, tmp_path: Path
) -> None:
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    done = ended(['-m', 'alf_ros', 'close', *arguments], tmp_path, environment, START_LIMIT)
    assert done.returncode == 2 and said in done.stderr, done
    assert len(own_lines(done.stderr)) == 1


def test_messages_without_stamps_have_the_time_of_arrival(tmp_path: Path, peer: Peer) -> None:
    """In ROS a stamp of zero is none; the second such message was refused as not later."""
    with ClosingProcess(tmp_path, '--active', 'guide') as node:
        joints = peer.listen('/joint_states', JointState)
        talker = peer.talk(INPUT, JointState)
        peer.known_to('/close')
        sent = []
        for place in (1.49, 1.48, 1.47, 1.46):
            talker.publish(message(0, guide=place))
            sent.append(place)
            peer.until(lambda: len(joints) == len(sent), f'answer {len(sent)}')
        reports = peer.listen('/close/diagnostics', DiagnosticArray)
        for ns in (10**18, 0, 10**18 + 10**7):  # of two clocks: none is earlier
            talker.publish(message(ns, guide=1.45))
            sent.append(1.45)
            peer.until(lambda: len(joints) == len(sent), f'answer {len(sent)}')
        good = {'messages': '7', 'times_back': '0', 'refused': '0'}
        peer.until(
            lambda: reports and good.items() <= values(reports[-1], 'input')[2].items(), 'counts'
        )
        assert [each.header.stamp.sec for each in joints] == [0, 0, 0, 0, 10**9, 0, 10**9]
        assert [each.position[2] for each in joints] == pytest.approx(sent)
        assert node.stop() == 0, node.output


def test_a_remapped_node_says_where_it_listens(tmp_path: Path, peer: Peer) -> None:
    """It named a topic that nobody heard, and two nodes in namespaces had one name in reports."""
    rules = ['__ns:=/left', 'active_joint_states:=encoders', '~/diagnostics:=/diagnostics']
    remaps = [word for rule in rules for word in ('-r', rule)]
    with ClosingProcess(tmp_path, '--active', 'guide', '--ros-args', *remaps) as node:
        reports = peer.listen('/diagnostics', DiagnosticArray)
        peer.until(lambda: reports, 'a report')
        assert [each.name for each in reports[0].status] == [
            'left/close: loops',
            'left/close: input',
        ]
        assert reports[0].status[0].message == 'waiting for guide on /left/encoders'
        joints = peer.listen('/left/joint_states', JointState)
        talker = peer.talk('/left/encoders', JointState)
        peer.known_to('/left/close')
        talker.publish(message(10**9, guide=1.4))
        peer.until(lambda: joints, 'a posture')
        assert node.stop() == 0, node.output
        assert 'active ones on /left/encoders' in node.output


def test_a_publisher_that_is_not_heard_is_said(tmp_path: Path, peer: Peer) -> None:
    """It said only that it waits: the mismatch was in no diagnostics."""
    with ClosingProcess(tmp_path, '--active', 'guide'):
        reports = peer.listen('/close/diagnostics', DiagnosticArray)
        peer.until(lambda: reports, 'a report')
        waits = f'waiting for guide on {INPUT}'
        assert values(reports[-1], 'loops')[1] == waits
        for kind, qos, said in (
            (
                JointState,
                BEST_EFFORT,
                'one publisher there is best effort, and only reliable ones',
            ),
            (Float64MultiArray, RELIABLE, 'sends std_msgs/msg/Float64MultiArray, not sensor_msgs'),
        ):
            talker = peer.node.create_publisher(kind, INPUT, qos)
            peer.until(lambda: said in values(reports[-1], 'loops')[1], said)  # noqa: B023
            level, text, _ = values(reports[-1], 'input')
            assert level == WARN and text.startswith(f'{waits}; one publisher there')
            peer.node.destroy_publisher(talker)
            peer.until(lambda: values(reports[-1], 'loops')[1] == waits, 'its end')


def test_two_nodes_of_one_name_say_so_both(tmp_path: Path, peer: Peer) -> None:
    """Both answered each message, and neither said a word; one that was killed is no second one,
    although it stays in the graph."""
    folders = [tmp_path / name for name in ('killed', 'first', 'second')]
    for folder in folders:
        folder.mkdir()
    reports = peer.listen('/close/diagnostics', DiagnosticArray)

    def processes(count: int) -> set[str]:
        return {values(each, 'loops')[2]['process'] for each in reports[-count:]}

    with ClosingProcess(folders[0], '--active', 'guide'):
        peer.until(lambda: reports, 'a report')
        (killed,) = processes(1)
    with ClosingProcess(folders[1], '--active', 'guide') as first:
        before = len(reports)
        peer.until(  # the last reports of the dead one may still arrive
            lambda: len(reports) > before + 8 and killed not in processes(8), 'reports beside it'
        )
        (mine,) = processes(8)
        assert mine != killed and 'a second node' not in first.output
        assert {values(each, 'loops')[1] for each in reports[-8:]} == {
            f'waiting for guide on {INPUT}'
        }
        with ClosingProcess(folders[2], '--active', 'guide') as second:
            peer.until(lambda: len(processes(2)) == 2, 'reports of both')
            (other,) = processes(2) - {mine}

            def told() -> set[tuple[str, str]]:
                said = (values(each, 'loops') for each in reports[-4:])
                return {(each[2]['process'], each[1]) for each in said}

            text = 'a second node close answers on /joint_states: process '
            both = {(mine, text + other), (other, text + mine)}
            peer.until(lambda: told() == both, 'both statuses')
            assert values(reports[-1], 'loops')[0] == WARN
            assert second.stop() == 0, second.output
        peer.until(
            lambda: told() == {(mine, f'waiting for guide on {INPUT}')}, 'the end of the second'
        )
        assert first.stop() == 0, first.output
        for node, process in ((first, other), (second, mine)):
            assert node.output.count('a second node') == 1, node.output
            assert f'process {process}' in node.output


def test_names_may_be_exchanged() -> None:
    assert renamed(['b=a', 'a=b'], ['a', 'b', 'c']) == {'b': 'a', 'a': 'b', 'c': 'c'}


def heard(*messages: dict[str, Any]) -> ActiveInput:
    found = ActiveInput(renamed(['e1=a'], ['a', 'b']))
    for fields in messages:
        found.take(JointState(**fields))
    return found


def test_a_name_twice_changes_nothing() -> None:
    """The last of its values counted, without a word."""
    heard = ActiveInput({'a': 'a'})
    assert heard.take(JointState(name=['a'], position=[0.1]))
    assert not heard.take(JointState(name=['a', 'a'], position=[0.2, 0.5]))
    assert heard.positions == {'a': 0.1} and heard.counts['repeated_names'] == 1
    assert heard.trouble == "repeated_names: 'a' is in one message twice"


def test_only_a_mistake_that_cost_the_values_makes_a_message_unusable() -> None:
    used = {'name': ['e1', 'wheel'], 'position': [1.0, 2.0]}
    lost = {'name': ['wheel'], 'position': [2.0]}
    said = "unknown_names: name: left out, not an active joint, got 'wheel'; known: b, e1"
    assert (heard(used).trouble, heard(used).unusable) == (said, '')
    assert heard(used, lost).unusable == said
    assert heard(lost, {}).unusable == said
    assert heard(lost, used).unusable == ''


def test_a_name_beside_used_values_does_not_make_them_late(tmp_path: Path, peer: Peer) -> None:
    """Where messages ended, the name was the reason for which none could be used."""
    with ClosingProcess(tmp_path, '--active', 'guide') as node:
        reports = peer.listen('/close/diagnostics', DiagnosticArray)
        talker = peer.talk(INPUT, JointState)
        peer.until(lambda: reports, 'a report')

        def said(task: str) -> str:
            return values(reports[-1], task)[1]

        talker.publish(message(1, guide=1e8))
        peer.until(lambda: 'too far away' in said('loops'), 'a refusal')
        for ns in range(10**9, 4 * 10**9, 10**9):
            talker.publish(message(ns, guide=1.4))
            peer.until(lambda: said('loops') == 'closed', 'an answer')
            talker.publish(message(ns + 1, guide=1.4, wheel=0.3))
            peer.until(lambda: 'input for' in said('loops'), 'old input')
            assert said('loops').startswith('no input for'), said('loops')
            assert said('input') == said('loops')
        told = [values(report, 'input')[2]['last_trouble'] for report in reports]
        assert any(each.startswith('unknown_names: name: left out') for each in told), told
        assert node.stop() == 0, node.output


def test_partial_messages_keep_the_last_values() -> None:
    found = heard(
        {'name': ['e1', 'b'], 'position': [1.0, 2.0], 'velocity': [3.0, 4.0]},
        {'name': ['b'], 'position': [5.0]},
    )
    assert (found.positions, found.rates) == ({'a': 1.0, 'b': 5.0}, {'a': 3.0})
    assert found.missing == [] and heard().missing == ['b', 'a']


def test_a_velocity_that_no_joint_has_is_left_out() -> None:
    """Velocities of 1e300 rad/s were published, without a word."""
    found = heard({'name': ['e1', 'b'], 'position': [1.0, 2.0], 'velocity': [1e300, 4.0]})
    assert found.rates == {'b': 4.0} and found.counts['not_finite'] == 1
    assert found.trouble == 'not_finite: velocity of e1: 1e+300'


def test_a_message_has_no_velocities_where_none_exist() -> None:
    closure = Closure('slider_crank', ['guide'])
    for place, count in ((1.9, 3), (2.1, 0)):
        posture = closure.close({'guide': place}, rates={'guide': 0.5})
        assert len(joint_state(posture, Time(), True).velocity) == count


@pytest.mark.parametrize(('pairs', 'said'), [
    (['x=c'], "names: not an active joint, got 'c'"),
    (['x=a', 'x=b'], "names: renamed twice, got 'x=b'"),
    (['x=a', 'y=a'], "names: renamed twice, got 'y=a'"),
    (['b=a'], "names: the name of another active joint, got 'b=a'; expected a new name of b too"),
])  # fmt: skip
def test_wrong_names_are_refused(pairs: list[str], said: str) -> None:
    with pytest.raises(InputError) as caught:
        renamed(pairs, ['a', 'b'])
    assert said in str(caught.value)
