"""Forces on single joints of an imported MJCF: their linear parts move as MuJoCo's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 1e-4, 0.3
DAMPED, SPRUNG = 'damping="0.02 0.05 0.1"', 'stiffness="2 1 3" springref="0.2"'


def bar(joint: str) -> str:
    return f"""<mujoco model="bar"><option timestep="{STEP}" integrator="RK4">
<flag contact="disable"/></option><worldbody><body name="b"><joint name="j" axis="0 1 0" {joint}/>
<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/></body></worldbody></mujoco>"""


def angle(model: Any) -> float:
    """After the motion, rad, by MuJoCo itself."""
    data = mujoco.MjData(model)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    return float(data.joint('j').qpos[0])


@pytest.mark.parametrize(
    ('joint', 'line'),
    [
        (
            DAMPED,
            'higher orders of damping: it is linear in the speed: the coefficients of square and '
            'cube are left out: j 0.05 and 0.1',
        ),
        (
            SPRUNG,
            'higher orders of springs: they are linear in the deflection: the coefficients of '
            'square and cube are left out: j 1 and 3',
        ),
    ],
)
def test_higher_orders_are_left_out_and_listed(joint: str, line: str, tmp_path: Path) -> None:
    """No effect on joints has them; the linear part stays, and the report says the difference."""
    source = bar(joint)
    text = imported(saved(tmp_path, 'it.xml', source), scene=True)
    assert text.split('\n')[1:3] == ['# Changes of the motion:', f'#   {line}']
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    found = simulation.sample().joints['j'].position
    model = mujoco.MjModel.from_xml_string(source)
    whole = angle(model)
    model.dof_dampingpoly[:], model.jnt_stiffnesspoly[:] = 0.0, 0.0
    assert found == pytest.approx(angle(model), abs=1e-9)
    assert abs(found - whole) > 1e-3


def test_higher_orders_of_a_ball_are_listed(tmp_path: Path) -> None:
    for joint in ('damping="0 0.1"', 'stiffness="0 0 2"'):
        source = bar(joint).replace('axis="0 1 0"', 'type="ball"')
        text = imported(saved(tmp_path, 'it.xml', source), scene=True)
        assert 'limits, damping, friction, springs, armature: these joints have none: j\n' in text
