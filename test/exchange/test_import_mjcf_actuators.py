"""Ranges of forces, and states, of actuators of an imported MJCF: motions like MuJoCo's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 1e-4, 0.3
JOINTS = ('j1', 'j2')
RANGE = 'actuatorfrcrange="-0.3 0.3"'
BELT = f"""<tendon><fixed name="belt" {RANGE} actuatorfrclimited="%s"><joint joint="j1" coef="1"/>
 <joint joint="j2" coef="-0.5"/></fixed></tendon>"""
SERVO = '<position name="hold" joint="j1" kp="2" gear="-1.5"/>'
OF_TARGETS = (
    'ranges of controls: they bound the control at the start only: targets that are sent later '
    'act beyond them too'
)
OF_EFFORTS = (
    'limits of motors: they bound no effort that is sent to the joint: such efforts act beyond '
    'them too'
)
BRAKE = '<velocity name="brake" joint="j1" kv="0.02"/>'
PUSH = '<motor name="push" joint="j1" %s/>'
PULL = '<motor name="pull" joint="j1" %s/>'


def robot(joint: str, actuators: str, key: str, flag: str = '', tendon: str = '') -> str:
    """Two bars without gravity, at a keyframe."""
    bar = '<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>'
    return f"""<mujoco model="bars"><compiler angle="radian"/>
<option timestep="{STEP}" integrator="RK4" gravity="0 0 0">
<flag contact="disable" {flag}/></option>
<worldbody><body name="b1"><joint name="j1" axis="0 1 0" {joint}/>{bar}
<body name="b2" pos="0.3 0 0" euler="0 0.5 0"><joint name="j2" axis="0 1 0"/>{bar}</body></body>
</worldbody>{tendon}<actuator>{actuators}</actuator><keyframe><key name="k" {key}/></keyframe>
</mujoco>"""


def positions(source: str) -> Floats:
    """Of the joints after the motion, rad, by MuJoCo itself."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    return np.array([float(data.joint(name).qpos[0]) for name in JOINTS])


def ours(source: str, folder: Path) -> tuple[Floats, str]:
    """Of the joints after the motion, rad, and the text."""
    text = imported(saved(folder, 'it.xml', source), scene=True, key='k')
    simulation = Simulation(
        scene_from_text(text), integrator='dop853_adaptive', tolerance=1e-11, step=1e-3
    )  # as limits have kinks
    simulation.step(round(DURATION * 1000))
    sample = simulation.sample()
    return np.array([sample.joints[name].position for name in JOINTS]), text


def limits(text: str) -> list[float | None]:
    """Of all motors and tendons."""
    return [each.parameters.limit for each in scene_from_text(text).effects]


# joint, actuators, keyframe, flag, tendon
LIKE_MUJOCO = {
    'two motors': (
        RANGE,
        PUSH % '' + PUSH.replace('push', 'pull') % '',
        'ctrl="0.6 -0.1"',
        '',
        '',
    ),
    'a servo and two others': (RANGE, SERVO + BRAKE + PUSH % '', 'ctrl="-0.3 0.4 0.2"', '', ''),
    'limits of their own': (
        RANGE,
        (PUSH + PULL) % (('ctrlrange="-0.1 0.1"',) * 2),
        'ctrl="0.5 0.09"',
        '',
        '',
    ),
    'on a tendon': (
        '',
        '<motor name="a" tendon="belt" gear="2"/><motor name="b" tendon="belt" gear="2"/>',
        'ctrl="0.5 -0.1"',
        '',
        BELT % 'true',
    ),
    'alone on a tendon': (
        '',
        '<motor name="a" tendon="belt" gear="2"/>',
        'ctrl="0.5"',
        '',
        BELT % 'true',
    ),
    'no range of controls': (
        '',
        PUSH % 'ctrlrange="-0.1 0.1"',
        'ctrl="0.4"',
        'clampctrl="disable"',
        '',
    ),
    'damping and a rotor': (
        '',
        PUSH % 'gear="-3" damping="0.01" armature="0.002"',
        'ctrl="0.2"',
        '',
        '',
    ),
    'damping and a rotor of one that is off': (
        'stiffness="3" springref="0.2"',
        PUSH % 'gear="3" damping="0.01" armature="0.002"',
        'ctrl="0.2"',
        'actuation="disable"',
        '',
    ),
    'damping on a tendon': (
        '',
        '<motor name="a" tendon="belt" gear="2" damping="0.01"/>',
        'ctrl="0.5"',
        '',
        BELT % 'true',
    ),
    'an integrator at rest': (
        '',
        '<intvelocity name="turn" joint="j1" kp="2" kv="0.1" actrange="-0.2 0.2"/>',
        'ctrl="0" act="0.15"',
        '',
        '',
    ),
}


@pytest.mark.parametrize(
    ('joint', 'actuators', 'key', 'flag', 'tendon'), LIKE_MUJOCO.values(), ids=LIKE_MUJOCO
)
def test_actuators_like_mujoco(
    joint: str, actuators: str, key: str, flag: str, tendon: str, tmp_path: Path
) -> None:
    """The range of a joint is of the sum of its actuators, on a tendon before the gear."""
    source = robot(joint, actuators, key, flag, tendon)
    found, text = ours(source, tmp_path)
    assert found == pytest.approx(positions(source), abs=1e-8)
    assert np.abs(found).max() > 0.02
    assert 'force ranges' not in text


def test_one_motor_for_all_is_listed(tmp_path: Path) -> None:
    """It has the gains of both."""
    source = robot(RANGE, SERVO + BRAKE, 'ctrl="-0.3 0.4"')
    _, text = ours(source, tmp_path)
    line = 'one motor stands for all on the joint, because its range is that of the sum'
    assert f'#   actuators in one: {line}: hold and brake\n' in text
    (motor,) = (each.parameters for each in scene_from_text(text).effects)
    assert motor.position_gain == 2.0 * 1.5**2 and motor.velocity_gain == 0.02
    assert motor.limit == 0.3


LISTED = (
    'force ranges of joints: they are of a sum: here of each actuator on the joint or tendon, '
)
LISTED += 'and of none on a tendon that moves the joint: '


def test_ranges_of_sums_that_no_motor_has_are_listed(tmp_path: Path) -> None:
    own = PUSH % 'forcerange="-0.2 0.2"' + PULL % ''
    _, text = ours(robot(RANGE, own, 'ctrl="0.5 0.5"'), tmp_path)
    assert f'#   {LISTED}j1\n' in text
    assert limits(text) == [0.2, 0.3]
    gears = '<motor tendon="belt" gear="2"/><motor tendon="belt" gear="3"/>'
    _, text = ours(robot('', gears, 'ctrl="1 0"', '', BELT % 'true'), tmp_path)
    assert f'#   {LISTED}belt\n' in text
    assert limits(text) == [0.6, pytest.approx(0.9)]
    cord = '<motor name="a" tendon="belt"/>'
    _, text = ours(robot(RANGE, cord, 'ctrl="0.5"', '', BELT % 'false'), tmp_path)
    assert f'#   {LISTED}j1\n' in text
    uneven = RANGE.replace('-0.3', '-0.1')
    _, text = ours(robot(uneven, PUSH % '', 'ctrl="0.5"'), tmp_path)
    assert 'force ranges of actuators: different in the two directions: the larger' in text


@pytest.mark.parametrize(
    ('actuator', 'line'),
    [
        (
            '<intvelocity name="turn" joint="j1" kp="2" actrange="-1 1"/>',
            'integrators of actuators: they integrate no control: they stay as at the start: turn',
        ),
        (
            '<cylinder name="turn" joint="j1" timeconst="0.2" area="2"/>',
            'activation of actuators: they act without delay: turn',
        ),
    ],
)
def test_states_of_actuators_are_listed(actuator: str, line: str, tmp_path: Path) -> None:
    """At the start the force is MuJoCo's, whose integrator begins at `act`; a filter has none."""
    source = robot('', actuator, 'ctrl="0.3" act="0.3"')
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, key='k')
    assert f'#   {line}\n' in text
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    (motor,) = (each.parameters for each in scene_from_text(text).effects)
    effort = motor.effort + (motor.position_gain or 0.0) * (motor.position or 0.0)
    assert effort == pytest.approx(float(data.qfrc_actuator[0]), rel=1e-12)
    assert effort > 0.1


@pytest.mark.parametrize(
    ('actuator', 'lines'),
    [
        (SERVO.replace('/>', ' ctrlrange="-1 1"/>'), [f'{OF_TARGETS}: hold']),
        (BRAKE.replace('/>', ' ctrlrange="-1 1"/>'), [f'{OF_TARGETS}: brake']),
        (PUSH % 'ctrlrange="-1 1"', [f'{OF_EFFORTS}: push']),
        (PUSH % 'forcerange="-1 1"', [f'{OF_EFFORTS}: push']),
        (SERVO.replace('/>', ' forcerange="-1 1"/>'), []),
        (PUSH % '', []),
    ],
)
def test_ranges_that_bound_no_later_command_are_listed(
    actuator: str, lines: list[str], tmp_path: Path
) -> None:
    """The control of the file was clipped, later ones were not, and the report said nothing."""
    text = imported(saved(tmp_path, 'it.xml', robot('', actuator, '')), scene=True)
    found = [each[4:] for each in text.split('\n') if each.startswith('#') and ' sent ' in each]
    assert found == lines


def test_the_filter_of_muscles_has_controls_from_0_to_1(tmp_path: Path) -> None:
    """A control of 3 excites a muscle like 1. It pushed three times as much."""
    for control, limits, value in (
        (3.0, '', 1.0),
        (-1.0, '', 0.0),
        (3.0, 'ctrlrange="0 .5"', 0.5),
    ):
        muscle = f'<general joint="j1" dyntype="muscle" gainprm="0.2" {limits}/>'
        key = f'ctrl="{control}" act="{value}"'
        source = robot('', muscle, key)
        text = imported(saved(tmp_path, 'it.xml', source), scene=True, key='k')
        assert 'activation of actuators: they act without delay' in text
        simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
        simulation.step(round(DURATION * 1e3))
        joints = simulation.sample().joints
        ours = [joints[name].position for name in JOINTS]
        assert ours == pytest.approx(positions(source), abs=1e-8)


def test_controls_that_change_move_as_in_mujoco(tmp_path: Path) -> None:
    """Efforts, positions and velocities that are sent every 50 ms, times or by the gear."""
    actuators = (
        PUSH % 'gear="1.5"'
        + SERVO.replace('kp="2"', 'kp="2" kv="0.1"')
        + '<velocity name="turn" joint="j2" kv="0.05" gear="1.3"/>'
    )
    source = robot('damping="0.01"', actuators, '')
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    controls = np.random.default_rng(3).uniform(-1.0, 1.0, (20, 3)) * [0.05, 0.5, 1.0]
    for push, place, speed in controls:
        data.ctrl[:] = push, place, speed
        for _ in range(round(0.05 / STEP)):
            mujoco.mj_step(model, data)
        simulation.apply_effort('j1', 1.5 * push)
        simulation.apply_target('j1', place / -1.5)
        simulation.apply_target('j2', velocity=speed / 1.3)
        simulation.step(50)
        found = [simulation.sample().joints[name].position for name in JOINTS]
        assert found == pytest.approx(data.qpos, abs=1e-9)
    assert np.abs(data.qpos).min() > 0.01


@pytest.mark.parametrize(
    ('joint', 'actuator', 'tendon'),
    [
        ('', PUSH % 'ctrlrange="-inf inf"', ''),
        ('', PUSH % 'forcerange="-inf inf"', ''),
        ('actuatorfrcrange="-inf inf" actuatorfrclimited="true"', PUSH % '', ''),
        ('range="-inf inf" limited="true"', PUSH % '', ''),
        ('', PUSH % '', 'range="-inf inf" limited="true"'),
        ('', SERVO.replace('/>', ' ctrlrange="-inf inf"/>'), ''),
    ],
)
def test_infinite_ranges_bound_nothing(
    joint: str, actuator: str, tendon: str, tmp_path: Path
) -> None:
    """They are no limits. Most files were refused, without a line."""

    def effects(joint: str, actuator: str, tendon: str) -> str:
        belt = f'<tendon><fixed name="t" {tendon}><joint joint="j1" coef="1"/></fixed></tendon>'
        source = robot(joint, actuator, 'ctrl="0.3"', tendon=belt)
        path = saved(tmp_path, 'it.xml', source)
        return imported(path, scene=True, key='k', stops=100.0)

    plain = SERVO if 'kp' in actuator else PUSH % ''
    assert effects(joint, actuator, tendon) == effects('', plain, '')


def test_one_infinite_end_of_a_tendon(tmp_path: Path) -> None:
    """The other end stops it; an infinite free length is refused with its line."""
    belt = '<tendon><fixed name="t" {}><joint joint="j1" coef="1"/></fixed></tendon>'
    source = robot('', PUSH % '', '', tendon=belt.format('range="-inf 1" limited="true"'))
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, stops=100.0)
    (stop,) = (each.parameters for each in scene_from_text(text).effects if each.kind == 'tendon')
    assert (stop.lower, stop.upper) == (None, 1.0)
    source = robot('', PUSH % '', '', tendon=belt.format('stiffness="1" springlength="0 inf"'))
    with pytest.raises(InputError, match=r'it.xml:\d+: fixed t: springlength: not a usable'):
        imported(saved(tmp_path, 'it.xml', source), scene=True)


@pytest.mark.parametrize('kind', ['qpos', 'qvel', 'ctrl'])
def test_a_keyframe_with_numbers_that_are_too_large_is_refused(kind: str, tmp_path: Path) -> None:
    """MuJoCo takes all controls for zero then. They were clipped to their range."""
    for value in ('inf', '1e11'):
        count = 1 if kind == 'ctrl' else 2
        key = f'{kind}="{" ".join([value] * count)}"'
        path = saved(tmp_path, 'it.xml', robot('', PUSH % 'ctrlrange="-1 1"', key))
        said = rf':\d+: key k: {kind}: not a usable number, got .*{value}'
        with pytest.raises(InputError, match=said):
            imported(path, scene=True, key='k')
