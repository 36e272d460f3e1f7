"""Numbers that are NaN in an MJCF are refused with their line; MuJoCo takes some for absent."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
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
    ],
)
def test_nan_is_refused(source: str, told: str, tmp_path: Path) -> None:
    """A mass of NaN became the one by density, and the report had it among readings only."""
    path = saved(tmp_path, 'it.xml', source)
    with pytest.raises(InputError) as caught:
        imported(path, scene=True)
    assert str(caught.value).startswith(f'{path}:{told}')


def test_nan_in_a_file_that_is_included(tmp_path: Path) -> None:
    part = '<mujocoinclude>\n<body><joint/><geom size="0.1" mass="nan"/></body></mujocoinclude>'
    path = saved(tmp_path, 'part.xml', part)
    with pytest.raises(InputError) as caught:
        imported(saved(tmp_path, 'it.xml', mjcf(more='<include file="part.xml"/>')))
    assert str(caught.value).startswith(f'{path}:2: geom: mass: not a finite number')


def test_nan_that_moves_nothing_is_listed(tmp_path: Path) -> None:
    head = '<custom><numeric name="x" data="nan"/></custom>'
    text = imported(saved(tmp_path, 'it.xml', mjcf('nan', head=head)))
    assert "XML contains a 'NaN'" in text
