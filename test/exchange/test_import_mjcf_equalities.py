"""Welds of an imported MJCF against MuJoCo's own motion, with constraints that hardly yield."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 1e-4, 0.2
SOFT = 1e-6  # rad by which MuJoCo's weld yields within this time
WELDS = {
    'plain': ('', 'weld'),
    'at an anchor': ('anchor="0.1 0 0.05"', 'weld'),
    'without torque': ('torquescale="0"', 'spherical'),
    'without torque, at an anchor': ('torquescale="0" anchor="0.1 0 0.05"', 'spherical'),
    'without torque, as drawn': ('torquescale="0" relpose="0.3 0 0 0.9 0.1 0 0"', 'spherical'),
    'a little torque': ('torquescale="0.5"', 'weld'),
}


def two_bodies(weld: str, ends: str = 'body1="b1" body2="b2"') -> str:
    """A pendulum, and a free body that a weld holds at its end."""
    return f"""<mujoco model="pair"><option timestep="{STEP}" integrator="RK4">
<flag contact="disable"/></option><worldbody>
<body name="b1"><joint name="pin" axis="0 1 0"/>
 <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/><site name="s1" pos="0.3 0 0"/></body>
<body name="b2" pos="0.3 0 0"><freejoint name="free"/><site name="s2"/>
 <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0.1 0"/></body></worldbody>
<equality><weld name="held" {ends} solref="0.0006 1" solimp="0.9999 0.9999 0.001 0.5 2" {weld}/>
</equality></mujoco>"""


def angle(source: str) -> float:
    """Of the pendulum after the motion, rad, by MuJoCo itself."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    return float(data.joint('pin').qpos[0])


@pytest.mark.parametrize(('weld', 'kind'), WELDS.values(), ids=WELDS)
def test_a_weld_like_mujoco(weld: str, kind: str, tmp_path: Path) -> None:
    """At its anchor, if it has one; without torque it is a ball there."""
    check(two_bodies(weld), kind, tmp_path)


@pytest.mark.parametrize(('weld', 'kind'), [('', 'weld'), ('torquescale="0"', 'spherical')])
def test_a_weld_of_sites_like_mujoco(weld: str, kind: str, tmp_path: Path) -> None:
    check(two_bodies(weld, 'site1="s1" site2="s2"'), kind, tmp_path)


def check(source: str, kind: str, folder: Path) -> None:
    text = imported(saved(folder, 'it.xml', source), scene=True)
    assert f'held: {{type: {kind}, ' in text
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    found = simulation.sample().joints['pin'].position
    assert found == pytest.approx(angle(source), abs=SOFT)


def test_an_anchor_that_is_elsewhere_moves_the_bodies_there(tmp_path: Path) -> None:
    """`relpose` places it on the first body. Without a joint that reaches it, it is refused."""
    source = two_bodies('anchor="0.1 0 0" relpose="0.3 0 0 1 0 0 0"')
    sample = simulate(imported(saved(tmp_path, 'it.xml', source), scene=True)).sample()
    assert sample.diagnostics.position_violation < 1e-12
    fixed = source.replace('<freejoint name="free"/>', '')
    message = 'held cannot be closed: 0.*m stay open, from 60 starts'
    with pytest.raises(InputError, match=message):
        imported(saved(tmp_path, 'it.xml', fixed))
    with pytest.raises(InputError, match=r'all joints are held, and 0.106 m stay open'):
        imported(saved(tmp_path, 'it.xml', fixed), positions={'pin': 0.2})


def test_bodies_that_closing_moves_are_told(tmp_path: Path) -> None:
    """A keyframe with the numbers of the report is closed as drawn. Bodies that stay are not
    told."""
    source = two_bodies('anchor="0.1 0 0" relpose="0.3 0.1 0 0.9 0.2 0 0"')
    lines = imported(saved(tmp_path, 'it.xml', source)).splitlines()
    found = next(line for line in lines if line.startswith('#   qpos of bodies: '))
    name, numbers = found.rsplit(': ', 1)[1].split(' at ')
    assert name == 'free' and len(numbers.split()) == 7
    angles = [line for line in lines if line.startswith('#   zero of joints: ')]
    pin = float(angles[0].rsplit(' at ', 1)[1]) if angles else 0.0
    key = f'<keyframe><key qpos="{pin!r} {numbers}"/></keyframe></mujoco>'
    again = imported(
        saved(tmp_path, 'it.xml', source.replace('</mujoco>', key)), key='0', scene=True
    )
    assert 'posture: ' not in again and 'qpos of bodies' not in again
    assert simulate(again).sample().diagnostics.position_violation < 1e-12


def test_couplings_that_only_limits_keep_open_are_refused_with_this_reason(tmp_path: Path) -> None:
    """Both give b = 1 - a and b = a: a = b = 0.5, beyond the limit 0.4 of b. The gap is least
    where both are off by 0.1 of a: a = 0.5, b = 0.4."""
    part = '<body><joint name="{}" axis="0 1 0" {}/><geom size="0.1" pos="0.2 0 0"/></body>'
    limited = part.format('b', 'limited="true" range="-1 0.4"')
    source = f"""<mujoco><compiler angle="radian"/><worldbody>{part.format('a', '')}{limited}
</worldbody><equality><joint name="one" joint1="b" joint2="a" polycoef="1 -1 0 0 0"/>
<joint name="two" joint1="b" joint2="a" polycoef="0 1 0 0 0"/></equality></mujoco>"""
    message = 'one, two cannot be closed: .* beyond the limits of the joints they close; expected'
    with pytest.raises(InputError, match=message):
        imported(saved(tmp_path, 'it.xml', source))
    wider = imported(saved(tmp_path, 'it.xml', source.replace('1 0.4"', '1 0.6"')))
    assert 'a at 0.5, b at 0.5' in wider


def test_an_equality_inside_one_body_holds_nothing(tmp_path: Path) -> None:
    """As in MuJoCo: of two bodies of the ground, and of bodies that are fixed to each other."""
    source = """<mujoco><worldbody><body name="post"><geom size="0.1"/></body>
<body name="arm"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>
<body name="tool"><geom size="0.1"/></body></body></worldbody><equality>
<weld name="one" body1="post" relpose="1 0 0 1 0 0 0"/>
<connect name="two" body1="arm" body2="tool" anchor="0 0 1"/>
</equality></mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    told = 'equality {} inside one body, or the ground'
    assert f'#   elements: {told.format("one")}, {told.format("two")}\n' in text
    simulation = simulate(text)
    simulation.step(10)
    assert abs(simulation.sample().joint_positions[0]) > 1e-4
