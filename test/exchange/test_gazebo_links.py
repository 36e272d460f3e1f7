"""`<gazebo><link>` in a URDF: a link of SDF, held by joints of extensions, as in hands of PR2."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError, Simulation
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

BAR = (
    '<link name="{}"><inertial><origin xyz="0.1 0 0" rpy="0 0 0.3"/><mass value="{}"/>'
    '<inertia ixx="1e-4" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
HINGE = (
    '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/>'
    '<origin xyz="{}" rpy="{}"/><axis xyz="0 0 1"/></joint>'
)
# a crank upright, 0.1 m; a coupler of 0.4 m from its end to C, level; a rocker upright, 0.1 m
TREE = (
    '<robot name="four_bar"><link name="base"/>'
    + BAR.format('crank', 0.2)
    + BAR.format('rocker', 0.4)
    + HINGE.format('O', 'base', 'crank', '0 0 0', '0 0 1.5707963267948966')
    + HINGE.format('C', 'base', 'rocker', '0.4 0 0', '0 0 1.5707963267948966')
    + '{}</robot>'
)
LOOP = (
    '<gazebo><joint name="{}" type="revolute"><parent>{}</parent><child>coupler</child>'
    '<pose>{} 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint></gazebo>'
)
IN_TREE = TREE.format(
    BAR.format('coupler', 0.3)
    + HINGE.format('A', 'crank', 'coupler', '0.1 0 0', '0 0 -1.5707963267948966')
    + LOOP.format('B', 'rocker', 0.4)
)
ADDED = """<gazebo><link name="coupler"><pose>0 0.1 0 0 0 0</pose><inertial><mass>0.3</mass>
<pose>0.1 0 0 0 0 0.3</pose><inertia><ixx>1e-4</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia>
</inertial><gravity>{}</gravity></link></gazebo>"""
IN_GAZEBO = TREE.format(ADDED + LOOP.format('A', 'crank', 0) + LOOP.format('B', 'rocker', 0.4))


def moved(folder: Path, urdf: str) -> dict[str, tuple[float, float]]:
    scene = scene_from_text(imported(saved(folder, 'it.urdf', urdf), scene=True))
    # gravity acts across the drawing, which is level
    simulation = Simulation(scene, step=1e-3, integrator='rk4')
    simulation.apply_effort('O', 0.2)
    simulation.step(400)
    found = simulation.sample().joints
    return {name: (found[name].position, found[name].velocity) for name in ('O', 'B', 'C')}


def test_it_moves_as_a_link_of_the_tree(tmp_path: Path) -> None:
    expected, found = moved(tmp_path, IN_TREE), moved(tmp_path, IN_GAZEBO.format('true'))
    assert abs(expected['O'][0]) > 1.0
    for name in expected:
        np.testing.assert_allclose(found[name], expected[name], atol=1e-9)


def test_gravity_of_it_and_defaults_are_told(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.urdf', IN_GAZEBO.format('false')))
    assert (
        '#   compensation of gravity (see --scene): these bodies have their whole weight: coupler'
        in text
    )
    bare = IN_GAZEBO.format('true').replace('<mass>0.3</mass>', '')
    told = (
        '#   mass: default of SDF: a link without a mass has 1 kg and 1 kg m2 about every axis: '
    )
    assert f'{told}coupler\n' in imported(saved(tmp_path, 'it.urdf', bare))


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('<link name="coupler">', '<link>', 'link: it has no name'),
        ('<pose>0 0.1 0 0 0 0', '<pose>0 0.1 0', "coupler: not usable numbers, got '0 0.1 0'"),
        ('<pose>0 0.1', '<pose relative_to="crank">0 0.1', 'coupler: no frame for relative_to'),
        ('<link name="coupler">', '<link name="crank">', 'crank: a name of two links'),
    ],
)
def test_a_mistake_in_it_has_its_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    urdf = '\n' + IN_GAZEBO.format('true').replace(old, new, 1)
    path = saved(tmp_path, 'it.urdf', urdf)
    with pytest.raises(InputError) as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}:2: {message}')
