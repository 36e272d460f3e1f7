"""Names that meet here and do not in the file: the robot moves as with other names.

A body may be called as the ground of alf_ros, a loop as a joint, a body as MuJoCo's number of one
without a name.
"""

from __future__ import annotations

from pathlib import Path
from textwrap import indent

import pytest

import support.imported_robots as robots
from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved, simulate
from support.usd_robots import body, joint, massive, stage

BESIDE = massive(2.0, (0.0, 0.3, 0.0), (0.3, 0.4, 0.5))

FORMATS = {
    'it.urdf': robots.robot(
        '<link name="base"/>',
        robots.rod('plate', 0.4, 1.0),
        robots.rod('arm', 0.3, 1.0),
        robots.hinge('pin', 'base', 'plate', 0.0, 0.0),
        robots.hinge('knee', 'plate', 'arm', 0.4, 0.0),
    ),
    'it.sdf': """<sdf version="1.9"><model name="m"><link name="plate"><inertial>
<pose>0.2 0 0 0 0 0</pose><mass>2</mass></inertial></link>
<link name="arm"><pose>0.4 0 0 0 0 0</pose>
<inertial><pose>0.2 0 0 0 0 0</pose></inertial></link>
<joint name="pin" type="revolute"><parent>world</parent><child>plate</child>
<axis><xyz>0 1 0</xyz></axis></joint><joint name="knee" type="revolute"><parent>plate</parent>
<child>arm</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>""",
    'it.xml': """<mujoco model="m"><worldbody><body name="plate"><joint name="pin" axis="0 1 0"/>
<geom size="0.1" pos="0.2 0 0"/><body name="arm" pos="0.4 0 0"><joint name="knee" axis="0 1 0"/>
<geom size="0.1" pos="0.2 0 0"/></body></body></worldbody></mujoco>""",
    'it.usda': stage(
        body('plate', BESIDE),
        body('arm', BESIDE),
        joint('Revolute', 'pin', (('', (0, 0, 0)), ('/plate', (0, 0, 0)))),
        joint('Revolute', 'knee', (('/plate', (0, 0, 0)), ('/arm', (0, 0, 0)))),
    ),
}
LOOP = """<gazebo><joint name="bolt" type="revolute"><parent>world</parent><child>base</child>
<axis><xyz>0 1 0</xyz></axis></joint></gazebo>"""
NEEDS = {'it.xml': 'mujoco', 'it.usda': 'pxr'}


@pytest.mark.parametrize('name', FORMATS)
def test_a_moving_body_called_ground(name: str, tmp_path: Path) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    text = FORMATS[name]
    expected, found = (
        imported(saved(tmp_path, name, each), scene=True)
        for each in (text, text.replace('plate', 'ground'))
    )
    assert '#   names, changed: ground is ground_2\n' in found
    states = []
    for each in (expected, found):
        simulation = simulate(each)
        simulation.step(100)
        states.append(simulation.sample().joint_positions)
    assert states[1] == pytest.approx(states[0], abs=1e-12) and abs(states[0]).max() > 1e-3


def test_the_report_calls_the_ground_so(tmp_path: Path) -> None:
    """The readers have another name for it, which no body of a file can have."""
    parts = '<link name="l"/><joint name="no" type="ball"><parent>world</parent><child>l</child>'
    held = '</joint><joint name="held" type="fixed"><parent>world</parent><child>l</child></joint>'
    sdf = FORMATS['it.sdf'].replace('</model>', f'{parts}{held}</model>')
    text = imported(saved(tmp_path, 'it.sdf', sdf))
    assert '#   elements: joint no of a fixed part\n' in text and '\0' not in text
    urdf = FORMATS['it.urdf'].replace('</robot>', f'{LOOP}</robot>')
    with pytest.raises(InputError, match='bolt: both sides are of the ground'):
        imported(saved(tmp_path, 'it.urdf', urdf))


def four_bar(loop: str, *names: str) -> str:
    """An MJCF with a loop, and the names of its three bodies."""
    a, b, c = (f'name="{name}"' if name else '' for name in names)
    return f"""<mujoco><worldbody><body {a}><joint name="knee" axis="0 1 0" stiffness="2"/>
<geom size="0.1" pos="0.2 0 0"/><body {b} pos="0.3 0 0"><joint name="mid" axis="0 1 0"/>
<geom size="0.1" pos="0.2 0 -0.1"/></body></body><body {c} pos="0.6 0 0">
<joint name="top" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.2"/></body></worldbody>
<equality><connect name="{loop}" body1="{names[1]}" body2="{names[2]}" anchor="0.3 0 -0.4"/>
</equality></mujoco>"""


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        (four_bar('knee', 'a', 'b', 'c'), 'names, changed: loop knee is knee_2'),
        (four_bar('eye', '', 'body1', 'c'), 'softness: constraints hold exactly: eye'),
    ],
    ids=['a loop and a joint', 'a body without name'],
)
def test_names_of_an_mjcf(text: str, told: str, tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    found = []
    for each in (four_bar('eye', 'a', 'b', 'c'), text):
        report = imported(saved(tmp_path, 'it.xml', each), scene=True)
        simulation = simulate(report)
        simulation.step(100)
        joints = simulation.sample().joints
        found.append([joints[name].position for name in ('knee', 'mid', 'top')])
    assert f'#   {told}\n' in report
    assert found[1] == pytest.approx(found[0], abs=1e-12) and max(map(abs, found[0])) > 1e-3


def test_a_loop_of_a_urdf_with_the_name_of_a_joint(tmp_path: Path) -> None:
    """Both are there: two rods on one pin, held together."""
    loop = LOOP.replace('bolt', 'pin').replace('world', 'plate').replace('"revolute"', '"ball"')
    arm = FORMATS['it.urdf'].replace('</robot>', f'{loop.replace("base", "arm")}</robot>')
    path = saved(tmp_path, 'it.urdf', arm)
    kinds = [joint.kind for joint in scene_from_text(imported(path, scene=True)).mechanism.joints]
    assert kinds == ['revolute', 'revolute', 'spherical']


def test_a_joint_called_as_a_coordinate_of_another(tmp_path: Path) -> None:
    """The first angle of a universal joint `pin` is `pin_first`."""
    axes = '<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>'
    first = (
        'type="revolute"><parent>world</parent><child>plate</child>\n<axis><xyz>0 1 0</xyz></axis>'
    )
    sdf = FORMATS['it.sdf'].replace('knee', 'pin_first')
    assert first in sdf
    both = first.replace('revolute', 'universal').replace('<axis><xyz>0 1 0</xyz></axis>', axes)
    text = imported(saved(tmp_path, 'it.sdf', sdf.replace(first, both)))
    assert '#   names, changed: pin_first is pin_first_2\n' in text
    assert set(simulate(f'mechanism:\n{indent(text, "  ")}').sample().joints) == {
        'pin_first', 'pin_second', 'pin_first_2',
    }  # fmt: skip


def test_a_servo_on_a_tendon_with_the_name_of_a_joint(tmp_path: Path) -> None:
    """Each takes targets by its own name."""
    pytest.importorskip('mujoco')
    more = """<tendon><fixed name="cord"><joint joint="pin" coef="1"/></fixed></tendon>
<actuator><position name="pin" tendon="cord" kp="5"/></actuator></mujoco>"""
    source = FORMATS['it.xml'].replace('</mujoco>', more)
    simulation = simulate(imported(saved(tmp_path, 'it.xml', source), scene=True))
    simulation.apply_target('pin_2', position=0.3)
    with pytest.raises(InputError, match='pin: no motor with a position_gain on it'):
        simulation.apply_target('pin', position=0.3)


@pytest.mark.parametrize(
    ('models', 'name'),
    [
        (
            '<model name="m"><link name="a"/></model>\n<model name="m"><link name="a"/></model>',
            'm',
        ),
        (
            '<model name="m"><model name="k"><link name="a"/></model>\n'
            '<model name="k"><link name="a"/></model></model>',
            'm::k',
        ),
    ],
)
def test_two_models_of_an_sdf_with_one_name(models: str, name: str, tmp_path: Path) -> None:
    """The message had the name that a frame of a model has within, `m::__model__`."""
    path = saved(tmp_path, 'it.sdf', f'<sdf version="1.9"><world name="w">{models}</world></sdf>')
    with pytest.raises(InputError, match=f'it.sdf:2: {name}: a name of two models: the <name>'):
        imported(path)


def test_a_model_that_is_included_twice(tmp_path: Path) -> None:
    """Each needs a name; with one they are two models."""
    saved(tmp_path, 'arm.sdf', FORMATS['it.sdf'].replace('name="m"', 'name="arm"'))
    world = '<sdf version="1.9"><world name="w">{}{}</world></sdf>'
    arm = '<include><uri>arm.sdf</uri>{}</include>'
    twice = world.format(arm.format(''), arm.format(''))
    with pytest.raises(InputError, match='arm.sdf:1: arm: a name of two models: the <name>'):
        imported(saved(tmp_path, 'it.sdf', twice))
    other = '<name>other</name><pose>1 0 0 0 0 0</pose>'
    both = world.format(arm.format(''), arm.format(other))
    text = imported(saved(tmp_path, 'it.sdf', both), scene=True)
    joints = scene_from_text(text).mechanism.joints
    assert [each.name for each in joints] == ['arm__pin', 'arm__knee', 'other__pin', 'other__knee']


def test_models_of_an_sdf_that_are_placed_by_each_other(tmp_path: Path) -> None:
    one, other = (
        f'<model name="{a}"><pose relative_to="{b}">0 0 0 0 0 0</pose><link name="l"/></model>'
        for a, b in ('mn', 'nm')
    )
    source = f'<sdf version="1.9"><world name="w">{one}{other}</world></sdf>'
    with pytest.raises(InputError, match='it.sdf:1: m: its pose is relative to itself'):
        imported(saved(tmp_path, 'it.sdf', source))
