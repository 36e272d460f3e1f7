"""Forces on the joints of imported robots, against an independent integration of MuJoCo's M and J.

MuJoCo gives the mass matrix with armature, the bias forces and the Jacobians of the constraints.
The test states the laws independently of the package, and its constraints hold exactly:
M q̈ = τ - bias + Jᵀ λ, J q̈ = -J̇ q̇.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import support.imported_robots as robots
from alf_ros import InputError, Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.coupled_bars import two_bars
from support.imported_motions import saved, simulate
from support.paths import DATA

FOLDER = DATA / 'robots'
LEG = str(FOLDER / 'leg.xml')
STOPS, SLIP = 2e2, 1e-2  # N m/rad^1.5; rad/s or m/s below which dry friction fades
DURATION, INSTANTS = 0.6, 7


class Independent:
    """The leg in its joint coordinates."""

    def __init__(self) -> None:
        self.mujoco = pytest.importorskip('mujoco')
        self.model = self.mujoco.MjModel.from_xml_path(LEG)
        self.data = self.mujoco.MjData(self.model)
        self.mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        self.start = self.data.qpos.copy()
        toe, knee = (self.model.joint(name).qposadr[0] for name in ('toe', 'knee'))
        self.mimic = toe, knee
        self.start[toe] = 0.1 - 0.6 * (self.start[knee] - 0.2)
        self.control = self.data.ctrl.copy()

    def effort(self, q: Floats, v: Floats) -> Floats:
        """Of dampers, dry friction, springs, stops and actuators."""
        model = self.model
        force = -model.dof_damping * v
        force -= model.dof_frictionloss * v / np.sqrt(v**2 + SLIP**2)
        force -= model.jnt_stiffness * (q - model.qpos_spring)
        for n in np.flatnonzero(model.jnt_limited):
            below, above = model.jnt_range[n, 0] - q[n], q[n] - model.jnt_range[n, 1]
            force[n] += STOPS * (max(below, 0.0) ** 1.5 - max(above, 0.0) ** 1.5)
        rail, hip, crank = (model.joint(name).dofadr[0] for name in ('rail', 'hip', 'crank'))
        u = self.control
        force[rail] += 3.0 * u[0]
        hold = 20.0 * (u[1] - 2.0 * q[hip]) - 0.4 * 2.0 * v[hip]
        force[hip] += 2.0 * min(max(hold, -6.0), 6.0)
        force[crank] += -1.5 * 0.3 * (u[2] + 1.5 * v[crank])
        return np.asarray(force)

    def jacobian(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """(rows, n) of the mimic and of the loop across its axis, and J̇ q̇ (rows,)."""
        mujoco, model, data = self.mujoco, self.model, self.data
        J, rate = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        toe, knee = self.mimic
        J[0, [toe, knee]] = 1.0, 0.6
        # of the loop: the anchor on both bodies, as MuJoCo has compiled it
        sides = zip(('link', 'rocker'), model.eq_data[2, :6].reshape(2, 3), (1, -1), strict=True)
        for body, inner, sign in sides:
            n = model.body(body).id
            at = data.xpos[n] + data.xmat[n].reshape(3, 3) @ inner
            linear, change = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, linear, None, at, n)
            mujoco.mj_jacDot(model, data, change, None, at, n)
            J[1:] += sign * linear[[0, 2]]
            rate[1:] += sign * change[[0, 2]]
        return J, rate @ v

    def rate(self, _: float, y: Floats) -> Floats:
        mujoco, model, data = self.mujoco, self.model, self.data
        q, v = np.split(y, 2)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        M = np.zeros((model.nv, model.nv))
        for column, unit in zip(M, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        J, bent = self.jacobian(q, v)
        m, n = J.shape
        whole = np.block([[M, -J.T], [J, np.zeros((m, m))]])
        right = np.concatenate([self.effort(q, v) - data.qfrc_bias, -bent])
        return np.concatenate([v, np.linalg.solve(whole, right)[:n]])

    def positions(self) -> Floats:
        """(instants, joints) rad, m."""
        y = np.concatenate([self.start, np.zeros(self.model.nv)])
        times = np.linspace(0.0, DURATION, INSTANTS)
        found = solve_ivp(
            self.rate, (0.0, DURATION), y, 'DOP853', times, rtol=1e-11, atol=1e-12, max_step=2e-3
        )
        return np.asarray(found.y[: self.model.nq].T)


def test_all_that_acts_on_joints_like_mujoco() -> None:
    """Armature, friction, springs, stops, actuators, a mimic and a loop from a keyframe on."""
    independent = Independent()
    expected = independent.positions()
    text = imported(LEG, stops=STOPS, key='bent')
    scene = scene_from_text(text)
    sim = Simulation(scene, integrator='dop853_adaptive', tolerance=1e-11, step=1e-3)
    model = independent.model
    names = [model.joint(n).name for n in range(model.njnt)]
    every = round(DURATION / (INSTANTS - 1) / 1e-3)
    for sample, row in zip(sim.run(DURATION, every=every), expected, strict=True):
        found = [sample.joints[name].position for name in names]
        assert found == pytest.approx(row - expected[0], abs=1e-7)
    assert np.ptp(expected, axis=0).min() > 0.05
    assert expected[:, 1].max() > model.jnt_range[model.joint('hip').id, 1] + 1e-3


def test_what_a_leg_leaves() -> None:
    """Omissions that change the motion come first, each with its consequence."""
    pytest.importorskip('mujoco')
    lines = imported(LEG, key='bent').split('\n')
    assert lines[1] == '# Changes of the motion:'
    for line in (
        'limits (see --stops): joints pass their limits: hip',
        'armature (see --scene): the inertia of rotors is not counted: '
        'rail, hip, knee, toe, crank, link, rocker',
        'dry friction (see --scene): joints have no friction: rail, knee, rocker',
        'actuators (see --scene): they apply no force: push, hold, turn',
        'actuators: they apply no force: stiffener',
        'softness: constraints hold exactly: like_the_knee, wrist',
    ):
        assert f'#   {line}' in lines
    assert not any(line.startswith('#   tendons') for line in lines)  # nothing acts on the cord
    end = '# Left out without an effect on the motion: lights 1, cameras 1, sensors 1'
    assert end in lines
    assert f'{end}, keyframes 1' in imported(LEG).split('\n')  # where it does not begin there


def test_a_keyframe_and_a_joint_where_an_equality_has_it() -> None:
    pytest.importorskip('mujoco')
    sample = simulate(imported(LEG, scene=True, positions={'knee': 0.7})).sample()
    along, hip = sample.points['toe_at'] - sample.points['knee_at'], sample.points['knee_at']
    assert np.linalg.norm(along) == pytest.approx(0.4) and hip[2] < 1.0
    with pytest.raises(InputError, match=r"--set: an equality has it at -0.08, got 'toe=0.3'"):
        imported(LEG, key='0', positions={'toe': 0.3})
    with pytest.raises(InputError, match="no such keyframe, got 'bnt'; did you mean 'bent'"):
        imported(LEG, key='bnt')
    with pytest.raises(InputError, match='--key: for MJCF only'):
        imported(str(FOLDER / 'nested.sdf'), key='bent')


def test_an_actuator_stays_in_its_range(tmp_path: Path) -> None:
    """9 of 9 times gear 3 at most; a control beyond its range counts as its end."""
    pytest.importorskip('mujoco')
    source = Path(LEG).read_text(encoding='utf-8').replace('ctrl="2 ', 'ctrl="50 ')
    text = imported(saved(tmp_path, 'leg.xml', source), scene=True, key='bent')
    motors = {e.label: e.parameters for e in scene_from_text(text).effects if e.kind == 'motor'}
    assert motors['motor.push'].effort == 27.0 and motors['motor.push'].limit == 27.0


# -------------------------------------------------------------------------------------------- URDF


@pytest.mark.parametrize('ratio', [1.0, -0.5])
def test_a_mimicking_joint_of_a_urdf(ratio: float, tmp_path: Path) -> None:
    """Two bars, the second raised by the offset: Lagrange's equation of the one coordinate."""
    raised = math.atan2(0.2, 0.7)
    path = saved(tmp_path, 'it.urdf', finger(ratio, raised))
    text = imported(path, scene=True)
    assert '#   mimic' not in text
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    sim.step(1000)
    found = [sim.sample().joints[name].position for name in ('one', 'two')]
    assert found == pytest.approx(two_bars(ratio, 1.0), abs=1e-9)
    message = "--set or side file: 'two' mimics 'one', which has it at 0.2"
    with pytest.raises(InputError, match=message):
        imported(path, positions={'two': 1.0})


def finger(ratio: float, offset: float, *more: str) -> str:
    """The bars of test_couplings."""
    mimic = f'<mimic joint="one" multiplier="{ratio!r}" offset="{offset!r}"/></joint>'
    return robots.robot(
        '<link name="base"/>',
        robots.link('upper', (0.5, 0.0, 0.0), 1.5, (0.1, 0.2, 0.2, 0, 0, 0)),
        robots.link('lower', (0.3, 0.0, 0.0), 0.8, (0.1, 0.1, 0.1, 0, 0, 0)),
        robots.hinge('one', 'base', 'upper', 0.0, 0.0),
        robots.hinge('two', 'upper', 'lower', 1.0, 0.0).replace('</joint>', mimic),
        *more,
    )


CONTROL = """<ros2_control name="hardware" type="system">
 <joint name="one"><command_interface name="position"/><command_interface name="velocity"/>
  <state_interface name="position"><param name="initial_value">0.4</param></state_interface>
 </joint>
 <joint name="two"><state_interface name="position"/></joint></ros2_control>"""
TRANSMISSION = """<transmission name="t"><type>transmission_interface/SimpleTransmission</type>
 <joint name="one"><hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface>
 </joint><actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>
</transmission>"""


def test_motors_of_a_urdf(tmp_path: Path) -> None:
    """They have the limit of the joint and push nothing; ros2_control says where it begins."""
    limit = '<limit effort="7" velocity="2"/><dynamics damping="0.2" friction="0.3"/>'
    for elements, gains in ((CONTROL, True), (TRANSMISSION, False)):
        source = finger(2.0, 0.1, elements).replace(
            '<child link="upper"/>', '<child link="upper"/>' + limit
        )
        text = imported(saved(tmp_path, 'it.urdf', source), scene=True)
        found = {e.kind: e.parameters for e in scene_from_text(text).effects}
        assert found['motor'].joint == 'one' and found['motor'].limit == 7.0
        assert found['joint_friction'].load == 0.3 and found['joint_friction'].dynamic == 1.0
        assert ('gains of actuators' in text) == gains
        assert ('one at 0.4, two at 0.9' in text) == gains


def geared(name: str, inertia: str, ratio: str) -> str:
    """A double pendulum with a rotor at the shoulder, as Drake states it."""
    return robots.double_pendulum().replace(
        '</robot>',
        f"""<transmission><type>SimpleTransmission</type><joint name="shoulder"/>
<actuator name="{name}"><drake:rotor_inertia value="{inertia}"/>
<drake:gear_ratio value="{ratio}"/></actuator></transmission></robot>""",
    )


def test_a_rotor_of_drake_is_felt_by_the_square_of_its_reduction(tmp_path: Path) -> None:
    """q̈ of the double pendulum at rest, against its own mass matrix with J n² added."""
    text = imported(saved(tmp_path, 'it.urdf', geared('m', '2e-5', '-150')), scene=True)
    assert 'rotors of transmissions' not in text and 'reductions of transmissions' not in text
    rotor, m1, m2, l1, l2, g = 2e-5 * 150.0**2, 1.0, 1.0, 1.0, 0.8, 9.81
    # the lower bar is at right angles to the upper one, which is drawn along x
    M = np.array(
        [
            [m1 * l1**2 / 3 + m2 * (l1**2 + l2**2 / 3) + rotor, m2 * l2**2 / 3],
            [m2 * l2**2 / 3, m2 * l2**2 / 3],
        ]
    )
    exact = np.linalg.solve(M, [-g * (m1 * l1 / 2 + m2 * l1), 0.0])
    h = 1e-4
    simulation = simulate(text)
    simulation.step(round(h / simulation.h) or 1)
    joints, t = simulation.sample().joints, simulation.t
    found = [joints[name].velocity / t for name in ('shoulder', 'elbow')]
    assert found == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ('inertia', 'ratio', 'said'),
    [
        ('-1', '2', "actuator m: drake:rotor_inertia: negative, got '-1'; expected 0 or more"),
        ('1', 'x', "actuator m: drake:gear_ratio: not a number, got 'x'"),
        ('inf', '2', 'actuator m: drake:rotor_inertia: not a usable number'),
    ],
)
def test_a_rotor_of_drake_that_cannot_be(
    inertia: str, ratio: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        imported(saved(tmp_path, 'it.urdf', geared('m', inertia, ratio)))


@pytest.mark.parametrize(
    ('added', 'line'),
    [
        (CONTROL.replace('0.4', '0.7'), 'attributes that disagree: the first one counts: '),
        (CONTROL, ''),
        (
            CONTROL.replace('"one"', '"two"'),
            'positions of joints: the bodies start as drawn, not there: two',
        ),
        (CONTROL.replace('"one"', '"two"').replace('0.4', '0.9'), ''),
        (CONTROL.replace('"one"', '"three"'), ''),
    ],
)
def test_initial_values_that_do_not_count_are_listed(
    added: str, line: str, tmp_path: Path
) -> None:
    """Of a joint that another one moves, and one of two for a joint. They were ignored."""
    source = saved(tmp_path, 'it.urdf', finger(2.0, 0.1, CONTROL + added))
    text = imported(source, scene=True)
    assert 'one at 0.4, two at 0.9' in text
    kinds = ('positions of joints', 'attributes that disagree')
    assert any(kind in text for kind in kinds) == bool(line)
    assert f'#   {line}' in text


@pytest.mark.parametrize(
    ('attribute', 'inside', 'line'),
    [
        ('', '<param name="initial_position">0.4</param>', 'positions of joints: .*: one'),
        ('', '<param name="initial_velocity">2</param>', 'velocities of joints: .*: one'),
        (' mimic="true"', '', 'mimic: .*: one'),
        ('', '<param name="initial_position">0.0</param>', ''),
        (' mimic="false"', '', ''),
    ],
)
def test_what_ros2_control_says_of_the_start_of_a_joint_is_listed(
    attribute: str, inside: str, line: str, tmp_path: Path
) -> None:
    """As early versions and some drivers have it. It was ignored."""
    joint = f'<ros2_control><joint name="one"{attribute}>{inside}</joint></ros2_control>'
    text = imported(saved(tmp_path, 'it.urdf', finger(2.0, 0.1, joint)), scene=True)
    found = re.findall('#   ((?:positions of|velocities of|mimic).*)', text)
    assert [bool(re.fullmatch(line, each)) for each in found] == [True] * bool(line)


def test_a_revolute_joint_without_limits_is_listed(tmp_path: Path) -> None:
    turning = finger(1.0, 0.0)
    text = imported(saved(tmp_path, 'it.urdf', turning.replace('continuous', 'revolute')))
    assert '#   limits: there are none: the format asks for some' in text
    assert 'limits' not in imported(saved(tmp_path, 'it.urdf', turning))


def test_an_effort_limit_of_zero_is_none_and_listed(tmp_path: Path) -> None:
    """Converters of drawings write it where nothing is known."""
    limit = '<child link="upper"/><limit effort="0" velocity="0"/>'
    source = finger(2.0, 0.1, TRANSMISSION).replace('<child link="upper"/>', limit)
    text = imported(saved(tmp_path, 'it.urdf', source), scene=True)
    assert '#   limits of effort: one is 0: its motor has none\n' in text
    (motor,) = (e.parameters for e in scene_from_text(text).effects if e.kind == 'motor')
    assert motor.limit is None


MISTAKES = {
    'number': (('>0.4<', '>much<'), "one: not usable numbers, got 'much'"),
    'circle': (
        ('name="one" type="continuous">', 'name="one" type="continuous"><mimic joint="two"/>'),
        'it mimics itself',
    ),
    'itself': (
        ('name="one" type="continuous">', 'name="one" type="continuous"><mimic joint="one"/>'),
        'one: it mimics itself',
    ),
}


def test_a_joint_that_mimics_nobody(tmp_path: Path) -> None:
    source = finger(2.0, 0.1).replace('mimic joint="one"', 'mimic joint="thumb"')
    text = imported(saved(tmp_path, 'it.urdf', source))
    assert "#   mimic: these joints are free: two, for there is no 'thumb'\n" in text


@pytest.mark.parametrize(('change', 'message'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    source = finger(2.0, 0.1, CONTROL)
    assert change[0] in source
    with pytest.raises(InputError, match=message):
        imported(saved(tmp_path, 'it.urdf', source.replace(*change)))


PLANE = """<robot name="r"><link name="base"/><link name="b"><inertial><origin xyz="0 0 -0.2"/>
<mass value="2"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial>
</link><joint name="j" type="planar"><parent link="base"/><child link="b"/>
<origin rpy="0.5 0 0"/><axis xyz="2 0 0"/><dynamics damping="3 8 0.4"/></joint></robot>"""


def test_the_three_dampings_of_a_planar_joint(tmp_path: Path) -> None:
    """Drake has them along the plane's x and y, which are -z and y for the axis x, and about it.
    The centre of mass is 0.2 m beside the axis, in the plane's x."""
    text = imported(saved(tmp_path, 'it.urdf', PLANE), scene=True)
    assert 'Changes of the motion' not in text
    simulation = simulate(text)
    pull = 9.81 * np.array([math.cos(0.5), -math.sin(0.5)])

    def rate(_: float, y: Floats) -> Floats:
        along, across = 2.0 * 0.2 * math.cos(y[2]), 2.0 * 0.2 * math.sin(y[2])
        masses = [(2.0, 0.0, -across), (0.0, 2.0, along), (-across, along, 0.05 + 2.0 * 0.2**2)]
        forces = np.array([2.0 * pull[0], 2.0 * pull[1], along * pull[1] - across * pull[0]])
        forces += y[5] ** 2 * np.array([along, across, 0.0]) - np.array([3.0, 8.0, 0.4]) * y[3:]
        return np.concatenate([y[3:], np.linalg.solve(masses, forces)])

    found = solve_ivp(rate, (0.0, 0.3), np.zeros(6), 'DOP853', rtol=1e-12, atol=1e-13)
    simulation.step(300)
    joints = simulation.sample().joints
    ours = [joints[f'j_{axis}'].position for axis in 'XYZ']
    assert ours == pytest.approx(found.y[:3, -1], abs=1e-9)


def test_what_a_planar_joint_with_dampings_lacks(tmp_path: Path) -> None:
    """No damping at all; friction, which is listed; an axis against z; and mistakes."""
    text = imported(saved(tmp_path, 'it.urdf', PLANE.replace('3 8 0.4', '0 0 0')), scene=True)
    assert 'Changes of the motion' not in text and 'joint_friction' not in text
    for old, new in (('"3 8', '"3 8 0.4" friction="1'), ('<dyn', '<limit effort="0"/><dyn')):
        text = PLANE.replace(' 0.4"', '"') if 'friction' in new else PLANE
        text = imported(saved(tmp_path, 'it.urdf', text.replace(old, new)), scene=True)
        assert 'springs, armature: these joints have none: j' in text
    text = imported(saved(tmp_path, 'it.urdf', PLANE.replace('2 0 0', '0 0 -2')), scene=True)
    assert 'Changes of the motion' not in text
    one, spaced = (PLANE.replace('3 8 0.4', each) for each in ('0.4', ' 0.4 '))
    texts = [imported(saved(tmp_path, 'it.urdf', each), scene=True) for each in (one, spaced)]
    assert texts[0] == texts[1] and 'j_X' not in texts[0]
    for old, new, message in (
        ('3 8 0.4', '3 8', ":4: joint j: dynamics damping: the wrong number of values, got '3 8'"),
        ('3 8 0.4', '3 x 8', ':4: joint j: dynamics damping: not numbers'),
        ('3 8 0.4', '3 -8 1', ':3: j_Y'),
        ('2 0 0', '0 0 0', ':3: j_X: zero is no direction'),
        ('planar', 'revolute', ':4: joint j: dynamics damping: the wrong number of values'),
    ):
        with pytest.raises(InputError) as caught:
            imported(saved(tmp_path, 'it.urdf', PLANE.replace(old, new)), scene=True)
        assert message in str(caught.value)


@pytest.mark.parametrize('scene', [True, False])
def test_dry_friction_is_listed(scene: bool, tmp_path: Path) -> None:
    """It fades at low speed: a bar that 0.9 of it holds creeps at 0.02 rad/s."""
    held, bar = '<dynamics friction="2.18"/>', '<robot name="r"><link name="base"/><link name="b">'
    bar += '<inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1"'
    bar += ' ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">'
    bar += f'<parent link="base"/><child link="b"/><axis xyz="0 1 0"/>{held}</joint></robot>'
    text = imported(saved(tmp_path, 'it.urdf', bar), scene=scene)
    listed = (
        'law of dry friction: it fades below 0.01 rad/s or m/s: what it holds creeps slowly: j'
    )
    assert (listed in text) == scene
    if scene:
        simulation = Simulation(scene_from_text(text))
        simulation.step(500)
        part = 9.81 * 0.2 / 2.18
        creep = 0.01 * part / math.sqrt(1.0 - part**2)
        assert simulation.sample().joints['j'].velocity == pytest.approx(creep, rel=0.01)
