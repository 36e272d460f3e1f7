"""Older versions of SDF, which have data elsewhere, and links that no force moves: pendulums."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved, simulate

ARM = """<link name="arm"><pose{}>{}</pose><inertial><pose>0.3 0 0 0 0 0</pose><mass>2</mass>
<inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.3</izz></inertia></inertial></link>"""
PIN = """<joint name="pin" type="Revolute"><parent>{}</parent><child>arm</child>
<axis><xyz>0 1 0</xyz></axis></joint>"""
WORLD = '<sdf version="{}"><world name="w">{}<model name="m">{}</model></world></sdf>'
INERTIA = 0.2 + 2.0 * 0.3**2  # kg m^2, about the pin


def acceleration(folder: Path, source: str) -> float:
    """Of the pin at the start, rad/s^2."""
    simulation = simulate(imported(saved(folder, 'it.sdf', source), scene=True))
    simulation.step(1)
    return simulation.sample().joints['pin'].velocity / 1e-3


@pytest.mark.parametrize(('version', 'g'), [('1.4', 2.0), ('1.5', 2.0), ('1.6', 9.8)])
def test_gravity_is_in_the_physics_of_old_worlds(version: str, g: float, tmp_path: Path) -> None:
    """From 1.6 on it is beside <physics>, where the default holds; g is along -x + -z here."""
    physics = '<physics type="ode"><gravity>-5 0 -2</gravity></physics>'
    source = WORLD.format(version, physics, ARM.format('', '0 0 0 0 0 0') + PIN.format('world'))
    found = acceleration(tmp_path, source)
    assert found == pytest.approx(2.0 * 0.3 * g / INERTIA, rel=1e-4)


def test_the_gravity_of_a_world_counts_before_that_of_its_physics(tmp_path: Path) -> None:
    both = '<gravity>0 0 -3</gravity><physics type="ode"><gravity>0 0 -2</gravity></physics>'
    source = WORLD.format('1.5', both, ARM.format('', '0 0 0 0 0 0') + PIN.format('world'))
    expected = 2.0 * 0.3 * 3.0 / INERTIA
    assert acceleration(tmp_path, source) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(('version', 'key'), [('1.6', 'frame'), ('1.7', 'relative_to')])
def test_a_pose_is_in_the_frame_that_it_names(version: str, key: str, tmp_path: Path) -> None:
    """The arm is drawn 60 degrees below the x axis, by a frame that is turned by 40 degrees."""
    turned, rest = np.deg2rad([40.0, 20.0])
    frame = f'<frame name="f"><pose>0.1 0 0.4 0 {turned} 0</pose></frame>'
    arm = ARM.format(f' {key}="f"', f'0 0 0 0 {rest} 0')
    source = f'<sdf version="{version}"><model name="m">{frame}{arm}{PIN.format("world")}'
    text = imported(saved(tmp_path, 'it.sdf', source + '</model></sdf>'), scene=True)
    simulation = simulate(text)
    np.testing.assert_allclose(simulation.sample().points['pin_at'], [0.1, 0.0, 0.4], atol=1e-15)
    simulation.step(1)
    expected = 2.0 * 0.3 * 9.8 * 0.5 / INERTIA
    found = simulation.sample().joints['pin'].velocity / 1e-3
    assert found == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize('on', ['world', 'base'])
def test_a_kinematic_link_is_the_ground(on: str, tmp_path: Path) -> None:
    """A free one of any mass, without a joint of its own, carries the pendulum."""
    base = '<link name="base"><kinematic>true</kinematic><pose>0 0 0.2 0 0 0</pose></link>'
    body = base + ARM.format('', '0 0 0 0 0 0') + PIN.format(on)
    source = saved(tmp_path, 'it.sdf', f'<sdf version="1.9"><model name="m">{body}</model></sdf>')
    text = imported(source, scene=True)
    assert '#   motion of kinematic bodies: they do not move: base\n' in text
    found = acceleration(tmp_path, Path(source).read_text('utf-8'))
    assert found == pytest.approx(2.0 * 0.3 * 9.8 / INERTIA, rel=1e-4)


def test_a_screw_without_a_pitch_advances_a_metre(tmp_path: Path) -> None:
    """As libsdformat has it: a nut that weight drives along its thread, m g l = (J + m l^2) a."""
    screw = PIN.format('world').replace('Revolute', 'screw').replace('0 1 0', '0 0 -1')
    body = ARM.format('', '0 0 0 0 0 0').replace('0.3 0 0 0 0 0', '0 0 0 0 0 0') + screw
    source = f'<sdf version="1.9"><model name="m">{body}</model></sdf>'
    lead = 1.0 / (2.0 * np.pi)
    expected = 2.0 * 9.8 * lead / (0.3 + 2.0 * lead**2)
    assert acceleration(tmp_path, source) == pytest.approx(expected, rel=1e-6)


def test_links_without_gravity(tmp_path: Path) -> None:
    """Of two pendulums and a free link one falls; a body half of which is without is slower."""
    arm = ARM.format('', '0 0 0 0 0 0') + PIN.format('world')
    off = '<gravity>0</gravity>'
    light = arm.replace('"arm">', f'"arm">{off}', 1)
    other = (arm + '<link name="ball"><gravity>false</gravity></link>').replace('"arm"', '"two"')
    other = other.replace('"pin"', '"pin_of_two"').replace('>arm<', '>two<')
    source = f'<sdf version="1.9"><model name="m">{light}{other}</model></sdf>'
    text = imported(saved(tmp_path, 'it.sdf', source), scene=True)
    simulation = simulate(text)
    simulation.step(1)
    joints = simulation.sample().joints
    assert abs(joints['pin'].velocity) < 1e-12
    assert joints['pin_of_two'].velocity == pytest.approx(2e-3 * 0.3 * 9.8 / INERTIA, rel=1e-4)
    assert float(np.abs(simulation.sample().velocities['ball_at']).max()) < 1e-12
    half = '<joint name="held" type="fixed"><parent>two</parent><child>arm</child></joint>'
    half = source.replace(PIN.format('world'), half, 1)
    simulation = simulate(imported(saved(tmp_path, 'it.sdf', half), scene=True))
    simulation.step(1)
    speed = simulation.sample().joints['pin_of_two'].velocity
    assert speed == pytest.approx(1e-3 * 0.3 * 2 * 9.8 / (2 * INERTIA), rel=1e-4)


def test_links_without_gravity_where_there_is_none(tmp_path: Path) -> None:
    arm = ARM.format('', '0 0 0 0 0 0').replace('"arm">', '"arm"><gravity>0</gravity>', 1)
    source = WORLD.format('1.9', '<gravity>0 0 0</gravity>', arm + PIN.format('world'))
    text = imported(saved(tmp_path, 'it.sdf', source), scene=True)
    assert 'constant_wrench' not in text


CONFIG = '<?xml version="1.0"?><model><name>arm</name>{}</model>'
NAMED = '<sdf version="{}">{}</sdf>'


@pytest.mark.parametrize(
    ('config', 'mass'),
    [
        (NAMED.format('1.4', 'arm-1_4.sdf') + NAMED.format('1.10', 'model.sdf'), 10.0),
        (NAMED.format('1.10', 'model.sdf') + NAMED.format('1.9', 'new.sdf'), 10.0),
        (NAMED.format('1.9', 'new.sdf') + NAMED.format('2.0', 'model.sdf'), 9.0),
        ('', 10.0),
        (None, 10.0),
    ],
)
def test_a_folder_has_the_model_of_its_newest_version(
    config: str | None, mass: float, tmp_path: Path
) -> None:
    """Models come with files for old versions, whose names are the first of the alphabet."""
    folder = tmp_path / 'arm'
    folder.mkdir()
    for name, version, m in (('arm-1_4', '1.4', 4), ('model', '1.10', 10), ('new', '1.9', 9)):
        link = f'<link name="l"><inertial><mass>{m}</mass></inertial></link>'
        saved(
            folder,
            f'{name}.sdf',
            f'<sdf version="{version}"><model name="arm">{link}</model></sdf>',
        )
    if config is not None:
        saved(folder, 'model.config', CONFIG.format(config))
    include = '<include><uri>model://arm</uri></include>'
    source = saved(
        tmp_path, 'it.sdf', f'<sdf version="1.9"><world name="w">{include}</world></sdf>'
    )
    (body,) = scene_from_text(imported(source, scene=True)).mechanism.bodies
    assert body.mass == mass


MIMIC = """<joint name="k" type="revolute"><parent>arm</parent><child>hand</child><axis>
<xyz>0 1 0</xyz><mimic joint="pin"{}><multiplier>2</multiplier></mimic></axis></joint>"""


@pytest.mark.parametrize(
    ('kinematic', 'axis', 'held'),
    [('1', '', True), ('0', '', False), ('0', ' axis="axis2"', None)],
)
def test_a_joint_that_mimics_a_fixed_one_stays(
    kinematic: str, axis: str, held: bool | None, tmp_path: Path
) -> None:
    """It was a traceback. A second axis of the pin, which has one, leaves the joint free."""
    arm = ARM.format('', '0 0 1 0 0 0')
    hand = arm.replace('"arm"', '"hand"')
    still = arm.replace('<pose>', f'<kinematic>{kinematic}</kinematic><pose>', 1)
    joints = PIN.format('world') + MIMIC.format(axis)
    text = imported(
        saved(tmp_path, 'it.sdf', WORLD.format('1.11', '', still + hand + joints)), scene=True
    )
    simulation = simulate(text)
    simulation.step(100)
    found = simulation.sample().joints
    moved = found['k'].position
    assert ('mimic: these joints are free: k' in text) == (held is None)
    if held:
        assert abs(moved) < 1e-12 and 'pin' not in found
    else:
        ratio = moved / found['pin'].position
        assert (ratio == pytest.approx(2.0, rel=1e-9)) == (held is not None)


@pytest.mark.parametrize('name', ['a', 'world'])
def test_a_joint_of_an_old_version_has_the_name_of_a_link(name: str, tmp_path: Path) -> None:
    """Joints had no frames until 1.6: libsdformat gives such a joint another name."""
    links = (ARM.format('', '0 0 0 0 0 0').replace('"arm"', f'"{each}"') for each in 'ab')
    pins = (
        PIN.format('world').replace('"pin"', f'"{own}"').replace('>arm<', f'>{link}<')
        for own, link in ((name, 'a'), (f'{name}_joint', 'b'))
    )
    model = ''.join([*links, *pins])
    text = imported(saved(tmp_path, 'it.sdf', WORLD.format('1.6', '', model)), scene=True)
    assert f'#   names, changed: joint {name} is {name}_joint_2\n' in text
    joints = {each.name: each.child for each in simulate(text).scene.mechanism.joints}
    assert joints == {f'{name}_joint_2': 'a', f'{name}_joint': 'b'}


def test_a_joint_of_a_later_version_has_its_own_name(tmp_path: Path) -> None:
    model = ARM.format('', '0 0 0 0 0 0') + PIN.format('world').replace('"pin"', '"arm"')
    with pytest.raises(InputError, match='it.sdf:2: m::arm: a name of two frames'):
        imported(saved(tmp_path, 'it.sdf', WORLD.format('1.7', '', model)), scene=True)


def test_a_version_with_another_root_is_refused_as_what_it_is(tmp_path: Path) -> None:
    """It was "not a URDF". Other elements differ too: <origin>, and masses in attributes."""
    source = '<gazebo version="1.2"><model name="m"><link name="a"/></model></gazebo>'
    with pytest.raises(InputError, match='it.sdf:1: sdf version: SDF before 1.3, whose root is'):
        imported(saved(tmp_path, 'it.sdf', source))


@pytest.mark.parametrize('encoding', ['utf-16', 'utf-16-le', 'utf-16-be'])
def test_a_file_in_utf_16(encoding: str, tmp_path: Path) -> None:
    """The mark of the order of bytes may be absent. Lines count as in other files."""
    head = '<?xml version="1.0" encoding="UTF-16"?>\n<!-- a -- b -->\n'
    source = WORLD.format('1.9', '', ARM.format('', '0 0 0 0 0 0') + PIN.format('world'))
    path = tmp_path / 'it.sdf'
    path.write_bytes((head + source).encode(encoding))
    expected = imported(saved(tmp_path, 'plain.sdf', source))
    assert imported(str(path)).split('\n')[1:] == expected.split('\n')[1:]
    path.write_bytes((head + source.replace('0 1 0', '0 0 0')).encode(encoding))
    with pytest.raises(InputError, match='it.sdf:5: '):
        imported(str(path))


def test_an_mjcf_in_utf_16_is_refused_by_mujoco(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    path = tmp_path / 'it.xml'
    path.write_bytes('<mujoco><worldbody/></mujoco>'.encode('utf-16'))
    with pytest.raises(InputError, match='it.xml: MuJoCo refuses it: XML parse error'):
        imported(str(path))
