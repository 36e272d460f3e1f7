"""Gearboxes of Gazebo in a URDF: a pendulum that turns a wheel, against the equation of motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

ARM, WHEEL, MASS, REACH, RATIO = 0.2, 0.05, 2.0, 0.3, -3.0  # kg m^2, kg, m
LINK = """<link name="{}"><inertial><origin xyz="{} 0 0"/><mass value="2"/>
<inertia ixx="{I}" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/>
<origin xyz="0 {} 0" rpy="{} 0 0"/><axis xyz="0 {} {}"/>{}</joint>"""
GEARS = """<gazebo><joint name="gears" type="gearbox"><parent>{}</parent><child>wheel</child>
<gearbox_ratio>{}</gearbox_ratio><gearbox_reference_body>{}</gearbox_reference_body>
<axis><xyz expressed_in="__model__">0 {} {}</xyz></axis>
<axis2><xyz>0 0 {}</xyz></axis2></joint></gazebo>"""


def robot(
    on: str = 'base',
    body: str = 'base',
    first: str = 'arm',
    sign: int = 1,
    along: tuple[int, int] = (1, 0),
    mimic: str = '',
) -> str:
    """An arm on a base, and a wheel on one of both, whose z is the y of the arm."""
    quarter = -1.5707963267948966
    return f"""<robot name="r"><link name="base"/>{LINK.format('arm', REACH, I=ARM)}
    {LINK.format('wheel', 0, I=WHEEL)}{HINGE.format('swing', 'base', 'arm', 0, 0, 1, 0, mimic)}
    {HINGE.format('turn', on, 'wheel', 0.1, quarter, 0, sign, '')}
    {GEARS.format(first, RATIO, body, *along, 1)}</robot>"""


@pytest.mark.parametrize('start', [0.0, 0.2])
@pytest.mark.parametrize('sign', [1, -1])
def test_it_turns_with_its_ratio(sign: int, start: float, tmp_path: Path) -> None:
    """Both angles are zero where all joints are zero, also if it is drawn elsewhere."""
    path = saved(tmp_path, 'it.urdf', robot(sign=sign))
    simulation = simulate(imported(path, scene=True, positions={'swing': start}))
    simulation.step(600)
    joints = simulation.sample().joints
    swing, turn = joints['swing'], joints['turn']
    assert swing.position > 0.5
    factor = -RATIO * sign
    assert turn.position == pytest.approx(factor * swing.position, abs=1e-12)
    inertia = ARM + MASS * REACH**2 + RATIO**2 * WHEEL
    work = -MASS * 9.81 * REACH * (_height(swing.position + start) - _height(start))
    assert 0.5 * inertia * swing.velocity**2 == pytest.approx(work, rel=1e-8)


def _height(angle: float) -> float:
    """Of the tip of the arm, per metre: it turns about y."""
    return -math.sin(angle)


def test_the_reference_body_is_a_carrier(tmp_path: Path) -> None:
    """The parent is the base, which turns back as seen from the arm, and the wheel is on it."""
    path = saved(tmp_path, 'it.urdf', robot(on='arm', body='arm', first='base'))
    simulation = simulate(imported(path, scene=True))
    simulation.step(600)
    joints = simulation.sample().joints
    swing, turn = joints['swing'], joints['turn']
    assert turn.position == pytest.approx(RATIO * swing.position, abs=1e-12)
    inertia = ARM + MASS * REACH**2 + (1.0 + RATIO) ** 2 * WHEEL
    work = -MASS * 9.81 * REACH * _height(swing.position)
    assert 0.5 * inertia * swing.velocity**2 == pytest.approx(work, rel=1e-8)


@pytest.mark.parametrize(
    'changed',
    [
        {'along': (0, 1)},
        {'body': 'arm'},
        {'body': ''},
        {'mimic': '<mimic joint="turn" multiplier="2"/>'},
    ],
)
def test_a_gearbox_without_two_free_hinges_is_listed(
    changed: dict[str, Any], tmp_path: Path
) -> None:
    text = imported(saved(tmp_path, 'it.urdf', robot(**changed)))
    assert '#   gearboxes: they are omitted: ' in text
    assert text.count('couplings') == ('mimic' in changed)


def test_a_reference_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="gears: no such link, got 'nothing'"):
        imported(saved(tmp_path, 'it.urdf', robot(body='nothing')))
