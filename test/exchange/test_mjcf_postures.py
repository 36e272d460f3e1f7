"""Loops of an MJCF that --set or a keyframe opens: Newton's method on the joints closes them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import InputError, Simulation
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.mjcf_equalities import _couplings, _loops
from alf_ros.exchange.mjcf_posture import Held, _MjcfPosture
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.thorough import combined

mujoco = pytest.importorskip('mujoco')

KEY = '<keyframe><key name="up" qpos="{}"/></keyframe></mujoco>'


def told(text: str) -> dict[str, float]:
    line = next(line for line in text.splitlines() if 'zero of joints' in line)
    return {name: float(x) for name, x in re.findall(r'(\w+) at ([-+.\de]+)', line)}


def gap(source: str, positions: dict[str, float]) -> float:
    """m, of the connect, by MuJoCo itself."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    for name, x in positions.items():
        data.joint(name).qpos[0] = x
    mujoco.mj_forward(model, data)
    return float(np.abs(data.efc_pos[: 3 * model.neq]).max())


def violation(text: str) -> float:
    simulation = Simulation(scene_from_text(text))
    return simulation.sample().diagnostics.position_violation


def test_a_four_bar_closes_after_set(tmp_path: Path) -> None:
    """As MuJoCo has the loop, and with all positions of the report in --set again."""
    source = robots.four_bar_mjcf()
    path = saved(tmp_path, 'it.xml', source)
    text = imported(path, scene=True, positions={'crank_pin': 0.4})
    assert 'wrist (1 of 1 starts close them; the nearest posture is taken)' in text
    found = told(text)
    assert found.keys() == {'crank_pin', 'knee', 'rocker_pin'} and found['crank_pin'] == 0.4
    assert gap(source, {'crank_pin': 0.4}) > 0.01
    assert gap(source, found) < 1e-10
    assert violation(text) < 1e-12
    again = imported(path, scene=True, positions=found)
    assert 'posture' not in again and violation(again) < 1e-12


def test_a_keyframe_that_opens_the_loop_is_a_start(tmp_path: Path) -> None:
    """Joints of --set stay, joints of the keyframe do not."""
    source = robots.four_bar_mjcf().replace('</mujoco>', KEY.format('0.40 -0.14 0.13'))
    path = saved(tmp_path, 'it.xml', source)
    found = told(imported(path, key='up'))
    assert gap(source, found) < 1e-10
    assert 0.0 < abs(found['crank_pin'] - 0.4) < 0.2
    assert told(imported(path, key='up', positions={'crank_pin': 0.4}))['crank_pin'] == 0.4


def test_limits_choose_the_branch_and_can_forbid_it(tmp_path: Path) -> None:
    source = robots.four_bar_mjcf()
    one = told(imported(saved(tmp_path, 'it.xml', source), positions={'crank_pin': 0.4}))
    beyond = f'name="knee" limited="true" range="-200 {np.degrees(one["knee"]) - 5.0}"'
    limited = source.replace('name="knee"', beyond)
    other = told(imported(saved(tmp_path, 'it.xml', limited), positions={'crank_pin': 0.4}))
    assert other['knee'] < one['knee'] - 0.08
    assert gap(limited, other) < 1e-10
    never = source.replace('name="knee"', 'name="knee" limited="true" range="0 1"')
    with pytest.raises(InputError, match='wrist cannot be closed.*m stay open.*from 60 starts'):
        imported(saved(tmp_path, 'it.xml', never), positions={'crank_pin': 0.4})


BALLS = """<mujoco><compiler angle="radian"/><worldbody>
<body name="arm"><joint name="pin" axis="0 1 0"/><geom size="0.05" pos="0.1 0 0"/>
 <body name="slider" pos="0.2 0 0"><joint name="slide" type="slide" axis="0 0 1"/>
 <geom size="0.05"/>
 <body name="rod" pos="0 0 0.1"><joint name="ball" type="ball"/>
  <geom type="capsule" size="0.01" fromto="0 0 0 0.3 0.05 0"/></body></body></body>
<body name="twin" pos="0 0.4 0"><joint name="twin_pin" axis="0 1 0"/><geom size="0.05"/></body>
<body name="loose" pos="0.6 0 0.1" euler="0.1 0.2 0.3"><freejoint/><geom size="0.05"/></body>
</worldbody><equality>
<connect name="tip" body1="rod" body2="loose" anchor="0.3 0.05 0"/>
<weld name="place" body1="loose" relpose="-0.55 -0.05 -0.12 1 0 0.1 0"/>
<joint name="geared" joint1="twin_pin" joint2="pin" polycoef="0.1 -2 0 0 0"/>
</equality></mujoco>"""


def test_balls_free_bodies_and_couplings_follow(tmp_path: Path) -> None:
    """The pin stays, so its coupling does; the ball, the slide and the free body move."""
    text = imported(saved(tmp_path, 'it.xml', BALLS), scene=True, positions={'pin': 0.2})
    found = told(text)
    assert found['pin'] == 0.2 and found['twin_pin'] == pytest.approx(0.1 - 0.4, abs=1e-12)
    assert 'tip, place (' in text or 'place, tip (' in text
    assert violation(text) < 1e-12


def test_the_derivative_of_the_gaps(tmp_path: Path) -> None:
    """By central differences, far from the position drawn."""
    model = mujoco.MjModel.from_xml_string(BALLS)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    held: list[Held] = [*_loops(mujoco, model).values(), *_couplings(mujoco, model).values()]
    posture = _MjcfPosture(mujoco, data, held, range(model.nv), 0.7)
    x = np.random.default_rng(3).uniform(-0.8, 0.8, model.nv)
    slope = posture.gaps(x)[1]
    for n in range(x.size):
        step = 1e-6 * np.eye(x.size)[n]
        ahead, behind = posture.gaps(x + step)[0], posture.gaps(x - step)[0]
        np.testing.assert_allclose(slope[:, n], (ahead - behind) / 2e-6, rtol=0.0, atol=1e-8)


COUPLED = """<mujoco><compiler angle="radian" autolimits="true"/>
<default><geom contype="0" conaffinity="0" size="0.03"/></default><worldbody>
<body><joint name="a" axis="0 1 0" ref="0.2"/><geom pos="0.3 0 0"/>
 <body pos="0.4 0 0"><joint name="b" axis="0 1 0"/><geom pos="0.2 0.1 0"/></body></body>
<body pos="0 1 0"><joint name="c" axis="0 1 0" ref="-0.1"/><geom pos="0.3 0 0"/>
 <body pos="0.4 0 0"><joint name="d" type="slide" axis="0 1 0"/><geom pos="0.1 0 0"/></body></body>
</worldbody><tendon>
<fixed name="one"><joint joint="a" coef="1"/><joint joint="b" coef="0.5"/></fixed>
<fixed name="two"><joint joint="c" coef="2"/><joint joint="d" coef="-1"/></fixed></tendon>
<equality>{}</equality><keyframe><key name="bent" qpos="0.5 -0.2 0.3 0.1"/></keyframe></mujoco>"""
TIED = '<tendon name="tied" tendon1="one" tendon2="two" polycoef="0.05 -0.7 0 0 0"/>'
HELD = '<tendon name="held" tendon1="one" polycoef="0.3 0 0 0 0"/>'
CHAIN = """<joint name="first" joint1="a" joint2="b" polycoef="0.1 2 0 0 0"/>
<joint name="second" joint1="b" joint2="c" polycoef="0 -0.5 0 0 0"/>"""
EQUALITIES = {'tendons': TIED, 'a tendon': HELD, 'a chain': CHAIN, 'both': TIED + CHAIN}


@pytest.mark.parametrize(
    ('equality', 'start'),
    combined(
        [pytest.param(text, id=name) for name, text in EQUALITIES.items()],
        [
            pytest.param({}, id='drawn'),
            pytest.param({'c': 0.7}, id='set'),
            pytest.param({'key': 'bent'}, id='key'),
            pytest.param({'key': 'bent', 'c': 0.7}, id='key and set'),
        ],
    ),
)
def test_couplings_hold_as_in_the_file_wherever_it_starts(
    equality: str, start: dict[str, Any], tmp_path: Path
) -> None:
    """By MuJoCo's own residuals, at the start and after a motion, which a constant must not leave.
    The reference is `qpos0`, neither the keyframe nor the positions set."""
    source, given = COUPLED.format(equality), dict(start)
    key = given.pop('key', None)
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, key=key, positions=given)
    assert 'phase of mimic' not in text
    simulation = Simulation(scene_from_text(text))
    model = mujoco.MjModel.from_xml_string(source)
    drawn = {'a': 0.0, 'b': 0.0, 'c': 0.0, 'd': 0.0} | told(text)
    assert given.items() <= drawn.items()
    for _ in range(2):
        data = mujoco.MjData(model)
        for name, joint in simulation.sample().joints.items():
            data.joint(name).qpos[0] = drawn[name] + joint.position
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[: model.neq]).max() < 1e-12
        simulation.step(200)
    assert abs(simulation.sample().joints['c'].position) > 1e-3


def test_couplings_that_contradict_what_is_set_are_refused(tmp_path: Path) -> None:
    source = saved(tmp_path, 'it.xml', COUPLED.format(TIED))
    everything = {'a': 0.3, 'b': 0.0, 'c': 0.0, 'd': 0.2}
    with pytest.raises(InputError, match='tied cannot be closed: all joints are held'):
        imported(source, positions=everything)
    chain = saved(tmp_path, 'it.xml', COUPLED.format(CHAIN))
    text = imported(chain, positions={'a': 0.3000004})
    assert 'phase of mimic' not in text and 'a at 0.3,' in text
    with pytest.raises(InputError, match='an equality has it at 0.3'):
        imported(chain, positions={'a': 0.5})
