"""Tendons of an imported MJCF: their forces and the motion against MuJoCo's own numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

mujoco = pytest.importorskip('mujoco')

STOPS, SLIP, DURATION = 300.0, 1e-2, 0.4
JOINTS = ('j1', 'j2', 'j3')
BELT = """<fixed name="belt" stiffness="30" damping="0.5" springlength="-0.1 0.02" %s>
 <joint joint="j1" coef="0.5"/><joint joint="j3" coef="-2"/></fixed>"""
PASSIVE = 'range="-0.15 0.12" frictionloss="0.2"'
CORD = """<spatial name="cord" stiffness="200" damping="3" springlength="1.1"><site site="w"/>
 <site site="s1"/><site site="s2"/><pulley divisor="2"/><site site="s2"/><site site="s3"/>
 <pulley divisor="4"/><site site="w2"/><site site="s3"/></spatial>"""
ACTUATORS = """<actuator>
 <position name="hold" tendon="cord" kp="5" kv="0.2" gear="-2" forcerange="-9 9"/>
 <motor name="pull" tendon="belt" gear="3"/>
 <velocity name="wind" tendon="belt" kv="0.1"/></actuator>"""


def robot(tendons: str, *more: str) -> str:
    """Two bars and a slide; the first joint has another zero."""
    return f"""<mujoco model="finger"><compiler angle="radian" autolimits="true"/>
<option gravity="0.3 0.2 -9.81"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody><site name="w" pos="0 0.2 0.3"/><site name="w2" pos="0.2 0.2 0.3"/>
 <geom name="post" type="cylinder" size="0.05 0.1" pos="0.1 0 0.2"/>
 <body euler="0.3 0.2 0.1"><joint name="j1" axis="0 1 0" ref="0.1"/>
  <geom type="capsule" fromto="0 0 0 .4 0 0" size=".02"/><site name="s1" pos=".1 .02 .03"/>
  <body pos=".4 0 0"><joint name="j2" axis="0 .9 .1"/>
   <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="s2" pos=".1 .02 -.03"/>
   <body pos=".3 0 0"><joint name="j3" type="slide" axis="1 0 .1" damping="2" stiffness="90"/>
    <geom type="box" size=".1 .02 .03"/><site name="s3" pos=".1 .02 -.03"/>
</body></body></body></worldbody><tendon>{tendons}</tendon>{''.join(more)}
<keyframe><key name="bent" qpos="0.3 -0.4 0.05"/></keyframe></mujoco>"""


def started(folder: Path, source: str, **wishes: Any) -> tuple[Any, Any, str]:
    """MuJoCo's model and data at the keyframe, and our text."""
    text = imported(saved(folder, 'it.xml', source), scene=True, key='bent', **wishes)
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    return model, data, text


@pytest.mark.parametrize(
    'tendons, actuators',
    [(BELT % '', ''), (CORD, ''), (BELT % '' + CORD, ACTUATORS)],
    ids=['joints', 'sites', 'actuators'],
)
def test_powers_like_mujoco(tendons: str, actuators: str, tmp_path: Path) -> None:
    """Of what tendons exert at the same positions and velocities: to rounding."""
    source = robot(tendons, actuators).replace(
        'qpos="0.3 -0.4 0.05"', 'qpos="0.3 -0.4 0.05"' + (' ctrl="-1.1 0.7 0.2"' * bool(actuators))
    )
    model, data, text = started(tmp_path, source)
    model.dof_damping[:], model.jnt_stiffness[:] = 0.0, 0.0  # what else is passive
    drawn = data.qpos.copy()
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    for sample in sim.run(0.3, every=100):
        joints = [sample.joints[name] for name in JOINTS]
        data.qpos[:] = drawn + [each.position for each in joints]
        data.qvel[:] = [each.velocity for each in joints]
        mujoco.mj_forward(model, data)
        wanted = (data.qfrc_passive + data.qfrc_actuator) @ data.qvel
        found = sum(power for name, power in sample.powers.items() if 'tendon' in name)
        assert found == pytest.approx(wanted, rel=1e-12, abs=1e-13)
        if sample.t > 0.0:
            assert abs(wanted) > 0.05


def test_efforts_of_joints_like_mujoco(tmp_path: Path) -> None:
    """Of a tendon over joints each joint has its share."""
    pull = '<actuator><motor name="pull" tendon="belt" gear="3"/></actuator>'
    source = robot(BELT % '', pull).replace('0.05"/>', '0.05" ctrl="0.7"/>')
    model, data, text = started(tmp_path, source)
    drawn = data.qpos.copy()
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    sim.step(200)
    joints = [sim.sample().joints[name] for name in JOINTS]
    data.qpos[:] = drawn + [each.position for each in joints]
    data.qvel[:] = [each.velocity for each in joints]
    mujoco.mj_forward(model, data)
    wanted = data.qfrc_passive + data.qfrc_actuator
    assert [each.effort for each in joints] == pytest.approx(wanted, rel=1e-10, abs=1e-12)
    assert abs(wanted[0]) > 0.1 and abs(wanted[2]) > 0.1


def test_the_motion_like_mujoco(tmp_path: Path) -> None:
    """With dry friction, and a stop that it reaches, as the documents state them."""
    source = robot(BELT % PASSIVE + CORD, ACTUATORS)
    model, data, text = started(tmp_path, source, stops=STOPS)
    friction, (low, high) = float(model.tendon_frictionloss[0]), model.tendon_range[0].copy()
    model.tendon_frictionloss[:], model.tendon_limited[:] = 0.0, 0  # MuJoCo's own are soft
    reached = []

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = np.split(y, 2)
        data.qfrc_applied[:] = 0.0
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        L, speed = float(data.ten_length[0]), float(data.ten_velocity[0])
        reached.append(L)
        F = -friction * speed / np.hypot(speed, SLIP)
        F += STOPS * (max(low - L, 0.0) ** 1.5 - max(L - high, 0.0) ** 1.5)
        data.qfrc_applied[:] = F * np.array([0.5, 0.0, -2.0])
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc])

    start = np.concatenate([data.qpos, np.zeros(3)])
    times = np.linspace(0.0, DURATION, 5)
    wanted = (
        solve_ivp(
            rate, (0.0, DURATION), start, 'DOP853', times, rtol=1e-10, atol=1e-12, max_step=2e-3
        )
        .y[:3]
        .T
    )
    sim = Simulation(scene_from_text(text), integrator='dop853_adaptive', tolerance=1e-11)
    for sample, row in zip(sim.run(DURATION, every=100), wanted, strict=True):
        found = [sample.joints[name].position for name in JOINTS]
        assert found == pytest.approx(row - wanted[0], abs=1e-7)
    assert np.ptp(wanted, axis=0).min() > 0.02 and not low < min(reached) < max(reached) < high


ROTOR = """<fixed name="drum" armature="0.3"><joint joint="j1" coef="0.5"/>
 <joint joint="j2" coef="-0.7"/><joint joint="j3" coef="3"/></fixed>"""


def test_armature_like_mujoco(tmp_path: Path) -> None:
    """The inertia a (∂L/∂q)(∂L/∂q)ᵀ of a tendon over joints, and of an actuator on one."""
    pull = '<actuator><motor name="pull" tendon="belt" gear="3" armature="0.02"/></actuator>'
    source = robot(BELT % '' + ROTOR, pull)
    model, data, text = started(tmp_path, source)
    assert 'armature of tendons' not in text
    assert model.tendon_armature.tolist() == [0.0, 0.3]

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = np.split(y, 2)
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc])

    start = np.concatenate([data.qpos, np.zeros(3)])
    wanted = solve_ivp(rate, (0.0, DURATION), start, 'DOP853', rtol=1e-10, atol=1e-12).y[:, -1]
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    sim.step(round(DURATION / 1e-3))
    sample = sim.sample()
    joints = [sample.joints[name] for name in JOINTS]
    found = [each.position for each in joints], [each.velocity for each in joints]
    assert np.ravel(found) == pytest.approx(wanted - [*start[:3], 0.0, 0.0, 0.0], abs=1e-8)


def test_armature_on_branches_is_listed(tmp_path: Path) -> None:
    """MuJoCo has no inertia there that couples the joints; here the rotor has all of it."""
    arm = """<body pos="0 {0} 0"><joint name="{1}" axis="0 1 0"/>
 <inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body>"""
    source = f"""<mujoco><worldbody>{arm.format(0, 'a')}{arm.format(1, 'b')}</worldbody><tendon>
 <fixed name="t" armature="0.3"><joint joint="a" coef="1"/><joint joint="b" coef="-0.5"/></fixed>
 </tendon></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    assert '#   armature on branches: the rotors of these tendons couple all' in text
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    sim.step(1)
    M = (0.1 + 2.0 * 0.3**2) * np.eye(2) + 0.3 * np.outer([1.0, -0.5], [1.0, -0.5])
    wanted = 1e-3 * np.linalg.solve(M, [2.0 * 9.81 * 0.3] * 2)
    found = [sim.sample().joints[name].velocity for name in ('a', 'b')]
    assert found == pytest.approx(wanted, rel=1e-4)


EQUALITY = """<equality><tendon name="tied" tendon1="belt" tendon2="other"
 polycoef="%s 0.5 0 0 0"/></equality>"""
OTHER = '<fixed name="other"><joint joint="j2" coef="3"/></fixed>'


def test_tied_tendons_are_a_coupling(tmp_path: Path) -> None:
    """0.5 x1 - 2 x3 - 0.5 · 3 x2 is what the file says, to where the joints are moved."""
    _, _, text = started(tmp_path, robot(BELT % '' + OTHER, EQUALITY % '0'))
    (coupling,) = scene_from_text(text).mechanism.couplings
    assert dict(coupling.of) == {'j1': 0.5, 'j2': -1.5, 'j3': -2.0}
    assert '#   posture: ' in text and 'tied (1 of ' in text
    assert '#   softness: constraints hold exactly: tied\n' in text
    left = 0.5 * (0.3 - 0.1) - 2.0 * 0.05 - 0.5 * 3.0 * -0.4
    _, _, text = started(tmp_path, robot(BELT % '' + OTHER, EQUALITY % left))
    assert 'posture' not in text and 'phase of mimic' not in text


WRAPPED = """<spatial name="round" stiffness="9"><site site="w"/><geom geom="post"/>
 <site site="s1"/></spatial>"""


def test_what_does_not_come_along_is_listed(tmp_path: Path) -> None:
    source = robot(
        BELT % 'range="-1 1"' + CORD.replace('damping', 'armature="0.1" damping') + WRAPPED,
        '<actuator><motor name="pull" tendon="round"/></actuator>',
        EQUALITY.replace('other', 'round') % '0',
    )
    _, _, text = started(tmp_path, source)
    for line in (
        'limits (see --stops): joints pass their limits: belt',
        'equalities: not joint, tendon over joints, connect or weld, or not linear: they are '
        'ignored: tied',
        'actuators: they apply no force: pull',
        'tendons: they apply no force: round wraps around a geom',
        'armature of tendons: over places: the inertia of their drives is not counted: cord',
    ):
        assert f'#   {line}\n' in text
    bare = imported(str(tmp_path / 'it.xml'), key='bent')
    assert '#   tendons (see --scene): they apply no force: belt, cord\n' in bare


def test_a_tendon_over_a_ball_is_listed(tmp_path: Path) -> None:
    """MuJoCo adds the first number of its quaternion; such a file was refused for a name."""
    ball = (
        """<body pos="1 0 0"><joint name="b" type="ball"/><geom size=".1"/></body></worldbody>"""
    )
    over = """<fixed name="belt" stiffness="9"><joint joint="j1" coef="1"/>
 <joint joint="b" coef="2"/></fixed>"""
    source = robot(over + OTHER, EQUALITY % '0').replace('</worldbody>', ball)
    try:
        text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    except InputError as error:  # of MuJoCo 4
        assert 'must be slide or hinge' in str(error)
        return
    assert '#   tendons: they apply no force: belt is over a ball or a free joint\n' in text
    assert 'they are ignored: tied\n' in text


def test_limits_of_a_tendon_that_margins_move_past_each_other(tmp_path: Path) -> None:
    source = robot(BELT % 'range="-0.1 0.1" margin="0.2"')
    _, _, text = started(tmp_path, source, stops=STOPS)
    line = 'limits without range: lower is not below upper: nothing stops them: belt'
    assert f'#   {line}\n' in text and 'stop_stiffness' not in text
