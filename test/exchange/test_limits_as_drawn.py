"""Joints and tendons that are drawn beyond a limit: with --stops the report names them."""

from __future__ import annotations

from pathlib import Path

import pytest

import support.imported_robots as robots
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

TOLD = (
    '#   limits as drawn: these are drawn beyond a limit, and its stop throws them back at the '
    'start'
)
URDF = robots.robot(
    '<link name="base"/>',
    robots.rod('arm', 0.4, 1.0),
    robots.hinge('pin', 'base', 'arm', 0.0, 0.0, kind='revolute').replace(
        '</joint>', '<limit lower="0.3" upper="1.2" effort="1" velocity="1"/></joint>'
    ),
)
SDF = """<sdf version="1.9"><model name="m"><link name="arm"/><joint name="pin" type="revolute">
<parent>world</parent><child>arm</child><axis><limit><lower>-2</lower><upper>-0.25</upper></limit>
</axis></joint></model></sdf>"""
MJCF = """<mujoco><worldbody><body><joint name="pin" axis="0 1 0" range="5 90"/>
<geom size="0.1" pos="0.3 0 0"/></body></worldbody><tendon><fixed name="cord" range="-1 -0.5">
<joint joint="pin" coef="2"/></fixed></tendon></mujoco>"""


@pytest.mark.parametrize(
    ('name', 'text', 'positions', 'told'),
    [
        ('it.urdf', URDF, {}, ['pin is at 0, its limit is 0.3']),
        ('it.urdf', URDF, {'pin': 1.5}, ['pin is at 1.5, its limit is 1.2']),
        ('it.urdf', URDF, {'pin': 0.3}, []),
        ('it.urdf', URDF, {'pin': 0.8}, []),
        ('it.sdf', SDF, {}, ['pin is at 0, its limit is -0.25']),
        ('it.xml', MJCF, {},
         ['pin is at 0, its limit is 0.0872665', 'cord is at 0, its limit is -0.5']),
        ('it.xml', MJCF, {'pin': 0.1}, ['cord is at 0.2, its limit is -0.5']),
        ('it.xml', MJCF.replace('range', 'margin="0.125" range'), {'pin': 1.5},
         ['pin is at 1.5, its limit is 1.4458', 'cord is at 3, its limit is -0.625']),
    ],
)  # fmt: skip
def test_each_is_named_with_its_limit(
    name: str, text: str, positions: dict[str, float], told: list[str], tmp_path: Path
) -> None:
    source = saved(tmp_path, name, text)
    made = imported(source, stops=1e3, positions=positions)
    lines = [line for line in made.splitlines() if 'limits as drawn' in line]
    assert lines == ([f'{TOLD}: {", ".join(told)}'] if told else [])
    assert 'limits as drawn' not in imported(source, scene=True, positions=positions)


def test_the_stop_throws_it_back(tmp_path: Path) -> None:
    """Without weight and losses the energy of the stop, k d^2.5 / 2.5, moves the rod."""
    depth, k = 0.3, 100.0
    text = imported(saved(tmp_path, 'it.urdf', URDF), stops=k)
    weightless = text.replace('[0.0, 0.0, -9.81]', '[0.0, 0.0, 0.0]')
    assert weightless != text
    simulation = simulate(weightless)
    simulation.step(60)
    pin = simulation.sample().joints['pin']
    assert 0.3 < pin.position < 1.2
    speed = (2.0 * k * depth**2.5 / 2.5 / (0.4**2 / 3.0)) ** 0.5
    assert pin.velocity == pytest.approx(speed, rel=1e-6)
