"""Long chains, and elements deep inside others, which readers must not call themselves for."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved

MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
LINK = f'<link name="%s">{MASS}</inertial></link>'
HINGE = """<joint name="%s" type="continuous"><parent link="base"/><child link="%s"/>
<origin xyz="0 0 %s"/><axis xyz="0 1 0"/>%s</joint>"""
LONG = 1100  # more than the calls that Python allows


def test_a_long_chain_of_frames(tmp_path: Path) -> None:
    """Each is attached to the next one of the file."""
    frames = ''.join(
        f'<frame name="f{n}" attached_to="f{n + 1}"><pose>0 0 {1 / 1024} 0 0 0</pose></frame>'
        for n in range(LONG)
    )
    sdf = f"""<sdf version="1.9"><model name="m"><link name="arm"><pose relative_to="f0"/></link>
<frame name="f{LONG}"/>{frames}<joint name="pin" type="revolute"><parent>world</parent>
<child>arm</child></joint></model></sdf>"""
    assert f'pin_at: {{at: [0.0, 0.0, {LONG / 1024}]' in imported(saved(tmp_path, 'it.sdf', sdf))
    ring = sdf.replace(f'<frame name="f{LONG}"/>', f'<frame name="f{LONG}" attached_to="f0"/>')
    with pytest.raises(InputError, match=r'it\.sdf:2: f0: its pose is relative to itself'):
        imported(saved(tmp_path, 'it.sdf', ring))


@pytest.mark.thorough
def test_a_long_chain_of_mimics(tmp_path: Path) -> None:
    """Each joint is where the next one is, and a bit further; the last one leads."""
    parts = [LINK.replace('%s', f'l{n}') for n in range(LONG)]
    follows = '<mimic joint="j%d" offset="0.001"/>'
    parts += [
        HINGE % (f'j{n}', f'l{n}', n, follows % (n + 1) if n + 1 < LONG else '')
        for n in range(LONG)
    ]
    urdf = f'<robot name="r"><link name="base"/>{"".join(parts)}</robot>'
    text = imported(saved(tmp_path, 'it.urdf', urdf), positions={f'j{LONG - 1}': 0.5})
    assert f'j0 at {0.5 + (LONG - 1) / 1000:.12g}' in text


DEEP = {
    'it.urdf': f'<robot name="r">\n<link name="a">{"<x>" * 2000}{"</x>" * 2000}</link></robot>',
    'models.sdf': f'<sdf version="1.9">\n{"<model>" * 2000}{"</model>" * 2000}</sdf>',
    'few_models.sdf': '<sdf version="1.9">\n'
    + '<model name="a">' * 50
    + '<link name="a"/>'
    + '</model>' * 50
    + '</sdf>',
}


@pytest.mark.parametrize('name', DEEP)
def test_elements_too_deep_inside_others(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf'{name}:2: \w+: .*inside more than (200|40) others'):
        imported(saved(tmp_path, name, DEEP[name]))


def test_what_a_cdata_section_says_is_no_comment(tmp_path: Path) -> None:
    """A robot between two such sections was taken for a comment."""
    parts = f'<link name="base"/>{LINK % "l"}{HINGE % ("j", "l", 0.5, "")}'
    urdf = f"""<robot name="r"><gazebo><![CDATA[ <!-- ]]></gazebo>{parts}
<gazebo><![CDATA[ --> ]]></gazebo><!-- <![CDATA[ --></robot>"""
    plain = f'<robot name="r"><gazebo/>{parts}\n<gazebo/></robot>'
    found, expected = (imported(saved(tmp_path, 'it.urdf', each)) for each in (urdf, plain))
    assert found == expected
