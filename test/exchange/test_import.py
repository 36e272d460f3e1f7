"""Import of URDF and MJCF: the mechanism moves like the original, and omissions are listed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.commands.import_ import main
from alf_ros.errors import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import angles, check_four_bar, saved, simulate

# -------------------------------------------------------------------------------------------- URDF


def test_double_pendulum_like_ours(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.urdf', robots.double_pendulum()), scene=True)
    start = {'mechanism': 'double_pendulum', 'effects': {'gravity': {'acceleration': [0, -9.81]}}}
    ours = Simulation(load_scene(start), integrator='dop853', step=1e-3)
    names = ('shoulder', 'elbow')
    expected = angles(ours, names)
    assert np.abs(expected).max() > 1.0
    assert angles(simulate(text), names) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('idiom', ['gazebo', 'constraint', 'file'])
def test_four_bar_like_ours(idiom: str, tmp_path: Path) -> None:
    inside = {'gazebo': [robots.BY_GAZEBO], 'constraint': [robots.BY_CONSTRAINT], 'file': []}
    source = saved(tmp_path, 'it.urdf', robots.four_bar(*inside[idiom]))
    side = saved(tmp_path, 'loops.yaml', robots.BY_FILE) if idiom == 'file' else None
    check_four_bar(imported(source, loops=side, scene=True))


def test_turned_frames_and_any_inertia(tmp_path: Path) -> None:
    """One body, its inertia told in a turned frame about a far centre of mass, and lumped."""
    J = (0.3, 0.4, 0.5, 0.02, -0.03, 0.05)
    whole = robots.robot(
        '<link name="world"/>',
        robots.link('a', (0.2, 0.1, -0.3), 2.0, J),
        '<joint name="j" type="revolute"><parent link="world"/><child link="a"/>'
        '<origin xyz="0 0 1" rpy="0.3 -0.4 0.7"/><axis xyz="0.1 1 0.2"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>',
    )
    split = whole.replace(
        '</robot>',
        '<link name="b"><inertial><origin xyz="0 0 0"/><mass value="0.5"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="f" type="fixed"><parent link="a"/><child link="b"/>'
        '<origin xyz="0.5 -0.1 0.2" rpy="1 2 3"/></joint></robot>',
    )
    text = imported(saved(tmp_path, 'it.urdf', split), scene=True)
    # a physical pendulum about the axis: I θ̈ = torque of gravity, with I by hand
    u = np.array([0.1, 1.0, 0.2]) / np.linalg.norm([0.1, 1.0, 0.2])
    com, far = np.array([0.2, 0.1, -0.3]), np.array([0.5, -0.1, 0.2])
    tensor = np.array([[0.3, 0.02, -0.03], [0.02, 0.4, 0.05], [-0.03, 0.05, 0.5]])
    inertia = u @ tensor @ u + 2.0 * np.sum(np.cross(u, com) ** 2)
    inertia += 0.1 + 0.5 * np.sum(np.cross(u, far) ** 2)
    cx, sx, cy, sy, cz, sz = (f(a) for a in (0.3, -0.4, 0.7) for f in (math.cos, math.sin))
    R = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    R = R @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    R = R @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    torque = R @ u @ np.cross(R @ (2.0 * com + 0.5 * far), [0, 0, -9.81])
    simulation = simulate(text)
    simulation.step(1)
    speed = simulation.sample().joints['j'].velocity
    assert speed == pytest.approx(torque / inertia * 1e-3, rel=1e-4)


def test_stops_damping_and_drawn_positions(tmp_path: Path) -> None:
    source = robots.double_pendulum().replace(
        'name="shoulder" type="continuous">',
        'name="shoulder" type="revolute"><dynamics damping="0.5" friction="0.1"/>'
        '<limit lower="-1" upper="2" effort="9" velocity="3"/>',
    )
    path = saved(tmp_path, 'it.urdf', source)
    text = imported(path, stops=1e4, positions={'shoulder': 0.5})
    effects = {e.kind: e.parameters for e in scene_from_text(text).effects}
    assert effects['joint_stop'].lower == -1.5 and effects['joint_stop'].upper == 1.5
    assert effects['joint_friction'].viscous == 0.5 and effects['joint_friction'].load == 0.1
    drawn = {p.name: p.at for p in scene_from_text(text).mechanism.points}
    assert drawn['elbow_at'] == pytest.approx((math.cos(0.5), 0.0, math.sin(0.5)), abs=1e-15)
    for line in (
        'limits of velocity: shoulder',
        'limits of effort: shoulder',
        'zero of joints: here it is as drawn: shoulder at 0.5',
    ):
        assert f'#   {line}\n' in text
    bare = imported(path)
    assert 'effects' not in bare
    assert '#   limits (see --stops): joints pass their limits: shoulder\n' in bare
    assert '#   dry friction (see --scene): joints have no friction: shoulder\n' in bare
    assert '#   damping (see --scene): joints are not damped: shoulder\n' in bare
    assert '#   gravity (see --scene): gravity is absent: 0 0 -9.81\n' in bare


def test_a_spring_of_gazebo_oscillates(tmp_path: Path) -> None:
    """About the vertical, so that there is no torque of gravity: a cosine."""
    k, rest, drawn, inertia = 5.0, 0.8, 0.3, 0.5 + 2.0 * 0.2**2
    spring = f'<springStiffness>{k}</springStiffness><springReference>{rest}</springReference>'
    source = robots.robot(
        '<link name="world"/>',
        robots.link('a', (0.2, 0.0, 0.0), 2.0, (0.3, 0.4, 0.5, 0.0, 0.0, 0.0)),
        '<joint name="j" type="continuous"><parent link="world"/><child link="a"/>'
        '<axis xyz="0 0 1"/></joint>',
        f'<gazebo reference="j">{spring}</gazebo>',
    )
    text = imported(saved(tmp_path, 'it.urdf', source), scene=True, positions={'j': drawn})
    assert 'physics of Gazebo' not in text
    simulation = simulate(text)
    simulation.step(800)
    expected = rest + (drawn - rest) * math.cos(math.sqrt(k / inertia) * 0.8)
    found = drawn + simulation.sample().joints['j'].position
    assert found == pytest.approx(expected, abs=1e-10)


def test_everything_else_is_listed(tmp_path: Path) -> None:
    extra = """<transmission name="drive"><type>t</type><joint name="elbow"/></transmission>
<gazebo reference="upper"><mu1>0.2</mu1></gazebo><gazebo><plugin name="p"/></gazebo>
<ros2_control name="hardware" type="system"/></robot>"""
    source = robots.double_pendulum().replace('</robot>', extra).replace('upper', 'upper-arm')
    source = source.replace(
        '<axis xyz="0 -1 0"/></joint>', '<axis xyz="0 -1 0"/><mimic joint="x"/></joint>', 1
    )
    text = imported(saved(tmp_path, 'it.urdf', source))
    for line in (
        'gazebo: mu1 of upper-arm',
        'plugins: forces and control that they apply are missing: p',
        "mimic: these joints are free: shoulder, for there is no 'x'",
        'actuators (see --scene): they apply no force: elbow_motor',
        'names, changed: upper-arm is upper_arm',
    ):
        assert f'#   {line}\n' in text


def test_floating_root(tmp_path: Path) -> None:
    """Free fall, spinning about a principal axis."""
    source = saved(
        tmp_path, 'it.urdf', robots.robot(robots.link('a', (0.1, 0, 0), 2.0, (1, 1, 1, 0, 0, 0)))
    )
    simulation = simulate(imported(source, scene=True, floating=True))
    simulation.step(1000)
    (place,) = simulation.sample().points.values()
    assert place == pytest.approx([0, 0, -0.5 * 9.81], abs=1e-9)
    with pytest.raises(InputError, match='no part of it can move'):
        imported(source)


MISTAKES = {
    'no XML': (('<robot name', '<robot <'), 'not XML: '),
    'type': (('"continuous"', '"contnuous"'), 'Invalid joint type: contnuous in /robot'),
    'number': (
        ('mass value="1.0"', 'mass value="one"'),
        r'it.urdf:\d: link upper: mass value: not a number, got',
    ),
    'no mass': (('mass value="1.0"', 'mass'), 'link upper: mass: it has no value'),
    'nan': (
        ('xyz="1.0 0 0"', 'xyz="nan 0 0"'),
        "elbow: origin xyz: not usable numbers, got 'nan 0 0'",
    ),
    'huge': (('mass value="1.0"', 'mass value="1e300"'), 'mass value: not a usable number'),
    'a number more': (
        ('<axis xyz="0 -1 0"', '<axis xyz="0 -1 0 0"'),
        'shoulder: axis xyz: the wrong number of values.*expected 3 numbers',
    ),
    'link': (('parent link="upper"', 'parent link="uper"'), "elbow: no such link.*mean 'upper'"),
    'two parents': (('child link="lower"', 'child link="upper"'), 'child of shoulder already'),
    'hangs from itself': (('parent link="world"', 'parent link="lower"'), 'own ancestor'),
    'two joints': (('name="elbow"', 'name="shoulder"'), 'a name of two joints'),
    'inertia': (('izz="0.08', 'izz="9.08'), 'no body has such an inertia'),
    'axis': (('axis xyz="0 -1 0"', 'axis xyz="0 0 0"'), 'zero is no direction'),
}


@pytest.mark.parametrize(('change', 'message'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_of_a_urdf(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    source = robots.double_pendulum()
    assert change[0] in source
    path = saved(tmp_path, 'it.urdf', source.replace(*change, 1))
    with pytest.raises(InputError, match=message) as caught:
        imported(path)
    assert path in str(caught.value) and '\n' not in str(caught.value)


def test_what_is_no_urdf(tmp_path: Path) -> None:
    source = robots.double_pendulum()
    path = saved(tmp_path, 'it.urdf', source.replace('robot', 'machine'))
    with pytest.raises(InputError, match="not a URDF, got 'machine'; expected <robot>"):
        imported(path)
    named = source.replace('<robot', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')
    assert imported(saved(tmp_path, 'it.urdf', named))  # the name alone does no harm


@pytest.mark.parametrize(
    ('loops', 'message'),
    [
        ('loop: {}', "unknown key, got 'loop'; did you mean 'loops'"),
        ('loops: {w: {typ: weld}}', "loops.w.typ: unknown key, got 'typ'; did you mean 'type'"),
        ('loops: {w: {type: wld}}', "got 'wld'; did you mean 'weld'"),
        ('loops: {w: {type: weld, between: [crank, rcker], at: [0, 0, 0]}}', "mean 'rocker'"),
        ('loops: {w: {type: weld, between: [crank, crank], at: [0, 0, 0]}}', 'of one body'),
        ('loops: {w: {type: weld, between: [crank, rocker], at: [0, 0]}}', 'a list of 3'),
        (
            'loops: {w: {type: universal, between: [crank, rocker], at: [0, 0, 0], '
            'axes: [[1, 0, 0], [1, 1, 0]]}}',
            'loops.yaml: w: its two axes are not perpendicular',
        ),
        (
            'loops: {w: {type: weld, between: [crank, rocker], at: [0, 0, 0], axis: [1]}}',
            'unknown key',
        ),
    ],
)
def test_mistakes_of_a_loop_file(loops: str, message: str, tmp_path: Path) -> None:
    source = saved(tmp_path, 'it.urdf', robots.four_bar())
    with pytest.raises(InputError, match=message):
        imported(source, loops=saved(tmp_path, 'loops.yaml', loops))


def test_an_open_loop_is_closed_around_the_positions_given(tmp_path: Path) -> None:
    source = robots.four_bar(robots.BY_CONSTRAINT)
    moved = source.replace(f'rpy="0 {-robots.four_bar_angles()[2]!r} 0"', 'rpy="0 0 0"')
    path = saved(tmp_path, 'it.urdf', moved)
    assert 'posture' in imported(path)
    with pytest.raises(
        InputError, match='wrist cannot be closed: all joints.*0.*m stay open.*--set'
    ):
        imported(path, positions={'crank_pin': 0.0, 'knee': 0.0, 'rocker_pin': 0.0})
    text = imported(path, positions={'rocker_pin': robots.four_bar_angles()[2]}, scene=True)
    check_four_bar(text)
    with pytest.raises(InputError, match="no such joint, got 'rocker'; did you mean 'rocker_pin'"):
        imported(path, positions={'rocker': 1.0})


# -------------------------------------------------------------------------------------------- MJCF


NAMES = ('yaw', 'pitch', 'x', 'roll', 'tilt')


def mujoco_positions(source: str, step: float, duration: float) -> Floats:
    """Of the joints, rad or m, by MuJoCo itself."""
    mujoco = pytest.importorskip('mujoco')
    model = mujoco.MjModel.from_xml_string(source)
    model.opt.timestep = step
    data = mujoco.MjData(model)
    for _ in range(round(duration / step)):
        mujoco.mj_step(model, data)
    return np.array([float(data.joint(name).qpos[0]) for name in NAMES])


def our_positions(text: str, duration: float) -> Floats:
    simulation = simulate(text)
    simulation.step(round(duration * 1000))
    sample = simulation.sample()
    return np.array([sample.joints[name].position for name in NAMES])


def test_chain_like_mujoco(tmp_path: Path) -> None:
    """Hinges, a slide, turned frames, full inertias, springs and dampers: to rounding."""
    source = robots.CHAIN.replace(robots.BALL_JOINT, '')
    expected = mujoco_positions(source, 2e-4, 1.0)
    assert np.abs(expected).max() > 0.5
    text = imported(saved(tmp_path, 'chain.xml', source), scene=True)
    assert our_positions(text, 1.0) == pytest.approx(expected, abs=1e-10)
    assert 'contact' not in text  # as in the file, which has none
    assert '# Left out without an effect on the motion: shapes 2, lights 1\n' in text


def test_ball_joint_like_mujoco(tmp_path: Path) -> None:
    """As near as MuJoCo, whose quaternions are of lower order, is to itself at half the step."""
    text = imported(saved(tmp_path, 'chain.xml', robots.CHAIN), scene=True)
    coarse, fine = (mujoco_positions(robots.CHAIN, step, 0.5) for step in (2e-4, 1e-4))
    itself = np.abs(coarse - fine).max()
    assert 0.0 < itself < 1e-6
    assert np.abs(our_positions(text, 0.5) - fine).max() < itself


def test_four_bar_closed_by_connect_like_ours(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    text = imported(saved(tmp_path, 'it.xml', robots.four_bar_mjcf()), scene=True)
    assert 'softness: constraints hold exactly: wrist' in text
    check_four_bar(text)


def test_weld_and_sites(tmp_path: Path) -> None:
    """A rod cut in two and welded swings as a whole one; so does one held at sites."""
    pytest.importorskip('mujoco')
    half = '<inertial pos="0.25 0 0" mass="1" diaginertia="0.01 0.02 0.02"/>'
    site = '<site name="{}" pos="{} 0 0"/>'
    source = f"""<mujoco><worldbody><body name="a"><joint name="pin" axis="0 1 0"/>{half}
{site.format('one', 0.5)}</body>
<body name="b" pos="0.5 0 0"><freejoint/>{half}{site.format('two', 0)}</body></worldbody>
<equality><weld {{}}/></equality></mujoco>"""
    expected = 9.81 * (0.25 + 0.75) / (0.04 + 0.25**2 + 0.75**2) * 1e-3
    for sides in ('body1="a" body2="b"', 'site1="one" site2="two"', 'body1="b" body2="a"'):
        simulation = simulate(
            imported(saved(tmp_path, 'it.xml', source.format(sides)), scene=True)
        )
        simulation.step(1)
        assert simulation.sample().joints['pin'].velocity == pytest.approx(expected, rel=1e-5)
    turned = source.format('body1="a" body2="b" relpose="0.5 0 0 0.9 0.1 0 0"')
    text = imported(saved(tmp_path, 'it.xml', turned))
    assert 'posture: ' in text and 'loop0 (1 of 1 starts' in text  # the free body was moved


def test_mistakes_of_an_mjcf(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    for change, message in (
        (('<mujoco', '<mujoco><'), 'MuJoCo refuses it'),
        (('axis="0 -1 0"', 'axs="0 -1 0"'), 'MuJoCo refuses it: .*axs'),
        (('pos="0.0 0 0"', 'pos="1e80 0 0"'), 'body crank: pos: not a usable number'),
    ):
        path = saved(tmp_path, 'it.xml', robots.four_bar_mjcf().replace(*change, 1))
        with pytest.raises(InputError, match=message) as caught:
            imported(path)
        assert '\n' not in str(caught.value)
    path = saved(tmp_path, 'it.xml', robots.four_bar_mjcf())
    with pytest.raises(InputError, match='--floating: for URDF only'):
        imported(path, floating=True)
    with pytest.raises(InputError, match="no such joint, got 'kne'; did you mean 'knee'"):
        imported(path, positions={'kne': 1.0})


# ----------------------------------------------------------------------------------------- command


def test_the_command_writes_and_lists(tmp_path: Path, capsys) -> None:
    source = saved(tmp_path, 'it.urdf', robots.double_pendulum())
    assert main([source, '-o', str(tmp_path / 'out.yaml')]) == 0
    out, said = capsys.readouterr()
    assert out == '' and said.startswith('Changes of the motion:\n  gravity (see --scene)')
    assert main([source]) == 0
    out, _ = capsys.readouterr()
    assert out == (tmp_path / 'out.yaml').read_text(encoding='utf-8')
    assert load_scene({'mechanism': str(tmp_path / 'out.yaml')}).mechanism.name == 'robot'


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['nowhere.urdf'], 'nowhere.urdf: no such file'),
        (['it.urdf', '--stops', '-1'], 'not a stiffness'),
        (['it.urdf', '--set', 'shoulder'], "--set: not a pair, got 'shoulder'"),
        (['it.urdf', '--argument', 'size'], "not a pair, got 'size'; expected NAME=VALUE"),
        (['it.urdf', '--argument', 'size=2'], 'for xacro only'),
        (['it.urdf', '--loops', 'nowhere.yaml'], 'nowhere.yaml: no such file'),
        (['it.urdf', '-o', 'no/where.yaml'], '-o: No such file'),
        (['it.urdf', '--sceen'], 'unrecognized arguments'),
    ],
)
def test_mistakes_of_the_command(arguments, message, tmp_path: Path, monkeypatch) -> None:
    saved(tmp_path, 'it.urdf', robots.double_pendulum())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        main(arguments)
