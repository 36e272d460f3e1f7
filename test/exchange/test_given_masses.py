"""Files for viewers state no masses: with `--mass` their loops close as with real masses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from alf_ros import Closure, InputError
from alf_ros.commands.import_ import main
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import Scene, scene_from_text
from support.imported_motions import saved

BAR = '<link name="{}"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>{}</inertial></link>'
INERTIA = '<inertia ixx="1e-4" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
JOINT = (
    '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/>'
    '<origin xyz="{}"/><axis xyz="0 0 1"/></joint>'
)
FOUR_BAR = (  # a crank of 0.1 m, a coupler and a rocker of 0.3 m; O to C 0.3 m
    '<robot name="four_bar"><link name="base"/>'
    + ''.join(BAR.format(name, INERTIA) for name in ('crank', 'coupler', 'rocker'))
    + JOINT.format('O', 'base', 'crank', '0 0 0')
    + JOINT.format('A', 'crank', 'coupler', '0.1 0 0')
    + JOINT.format('C', 'base', 'rocker', '0.3 0 0')
    + '</robot>'
)
LOOP = 'loops: {B: {type: revolute, between: [end_a, end_c], axis: [0, 0, 1]}}\n'
ENDS = ''.join(
    f'<link name="{end}"/><joint name="to_{end}" type="fixed"><parent link="{bar}"/>'
    f'<child link="{end}"/><origin xyz="0.3 0 0"/></joint>'
    for end, bar in (('end_a', 'coupler'), ('end_c', 'rocker'))
)
WHOLE = FOUR_BAR.replace('</robot>', f'{ENDS}</robot>')
BARE = re.sub('<inertial>.*?</inertial>', '', WHOLE)
ASKED = {'O': 1.0}  # rad


def scene(text: str) -> Scene:
    return scene_from_text('mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n')))


def test_a_loop_without_masses_closes_as_with_them(tmp_path: Path) -> None:
    side = saved(tmp_path, 'side.yaml', LOOP)
    found = []
    for name, urdf, mass in (('whole', WHOLE, None), ('bare', BARE, 0.7)):
        text = imported(
            saved(tmp_path, f'{name}.urdf', urdf), loops=side, positions=ASKED, mass=mass
        )
        assert ('masses, given' in text) == (mass is not None)
        closed = Closure(scene(text), ['O']).close({'O': 0.2})
        found.append([closed.joints[joint] for joint in ('A', 'B', 'C')])
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)


def test_without_a_mass_it_is_refused_with_the_cure(tmp_path: Path) -> None:
    urdf, side = saved(tmp_path, 'it.urdf', BARE), saved(tmp_path, 'side.yaml', LOOP)
    with pytest.raises(InputError, match='has mass; expected mass .*or --mass KG'):
        imported(urdf, loops=side, positions=ASKED)
    with pytest.raises(InputError, match='O move no mass; expected mass .*or --mass KG'):
        imported(urdf)


def test_masses_of_the_file_count(tmp_path: Path) -> None:
    urdf = saved(tmp_path, 'it.urdf', WHOLE)
    plain, given = imported(urdf), imported(urdf, mass=0.7)
    told = [
        '# Changes of readings only:',
        '#   masses of the file: they count, and none is given: 0.7 kg',
    ]
    assert [line for line in given.splitlines() if line not in plain.splitlines()] == told


@pytest.mark.parametrize('mass', ['0', '-1'])
def test_no_mass(mass: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f'--mass: not a mass, got {float(mass)}'):
        main([saved(tmp_path, 'it.urdf', BARE), f'--mass={mass}'])
