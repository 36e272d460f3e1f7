"""Files that an included model names are beside the file of this model."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros.exchange.import_file import imported
from support.imported_motions import saved

AROUND = """<sdf version="1.9"><model name="m"><include{merge}><uri>../models/arm</uri></include>
</model></sdf>"""
ARM = """<sdf version="1.9"><model name="arm"><link name="a"><inertial><mass>1</mass></inertial>
<visual name="v"><geometry><mesh><uri>meshes/a.stl</uri></mesh></geometry></visual></link>
<include><uri>parts/tip.sdf</uri></include>
<joint name="j" type="revolute"><parent>world</parent><child>a</child></joint>
<joint name="k" type="revolute"><parent>a</parent><child>tip::t</child></joint></model></sdf>"""
TIP = """<sdf version="1.9"><model name="tip"><link name="t"><inertial><mass>2</mass></inertial>
</link></model></sdf>"""


@pytest.mark.parametrize('merge', ['', ' merge="true"'])
def test_paths_of_an_included_model_are_relative_to_its_file(merge: str, tmp_path: Path) -> None:
    arm, world = tmp_path / 'models' / 'arm', tmp_path / 'worlds'
    (arm / 'parts').mkdir(parents=True)
    world.mkdir()
    saved(arm, 'model.sdf', ARM)
    saved(arm / 'parts', 'tip.sdf', TIP)
    text = imported(saved(world, 'it.sdf', AROUND.format(merge=merge)))
    assert 'includes' not in text
    assert 'mass: 2' in text
    assert f'mesh: {{file: {arm / "meshes" / "a.stl"}' in text
