"""Recordings from bags: of rosbag2, written by others, and logs of this package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from alf_ros import identify, load_scene
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.scene.scene import Scene
from alf_ros.simulation.setup import made
from alf_ros.studies.identification.recorded_names import Topics
from alf_ros.studies.identification.recording_reader import read_recording
from support.foreign_bags import JOINTS as JOINTS_TYPE
from support.foreign_bags import Message, joints, wrench, written
from support.log_files import Retold, rewritten
from support.recordings import Machine, pushes, scene

NOW = 1_760_000_000_123_456_789  # ns, as clocks of machines are
FIT = ['coupler.mass', 'pin.viscous']
JOINTS = ('crank_pin', 'guide')


def bag(folder: Path, machine: Machine, states: str = '/joint_states') -> Path:
    """A machine and its commands, as `ros2 bag record` keeps them."""
    messages: list[Message] = [
        joints('/joint_commands', NOW + round(x.t * 1e9), [x.name], effort=[x.said['effort']])
        for x in machine.inputs
    ]
    for t, x, v in zip(machine.t, machine.x, machine.v, strict=True):
        stamp = NOW + round(t * 1e9)
        messages.append(joints(states, stamp, machine.joints, position=x, velocity=v))
    return written(folder / 'bag', messages)


def test_a_bag_of_another_writer(tmp_path: Path) -> None:
    """Positions, velocities and efforts to the nanosecond; the fit finds the exact numbers."""
    inputs = pushes('crank_pin', 2.0, 0.6)
    machine = Machine(scene(coupler__mass=1.2, pin__viscous=0.35), JOINTS, 0.6, inputs=inputs)
    path = bag(tmp_path, machine)
    for each in (path, path / 'bag_0.mcap'):
        recording = read_recording(each, scene())
        assert [c.name for c in recording.channels] == [
            *('crank_pin', 'crank_pin.velocity', 'guide', 'guide.velocity')
        ]
        for k, channel in enumerate(recording.channels):
            expected = (machine.v if k % 2 else machine.x)[:, k // 2]
            assert np.allclose(channel.t, machine.t, rtol=0.0, atol=1e-9)
            assert (channel.values == expected).all()
        assert len(recording.inputs) == len(inputs)
        for held, wanted in zip(recording.inputs, inputs, strict=True):
            assert held.t == pytest.approx(wanted.t, abs=2e-9)
            assert (held.kind, held.name, held.said) == ('effort', 'crank_pin', wanted.said)
    found = identify(scene(), path, FIT, window=0.3)
    assert np.allclose(found.values, [1.2, 0.35], rtol=1e-7)


def own_log(folder: Path, of: Scene) -> Path:
    """A log with efforts and a force, whose stamps are ahead of the simulated time."""
    setup = made(of, {})
    run, simulation = LogRun(folder, setup, ahead=NOW, name='own'), setup.simulation
    run.send()
    for tick in range(500 // setup.steps):
        if tick % 40 == 0:
            effort = 2.0 * np.sin(0.1 * tick)
            simulation.apply_effort('crank_pin', effort)
            run.note({'kind': 'effort', 'cause': 'command', 'name': 'crank_pin', 'effort': effort})
        if tick == 70:
            held: dict[str, Any] = {
                **{'name': 'coupler', 'force': [1.0, 0.5]},
                **{'torque': 0.1, 'frame': 'body'},
            }
            simulation.apply_wrench(**held)
            run.note({'kind': 'wrench', 'cause': 'command', **held})
        simulation.step(setup.steps)
        run.send()
    run.close()
    return run.recorder.folder


def test_a_log_of_this_package(tmp_path: Path) -> None:
    """Its journal has the inputs, at their steps: the numbers are found to rounding."""
    path = own_log(tmp_path, scene(coupler__mass=1.2, pin__viscous=0.35))
    recording = read_recording(path, scene())
    assert recording.begin == 0.0 and recording.end == pytest.approx(1.0)
    assert {x.kind for x in recording.inputs} == {'effort', 'wrench'}
    found = identify(scene(), path, FIT, window=0.5)
    assert np.allclose(found.values, [1.2, 0.35], rtol=1e-9)


def test_a_log_whose_metadata_stand_behind_its_messages(tmp_path: Path) -> None:
    """It was read as a recording of a machine, without the inputs in its journal."""
    path = own_log(tmp_path, scene())
    again = rewritten(load(path).files[0], tmp_path, behind=True)
    one, other = (read_recording(each, scene()) for each in (path, again))
    acting = [[(each.t, each.entry) for each in of.inputs] for of in (one, other)]
    assert acting[0] == acting[1] and one.begin == other.begin
    for channel, same in zip(one.channels, other.channels, strict=True):
        assert channel.t.tobytes() == same.t.tobytes()


def test_a_log_with_a_changed_input_is_refused(tmp_path: Path) -> None:
    """The fit would take what did not act."""
    log = load(own_log(tmp_path, scene()))
    edit = Retold(lambda k, entry: {**entry, 'effort': 9.0} if k == 2 else entry)
    with pytest.raises(InputError, match='effort crank_pin: changed after it was written'):
        read_recording(rewritten(log.files[0], tmp_path, change=edit), scene())


def test_names_are_mapped(tmp_path: Path) -> None:
    messages = [
        joints('/arm/states', NOW + k * 10**7, ['j1', 'other'], position=[0.785, k])
        for k in range(60)
    ]
    messages.append(wrench('/tool/force', NOW + 10**8, [1.0, 2.0, 0.0]))
    path = written(tmp_path / 'bag', messages)
    topics = Topics('/arm/states', renamed={'j1': 'crank_pin', '/tool/force': 'B'})
    recording = read_recording(path, scene(), topics)
    assert [c.name for c in recording.channels] == ['crank_pin']
    assert recording.unused == ('other',)
    (held,) = recording.inputs
    assert (held.kind, held.name, held.said['force']) == ('wrench', 'B', [1.0, 2.0])
    assert held.t == pytest.approx(0.1)


def test_measured_efforts_may_act(tmp_path: Path) -> None:
    messages = [
        joints('/joint_states', NOW + k * 10**7, ['guide'], position=[1.4], effort=[0.1 * k])
        for k in range(60)
    ]
    path = written(tmp_path / 'bag', messages)
    assert not read_recording(path, scene()).inputs
    mixed = written(tmp_path / 'mixed', [*messages[3:5], *messages[:3], *messages[5:]])
    for each in (path, mixed):
        recording = read_recording(each, scene(), Topics(commands='joint_states'))
        assert [x.said['effort'] for x in recording.inputs[:3]] == [0.0, 0.1, 0.2]
    assert {x.kind for x in recording.inputs} == {'effort'}


def test_targets_of_motors(tmp_path: Path) -> None:
    of = load_scene('slider_crank_controlled')
    messages = [
        joints('/joint_states', NOW, ['crank_pin'], position=[0.8], velocity=[0.0]),
        joints('/joint_commands', NOW + 10**7, ['crank_pin'], position=[0.9]),
        joints('/joint_states', NOW + 2 * 10**7, ['crank_pin'], position=[0.8], velocity=[0.0]),
    ]
    (held,) = read_recording(written(tmp_path / 'bag', messages), of).inputs
    assert (held.kind, held.said) == ('target', {'position': 0.9})


def test_refused_in_one_line(tmp_path: Path) -> None:
    state = joints('/joint_states', NOW, ['crank_pin'], position=[0.7])
    good = written(tmp_path / 'good', [state])
    effort = joints('/joint_commands', NOW, ['crankpin'], effort=[1.0])
    typo = written(tmp_path / 'typo', [state, effort])
    push = written(tmp_path / 'push', [state, wrench('/w/copler', NOW, [1.0, 0.0, 0.0])])
    tilted = written(tmp_path / 'tilted', [state, wrench('/w/coupler', NOW, [1, 0, 0], 'tool')])
    none = written(tmp_path / 'none', [joints('/joint_states', NOW, ['crankpin'], position=[0.7])])
    halved = joints('/joint_states', NOW, ['crank_pin', 'guide'], position=[0.7])
    short = written(tmp_path / 'short', [halved])
    only = joints('/joint_states', NOW, ['guide'], velocity=[0.7])
    speeds = written(tmp_path / 'speeds', [only])
    (tmp_path / 'sqlite').mkdir()
    (tmp_path / 'sqlite' / 'bag_0.db3').write_bytes(b'')
    for name in ('bag_0.mcap.zstd', 'bag_0.db3.zstd'):
        (tmp_path / name.rpartition('_0.')[2]).mkdir()
        (tmp_path / name.rpartition('_0.')[2] / name).write_bytes(b'')
    (tmp_path / 'text.mcap').write_text('no bag')
    (tmp_path / 'cut.mcap').write_bytes(b'')
    cases = [
        (tmp_path / 'cut.mcap', None, 'recording, which is damaged: cut.mcap: cut off at byte 0'),
        (good, Topics('joints'), "joints: no positions of joints in this recording, got 'joints'"),
        (good, Topics(renamed={'pin': 'crank_pin'}), 'nothing of this name in the recording'),
        (good, Topics(renamed={'crank_pin': 'kne'}), "did you mean 'knee'?"),
        (typo, None, "an effort on a joint that the scene lacks, got 'crankpin'; did you mean"),
        (push, None, "('/w/copler' in the recording), got 'copler'; did you mean 'coupler'?"),
        (tilted, None, "a wrench in another frame, got 'tool'; expected 'world' or 'coupler'"),
        (none, None, "no recorded joint is one of the scene, got 'crankpin'; did you mean"),
        (speeds, None, "joints: velocities without positions, got 'guide'; expected positions,"),
        (short, None, 'bag_0.mcap: /joint_states: a message that is not of its type'),
        (tmp_path / 'sqlite', None, 'cannot be read: Cannot open database'),
        (tmp_path / 'db3.zstd', None, 'a recording in SQLite; expected MCAP: `ros2 bag convert`'),
        (tmp_path / 'mcap.zstd', None, 'a recording in compressed files; expected files that `zs'),
        (tmp_path / 'mcap.zstd' / 'bag_0.mcap.zstd', None, 'a recording in compressed files;'),
        (tmp_path / 'text.mcap', None, 'not an MCAP file'),
        (tmp_path / 'nothing', None, 'no such log; expected a folder or an .mcap file'),
    ]
    for path, topics, expected in cases:
        with pytest.raises(InputError) as caught:
            read_recording(path, scene(), topics)
        assert expected in str(caught.value), path
        assert '\n' not in str(caught.value)


def test_a_file_of_a_bag_that_is_not_there_is_said(tmp_path: Path) -> None:
    """The inputs in it are not known."""
    path = written(tmp_path / 'bag', [joints('/joint_states', NOW, ['guide'], position=[1.4])])
    files = '{relative_file_paths: [bag_0.mcap, bag_1.mcap]}'
    (path / 'metadata.yaml').write_text(f'rosbag2_bagfile_information: {files}')
    assert read_recording(path, scene()).damage == '1 of its 2 files are not there'


def test_a_file_that_is_not_of_the_bag_is_refused(tmp_path: Path) -> None:
    """It was read as more of the same run, if it was later."""
    path = written(tmp_path / 'bag', [joints('/joint_states', NOW, ['guide'], position=[1.4])])
    later = joints('/joint_states', NOW + 10**9, ['guide'], position=[0.4])
    other = written(tmp_path / 'other', [later]) / 'bag_0.mcap'
    other.rename(path / 'other_0.mcap')
    files = '{relative_file_paths: [bag/bag_0.mcap.zstd]}'  # decompressed, in its folder
    (path / 'metadata.yaml').write_text(f'rosbag2_bagfile_information: {files}')
    with pytest.raises(InputError, match=r"yaml beside it does not list, got 'other_0\.mcap'"):
        read_recording(path, scene())
    (path / 'other_0.mcap').unlink()
    (channel,) = read_recording(path, scene()).channels
    assert channel.values.tolist() == [1.4]


COMPRESSED = b'\x28\xb5\x2f\xfd' + bytes(20)
UNREADABLE = {
    'compressed': (JOINTS_TYPE, COMPRESSED, 'a compressed message, got '),
    'without a definition': ('', bytes(24), 'no definition of its type, got '),
    'of IDL': ('module sensor_msgs {};', bytes(24), 'not a complete definition, got '),
}


@pytest.mark.parametrize(('text', 'data', 'said'), UNREADABLE.values(), ids=UNREADABLE)
def test_messages_that_are_not_read(tmp_path: Path, text: str, data: bytes, said: str) -> None:
    with open(tmp_path / 'it.mcap', 'wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema('sensor_msgs/msg/JointState', 'ros2msg', text.encode())
        channel = writer.register_channel('/joint_states', 'cdr', schema)
        writer.add_message(channel, NOW, data, NOW)
        writer.finish()
    with pytest.raises(InputError, match=rf'it\.mcap: /joint_states: {said}'):
        read_recording(tmp_path / 'it.mcap', scene())


def _states(topic: str = '/joint_states', begin: int = NOW, angle: float = 0.7) -> list[Message]:
    return [
        joints(topic, begin + k * 10**7, ['crank_pin'], position=[angle + 1e-3 * k])
        for k in range(40)
    ]


def _effort(stamp: int, topic: str = '/joint_commands', **values: list[float]) -> Message:
    return joints(topic, stamp, ['crank_pin'], **(values or {'effort': [1.0]}))


def test_what_would_be_another_motion_is_refused(tmp_path: Path) -> None:
    """Two robots, two runs, clocks that differ, inputs that nothing follows: all of them made a
    fit with other inputs or positions than the machine had, without a word."""
    state, late = _states(), NOW + 10**8
    planned, again = _states('/planned/joint_states', angle=0.8), _states(begin=NOW + 3 * 10**6)
    pushed = [wrench(f'/{arm}/coupler', late, [1, 0, 0]) for arm in ('left', 'right')]
    twice = joints('/joint_states', late, ['crank_pin', 'crank_pin'], position=[0.7, 0.8])
    cases: list[tuple[list[Message], str]] = [
        ([*state, *planned], "is on two topics, got '/joint_states and /planned/joint_states'"),
        (
            [*state, _effort(late), _effort(late, '/old/joint_commands')],
            "commands: 'crank_pin' is",
        ),
        ([*state, *pushed], "map: 'coupler' is on two topics, got '/left/coupler and /right/"),
        ([*state, *again], 'crank_pin: stamps go back: more than one run'),
        ([*state, _effort(0)], '/joint_commands: an input without a stamp'),
        ([*state, wrench('/coupler', 0, [1, 0, 0])], '/coupler: an input without a stamp'),
        ([_states(begin=0)[0]], '/joint_states: measurements without stamps'),
        ([*_states(begin=10**9), _effort(NOW)], "got '1.76e+09 s behind them'"),
        ([*state, _effort(10**9)], "got '1.76e+09 s before them'; expected stamps of one clock"),
        (
            [*state, _effort(late), wrench('/coupler', 10**9, [1, 0, 0])],
            "coupler: its wrench is at other times than the measurements, got '1.76e+09 s before",
        ),
        ([*state, _effort(late, position=[0.9])], 'a position that no motor of the scene follows'),
        (
            [*state, _effort(late, effort=[np.inf])],
            '/joint_commands: effort of crank_pin: not fin',
        ),
        (
            [*state, wrench('/coupler', late, [np.nan, 0, 0])],
            '/coupler: force and torque: not fin',
        ),
        (
            [*state, _effort(late), _effort(NOW + 10**7, effort=[9.0])],
            'crank_pin: stamps of its effort go back: more than one run, or more than one sender, '
            "got '-0.09 s'",
        ),
        ([*state, twice], "a joint that is in one message twice, got 'crank_pin'"),
    ]
    for number, (messages, expected) in enumerate(cases):
        path = written(tmp_path / str(number), messages)
        with pytest.raises(InputError) as caught:
            read_recording(path, scene())
        assert expected in str(caught.value)
        assert str(path) in str(caught.value) and '\n' not in str(caught.value)


def test_messages_out_of_their_order(tmp_path: Path) -> None:
    """They are sorted, the first ones too; those before the first time of a clock are left out."""
    state = _states()
    mixed = [_states(begin=0)[0], *state[3:5], *state[:3], *state[5:], _effort(NOW + 10**8)]
    (channel,) = read_recording(written(tmp_path / 'bag', mixed), scene()).channels
    assert np.allclose(channel.t, 0.01 * np.arange(40), rtol=0.0, atol=1e-12)
    assert np.allclose(channel.values, 0.7 + 1e-3 * np.arange(40), rtol=0.0, atol=1e-12)


def test_a_plan_may_begin_at_zero(tmp_path: Path) -> None:
    plan = written(tmp_path / 'plan', [_effort(0), _effort(10**8, effort=[2.0])])
    assert [x.t for x in read_recording(plan, scene(), plan=True).inputs] == [0.0, 0.1]


def test_a_stamp_that_is_years_away(tmp_path: Path) -> None:
    """It made a billion windows before the first one was looked at."""
    far = joints('/joint_states', NOW + 3 * 10**17, ['crank_pin'], position=[0.8])
    with pytest.raises(InputError, match='too few measurements in a window'):
        identify(scene(), written(tmp_path / 'bag', [*_states(), far]), FIT, window=0.1)


def test_a_joint_that_nothing_was_measured_of(tmp_path: Path) -> None:
    messages = [
        joints('/joint_states', NOW + k * 10**7, JOINTS, position=[0.785, np.nan])
        for k in range(60)
    ]
    recording = read_recording(written(tmp_path / 'bag', messages), scene())
    assert [c.name for c in recording.channels] == ['crank_pin']
    messages = [
        joints('/joint_states', NOW + k * 10**7, JOINTS, position=[np.nan, np.nan])
        for k in range(60)
    ]
    with pytest.raises(InputError, match='no positions of joints in this recording'):
        read_recording(written(tmp_path / 'nan', messages), scene())


def test_two_recorded_joints_of_one_name(tmp_path: Path) -> None:
    messages = [
        joints('/joint_states', NOW + k * 10**7, ['j1', 'guide'], position=[0.785, 1.4])
        for k in range(60)
    ]
    path = written(tmp_path / 'bag', messages)
    with pytest.raises(InputError) as caught:
        read_recording(path, scene(), Topics(renamed={'j1': 'guide'}))
    told = str(caught.value)
    assert "map: two recorded joints stand for it, 'j1' and 'guide', got 'guide'" in told


def test_an_effort_can_be_left_out(tmp_path: Path) -> None:
    state = joints('/joint_states', NOW, ['crank_pin'], position=[0.7])
    effort = joints('/joint_commands', NOW, ['gripper'], effort=[1.0])
    path = written(tmp_path / 'bag', [state, effort])
    assert not read_recording(path, scene(), Topics(renamed={'gripper': ''})).inputs
