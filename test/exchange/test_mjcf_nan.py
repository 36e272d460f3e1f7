"""Numbers that are NaN, infinite or too large in an MJCF are refused with their line; MuJoCo takes
NaN for absent at some places."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.forked import ended
from support.imported_motions import saved

mujoco = pytest.importorskip('mujoco')

BODY = """<body name="{name}"><joint name="j" axis="0 1 0"/>
<geom type="sphere" size="0.1" pos="0.2 0 0" {geom}/>{more}</body>"""


def mjcf(name: str = 'b', geom: str = '', more: str = '', head: str = '') -> str:
    body = BODY.format(name=name, geom=geom, more=more)
    return f'<mujoco>{head}<worldbody>{body}</worldbody></mujoco>'


@pytest.mark.parametrize(
    ('source', 'told'),
    [
        (mjcf(geom='mass="nan"'), "2: geom: mass: not a finite number, got 'nan'"),
        (mjcf(geom='name="g" density="-NaN"'), "2: geom g: density: not a finite number, got '-N"),
        (mjcf('nan', more='<geom size="nan"/>'), "2: geom: size: not a finite number, got 'nan'"),
        (
            mjcf(head='<default><joint damping="NAN"/></default>'),
            "1: joint: damping: not a finite number, got 'NAN'",
        ),
        (mjcf().replace('name="j"', 'ref="inf"'), "1: joint: ref: not a usable number, got 'inf'"),
        (mjcf().replace('<joint', '<joint pos="0 inf 0"'), '1: joint j: pos: not a usable number'),
        (mjcf().replace('name="b"', 'quat="inf 0 0 1"'), '1: body: quat: not a usable number'),
        (mjcf(geom='mass="1e300"'), "2: geom: mass: not a usable number, got '1e300'"),
        (mjcf(head='<option gravity="0 -inf 0"/>'), '1: option: gravity: not a usable number'),
        (
            mjcf(geom='mass="inf"').replace(
                '<worldbody>', '<worldbody><geom type="plane" size="inf 1 1"/>'
            ),
            "2: geom: mass: not a usable number, got 'inf'",
        ),
    ],
)
def test_a_number_that_cannot_be_has_its_line(source: str, told: str, tmp_path: Path) -> None:
    """A mass of NaN became the one by density, and the report had it among readings only. Of
    numbers that are too large some ended in a traceback, others in a line about the mechanism."""
    path = saved(tmp_path, 'it.xml', source)
    with pytest.raises(InputError) as caught:
        imported(path, scene=True)
    assert str(caught.value).startswith(f'{path}:{told}')


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('damping', '-1'),
        ('stiffness', '-2 0 1'),
        ('armature', '-0.1'),
        ('frictionloss', '-0.1'),
    ],
)
def test_a_negative_number_has_its_line(key: str, value: str, tmp_path: Path) -> None:
    """Also of a default. The line was about the mechanism, and did not say where."""
    head = f'\n<default>\n<joint {key}="{value}"/></default>'
    path = saved(tmp_path, 'it.xml', mjcf(head=head))
    with pytest.raises(InputError) as caught:
        imported(path, scene=True)
    assert str(caught.value) == f'{path}:3: joint: {key}: a negative number, got {value!r}'
    # one that no joint has moves nothing
    imported(saved(tmp_path, 'it.xml', mjcf(head=head).replace('name="j"', f'{key}="0"')))


def test_nan_in_a_file_that_is_included(tmp_path: Path) -> None:
    part = '<mujocoinclude>\n<body><joint/><geom size="0.1" mass="nan"/></body></mujocoinclude>'
    path = saved(tmp_path, 'part.xml', part)
    with pytest.raises(InputError) as caught:
        imported(saved(tmp_path, 'it.xml', mjcf(more='<include file="part.xml"/>')))
    assert str(caught.value).startswith(f'{path}:2: geom: mass: not a finite number')


ATTACHING = """<mujoco><asset><model name="m" file="{file}"/></asset>
<worldbody><attach model="m" body="b" prefix="p_"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ('geom', 'said'),
    [
        ('mass="nan"', "mass: not a finite number, got 'nan'"),
        ('density="1e200"', "density: not a usable number, got '1e200'"),
    ],
)
def test_numbers_of_an_attached_model(geom: str, said: str, tmp_path: Path) -> None:
    """Also of one that such a model attaches, from its own folder."""
    (tmp_path / 'deep').mkdir()
    path = saved(tmp_path / 'deep', 'part.xml', mjcf(geom=geom))
    nested = (
        ATTACHING.format(file='part.xml')
        .replace('<attach', '<body name="b"><attach')
        .replace('</w', '</body></w')
    )
    saved(tmp_path / 'deep', 'nested.xml', nested)
    for part in ('part', 'nested'):
        with pytest.raises(InputError) as caught:
            imported(saved(tmp_path, 'it.xml', ATTACHING.format(file=f'deep/{part}.xml')))
        assert str(caught.value) == f'{path}:2: geom: {said}'


def test_an_attached_model_that_is_not_there(tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.xml', ATTACHING.format(file='none.xml'))
    with pytest.raises(InputError, match="MuJoCo refuses it: .*none.xml' Element 'model'"):
        imported(path)


def test_nan_that_moves_nothing_is_listed(tmp_path: Path) -> None:
    head = '<custom><numeric name="x" data="nan"/></custom>'
    text = imported(saved(tmp_path, 'it.xml', mjcf('nan', head=head)))
    assert "XML contains a 'NaN'" in text


@pytest.mark.parametrize('size', ['inf', '1e300'])
def test_a_shape_without_end_touches_nothing(size: str, tmp_path: Path) -> None:
    """It was a traceback."""
    inertial = '<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/>'
    plane = '<worldbody><geom type="plane" size="1 1 1"/>'
    source = mjcf(geom='contype="1"', more=inertial).replace('"0.1" pos', f'"{size}" pos')
    path = saved(tmp_path, 'it.xml', source.replace('<worldbody>', plane))
    text = imported(path, contact=1e5)
    assert 'contact of other shapes: these pass through the ground: ' in text
    assert 'ground_contact' not in text


def test_an_anchor_without_numbers_is_one_line(tmp_path: Path) -> None:
    """In a process of its own: MuJoCo may hang after such a failure."""
    more = '</worldbody><equality><connect body1="b" anchor=""/></equality><worldbody>'
    path = saved(tmp_path, 'it.xml', mjcf().replace('</worldbody>', more + '</worldbody>'))
    done = ended(['-m', 'alf_ros', 'import', path], tmp_path, {**os.environ}, 120.0)
    assert done.returncode == 2
    assert 'MuJoCo refuses it' in done.stderr
    assert done.stderr.count('\n') == 1
