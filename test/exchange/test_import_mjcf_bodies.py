"""Velocities of a keyframe and compensation of gravity in an imported MJCF: MuJoCo's motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

mujoco = pytest.importorskip('mujoco')

JOINTS = ('a', 'b', 'b2', 'h')
STEP, DURATION = 2e-4, 0.4  # s
# an arm with two hinges at one place, a tool that is fixed to it, and a body that flies
ROBOT = f"""<mujoco model="it">
<option timestep="{STEP}" integrator="RK4"><flag contact="disable"/></option>
<worldbody>
<body name="l1" pos="0 0 1" GRAVCOMP1><joint name="a" axis="0 1 0.3" damping="0.05"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0.1"/>
<body name="l2" pos="0.3 0 0.1" GRAVCOMP2><joint name="b" axis="0 1 0"/>
<joint name="b2" axis="1 0 0"/><geom type="capsule" size="0.02" fromto="0 0 0 0.2 0 -0.3"/>
<body name="tool" pos="0.2 0 -0.3" GRAVCOMP3><geom type="sphere" size="0.03"/></body></body></body>
<body name="free" pos="0 1 1" GRAVCOMP1><freejoint/><geom type="box" size="0.1 0.05 0.03"/>
<body name="flap" pos="0.1 0 0"><joint name="h" axis="0 0 1"/>
<geom type="box" size="0.03 0.02 0.05" pos="0.05 0 0"/></body></body>
</worldbody>
<keyframe><key name="k" qpos="0.3 0.2 0.1 0 1 1 0.8 0 0.6 0 0.4" qvel="QVEL"/></keyframe>
</mujoco>"""
MOVING = '1 -2 0.5 0.1 0.2 0.3 1 2 -1 3'


def robot(qvel: str = '0 0 0 0 0 0 0 0 0 0', *gravcomp: str) -> str:
    found = ROBOT.replace('QVEL', qvel)
    for n in range(3):
        text = f'gravcomp="{gravcomp[n]}"' if gravcomp else ''
        found = found.replace(f'GRAVCOMP{n + 1}', text)
    return found


def theirs(source: str) -> Floats:
    """(joints and 3,) rad, and m of a place of the flying body, at the end, by MuJoCo itself."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    angles = [float(data.joint(name).qpos[0]) for name in JOINTS]
    return np.array([*angles, *data.joint('h').xanchor])


def ours(text: str) -> Floats:
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    start = np.array([0.3, 0.2, 0.1, 0.4])  # joints are zero as drawn
    simulation.step(round(DURATION * 1000))
    sample = simulation.sample()
    angles = start + [sample.joints[name].position for name in JOINTS]
    return np.array([*angles, *sample.points['h_at']])


@pytest.mark.parametrize(
    'source',
    [
        robot(MOVING),
        robot('', '0.5', '1', '1').replace(' qvel=""', ''),
        robot(MOVING, *'111'),
        robot(MOVING, '0', '0.4', '1'),
        robot(MOVING, '0', '0.1', '-2'),
        robot(MOVING, '0', '0', '-2'),  # which MuJoCo does not count without a positive one
    ],
    ids=['moving', 'lifted', 'both', 'a part', 'a part is heavier', 'none is lifted'],
)
def test_the_motion_is_mujocos(source: str, tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, key='k')
    assert 'Changes of the motion' not in text
    expected = theirs(source)
    still = theirs(robot())
    assert np.abs(expected - still).max() > 0.1
    assert ours(text) == pytest.approx(expected, abs=1e-8)


def test_velocities_fit_other_lengths(tmp_path: Path) -> None:
    """As many components are given as the robot has freedoms: one of each of four hinges, and six
    of a body that flies. More would contradict each other where a length changes."""
    text = imported(saved(tmp_path, 'it.xml', robot(MOVING)), scene=True, key='k')
    scene = scene_from_text(text)
    given = [x for v in scene.velocities.values() for x in v if x is not None]
    assert len(given) == 10
    for name, value in (
        ('mechanism.points.b_at.at.0', '0.35'),
        ('mechanism.joints.h.axis.1', '1'),
    ):
        assert Simulation(with_changes(scene, {name: value})).t == 0.0
        Simulation(scene, tangents=[name]).step()


def test_forces_up_and_down_that_have_no_place_are_listed(tmp_path: Path) -> None:
    """Forces of equal size on two halves of a body are a torque."""
    source = """<mujoco><worldbody><body name="b" gravcomp="1" pos="0 0 1"><freejoint/>
    <geom size="0.1"/><body gravcomp="-1"><geom size="0.1" pos="1 0 0"/></body></body>
    </worldbody></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    assert 'compensation of gravity: these bodies have their whole weight here: b' in text
    assert 'constant_wrench' not in text


def test_a_mechanism_alone_lists_both(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.xml', robot(MOVING, *'111')), key='k')
    assert 'compensation of gravity (see --scene): these bodies have their whole weight' in text
    assert 'velocities of bodies (see --scene): the motion starts at rest: l1, l2, ' in text


@pytest.mark.parametrize(
    ('flag', 'actuator'), [('', ''), ('actuation="disable"', '<motor joint="h"/>')]
)
def test_compensation_by_actuators_that_are_not_there_is_listed(
    flag: str, actuator: str, tmp_path: Path
) -> None:
    """MuJoCo gives the joint none then; it was given here, without a word."""
    source = f"""<mujoco><option><flag {flag}/></option><worldbody><body name="b" gravcomp="1">
    <joint name="h" axis="0 1 0" actuatorgravcomp="true"/>
    <geom type="capsule" fromto="0 0 0 1 0 0" size="0.02"/></body></worldbody>
    <actuator>{actuator}</actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert abs(data.qacc[0]) > 1.0
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    assert 'compensation of gravity: these bodies have their whole weight here: b' in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-4)
    simulation.step(1)
    found = simulation.sample().joints['h'].velocity / 1e-4
    assert found == pytest.approx(data.qacc[0], rel=1e-6)


def test_velocities_of_a_mechanism_that_is_too_large(tmp_path: Path) -> None:
    """The message blamed the joints, of which this one has none."""
    body = '<body pos="{} 0 0"><freejoint/><geom size="0.1"/></body>'
    many = ''.join(body.format(n) for n in range(130))
    speeds = ' '.join(['1', *['0'] * 779])
    source = f"""<mujoco><worldbody>{many}</worldbody>
<keyframe><key name="k" qvel="{speeds}"/></keyframe></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, key='k')
    assert (
        'velocities of many bodies: the mechanism is too large to fit them to its joints' in text
    )
    assert 'velocities of bodies' not in text


MOCAP = f"""<mujoco model="it">
<option timestep="{STEP}" integrator="RK4"><flag contact="disable"/></option>
<worldbody><body name="hand" mocap="true" pos="0 0 1"><geom size="0.1"/>
<body name="palm" pos="0.2 0 0"><geom size="0.1"/>
<body name="finger"><joint name="h" axis="0 1 0"/><geom size="0.05" pos="0.1 0.02 0"/></body>
</body></body></worldbody><keyframe><key name="k" mpos="0.5 0 2" mquat="1 0.2 0 0"/></keyframe>
</mujoco>"""


@pytest.mark.parametrize('key', ['k', None])
def test_mocap_bodies_do_not_move(key: str | None, tmp_path: Path) -> None:
    """Newer versions of MuJoCo count them as bodies without joints that move: they fell."""
    text = imported(saved(tmp_path, 'it.xml', MOCAP), scene=True, key=key)
    assert 'motion of mocap bodies: they do not move: hand' in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    assert [each.name for each in simulation.model.mechanism.bodies] == ['finger']
    simulation.step(round(DURATION * 1e3))
    model = mujoco.MjModel.from_xml_string(MOCAP)
    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    turned = simulation.sample().joints['h'].position
    assert abs(turned) > 1.0
    assert turned == pytest.approx(float(data.joint('h').qpos[0]), abs=1e-9)
