"""Mistakes in an SDF end in one line that names file, line, key, value and the cure."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved
from support.imported_robots import SDF


@pytest.mark.parametrize(
    ('old', 'new', 'line', 'message'),
    [
        ('<mass>1', '<mass>1,5', 3, "a: not usable numbers, got '1,5'; expected a number"),
        ('1 0 0 0 0 0', '1 0 0 0 0', 5, "b: not usable numbers, got '1 0 0 0 0'; expected 6"),
        ('relative_to="a"', 'relative_to="c"', 5, "c: no such frame, got 'c'"),
        ('relative_to="a"', 'relative_to="b"', 5, 'b: its pose is relative to itself'),
        ('relative_to', 'degrees="yes" relative_to', 5, "b: neither true nor false, got 'yes'"),
        ('relative_to', 'rotation_format="rpy" relative_to', 5, 'b: no such rotation_format'),
        ('<link name="b">', '<link name="a">', 4, 'a: a name of two frames'),
        ('<link name="b">', '<link>', 4, 'link: it has no name'),
        ('<child>b', '<child>c', 6, "c: no such frame, got 'c'"),
        ('<child>b</child>', '', 6, 'q: no <child>'),
        ('<child>b', '<child>a', 6, "q: both sides are of one body, 'a'"),
        ('<xyz>0 1 0', '<xyz>0 0 0', 8, 'q: zero is no direction'),
        ('<xyz>0 1 0', '<xyz>', 8, "q: not usable numbers, got ''; expected 3 numbers"),
        ('<pose', '<collision name="c"><max_contacts>zero</max_contacts></collision><pose', 5,
         "b: not usable numbers, got 'zero'; expected a number"),
        ('<pose', '<self_collide>maybe</self_collide><pose', 5, 'b: neither true nor false'),
        ('<xyz>', '<xyz expressed_in="c">', 8, "c: no such frame, got 'c'"),
        ('<lower>-1', '<lower>-1 rad', 9, "q: not a number, got '-1 rad'"),
        ('version="1.9"', 'version="2"', 1, "sdf version: not a version of SDF that is read, got"),
    ],
)  # fmt: skip
def test_a_mistake_in_an_sdf_has_its_line(
    old: str, new: str, line: int, message: str, tmp_path: Path
) -> None:
    path = saved(tmp_path, 'it.sdf', SDF.replace(old, new))
    with pytest.raises(InputError) as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}:{line}: {message}')


def test_a_placement_frame_that_the_world_places_is_named(tmp_path: Path) -> None:
    """A joint whose child is the world is placed in the world."""
    model = '<model name="m" placement_frame="j">\n<link name="a"/>'
    joint = '<joint name="j" type="ball"><parent>a</parent><child>world</child></joint></model>'
    path = saved(tmp_path, 'it.sdf', f'<sdf version="1.9">\n{model}{joint}</sdf>')
    with pytest.raises(InputError) as caught:
        imported(path)
    said = "the pose of its placement_frame leads to 'world', not to the model, got 'j'"
    assert str(caught.value) == f'{path}:2: __model__: {said}'


def test_an_empty_world_is_not_asked_for_a_world(tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.sdf', '<sdf version="1.9">\n<world name="w"/></sdf>')
    with pytest.raises(InputError, match='none; expected <model> or <include> in the <world>$'):
        imported(path)


def test_a_colour_of_one_number_in_an_sdf_is_no_traceback(tmp_path: Path) -> None:
    shape = """<visual name="v"><geometry><sphere><radius>1</radius></sphere></geometry><material>
    <diffuse>1</diffuse></material></visual><pose"""
    text = imported(saved(tmp_path, 'it.sdf', SDF.replace('<pose', shape)))
    assert 'shapes 1' in text


def test_a_pitch_without_a_number_is_listed(tmp_path: Path) -> None:
    """It became the default of SDF without a word."""
    screw = SDF.replace('revolute', 'screw').replace('<child>', '<screw_thread_pitch/><child>')
    text = imported(saved(tmp_path, 'it.sdf', screw))
    assert 'pitch of screws: default of SDF' in text


def test_a_mistake_in_an_included_sdf_has_that_file(tmp_path: Path) -> None:
    """The file that includes it was named."""
    part = saved(tmp_path, 'part.sdf', SDF.replace('<mass>1', '<mass>one'))
    include = '<sdf version="1.9"><world name="w">\n<include><uri>part.sdf</uri>\n{}</include>'
    path = saved(tmp_path, 'it.sdf', include.format('') + '</world></sdf>')
    with pytest.raises(InputError, match='not usable numbers') as caught:
        imported(path)
    assert str(caught.value).startswith(f'{part}:3: ')
    saved(tmp_path, 'part.sdf', SDF)
    pose = '<pose relative_to="c">0 0 0 0 0 0</pose>'
    saved(tmp_path, 'it.sdf', include.format(pose) + '</world></sdf>')
    with pytest.raises(InputError, match='no such frame') as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}:3: ')
