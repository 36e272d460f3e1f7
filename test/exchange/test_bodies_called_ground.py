"""A body of a file may be called as the ground of alf_ros: it moves as with another name."""

from __future__ import annotations

from pathlib import Path

import pytest

import support.imported_robots as robots
from alf_ros import InputError
from alf_ros.exchange.import_file import imported
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
