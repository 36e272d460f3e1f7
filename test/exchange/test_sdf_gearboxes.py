"""Gearboxes of SDF: a pendulum that turns a wheel, against the equation of motion."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

ARM, WHEEL, MASS, REACH = 0.2, 0.05, 2.0, 0.3  # kg m^2, kg, m
LINK = """<link name="{}"><pose>{}</pose><inertial><pose>{} 0 0 0 0 0</pose><mass>2</mass>
<inertia><ixx>{I}</ixx><iyy>{I}</iyy><izz>{I}</izz></inertia></inertial></link>"""
HINGE = """<joint name="{}" type="revolute">{}<parent>{}</parent><child>{}</child>
<axis><xyz>0 {} 0</xyz></axis></joint>"""
GEARS = """<joint name="gears" type="gearbox"><parent>arm</parent><child>wheel</child>
<gearbox_ratio>{}</gearbox_ratio><gearbox_reference_body>{}</gearbox_reference_body>
<axis><xyz>0 1 0</xyz></axis><axis2><xyz>{}</xyz></axis2></joint>"""
PLACED = '<pose relative_to="wheel"/>'


def robot(ratio: float, turned: bool, axis: str = '0 1 0', body: str = 'base') -> str:
    """An arm on a base, and a wheel; turned: the base is the child of the hinge of the wheel."""
    ends = ('wheel', 'base') if turned else ('base', 'wheel')
    return f"""<sdf version="1.11"><model name="m">{LINK.format('base', '', '0', I=1)}
    {LINK.format('arm', '', REACH, I=ARM)}{LINK.format('wheel', '0 0.1 1 0 0 0', '0', I=WHEEL)}
    <joint name="held" type="fixed"><parent>world</parent><child>base</child></joint>
    {HINGE.format('swing', '', 'base', 'arm', 1)}
    {HINGE.format('turn', PLACED, *ends, -1 if turned else 1)}
    {GEARS.format(ratio, body, axis)}</model></sdf>"""


@pytest.mark.parametrize('turned', [False, True])
@pytest.mark.parametrize(('axis', 'sign'), [('0 1 0', 1.0), ('0 -2 0', -1.0)])
@pytest.mark.parametrize('ratio', [-3.0, 0.5])
def test_it_turns_with_its_ratio(
    ratio: float, axis: str, sign: float, turned: bool, tmp_path: Path
) -> None:
    text = imported(saved(tmp_path, 'it.sdf', robot(ratio, turned, axis)), scene=True)
    assert 'Changes of the motion' not in text
    simulation = simulate(text)
    simulation.step(1)
    inertia = ARM + MASS * REACH**2 + ratio**2 * WHEEL
    swing = simulation.sample().joints['swing'].velocity
    assert swing == pytest.approx(1e-3 * MASS * 9.8 * REACH / inertia, rel=1e-4)
    simulation.step(500)
    joints = simulation.sample().joints
    assert abs(joints['swing'].position) > 0.5
    # the hinge that is turned round has the opposite axis, so its coordinate is the same
    expected = -ratio * joints['swing'].position * sign
    assert joints['turn'].position == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(('held', 'free'), [('swing', 'turn'), ('turn', 'swing')])
def test_it_holds_the_other_hinge_of_a_part_that_is_fixed(
    held: str, free: str, tmp_path: Path
) -> None:
    text = robot(2.0, False).replace(f'"{held}" type="revolute"', f'"{held}" type="fixed"')
    found = imported(saved(tmp_path, 'it.sdf', text), scene=True)
    assert 'gearboxes' not in found
    assert f'{{joints: {{{free}: ' in found
    simulation = simulate(found)
    simulation.step(100)
    assert simulation.sample().joints[free].position == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(('axis', 'body'), [('1 0 0', 'base'), ('0 1 0', 'arm'), ('0 1 0', '')])
def test_what_has_no_such_hinges_is_listed(axis: str, body: str, tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.sdf', robot(2.0, False, axis, body)), scene=True)
    assert '#   gearboxes: they are omitted: ' in text
    assert 'couplings' not in text


def test_a_reference_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such frame, got 'nothing'"):
        imported(saved(tmp_path, 'it.sdf', robot(2.0, False, body='nothing')))
