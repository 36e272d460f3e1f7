"""`<gazebo><link>` in a URDF: a link of SDF, held by joints of extensions, as in hands of PR2."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import InputError, Simulation
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

CRANK, COUPLER, ROCKER = robots.four_bar_angles()  # rad
MASS = robots.DENSITY * robots.COUPLER
INERTIA = MASS * robots.COUPLER**2 / 12.0
PIN = (robots.CRANK * math.cos(CRANK), robots.CRANK * math.sin(CRANK))
IN_TREE = robots.four_bar(robots.BY_GAZEBO)
KNEE = """<gazebo><joint name="knee" type="revolute"><parent>crank</parent>
<child>coupler</child><axis><xyz>0 -1 0</xyz></axis></joint></gazebo>"""
# its inertia is in a frame that is turned about z
ADDED = f"""<gazebo><link name="coupler">
<pose>{PIN[0]!r} 0 {PIN[1]!r} 0 {-COUPLER!r} 0</pose><inertial>
<mass>{MASS!r}</mass><pose>{robots.COUPLER / 2.0} 0 0 0 0 {math.pi / 2.0!r}</pose>
<inertia><ixx>{INERTIA!r}</ixx><iyy>0</iyy><izz>{INERTIA!r}</izz></inertia></inertial>
<gravity>true</gravity></link></gazebo>"""
IN_GAZEBO = robots.robot(
    ADDED,
    '<link name="base"/>',
    robots.rod('crank', robots.CRANK, robots.DENSITY * robots.CRANK),
    robots.rod('rocker', robots.ROCKER, robots.DENSITY * robots.ROCKER),
    robots.hinge('crank_pin', 'base', 'crank', 0.0, CRANK),
    robots.hinge('rocker_pin', 'base', 'rocker', robots.GROUND, ROCKER),
    KNEE,
    robots.BY_GAZEBO,
)


def moved(folder: Path, urdf: str) -> dict[str, tuple[float, float]]:
    scene = scene_from_text(imported(saved(folder, 'it.urdf', urdf), scene=True))
    simulation = Simulation(scene, step=1e-3, integrator='rk4')
    simulation.step(400)
    found = simulation.sample().joints
    names = ('crank_pin', 'wrist', 'rocker_pin')
    return {name: (found[name].position, found[name].velocity) for name in names}


def test_it_moves_as_a_link_of_the_tree(tmp_path: Path) -> None:
    expected, found = moved(tmp_path, IN_TREE), moved(tmp_path, IN_GAZEBO)
    assert abs(expected['crank_pin'][1]) > 1.0
    for name in expected:
        np.testing.assert_allclose(found[name], expected[name], atol=1e-9)


def test_gravity_of_it_and_defaults_are_told(tmp_path: Path) -> None:
    text = imported(
        saved(tmp_path, 'it.urdf', IN_GAZEBO.replace('<gravity>true', '<gravity>false'))
    )
    assert (
        '#   compensation of gravity (see --scene): these bodies have their whole weight: coupler'
        in text
    )
    bare = re.sub('<mass>.*</mass>', '', IN_GAZEBO)
    told = (
        '#   mass: default of SDF: a link without a mass has 1 kg and 1 kg m2 about every axis: '
    )
    assert f'{told}coupler\n' in imported(saved(tmp_path, 'it.urdf', bare))


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('<link name="coupler">', '<link>', 'link: it has no name'),
        ('<pose>', '<pose>0 ', 'coupler: not usable numbers, got '),
        ('<pose>', '<pose>nan ', 'coupler: not usable numbers, got '),
        ('<pose>', '<pose relative_to="crank">', 'coupler: no frame for relative_to'),
        ('<mass>', '<mass>one', 'coupler: not usable numbers, got '),
        ('<link name="coupler">', '<link name="crank">', 'crank: a name of two links'),
    ],
)
def test_a_mistake_in_it_has_its_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.urdf', IN_GAZEBO.replace(old, new, 1))
    lines = Path(path).read_text('utf-8').splitlines()
    with pytest.raises(InputError) as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}:')
    line, _, told = str(caught.value).removeprefix(f'{path}:').partition(': ')
    assert told.startswith(message) and new in lines[int(line) - 1]


@pytest.mark.parametrize('alone', [False, True])
def test_it_hangs_from_the_root_that_there_is(alone: bool, tmp_path: Path) -> None:
    """From a `world` that is no link of the file; without another link it is the robot, and
    floats where it may."""
    others = robots.rod('bar', 1.0, 1.0), robots.hinge('pin', 'world', 'bar', 0.0, 0.0)
    urdf = robots.robot(ADDED) if alone else robots.robot(*others, ADDED)
    text = imported(saved(tmp_path, 'it.urdf', urdf), floating=alone)
    assert '\n  coupler:' in text and 'several root links' not in text
