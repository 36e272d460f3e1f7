"""Parts of URDF and SDF that change the motion and are not imported: each is named as such."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.commands.import_ import main
from alf_ros.errors import InputError

INERTIA = '<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/>'
LINK = f'<inertial><origin xyz="0.2 0 0"/><mass value="1"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="3" velocity="2"/>'
URDF = f"""
<robot name="r"><link name="base"/><link name="arm">{LINK}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>{LIMIT}
</joint>MORE</robot>"""
BODY = '<inertial><mass>1</mass><pose>0.2 0 0 0 0 0</pose></inertial>'
SDF = f"""
<sdf version="1.11"><model name="m"><link name="base">{BODY}</link><link name="arm">{BODY}</link>
<joint name="held" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="j" type="TYPE"><parent>base</parent><child>arm</child>AXES</joint>MORE
</model></sdf>"""
AXES = '<axis><xyz>1 0 0</xyz>FIRST</axis><axis2><xyz>0 1 0</xyz>SECOND</axis2>'
TWO = '<limit><lower>-0.1</lower><upper>0.1</upper></limit>'


def sdf(kind: str, axes: str, more: str = '') -> str:
    return SDF.replace('TYPE', kind).replace('AXES', axes).replace('MORE', more)


def universal(first: str = '', second: str = '') -> str:
    return sdf('universal', AXES.replace('FIRST', first).replace('SECOND', second))


def hinge(axis: str = '', joint: str = '', limit: str = TWO) -> str:
    """With more in the axis, and in the joint; a limit of the axis."""
    return sdf('revolute', f'<axis><xyz>0 1 0</xyz>{limit}{axis}</axis>{joint}')


def of_arm(more: str) -> str:
    """With more in the second link."""
    return hinge().replace('<link name="arm">', f'<link name="arm">{more}')


def controlled(more: str) -> str:
    return f'<ros2_control><joint name="j">{more}</joint></ros2_control>'


def ode(more: str) -> str:
    return f'<physics><ode>{more}</ode></physics>'


def report(tmp_path: Path, name: str, text: str) -> tuple[list[str], Path]:
    """The lines about the motion, and the file that is written."""
    (tmp_path / name).write_text(text, encoding='utf-8')
    made = tmp_path / 'made.yaml'
    assert main([str(tmp_path / name), '--scene', '-o', str(made)]) == 0
    head = made.read_text('utf-8').partition('Changes of readings')[0].splitlines()
    return [line.strip('# ') for line in head if line.startswith('#   ')], made


JOINTS = 'limits, damping, friction, springs, armature: these joints have none: j'
ROTORS = (
    'rotors of transmissions: the inertia of rotors is not counted: give it as `armature` of the '
    'motor, times the square of the reduction'
)
CONSTANTS = 'constants of motors: a command is the effort of the joint, not a current'
GAZEBO = '<gazebo reference="arm"><static>true</static><mu1>0.1</mu1></gazebo>'
SPRING = '<gazebo reference="on"><springStiffness>5</springStiffness></gazebo>'
MIMIC = '<ros2_control><joint name="j"><param name="mimic">k</param></joint></ros2_control>'
ROTOR = (
    '<transmission name="t"><joint name="j"/><actuator name="a"><motorInertia>1</motorInertia>'
    '</actuator></transmission>'
)

PLANE = (
    f'<link name="plate">{LINK}</link><joint name="k" type="planar"><parent link="base"/>'
    '<child link="plate"/><axis xyz="0 0 1"/></joint>'
)
UNKNOWN = (
    'unknown elements: the format has no such element there, or only one: what they do to '
    'the motion is missing'
)
NO_ATTRIBUTE = (
    'unknown attributes: the format has no such attribute there: what it does to the motion is '
    'missing'
)
NO_TEXT = 'unknown text: the format has no text there: what it does to the motion is missing'
EXTENSIONS = 'physics of Gazebo: what these extensions do to the motion is missing'
REDUCED = (
    'reductions of transmissions: a command is the effort of the joint, not that of a motor '
    'before the reduction'
)


def geared(reduction: str) -> str:
    return f'<transmission name="t"><joint name="j"/>{reduction}</transmission>'


SOFT = 'soft limits: they do not give way as in the file: with --stops they have its stiffness: j'
STIFF = TWO.replace('</limit>', '<stiffness>1e4</stiffness></limit>')
LOSSY = TWO.replace('</limit>', '<dissipation>2</dissipation></limit>')
SCREW = '<axis><xyz>0 1 0</xyz>{}</axis>{}'


@pytest.mark.parametrize(
    'text, told',
    [
        (of_arm('<velocity_decay><linear>0.1</linear></velocity_decay>'),
         'damping of bodies: these bodies are not damped: arm'),
        (of_arm('<velocity_decay><angular>0.1</angular></velocity_decay>'),
         'damping of bodies: these bodies are not damped: arm'),
        (of_arm('<enable_wind>1</enable_wind>'),
         'wind: it exerts no force on these bodies: arm'),
        (of_arm('<enable_wind>0</enable_wind>').replace(
            '<model name="m">', '<model name="m"><enable_wind>true</enable_wind>'),
         'wind: it exerts no force on these bodies: base'),
        (hinge('<initial_position>0.05</initial_position>'),
         'positions of joints: the bodies start as drawn, not there: j'),
        (hinge(limit=STIFF), SOFT),
        (hinge(limit=LOSSY), SOFT),
        (hinge(joint=ode('<limit><cfm>0.1</cfm><erp>0.2</erp></limit>')), SOFT),
        (hinge(joint=ode('<limit><erp>0.8</erp></limit>')), SOFT),
        (hinge(joint=ode('<bounce>0.5</bounce>')), SOFT),
        (hinge(joint=ode('<cfm>0.01</cfm>')), 'softness: constraints hold exactly: j'),
        (hinge(joint=ode('<suspension><cfm>0.01</cfm></suspension>')),
         'softness: constraints hold exactly: j'),
        (hinge(joint=ode('<max_force>3</max_force>')), 'actuators: they apply no force: j (max'),
        (sdf('screw', SCREW.format(TWO, '<screw_thread_pitch>1</screw_thread_pitch>')),
         'limits of screws: of angles or of lengths'),
        (hinge('<dynamic><damping>1</damping></dynamic>'),
         f'{UNKNOWN}: dynamic of j'),
        (hinge('<dynamics><drake:spring>1</drake:spring></dynamics>'),
         f'{UNKNOWN}: spring of j'),
        (hinge('<xyz>1 0 0</xyz>'), f'{UNKNOWN}: xyz of j'),
        (hinge(joint='<drake:rotor_inertia>1</drake:rotor_inertia>'),
         f'{UNKNOWN}: rotor_inertia of j'),
        (of_arm('<mass>2</mass>'), f'{UNKNOWN}: mass of arm'),
        (sdf('ball', '', '<drake:linear_bushing_rpy/>'),
         f'{UNKNOWN}: linear_bushing_rpy of m'),
        (hinge('', '', '<dynamics>0.3</dynamics>'), f"{NO_TEXT}: dynamics '0.3' of j"),
        (sdf('revolute', '<axis>0 1 0</axis>'), f"{NO_TEXT}: axis '0 1 0' of j"),
        (hinge('<dynamics><damping value="1"/></dynamics>'),
         f'{NO_ATTRIBUTE}: damping value of j'),
        (hinge('<dynamics><damping><x>1</x></damping></dynamics>'), f'{UNKNOWN}: x of j'),
        (hinge().replace('<xyz>', '<xyz expresed_in="base">'),
         f'{NO_ATTRIBUTE}: xyz expresed_in of j'),
        (of_arm('<pose relative="base">0 0 0 0 0 0</pose>'),
         f'{NO_ATTRIBUTE}: pose relative of arm'),
        (hinge().replace('<pose>', '<pose relative_to="base">'),
         f'{NO_ATTRIBUTE}: pose relative_to in inertial of base'),
        (sdf('ball', '', '<frame name="f" attached="arm"/>'),
         f'{NO_ATTRIBUTE}: frame attached of m'),
        (hinge().replace('<model', '<modle/><model', 1), f'{UNKNOWN}: modle of the file'),
        (of_arm('').replace('<mass>1</mass>', '<mass/>'), 'mass: default of SDF'),
        (sdf('screw', SCREW.format('', '')), 'pitch of screws: default of SDF'),
        (sdf('ball', '', '<model_state name="m"/>'), 'state of the world: models start'),
    ],
)  # fmt: skip
def test_each_of_an_sdf_is_named(tmp_path: Path, text: str, told: str) -> None:
    lines, made = report(tmp_path, 'a.sdf', text)
    assert any(line.startswith(told) for line in lines), lines
    Simulation(load_scene(made)).step()


def test_what_an_sdf_says_as_it_is_by_default_is_not_listed(tmp_path: Path) -> None:
    usual = TWO.replace(
        '</limit>', '<stiffness>1e8</stiffness><dissipation>1</dissipation></limit>'
    )
    plain = ode(
        '<limit><cfm>0</cfm><erp>0.2</erp></limit><max_force>0</max_force><erp>0.5</erp>'
        '<suspension><cfm>0</cfm><erp>0.2</erp></suspension>'
    )
    text = hinge('<initial_position>0</initial_position>', plain, usual).replace(
        '<link name="arm">',
        '<link name="arm"><kinematic>0</kinematic><enable_wind>0</enable_wind>'
        '<velocity_decay><linear>0</linear><angular>0</angular></velocity_decay>',
    )
    assert report(tmp_path, 'a.sdf', text)[0] == report(tmp_path, 'a.sdf', hinge())[0]


def test_steps_and_limits_of_velocity_change_readings_only(tmp_path: Path) -> None:
    fast = TWO.replace('</limit>', '<velocity>2</velocity></limit>')
    scheme = ode('<implicit_spring_damper>1</implicit_spring_damper>')
    expected, _ = report(tmp_path, 'b.sdf', hinge())
    lines, made = report(tmp_path, 'a.sdf', hinge('', scheme, fast))
    assert lines == expected
    told = made.read_text('utf-8')
    assert 'elements: implicit_spring_damper of j' in told
    assert 'limits of velocity: j' in told


def test_what_an_include_adds_to_a_model_is_named(tmp_path: Path) -> None:
    (tmp_path / 'arm').mkdir()
    (tmp_path / 'arm' / 'model.sdf').write_text(sdf('ball', ''), encoding='utf-8')
    text = """<sdf version="1.9" xmlns:experimental="x"><world name="w"><include>
    <uri>model://arm</uri><plugin name="p" filename="f"/><experimental:params/>
    <poes>1 0 0 0 0 0</poes></include></world></sdf>"""
    lines, _ = report(tmp_path, 'a.sdf', text)
    assert 'plugins: forces and control that they apply are missing: p' in lines
    assert 'parameters of includes: the models are as in their own files: m' in lines
    assert f'{UNKNOWN}: poes of w' in lines


@pytest.mark.parametrize(
    'name, text, told',
    [
        ('a.urdf', URDF.replace('MORE', GAZEBO), 'physics of Gazebo'),
        ('a.urdf', URDF.replace('MORE', SPRING), 'physics of Gazebo'),
        ('a.urdf', URDF.replace('MORE', '<gazebo><plugin name="p"/></gazebo>'), 'plugins'),
        ('a.urdf', URDF.replace('MORE', '<gazebo><model name="more"/></gazebo>'),
         f'{EXTENSIONS}: model of the robot'),
        ('a.urdf', URDF.replace('MORE', '<gazebo reference="arm"><joint name="k"/></gazebo>'),
         f'{EXTENSIONS}: joint of arm'),
        ('a.urdf', URDF.replace('MORE', '<gazebo reference="j"><stopErp>0.8</stopErp></gazebo>'),
         f'{EXTENSIONS}: stopErp of j'),
        ('a.urdf', URDF.replace('MORE', '').replace('<mass', '<mass value="2"/><mass'),
         f'{UNKNOWN}: mass of arm'),
        ('a.urdf', URDF.replace('MORE', '').replace('"0.2 0 0"', '"0.2 0 0" quat_xyzw="1 0 0 0"'),
         f'{NO_ATTRIBUTE}: origin quat_xyzw of arm'),
        ('a.urdf', URDF.replace('MORE', '').replace('effort="3"', 'effort="3" efort="4"'),
         f'{NO_ATTRIBUTE}: limit efort of j'),
        ('a.urdf', URDF.replace('MORE', MIMIC), 'mimic: these joints are free: j'),
        ('a.urdf', URDF.replace('MORE', ROTOR), f'{ROTORS}: j'),
        ('a.urdf', URDF.replace('MORE', ROTOR.replace('motorInertia', 'motorTorqueConstant')),
         f'{CONSTANTS}: j'),
        ('a.urdf', URDF.replace('MORE', controlled('<param name="rotor_inertia">1</param>')),
         f'{ROTORS}: j'),
        ('a.urdf', URDF.replace('MORE', controlled('<command_interface name="effort">'
         '<param name="max">1</param></command_interface>')),
         'limits of commands: commands beyond them act too: j (effort)'),
        ('a.urdf', URDF.replace('MORE', controlled('<command_interface name="position">'
         '<param name="min">-0.5</param></command_interface>')),
         'limits of commands: commands beyond them act too: j (position)'),
        ('a.urdf', URDF.replace('MORE', controlled('<command_interface name="velocity">'
         '<param name="max">2</param></command_interface><command_interface name="effort">'
         '<param name="min">-2</param><param name="max">2</param></command_interface>')),
         'limits of commands: commands beyond them act too: j (velocity), j (effort)'),
        ('a.urdf', URDF.replace('MORE', '').replace('"revolute"', '"planar"').replace(
            LIMIT, '<mimic joint="k"/>'), 'mimic: these joints are free: j'),
        ('a.urdf', URDF.replace(LIMIT, LIMIT + '<mimic joint="k"/>').replace('MORE', PLANE),
         "mimic: these joints are free: j, for 'k' has several coordinates"),
        ('a.urdf', URDF.replace('MORE', ROTOR.replace('motorInertia', 'drake:rotor_inertia')),
         f'{ROTORS}: j'),
        ('a.urdf', URDF.replace('MORE', geared('<actuator name="a"><mechanicalReduction>50'
         '</mechanicalReduction></actuator>')), f'{REDUCED}: j by 50'),
        ('a.urdf', URDF.replace('MORE', geared('<mechanicalReduction>-3.5</mechanicalReduction>')),
         f'{REDUCED}: j by -3.5'),
        ('a.urdf', URDF.replace('MORE', geared('<actuator name="a"><drake:gear_ratio value="9"/>'
         '</actuator>')), f'{REDUCED}: j by 9'),
        ('a.urdf', URDF.replace('MORE', '<ros2_control>' + geared('<actuator name="a">'
         '<mechanical_reduction>2.0</mechanical_reduction></actuator>') + '</ros2_control>'),
         f'{REDUCED}: j by 2.0'),
        ('a.urdf', URDF.replace('MORE', '<link name="alone"/>'), 'several root links'),
        ('a.urdf', URDF.replace('MORE', '').replace('"revolute"', '"floating"').replace(
            LIMIT, '<dynamics damping="1"/>'), JOINTS),
        ('a.urdf', URDF.replace('MORE', '').replace('"revolute"', '"planar"').replace(
            LIMIT, '<dynamics damping="1"/>'), JOINTS),
        ('a.urdf', URDF.replace('MORE', '<loop_joint name="l" type="revolute"/>'),
         f'{UNKNOWN}: loop_joint l'),
        ('a.urdf', URDF.replace('MORE', '<drake:linear_bushing_rpy/>'),
         f'{UNKNOWN}: linear_bushing_rpy'),
        ('a.urdf', URDF.replace('MORE', '').replace(LIMIT, LIMIT + '<dynamic damping="1"/>'),
         f'{UNKNOWN}: dynamic of j'),
        ('a.urdf', URDF.replace('MORE', '').replace(LIMIT, 2 * '<dynamics damping="1"/>'),
         f'{UNKNOWN}: dynamics of j'),
        ('a.urdf', URDF.replace('MORE', '').replace('<origin xyz="0.2 0 0"/>',
         '<origin>0.2 0 0</origin>'), f"{NO_TEXT}: origin '0.2 0 0' of arm"),
        ('a.urdf', URDF.replace('MORE', '').replace(LIMIT, LIMIT + '<dynamics><damping>1</damping>'
         '</dynamics>'), f'{UNKNOWN}: damping of j'),
        ('a.urdf', URDF.replace('MORE', '').replace(LINK, 2 * LINK),
         f'{UNKNOWN}: inertial of arm'),
        ('a.sdf', sdf('ball', f'<axis>{TWO}</axis>'), JOINTS),
        ('a.sdf', sdf('ball', '<axis><dynamics><damping>1</damping></dynamics></axis>'), JOINTS),
        ('a.sdf', universal('', '<mimic joint="j" axis="z"><multiplier>1</multiplier></mimic>'),
         'mimic: these joints are free: j'),
        ('a.sdf', sdf('ball', '', '<plugin name="p" filename="f"/>'), 'plugins'),
        ('a.sdf', sdf('ball', '').replace('<inertial>', '<inertial auto="true">'),
         'inertia by shapes'),
        ('a.sdf', sdf('ball', '').replace('</inertial>', '<fluid_added_mass/></inertial>'),
         'added mass of fluids'),
    ],
)  # fmt: skip
def test_each_is_named(tmp_path: Path, name: str, text: str, told: str) -> None:
    lines, made = report(tmp_path, name, text)
    assert any(line.startswith(told) for line in lines), lines
    if 'floating' not in text:
        Simulation(load_scene(made)).step()


CABLE = """<mujoco><extension><plugin plugin="mujoco.elasticity.cable"/></extension><worldbody>
<composite prefix="c_" type="cable" curve="s" count="4 1 1" size="0.5" initial="none">
<plugin plugin="mujoco.elasticity.cable"><config key="bend" value="4e6"/></plugin>
<joint kind="main"/><geom type="capsule" size="0.005"/></composite></worldbody></mujoco>"""
BALLS = """<mujoco>{}<worldbody>
<body name="a" sleep="init"><joint name="j" type="slide"/><geom name="a" size="0.1" {}/></body>
<body name="b" pos="0 0 1"><joint type="slide"/><geom name="b" size="0.1" {}/></body>
</worldbody>{}</mujoco>"""
PID = """<actuator><plugin name="act" plugin="mujoco.pid" joint="j" actdim="1">
<config key="kp" value="4"/><config key="ki" value="1"/></plugin></actuator>"""
PAIR, MASKED = (
    '<contact><pair geom1="a" geom2="b"/></contact>',
    ('contype="0" conaffinity="0"',) * 2,
)


@pytest.mark.parametrize(
    'text, told',
    [
        (CABLE, 'plugins: forces and control that they apply are missing: c_B_first, c_B_1'),
        (BALLS.format('<extension><plugin plugin="mujoco.pid"/></extension>', *MASKED, PID),
         'actuators: they apply no force: act'),
        (BALLS.format('', *MASKED, PAIR),
         'contact between bodies: they pass through each other (2)'),
        (BALLS.format('<option><flag sleep="enable"/></option>', *MASKED, ''),
         'sleeping bodies: they move from the start, not when something touches them: a'),
        (BALLS.format('', *MASKED, ''), None),
    ],
    ids=['plugin', 'actuator by a plugin', 'pair', 'asleep', 'nothing'],
)  # fmt: skip
def test_each_of_an_mjcf_is_named(tmp_path: Path, text: str, told: str | None) -> None:
    mujoco = pytest.importorskip('mujoco')
    if text is CABLE and int(mujoco.__version__.partition('.')[0]) >= 4:
        with pytest.raises(InputError, match='composite'):  # which MuJoCo 4 has no more
            report(tmp_path, 'a.xml', text)
        return
    lines, _ = report(tmp_path, 'a.xml', text)
    assert lines == [] if told is None else any(line.startswith(told) for line in lines), lines


def test_a_joint_of_an_sdf_that_mimics_itself(tmp_path: Path) -> None:
    axis = '<axis><xyz>1 0 0</xyz><mimic joint="j"><multiplier>2</multiplier></mimic></axis>'
    with pytest.raises(InputError, match='j: it mimics itself'):
        report(tmp_path, 'a.sdf', sdf('revolute', axis))


def test_joints_of_an_sdf_that_mimic_each_other(tmp_path: Path) -> None:
    """Both couplings together would lock them."""
    axis = '<axis><xyz>1 0 0</xyz><mimic joint="{}"><multiplier>2</multiplier></mimic></axis>'
    ends = f'<parent>arm</parent><child>hand</child>{axis.format("j")}'
    more = f'<link name="hand">{BODY}</link><joint name="k" type="revolute">{ends}</joint>'
    with pytest.raises(InputError, match='k: it mimics itself'):
        report(tmp_path, 'a.sdf', sdf('revolute', axis.format('k'), more))


def test_a_link_of_a_urdf_with_inertia_alone(tmp_path: Path) -> None:
    """Its inertia is added to the link that it is fixed to."""
    more = f"""<link name="disk"><inertial><mass value="0"/>{INERTIA}</inertial></link>
    <joint name="on" type="fixed"><parent link="arm"/><child link="disk"/></joint>"""
    _, made = report(tmp_path, 'a.urdf', URDF.replace('MORE', more))
    (body,) = load_scene(made).mechanism.bodies
    np.testing.assert_allclose(np.diag(body.inertia), [0.02, 0.04, 0.06])
    assert body.mass == 1.0


@pytest.mark.parametrize(
    'harmless',
    [
        '<turnGravityOff>false</turnGravityOff>', '<gravity>true</gravity>', '<static>0</static>',
        '<material>Gazebo/Red</material>', '<kp>1e6</kp>', '<kinematic>false</kinematic>',
    ],
)  # fmt: skip
def test_extensions_of_gazebo_without_an_effect_are_no_change_of_the_motion(
    harmless: str, tmp_path: Path
) -> None:
    gazebo = f'<gazebo reference="arm">{harmless}</gazebo>'
    lines, _ = report(tmp_path, 'a.urdf', URDF.replace('MORE', gazebo))
    assert lines == report(tmp_path, 'a.urdf', URDF.replace('MORE', ''))[0]


def test_elements_for_sensing_change_no_motion(tmp_path: Path) -> None:
    more = '<!-- a comment --><sensor name="s"/><material name="grey"/>'
    expected, _ = report(tmp_path, 'a.urdf', URDF.replace('MORE', ''))
    lines, made = report(tmp_path, 'a.urdf', URDF.replace('MORE', more))
    assert lines == expected and '#   elements: sensor s\n' in made.read_text('utf-8')


def test_places_of_meshes_for_mujoco_change_no_motion(tmp_path: Path) -> None:
    expected, _ = report(tmp_path, 'a.urdf', URDF.replace('MORE', ''))
    for more, listed in (
        ('<compiler meshdir="meshes" discardvisual="false"/>', []),
        ('<compiler meshdir="meshes" balanceinertia="true"/>', [f'{UNKNOWN}: mujoco']),
        ('<option gravity="0 0 0"/>', [f'{UNKNOWN}: mujoco']),
    ):
        lines, _ = report(tmp_path, 'a.urdf', URDF.replace('MORE', f'<mujoco>{more}</mujoco>'))
        assert sorted(lines) == sorted([*expected, *listed])


def test_a_transmission_that_reduces_nothing_is_not_listed(tmp_path: Path) -> None:
    plain = geared('<actuator name="a"><mechanicalReduction>1.0</mechanicalReduction></actuator>')
    lines, _ = report(tmp_path, 'a.urdf', URDF.replace('MORE', plain))
    assert not any('reductions' in line for line in lines)
