"""Robot files that others write load: one small file for each thing that they do.

The files are in test/data/robots, written for this test.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import support.imported_robots as robots
from alf_ros.errors import InputError
from alf_ros.exchange import inertia
from alf_ros.exchange.import_file import imported
from support.imported_motions import check_four_bar, saved, simulate
from support.paths import DATA

FOLDER = DATA / 'robots'
GRAVITY = 9.81


def first_speed(text: str, joint: str) -> float:
    """rad/s or m/s of a joint after 1 ms."""
    simulation = simulate(text)
    simulation.step(1)
    return float(simulation.sample().joints[joint].velocity)


@pytest.mark.parametrize(
    ('name', 'inertia_about_pin', 'arguments'),
    [
        ('fixed_without_axis.urdf', 1.1, {}),
        ('undeclared_prefixes.urdf', 1.1, {}),
        ('arm.urdf.xacro', 1.1, {}),
        ('arm.urdf.xacro', 1.1 * 4.0, {'length': '2'}),
    ],
)
def test_a_pendulum_of(name: str, inertia_about_pin: float, arguments: dict[str, str]) -> None:
    if name.endswith('.xacro'):
        pytest.importorskip('xacro')
    text = imported(str(FOLDER / name), scene=True, arguments=arguments)
    expected = math.sqrt(inertia_about_pin / 1.1) * GRAVITY / inertia_about_pin * 1e-3
    assert first_speed(text, 'pin') == pytest.approx(expected, rel=1e-5)


def test_undeclared_prefixes_are_listed() -> None:
    text = imported(str(FOLDER / 'undeclared_prefixes.urdf'))
    line = 'physics of Gazebo: what these extensions do to the motion is missing'
    assert f'#   {line}: controller:gazebo_ros_p3d of arm\n' in text


def test_sensors_of_old_gazebo_are_no_change_of_the_motion(tmp_path: Path) -> None:
    source = (FOLDER / 'undeclared_prefixes.urdf').read_text(encoding='utf-8')
    source = source.replace('controller:gazebo_ros_p3d', 'sensor:camera')
    text = imported(saved(tmp_path, 'it.urdf', source))
    assert '#   gazebo: sensor:camera of arm\n' in text and 'physics of Gazebo' not in text


@pytest.mark.parametrize(
    'off',
    [
        '<gravity>0</gravity>',
        '<turnGravityOff>true</turnGravityOff>',
        '<turnGravityOff>Yes</turnGravityOff>',
        '<gravity>1</gravity>',
    ],
)
def test_links_of_a_urdf_without_gravity(off: str, tmp_path: Path) -> None:
    """The arm stays, whose centre of mass is beside the pin; the one with gravity falls."""
    source = (FOLDER / 'undeclared_prefixes.urdf').read_text(encoding='utf-8')
    gazebo = f'<gazebo reference="arm">{off}</gazebo></robot>'
    text = imported(saved(tmp_path, 'it.urdf', source.replace('</robot>', gazebo)), scene=True)
    speed = GRAVITY / 1.1 * 1e-3 if '1' in off else 0.0
    assert first_speed(text, 'pin') == pytest.approx(speed, rel=1e-5, abs=1e-12)
    assert 'gravity of' not in text and 'turnGravityOff' not in text


def test_a_moving_joint_needs_an_axis(tmp_path: Path) -> None:
    source = (FOLDER / 'fixed_without_axis.urdf').read_text(encoding='utf-8')
    path = saved(tmp_path, 'it.urdf', source.replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'))
    with pytest.raises(InputError, match='pin: zero is no direction'):
        imported(path)
    whole = str(FOLDER / 'fixed_without_axis.urdf')
    with pytest.raises(InputError, match="not a joint with one coordinate, got 'glue'"):
        imported(whole, positions={'glue': 0.1})


def test_what_can_only_float_says_so() -> None:
    path = str(FOLDER / 'free_flyer.urdf')
    with pytest.raises(InputError, match='no part of it can move: with --floating its root'):
        imported(path)
    simulation = simulate(imported(path, floating=True, scene=True))
    simulation.step(100)
    (place,) = simulation.sample().points.values()
    assert place == pytest.approx([0.0, 0.0, -0.5 * GRAVITY * 0.01], abs=1e-12)


def test_a_frame_without_mass_at_the_end(tmp_path: Path) -> None:
    """A camera that pans and tilts without mass moves nothing, and is left out with its joints."""
    camera = """<link name="pan"/><link name="eye"/>
 <joint name="panning" type="continuous"><parent link="arm"/><child link="pan"/></joint>
 <joint name="tilting" type="continuous"><parent link="pan"/><child link="eye"/></joint></robot>"""
    source = (FOLDER / 'fixed_without_axis.urdf').read_text(encoding='utf-8')
    text = imported(saved(tmp_path, 'it.urdf', source.replace('</robot>', camera)), scene=True)
    assert 'no mass: tilting, panning\n' in text
    assert first_speed(text, 'pin') == pytest.approx(GRAVITY / 1.1 * 1e-3, rel=1e-5)


# ------------------------------------------------------------------------------------------- xacro


def test_a_xacro_that_cannot_be_expanded(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    source = (FOLDER / 'arm.urdf.xacro').read_text(encoding='utf-8')
    for change, message in (
        (('${L}', '${missing}'), 'xacro cannot expand it'),
        (('$(arg length)', '$(find nowhere)/x'), 'xacro cannot expand it'),
    ):
        path = saved(tmp_path, 'it.xacro', source.replace(*change))
        with pytest.raises(InputError, match=message) as caught:
            imported(path)
        assert '\n' not in str(caught.value)


# -------------------------------------------------------------------------------- names and points


def test_names_that_the_loader_uses_itself() -> None:
    """`cup` falls with its joint `cup_z`, and nothing else moves."""
    pytest.importorskip('mujoco')
    text = imported(str(FOLDER / 'names.xml'), scene=True)
    for line in ('cup is cup_2', 'cup_y is cup_y', 'ground is ground_2'):
        assert (line in text) == (line != 'cup_y is cup_y')
    simulation = simulate(text)
    simulation.step(1)
    sample = simulation.sample()
    assert sample.joints['cup_x'].velocity == pytest.approx(0.0, abs=1e-12)
    assert sample.joints['cup_z'].velocity < -0.5 * GRAVITY * 1e-3


STEMS = st.sampled_from(['a', 'b', 'a_x', 'b_z', 'a_length', 'a_b', 'a_b_at', 'a_at', 'x', 'true'])
THREE = st.lists(STEMS, min_size=3, max_size=3, unique=True)


@settings(max_examples=30, deadline=None)
@given(THREE, THREE)
def test_any_names(tmp_path_factory, links: list[str], joints: list[str]) -> None:
    """A chain of three links and three joints, one of them without orientation of its own."""
    kinds = ('continuous', 'prismatic', 'floating')
    above = ('root', *links)
    parts = [robots.link(name, (0.1, 0.2, 0.0), 1.0, (1, 1, 1, 0, 0, 0)) for name in links]
    made = [
        f'<joint name="{name}" type="{kind}"><parent link="{one}"/><child link="{other}"/>'
        '<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
        for name, kind, one, other in zip(joints, kinds, above, links, strict=False)
    ]
    whole = robots.robot('<link name="root"/>', *parts, *made)
    path = saved(tmp_path_factory.mktemp('names'), 'it.urdf', whole)
    assert 'bodies:' in imported(path)  # which has been loaded


def test_a_weld_where_a_joint_is() -> None:
    """The two halves swing as one rod."""
    pytest.importorskip('mujoco')
    text = imported(str(FOLDER / 'weld_at_a_joint.xml'), scene=True)
    simulation = simulate(text)
    simulation.step(1)
    sample = simulation.sample()
    expected = GRAVITY * 1.0 / (0.04 + 0.25**2 + 0.75**2) * 1e-3
    assert sample.joints['pin'].velocity == pytest.approx(expected, rel=1e-5)
    assert sample.joints['elbow'].velocity == pytest.approx(0.0, abs=1e-12)


def test_meshes_and_pictures_that_are_not_there() -> None:
    """A body with an inertia in the file keeps its motion; a body without one is named."""
    pytest.importorskip('mujoco')
    text = imported(str(FOLDER / 'missing_meshes.xml'), scene=True)
    assert '#   shapes without their file: their mass is not counted: tip\n' in text
    expected = GRAVITY * 1.0 / (0.1 + 1.0) * 1e-3
    assert first_speed(text, 'pin') == pytest.approx(expected, rel=1e-5)


def test_a_mesh_of_an_attached_model_is_there(tmp_path: Path) -> None:
    """It lies beside its model; only a picture is missing."""
    pytest.importorskip('mujoco')
    (tmp_path / 'arm' / 'meshes').mkdir(parents=True)
    corners = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'
    saved(tmp_path / 'arm' / 'meshes', 'corner.obj', corners)
    saved(
        tmp_path / 'arm',
        'arm.xml',
        """<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="corner.obj"/>
<texture name="t" type="2d" file="none.png"/></asset><worldbody><body name="b">
<joint name="j" axis="0 1 0"/><geom type="mesh" mesh="m" density="6"/></body></worldbody>
</mujoco>""",
    )
    whole = """<mujoco><asset><model name="a" file="arm/arm.xml"/></asset>
<worldbody><attach model="a" body="b" prefix="p_"/></worldbody></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', whole), scene=True)
    assert 'without their file' not in text
    assert simulate(text).scene.mechanism.bodies[0].mass == pytest.approx(1.0, rel=1e-6)


# ----------------------------------------------------------------------------------------- inertia


def test_an_impossible_inertia_is_refused_or_repaired() -> None:
    path = str(FOLDER / 'impossible_inertia.urdf')
    expected = r'arm: no body has such an inertia.*\[0.04, 0.05, 0.12\].*--repair-inertia.* 13 %'
    with pytest.raises(InputError, match=expected):
        imported(path)
    text = imported(path, scene=True, repair_inertia=True)
    assert '#   inertia, repaired: the least change' in text and 'arm by 13 %' in text
    # 0.03 too much: 0.01 more on both, 0.01 less on the third
    assert first_speed(text, 'pin') == pytest.approx(GRAVITY / 1.05 * 1e-3, rel=1e-5)


MOMENTS = st.floats(-1.0, 1.0, allow_subnormal=False)


@settings(max_examples=200, deadline=None)
@given(st.lists(MOMENTS, min_size=6, max_size=6), st.integers(0, 99))
def test_the_nearest_inertia(moments: list[float], seed: int) -> None:
    """It is possible, and no other possible one is nearer; a possible one stays."""
    J = np.diag(moments[:3]) + np.diag(moments[3:5], 1) + np.diag(moments[3:5], -1)
    J[0, 2] = J[2, 0] = moments[5]
    found, change = inertia.nearest(J)
    low, middle, high = np.linalg.eigvalsh(found)
    size = np.abs(J).max()
    assert low >= -1e-12 * size and low + middle >= high - 1e-12 * size
    assert change * np.linalg.norm(J) == pytest.approx(np.linalg.norm(found - J), abs=1e-12)
    random = np.random.default_rng(seed)
    for _ in range(20):
        s = random.standard_normal((3, 3))
        other = s @ s.T
        other = np.trace(other) * np.eye(3) - other
        mixed = found + random.uniform(0.0, 1.0) * (other * size - found)
        assert np.linalg.norm(mixed - J) >= np.linalg.norm(found - J) - 1e-12
        assert inertia.nearest(other)[1] < 1e-9


# --------------------------------------------------------------------------------------------- SDF


@pytest.mark.parametrize('name', ['four_bar_frames.sdf', 'four_bar_1_6.sdf'])
def test_a_loop_of_an_sdf(name: str) -> None:
    """Frames, degrees, quaternions, axes in other frames: the motion of our four-bar."""
    check_four_bar(imported(str(FOLDER / name), scene=True))


def test_nested_models_of_an_sdf() -> None:
    """Pivot 0.1 m under the trolley, masses, damper, spring: accelerations by hand."""
    text = imported(str(FOLDER / 'nested.sdf'), scene=True, stops=1e4)
    simulation = simulate(text)
    sample = simulation.sample()
    assert sample.points['swing_at'] == pytest.approx([0.5, 0.0, 1.9], abs=1e-15)
    # the rope's com is 1 m under its frame, which is 0.4 m under the pivot
    simulation.step(1)
    # a force of 4 N/m * 0.25 m on 3 kg and a pendulum that turns as it likes
    reduced = 3.0 + 2.0 - (2.0 * 1.4) ** 2 / (0.2 + 2.0 * 1.4**2)
    speed = simulation.sample().joints['roll'].velocity
    assert speed == pytest.approx(4.0 * 0.25 / reduced * 1e-3, rel=1e-3)
    assert 'lower: -2.0, upper: 2.0' in text and 'viscous: 0.7' in text
    assert '(1)' in text  # one body that would touch


def test_a_screw_of_an_sdf() -> None:
    lead = 0.3 / (2.0 * math.pi)
    text = imported(str(FOLDER / 'screw.sdf'), scene=True)
    expected = -2.0 * 9.8 * lead / (0.5 + 2.0 * lead**2) * 1e-3
    assert first_speed(text, 'thread') == pytest.approx(expected, rel=1e-5)


def test_an_included_model(tmp_path: Path) -> None:
    """The importer finds a model in the folder of its name; it lists a model without a folder."""
    (tmp_path / 'rod').mkdir()
    model = (FOLDER / 'nested.sdf').read_text(encoding='utf-8')
    saved(tmp_path / 'rod', 'model.sdf', model)
    world = """<sdf version="1.9"><world name="w"><include><uri>model://rod</uri>
 <name>one</name><pose>1 0 0 0 0 0</pose></include>
 <include><uri>model://nowhere</uri></include></world></sdf>"""
    text = imported(saved(tmp_path, 'w.sdf', world), scene=True)
    assert '#   includes: their content is omitted: model://nowhere\n' in text
    points = simulate(text).sample().points
    assert any(place == pytest.approx([1.5, 0.0, -0.1]) for place in points.values())


MISTAKES = {
    'no name': (('link name="rail"', 'link'), 'link: it has no name'),
    'numbers': (('0.5 0 0 0 0 0', '0.5 0 0'), 'trolley: not usable numbers.*6 numbers'),
    'nan': (('0.5 0 0 0 0 0', 'nan 0 0 0 0 0'), 'trolley: not usable numbers'),
    'frame': (('relative_to="trolley"', 'relative_to="troley"'), "mean 'trolley'"),
    'link': (('<child>trolley', '<child>troley'), "mean 'trolley'"),
    'circle': (('<pose>0.5', '<pose relative_to="roll">0.5'), 'relative to itself'),
    'two links': (('link name="rail"', 'link name="trolley"'), 'a name of two frames'),
    'axis': (('<xyz>1 0 0', '<xyz>0 0 0'), 'roll: zero is no direction'),
    'hangs from itself': (('<child>trolley', '<child>roll'), 'relative to itself|no link'),
    'no child': (('<child>trolley</child>', ''), 'roll: no <child>'),
    'static': (('<static>false', '<static>true'), 'no part of it can move'),
}


@pytest.mark.parametrize(('change', 'message'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_of_an_sdf(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    source = (FOLDER / 'nested.sdf').read_text(encoding='utf-8')
    assert change[0] in source
    source = source.replace(*change, 1)
    path = saved(tmp_path, 'it.sdf', source)
    with pytest.raises(InputError, match=message) as caught:
        imported(path)
    assert path in str(caught.value) and '\n' not in str(caught.value)


def test_limits_of_an_sdf(tmp_path: Path) -> None:
    """Limits on one side, infinite limits, and limits that enclose no range."""
    source = (FOLDER / 'nested.sdf').read_text(encoding='utf-8')
    for lower, upper, said in (
        ('-inf', '2', 'roll: {joint: roll, upper: 2.0, stiffness: 10000.0}'),
        ('-1.79769e+308', '1e16', 'effects:\n  gravity'),
        ('0', '0', '#   limits without range: lower is not below upper: nothing stops them: roll'),
    ):
        ends = f'<lower>{lower}</lower><upper>{upper}</upper>'
        text = source.replace('<lower>-2</lower><upper>2</upper>', ends)
        made = imported(saved(tmp_path, 'it.sdf', text), stops=1e4)
        assert said in made and ('joint_stop' in made) == (upper == '2')


def test_an_unknown_joint_is_listed(tmp_path: Path) -> None:
    source = (FOLDER / 'nested.sdf').read_text(encoding='utf-8').replace('"ball"', '"cam"')
    text = imported(saved(tmp_path, 'it.sdf', source))
    assert '#   joints of unknown type: they are omitted: swing (cam)\n' in text


def test_options_of_other_formats() -> None:
    path = str(FOLDER / 'nested.sdf')
    with pytest.raises(InputError, match='--floating: for URDF only'):
        imported(path, floating=True)
    with pytest.raises(InputError, match='--set: not for SDF'):
        imported(path, positions={'roll': 1.0})


def test_a_link_of_the_world_that_is_not_there(tmp_path: Path) -> None:
    """Files of Drake hang from `world` without a link of this name; they were refused."""
    source = robots.double_pendulum()
    bare = source.replace('<link name="world"/>', '')
    assert bare != source
    text = imported(saved(tmp_path, 'it.urdf', bare), scene=True)
    assert '#   link of the world: there is none: it is the ground, as in Drake: world\n' in text
    expected = first_speed(imported(saved(tmp_path, 'it.urdf', source), scene=True), 'elbow')
    assert first_speed(text, 'elbow') == expected != 0.0
    floating = imported(saved(tmp_path, 'it.urdf', bare), floating=True)
    assert 'between: [ground, upper]' in floating


@pytest.mark.parametrize('axis', ['<axis/>', '<axis xzy="0 0 1"/>', '<axis xyz="0 0"/>'])
def test_the_axis_of_a_fixed_joint_is_not_read(axis: str, tmp_path: Path) -> None:
    """As urdfdom does not; without `xyz` such a joint was refused."""
    fixed = f"""<link name="tip"/><joint name="end" type="fixed"><parent link="lower"/>
 <child link="tip"/>{axis}</joint></robot>"""
    source = robots.double_pendulum().replace('</robot>', fixed)
    assert 'bodies:' in imported(saved(tmp_path, 'it.urdf', source))


def test_a_gearbox_of_gazebo_without_a_reference_is_listed(tmp_path: Path) -> None:
    """A misspelt type is refused."""
    gears = """<gazebo><joint name="lead" type="gearbox"><parent>upper</parent>
 <child>lower</child><axis><xyz>0 0 1</xyz></axis></joint></gazebo></robot>"""
    source = robots.double_pendulum().replace('</robot>', gears)
    text = imported(saved(tmp_path, 'it.urdf', source))
    assert re.search(r'#   gearboxes: they are omitted: .*: lead\n', text)
    with pytest.raises(InputError, match=r"lead: unknown type of joint, got 'gearbix'"):
        imported(saved(tmp_path, 'it.urdf', source.replace('"gearbox"', '"gearbix"')))


def test_sensors_and_pairs_of_meshes_that_are_not_there(tmp_path: Path) -> None:
    """They name the geom of a mesh; MuJoCo refused the model without it."""
    pytest.importorskip('mujoco')
    source = (FOLDER / 'missing_meshes.xml').read_text(encoding='utf-8')
    source = source.replace('<geom size="0.1"/>', '<geom name="ball" size="0.1"/>')
    source = source.replace('type="mesh" mesh="arm"/>', 'type="mesh" mesh="arm" name="shell"/>')
    more = """<contact><pair geom1="shell" geom2="ball"/></contact>
 <sensor><distance geom1="ball" geom2="shell"/><jointpos joint="pin"/></sensor></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source.replace('</mujoco>', more)))
    assert 'sensors 1' in text
