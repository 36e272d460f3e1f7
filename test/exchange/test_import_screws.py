"""Screws and universal joints of Drake in a URDF, against MuJoCo's mass matrix and bias forces."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError, Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text

LINK = """<link name="{}"><inertial><origin xyz="{}"/><mass value="{}"/>
<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.07"/></inertial></link>"""
URDF = f"""<robot name="r" xmlns:drake="http://drake.mit.edu"><link name="base"/>
{LINK.format('a', '0.1 0.02 0', 2)}{LINK.format('b', '0.2 0 -0.1', 1.5)}
{LINK.format('c', '0.05 0.1 -0.3', 1.2)}
<joint name="h" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<drake:joint name="s" type="screw"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/>
<axis xyz="0.2 0.3 2"/><dynamics damping="0.04"/>
<drake:screw_thread_pitch value="0.7"/></drake:joint>
<drake:joint name="u" type="universal"><parent link="b"/><child link="c"/>
<origin xyz="0.1 0.1 0"/><dynamics damping="0.05"/></drake:joint></robot>"""
BODY = """<body name="{}" pos="{}">{}
<inertial pos="{}" mass="{}" diaginertia="0.05 0.06 0.07"/>"""
MJCF = (
    '<mujoco><compiler angle="radian"/><worldbody>'
    + BODY.format('a', '0 0 0', '<joint axis="0 1 0"/>', '0.1 0.02 0', 2)
    + BODY.format(
        'b',
        '0.3 0 0',
        '<joint axis="0.2 0.3 2"/><joint type="slide" axis="0.2 0.3 2"/>',
        '0.2 0 -0.1',
        1.5,
    )
    + BODY.format(
        'c',
        '0.1 0.1 0',
        '<joint axis="1 0 0"/><joint axis="0 1 0"/>',
        '0.05 0.1 -0.3',
        1.2,
    )
    + '</body></body></body></worldbody></mujoco>'
)
LEAD = 0.7 / (2.0 * math.pi)


def saved(folder: Path, text: str, name: str = 'it.urdf') -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def reference(start: Floats, seconds: float) -> Floats:
    """The angles of h, s and of both axes of u: MuJoCo's chain, whose slide is the lead times the
    angle before it."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    free = np.zeros((5, 4))
    free[[0, 1, 3, 4], range(4)] = 1.0
    free[2, 1] = LEAD
    losses = np.array([0.0, 0.04, 0.05, 0.05])

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = free @ y[:4], free @ y[4:]
        mujoco.mj_forward(model, data)
        masses = np.zeros((5, 5))
        for row, unit in zip(masses, np.eye(5), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        forces = -free.T @ data.qfrc_bias - losses * y[4:]
        return np.concatenate([y[4:], np.linalg.solve(free.T @ masses @ free, forces)])

    begin = np.concatenate([start, np.zeros(4)])
    found = solve_ivp(rate, (0.0, seconds), begin, 'DOP853', rtol=1e-12, atol=1e-13)
    return np.asarray(found.y[:4, -1])


@pytest.mark.parametrize('turned', [0.0, 2.5])
def test_the_motion_is_that_of_the_chain(turned: float, tmp_path: Path) -> None:
    positions = {'s': turned} if turned else {}
    text = imported(saved(tmp_path, URDF), scene=True, positions=positions)
    assert 'Changes of the motion' not in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=5e-4)
    simulation.step(800)
    joints = simulation.sample().joints
    ours = [joints[name].position for name in ('h', 's', 'u_X', 'u_Y')]
    start = np.array([0.0, turned, 0.0, 0.0])
    assert ours == pytest.approx(reference(start, 0.4) - start, abs=1e-9)


def test_the_place_of_a_screw_that_is_set(tmp_path: Path) -> None:
    """The child has moved along the axis by the pitch for a turn, whatever the drawing says."""
    source = URDF.replace('0.2 0.3 2', '0 0 3')
    text = imported(saved(tmp_path, source), positions={'s': 2.0 * math.pi})
    assert 's_at: {at: [0.3, 0.0, 0.7]}' in text and 'pitch: 0.7' in text
    side = saved(tmp_path, f'positions: {{s: {2.0 * math.pi!r}}}', 'side.yaml')
    assert text == imported(saved(tmp_path, source), loops=side)


def test_names_of_rows_that_a_file_has_already(tmp_path: Path) -> None:
    """The joint that slides in a screw, and the links in rows, get free names: a file with these
    names is the same robot."""
    renamed = (
        URDF.replace('name="h"', 'name="s_slide"')
        .replace('"a"', '"s_slide_link"')
        .replace('"c"', '"u_X_link"')
    )
    text = imported(saved(tmp_path, renamed), scene=True)
    plain = imported(saved(tmp_path, URDF), scene=True)
    ends = []
    for each, hinge in ((text, 's_slide'), (plain, 'h')):
        simulation = Simulation(scene_from_text(each), integrator='dop853', step=1e-3)
        simulation.step(200)
        joints = simulation.sample().joints
        ends.append([joints[name].position for name in (hinge, 's', 'u_X', 'u_Y')])
    assert ends[0] == pytest.approx(ends[1], abs=1e-11)
    assert abs(ends[0][0]) > 0.01


def test_joints_with_the_names_of_parts_of_a_row(tmp_path: Path) -> None:
    """The angles of a universal joint get free names, also for --set; the robot is the same."""
    taken = saved(tmp_path, URDF.replace('name="h"', 'name="u_X"').replace('"s"', '"u_Y"'))
    plain = saved(tmp_path, URDF, 'plain.urdf')
    ends = []
    for source, names in ((taken, ('u_X', 'u_Y', 'u_X_2', 'u_Y_2')), (plain, ('h', 's', *'XY'))):
        names = tuple(f'u_{name}' if name in 'XY' else name for name in names)
        given = dict(zip(names[2:], (0.3, -0.2), strict=True))
        text = imported(source, scene=True, positions=given)
        assert text == imported(
            source, scene=True, loops=saved(tmp_path, f'positions: {given}', 'side.yaml')
        )
        simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
        simulation.step(200)
        joints = simulation.sample().joints
        ends.append([joints[name].position for name in names])
        told = '#   names, changed: u_X of u is u_X_2, u_Y of u is u_Y_2\n'
        assert (told in text) == (source == taken)
    assert ends[0] == pytest.approx(ends[1], abs=1e-11)
    assert min(abs(each) for each in ends[0]) > 1e-3


def test_a_pitch_between_spaces(tmp_path: Path) -> None:
    spaced = URDF.replace('thread_pitch value="', 'thread_pitch value=" ')
    assert spaced != URDF
    assert imported(saved(tmp_path, spaced)) == imported(saved(tmp_path, URDF))
    spaced = spaced.replace('thread_pitch value=" 0.7"', 'thread_pitch value="0.7\t"')
    assert imported(saved(tmp_path, spaced)) == imported(saved(tmp_path, URDF))


def test_positions_of_rows_in_a_side_file_and_with_set(tmp_path: Path) -> None:
    source = saved(tmp_path, URDF)
    given = {'u_X': 0.3, 'u_Y': -0.2, 's': 0.5}
    text = imported(source, positions=given)
    side = saved(tmp_path, f'positions: {given}', 'side.yaml')
    assert 'u_X at 0.3' in text and text == imported(source, loops=side)
    for wrong, message in (('u', 'no such joint'), ('s_slide', 's_slide')):
        with pytest.raises(InputError, match=message):
            imported(source, loops=saved(tmp_path, f'positions: {{{wrong}: 1}}', 'side.yaml'))
        with pytest.raises(InputError, match=message):
            imported(source, positions={wrong: 1.0})


def test_screws_that_mimic_and_are_mimicked(tmp_path: Path) -> None:
    for old, new in (
        ('</drake:joint>', '<mimic joint="h" multiplier="3"/></drake:joint>'),
        ('</joint>', '<mimic joint="s" multiplier="0.5"/></joint>'),
    ):
        text = imported(saved(tmp_path, URDF.replace(old, new, 1)), scene=True)
        assert 'Changes of the motion' not in text
        simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
        simulation.step(200)
        joints = simulation.sample().joints
        factor = 3.0 if 'drake' in old else 2.0
        assert abs(joints['h'].position) > 0.05
        assert joints['s'].position == pytest.approx(factor * joints['h'].position, abs=1e-9)


def test_what_screws_lack(tmp_path: Path) -> None:
    """Limits are listed, a pitch of zero leaves a revolute, and mistakes have their line."""
    limit = '<limit lower="-1" upper="1" effort="5" velocity="0"/>'
    text = imported(saved(tmp_path, URDF.replace('<drake:screw', limit + '<drake:screw')))
    assert 'limits of screws: of angles or of lengths' in text
    text = imported(saved(tmp_path, URDF.replace('value="0.7"', 'value="0"')), scene=True)
    assert 'type: screw' not in text and 's: {joint: s, viscous: 0.04}' in text
    negative = imported(saved(tmp_path, URDF.replace('value="0.7"', 'value="-0.7"')))
    assert 'pitch: -0.7' in negative
    for old, new, message in (
        ('value="0.7"', '', ':10: s: a screw without its pitch'),
        ('<drake:screw_thread_pitch value="0.7"/>', '', ':8: s: a screw without its pitch'),
        ('"0.7"', '"1/0"', ":10: s: the pitch is not a usable number, got '1/0'"),
        ('damping="0.04"', 'damping="x"', ':9: joint s: dynamics damping: not a number'),
        ('damping="0.05"', 'damping="x"', ':12: joint u: dynamics damping: not a number'),
        ('damping="0.04"', 'damping="-1"', 's: negative damping'),
    ):
        with pytest.raises(InputError) as caught:
            imported(saved(tmp_path, URDF.replace(old, new)), scene=True)
        assert message in str(caught.value)
