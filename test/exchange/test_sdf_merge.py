"""`<include merge="true">`: the motion of the same model nested, with names that have no scope."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

INERTIAL = '<inertial><mass>2</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz></inertia>'
HAND = f"""<sdf version="{{version}}"><model name="hand"{{placed}}><pose>0 0 9 0 0 0</pose>
<static>false</static>
<link name="palm"><pose>0.1 0 0 0 0.2 0</pose>{INERTIAL}</inertial></link>
<link name="finger"><pose{{from_model}}>0.3 0.1 0 0.3 0 0</pose>
 {INERTIAL}<pose>0.2 0 0.1 0 0 0</pose></inertial></link>
{{frames}}
<joint name="bend" type="revolute"><parent>palm</parent><child>finger</child>
 <axis><xyz{{axis}}>0.2 1 0</xyz></axis></joint>
</model></sdf>"""
FRAMES = f"""<frame name="grip"><pose>0 0.3 0 0.1 0.2 0.3</pose></frame>
<frame name="tip" attached_to="finger"><pose>0 0 0.2 0 0 0</pose></frame>
<model name="pad"><pose>0.2 0 0 0 0 0.4</pose><link name="rubber">
 {INERTIAL}</inertial></link></model>
<joint name="glue" type="ball"><parent>__model__</parent><child>pad::rubber</child>
 <pose relative_to="__model__">0.2 0 0.1 0 0 0</pose></joint>"""
ARM = f"""<sdf version="1.9"><model name="arm"><pose>0 0 1 0 0 0.5</pose>
<include{{merge}}><uri>model://hand</uri><name>hand</name>{{pose}}{{placed}}</include>
<link name="upper"><pose>0 0 -1 0 0 0</pose>{INERTIAL}</inertial></link>
<frame name="end" attached_to="upper"><pose>0.5 0 0.2 0.2 0 0</pose></frame>
<joint name="hold" type="fixed"><parent>world</parent><child>{{scope}}palm</child></joint>
<joint name="swing" type="revolute"><parent>{{scope}}finger</parent><child>upper</child>
 <pose relative_to="end"/><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""
NEW = {
    'version': '1.9',
    'from_model': ' relative_to="__model__"',
    'axis': ' expressed_in="__model__"',
    'frames': FRAMES,
    'placed': '',
}
OLD = {'version': '1.4', 'from_model': '', 'axis': '', 'frames': '', 'placed': ''}
POSE = '<pose>0.1 0.2 0.3 0.4 0 0</pose>'
CASES = {
    'at its own pose': (NEW, '', ''),
    'at a pose': (NEW, POSE, ''),
    'from a frame': (NEW, POSE.replace('<pose', '<pose relative_to="end"'), ''),
    'placed by a frame': (NEW, POSE, '<placement_frame>grip</placement_frame>'),
    'placed by a frame of its own': ({**NEW, 'placed': ' placement_frame="tip"'}, POSE, ''),
    'axes in the frame of the model': (OLD, POSE, ''),
}


def places(folder: Path, hand: str, pose: str, placed: str, merge: bool) -> Floats:
    """(points, 3) after a time, in the order of the names without scopes."""
    (folder / 'hand').mkdir(exist_ok=True)
    saved(folder / 'hand', 'model.sdf', hand)
    how, scope = (' merge="true"', '') if merge else ('', 'hand::')
    arm = ARM.format(merge=how, pose=pose, placed=placed, scope=scope)
    text = imported(saved(folder, 'arm.sdf', arm), scene=True)
    assert ('hand' in text.split('mechanism:')[1]) != merge
    simulation = simulate(text)
    simulation.step(50)
    points = simulation.sample().points
    return np.array([points[name] for name in sorted(points, key=short)])


def short(name: str) -> str:
    return name.removeprefix('hand__')


@pytest.mark.parametrize(('fields', 'pose', 'placed'), CASES.values(), ids=CASES)
def test_a_merged_model_moves_as_a_nested_one(
    fields: dict[str, str], pose: str, placed: str, tmp_path: Path
) -> None:
    hand = HAND.format(**fields)
    merged, nested = (places(tmp_path, hand, pose, placed, merge) for merge in (True, False))
    np.testing.assert_allclose(merged, nested, rtol=0.0, atol=1e-12)


def test_names_that_meet_are_refused(tmp_path: Path) -> None:
    (tmp_path / 'hand').mkdir()
    saved(tmp_path / 'hand', 'model.sdf', HAND.format(**NEW).replace('"finger"', '"upper"'))
    arm = ARM.format(merge=' merge="true"', pose='', placed='', scope='')
    with pytest.raises(InputError, match='upper: a name of two frames'):
        imported(saved(tmp_path, 'arm.sdf', arm))


@pytest.mark.parametrize('merge', ['', ' merge="true"'])
def test_a_model_that_includes_itself_is_refused(merge: str, tmp_path: Path) -> None:
    (tmp_path / 'arm').mkdir()
    source = f"""<sdf version="1.9"><model name="arm"><link name="one"/>
<include{merge}><uri>model://arm</uri></include></model></sdf>"""
    with pytest.raises(InputError, match='a model that includes itself'):
        imported(saved(tmp_path / 'arm', 'model.sdf', source))


def test_links_merged_into_a_world_are_refused(tmp_path: Path) -> None:
    (tmp_path / 'hand').mkdir()
    saved(tmp_path / 'hand', 'model.sdf', HAND.format(**NEW))
    world = """<sdf version="1.9"><world name="w">
<include merge="true"><uri>model://hand</uri></include></world></sdf>"""
    with pytest.raises(InputError, match='palm: merged into a world.*expected <include> in a'):
        imported(saved(tmp_path, 'w.sdf', world))


PENDULUM = f"""<sdf{{}}><model name="m"><link name="l">
{INERTIAL}<pose>0 0 1 0 0 0</pose></inertial>
</link><joint name="j" type="revolute"><parent>world</parent><child>l</child>
<axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""


@pytest.mark.parametrize('version', ['2.0', '1', 'x', '1.x', ''])
def test_other_versions_are_refused(version: str, tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.sdf', PENDULUM.format(f' version="{version}"'))
    message = f"sdf version: not a version of SDF that is read, got '{version}'; expected 1.4 to"
    with pytest.raises(InputError, match=message):
        imported(path)


def test_a_version_that_is_absent_or_near_is_listed(tmp_path: Path) -> None:
    for given, told in (('', 'none'), (' version="1.3"', '1.3'), (' version="1.13"', '1.13')):
        text = imported(saved(tmp_path, 'it.sdf', PENDULUM.format(given)))
        assert '#   version of SDF: 1.4 to 1.12 are expected' in text
        assert f': it.sdf has {told}\n' in text
    text = imported(saved(tmp_path, 'it.sdf', PENDULUM.format(' version="1.6"')))
    assert 'version of SDF' not in text


def test_a_frame_of_a_model_that_was_not_found(tmp_path: Path) -> None:
    """The error names the model, which is the cause."""
    source = """<sdf version="1.9"><model name="m"><link name="hand"/>
<include merge="true"><uri>model://arm</uri></include>
<joint name="wrist" type="fixed"><parent>palm</parent><child>hand</child></joint></model></sdf>"""
    expected = (
        "it.sdf:3: palm: no such frame, got 'palm'; expected the content of model://arm, which"
    )
    with pytest.raises(InputError, match=expected):
        imported(saved(tmp_path, 'it.sdf', source))


PART = f"""<sdf version="1.9"><model name="part"{{canonical}}><pose>0 0 0.5 0 0 0</pose>
<link name="a">{INERTIAL}</inertial></link>
<link name="b"><pose>1 0 0 0 0 0</pose>{INERTIAL}</inertial></link></model></sdf>"""
PAIR = f"""<sdf version="1.9"><model name="pair"><include{{merge}}>
<uri>model://{{of}}</uri></include>
<model name="load"><pose>2 0 0 0 0 0</pose><link name="c">{INERTIAL}</inertial></link></model>
<frame name="here"/>
<joint name="weld" type="fixed"><parent>here</parent><child>load::c</child></joint>
</model></sdf>"""
AROUND = """<sdf version="1.9"><model name="around"><pose>0 0 3 0 0 0</pose>
<include><uri>model://part</uri></include></model></sdf>"""


@pytest.mark.parametrize('named', ['', 'b'])
@pytest.mark.parametrize(
    ('of', 'merge', 'scope'),
    [
        ('part', '', 'part__'),
        ('part', ' merge="true"', ''),
        ('around', '', 'around__part__'),
        ('around', ' merge="true"', 'part__'),
    ],
)
def test_the_frame_of_a_model_hangs_from_the_first_model_in_it(
    of: str, merge: str, scope: str, named: str, tmp_path: Path
) -> None:
    """If it has no link of its own, also from a model of another file: a load would be fixed to
    the world. A merged model gives its links, not their order."""
    canonical = f' canonical_link="{named}"' if named else ''
    held = 'b' if named and scope else 'a'
    for name, text in (('part', PART), ('around', AROUND)):
        (tmp_path / name).mkdir()
        saved(tmp_path / name, 'model.sdf', text.format(canonical=canonical))
    text = imported(saved(tmp_path, 'pair.sdf', PAIR.format(of=of, merge=merge)), scene=True)
    bodies = {each.name: each for each in simulate(text).scene.mechanism.bodies}
    both = f'{scope}{held}'
    free = f'{scope}{"ab".replace(held, "")}'
    assert {name: each.mass for name, each in bodies.items()} == {both: 4.0, free: 2.0}
    places = {name: simulate(text).sample().points[f'{name}_at'] for name in bodies}
    height = 3.5 if of == 'around' else 0.5
    assert places[free] == pytest.approx([0.0 if held == 'b' else 1.0, 0.0, height])


def test_a_world_of_models_that_were_not_found(tmp_path: Path) -> None:
    """The error names them: what stands still may only be the rest of it."""
    source = '<sdf version="1.9"><include><uri>model://arm</uri></include></sdf>'
    expected = 'no part of it can move: .*, or in a model that was not found: model://arm$'
    with pytest.raises(InputError, match=expected):
        imported(saved(tmp_path, 'it.sdf', source))
