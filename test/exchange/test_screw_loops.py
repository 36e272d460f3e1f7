"""Screws of Gazebo that close loops of a URDF: a spindle that turns, and a nut that slides."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

INERTIA, MASS, PITCH = 0.02, 3.0, 0.7  # kg m^2, kg, m per turn
LEAD = PITCH / (2.0 * math.pi)  # m/rad
LINK = """<link name="{0}"><inertial><origin xyz="0.1 0 0.2"/><mass value="{1}"/><inertia
 ixx="{2}" ixy="0" ixz="0" iyy="{2}" iyz="0" izz="{2}"/></inertial></link>"""
SCREW = """<gazebo><joint name="thread" type="screw"><parent>{}</parent><child>{}</child>
<pose>0 0 0.1 0 0 0</pose><axis><xyz>0 0 1</xyz></axis>{}</joint></gazebo>"""
TOLD = f'<screw_thread_pitch>{PITCH}</screw_thread_pitch>'
OLD = f'<thread_pitch>{-1.0 / LEAD}</thread_pitch>'  # -rad/m


def robot(ends: tuple[str, str] = ('spindle', 'nut'), pitch: str = TOLD) -> str:
    """The axes of all joints are upright, and the spindle turns about its centre of mass."""
    return f"""<robot name="jack"><link name="base"/>
{LINK.format('spindle', 1, INERTIA).replace('0.1 0 0.2', '0 0 0.2')}{LINK.format('nut', MASS, 0.1)}
<joint name="turn" type="continuous"><parent link="base"/><child link="spindle"/>
<origin xyz="0.2 0.1 0"/><axis xyz="0 0 1"/></joint>
<joint name="rise" type="prismatic"><parent link="base"/><child link="nut"/>
<origin xyz="0.2 0.1 0.3"/><axis xyz="0 0 1"/><limit lower="-5" upper="5" effort="0" velocity="0"/>
</joint>{SCREW.format(*ends, pitch)}</robot>"""


@pytest.mark.parametrize('pitch', [TOLD, OLD])
@pytest.mark.parametrize('ends', [('spindle', 'nut'), ('nut', 'spindle')])
@pytest.mark.parametrize('positions', [{}, {'turn': 2.5}, {'rise': 1.9}])
def test_a_nut_on_a_spindle(
    positions: dict[str, float], ends: tuple[str, str], pitch: str, tmp_path: Path
) -> None:
    """It rises by a lead for each turn back, falls with the inertia of the spindle, and is the
    same wherever --set has it."""
    source = saved(tmp_path, 'it.urdf', robot(ends, pitch))
    text = imported(source, scene=True, positions=positions)
    assert 'joints of unknown type' not in text
    if positions:
        drawn = {name: float(x) for name, x in re.findall(r'(turn|rise) at ([-.\de]+)', text)}
        turns = (drawn['rise'] + LEAD * drawn['turn']) / PITCH
        assert turns == pytest.approx(round(turns), abs=1e-9)
    simulation = simulate(text)
    simulation.step(500)
    found = simulation.sample().joints
    fallen = -0.5 * 9.81 * MASS / (MASS + INERTIA / LEAD**2) * 0.5**2
    assert found['rise'].position == pytest.approx(fallen, rel=1e-9)
    assert found['turn'].position == pytest.approx(-fallen / LEAD, rel=1e-9)
    # of the child against the parent, about the axis
    sign = 1.0 if ends == ('spindle', 'nut') else -1.0
    assert found['thread'].position == pytest.approx(sign * fallen / LEAD, rel=1e-9)


def test_a_screw_without_a_pitch_has_the_default_of_sdf(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.urdf', robot(pitch='')))
    assert 'pitch of screws: default of SDF' in text and 'pitch: 1.0' in text


def test_a_thread_without_pitch_is_refused(tmp_path: Path) -> None:
    for none in ('<thread_pitch>0</thread_pitch>', '<screw_thread_pitch>0</screw_thread_pitch>'):
        with pytest.raises(InputError, match='thread: a thread without pitch'):
            imported(saved(tmp_path, 'it.urdf', robot(pitch=none)))


def test_places_that_no_turn_closes_are_refused(tmp_path: Path) -> None:
    held = {'turn': 1.0, 'rise': 0.1}
    with pytest.raises(InputError, match='thread cannot be closed: all joints are held'):
        imported(saved(tmp_path, 'it.urdf', robot()), positions=held)
