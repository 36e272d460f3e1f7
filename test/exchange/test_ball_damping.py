"""Damping of balls in a URDF of Drake and in an MJCF, against MuJoCo's accelerations."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

INERTIAL = """<inertial><origin xyz="0.1 0.02 -0.3"/><mass value="2"/>
<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.07"/></inertial>"""
URDF = f"""<robot name="r" xmlns:drake="http://drake.mit.edu"><link name="base"/>
<link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link>
<drake:joint name="b1" type="ball"><parent link="base"/><child link="a"/>
<dynamics damping="0.3"/></drake:joint>
<joint name="h" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/>
<axis xyz="0 1 0"/></joint></robot>"""
BODY = '<inertial pos="0.1 0.02 -0.3" mass="2" diaginertia="0.05 0.06 0.07"/>'
MJCF = f"""<mujoco><worldbody><body name="a"><joint name="b1" type="ball" damping="0.3"/>{BODY}
<body name="b" pos="0.2 0 0"><joint name="h" axis="0 1 0"/>{BODY}</body></body></worldbody>
</mujoco>"""


def reference(seconds: float) -> tuple[Floats, float]:
    """The place of the second body's frame, m, and the angle h, by MuJoCo's accelerations."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = y[:5], y[5:]
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        turning = np.zeros(4)
        mujoco.mju_mulQuat(turning, data.qpos[:4], np.concatenate([[0.0], data.qvel[:3]]))
        return np.concatenate([0.5 * turning, data.qvel[3:], data.qacc])

    begin = np.concatenate([[1.0], np.zeros(8)])
    found = solve_ivp(rate, (0.0, seconds), begin, 'DOP853', rtol=1e-12, atol=1e-13).y[:, -1]
    rate(seconds, found)
    return data.body('b').xpos.copy(), float(found[4])


@pytest.mark.parametrize(('name', 'source'), [('it.urdf', URDF), ('it.xml', MJCF)])
def test_a_ball_at_the_ground_has_its_damping(name: str, source: str, tmp_path: Path) -> None:
    text = imported(saved(tmp_path, name, source), scene=True)
    assert 'Changes of the motion' not in text and 'drag: {b1: {"on": a, spin: 0.3}}' in text
    simulation = simulate(text)
    start = simulation.sample().joints['h'].position
    simulation.step(500)
    place, angle = reference(0.5)
    sample = simulation.sample()
    assert sample.joints['h'].position - start == pytest.approx(angle, abs=1e-9)
    assert np.asarray(sample.points['h_at']) == pytest.approx(place, abs=1e-9)


def test_damping_of_balls_that_is_listed(tmp_path: Path) -> None:
    """Between two bodies, and of a rod without inertia about its axis."""
    said = 'damping of balls: between two moving bodies'
    between = URDF.replace('"base"/><child', '"c"/><child').replace(
        '<link name="a">',
        f"""
<link name="c">{INERTIAL}</link><joint name="k" type="continuous"><parent link="base"/>
<child link="c"/></joint><link name="a">""",
    )
    rod = MJCF.replace(
        'diaginertia="0.05 0.06 0.07"/>\n<body', 'diaginertia="0.05 0.05 1e-15"/><body'
    )
    for name, source in (('it.urdf', between), ('it.xml', rod)):
        text = imported(saved(tmp_path, name, source), scene=True)
        assert said in text and 'drag' not in text
    plain = imported(saved(tmp_path, 'it.urdf', URDF))
    assert 'damping (see --scene)' in plain and 'b1' in plain
    negative = URDF.replace('"0.3"', '"-0.3"')
    with pytest.raises(InputError, match=r'it.urdf:\d+: b1: negative damping'):
        imported(saved(tmp_path, 'it.urdf', negative), scene=True)


def test_what_an_sdf_says_of_the_axes_of_a_ball_is_listed(tmp_path: Path) -> None:
    """A ball has no axes, so no damping and limits about them."""
    sdf = """<sdf version="1.9"><model name="m"><link name="a"/><joint name="eye" type="ball">
<parent>world</parent><child>a</child>%s</joint></model></sdf>"""
    said = 'these joints have none: eye\n'
    for inside in ('<dynamics><damping>3</damping></dynamics>', '<limit><upper>1</upper></limit>'):
        for tag in ('axis', 'axis2'):
            source = sdf % f'<{tag}><xyz>0 1 0</xyz>{inside}</{tag}>'
            assert said in imported(saved(tmp_path, 'it.sdf', source), scene=True)
    plain = sdf % '<axis><xyz>0 1 0</xyz><limit><upper>1e16</upper></limit></axis>'
    assert said not in imported(saved(tmp_path, 'it.sdf', plain), scene=True)
