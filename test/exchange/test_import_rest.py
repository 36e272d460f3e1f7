"""Imported joints that come to rest: by dry friction as far as it lets them, and on stops where
the forces balance."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.optimize import brentq

from alf_ros import Simulation, equilibrium
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.thorough import thinned

G, M, L, J = 9.81, 2.0, 0.3, 0.05  # J about the centre of mass
SLIP = 1e-2  # of imported dry friction, rad/s or m/s
HOLD = 0.4  # N m or N, of dry friction
STOPS = 1e4  # N m/rad^1.5 or N/m^1.5


def urdf(kind: str, axis: str, more: str) -> str:
    """Of a bar of which the joint is an end, along x."""
    return f"""<robot name="it"><link name="base"/><link name="bar"><inertial>
<origin xyz="{L} 0 0"/><mass value="{M}"/>
<inertia ixx="0.01" iyy="{J}" izz="{J}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="{kind}"><parent link="base"/><child link="bar"/><axis xyz="{axis}"/>{more}
</joint></robot>"""


def mjcf(kind: str, axis: str, more: str) -> str:
    return f"""<mujoco model="it"><compiler angle="radian"/><option gravity="0 0 {-G}"/><worldbody>
<body name="bar"><joint name="j" type="{kind}" axis="{axis}" {more}/>
<inertial pos="{L} 0 0" mass="{M}" diaginertia="0.01 {J} {J}"/></body></worldbody></mujoco>"""


RUBBED = {
    'hinge.urdf': (urdf('continuous', '0 0 1', f'<dynamics friction="{HOLD}"/>'), J + M * L**2),
    'hinge.xml': (mjcf('hinge', '0 0 1', f'frictionloss="{HOLD}"'), J + M * L**2),
    'slide.urdf': (
        urdf(
            'prismatic',
            '1 0 0',
            f'<limit lower="-9" upper="9" effort="0" velocity="9"/><dynamics friction="{HOLD}"/>',
        ),
        M,
    ),
    'slide.xml': (mjcf('slide', '1 0 0', f'frictionloss="{HOLD}"'), M),
}


@pytest.mark.parametrize('name', RUBBED)
def test_dry_friction_stops_a_joint(name: str, tmp_path: Path) -> None:
    """Pushed to ω it turns by I ω² / 2 τ, and a little less as friction fades at the end: the law
    I ω dω / dφ = -τ ω / √(ω² + ε²). With the solver that comes with the scene."""
    source, inertia = RUBBED[name]
    if name.endswith('.xml'):
        pytest.importorskip('mujoco')
    sim = Simulation(scene_from_text(imported(saved(tmp_path, name, source), scene=True)))
    sim.apply_effort('j', 3.0)
    sim.step(200)
    sim.clear_inputs()
    joint = sim.sample().joints['j']
    v = joint.velocity
    sim.step(round(1e3 * (inertia * (v + 20.0 * SLIP) / HOLD)))
    after = sim.sample().joints['j']
    whole = v * math.hypot(v, SLIP) + SLIP**2 * math.asinh(v / SLIP)
    assert after.position - joint.position == pytest.approx(inertia * whole / (2 * HOLD), abs=1e-7)
    assert after.position - joint.position == pytest.approx(inertia * v**2 / (2 * HOLD), rel=1e-2)
    assert abs(after.velocity) < 1e-3


UP = 0.5  # rad or m, of the stop
LIMITED = {
    'hinge.urdf': urdf(
        'revolute',
        '0 1 0',
        f'<limit lower="-1" upper="{UP}" effort="0" velocity="9"/><dynamics damping="6"/>',
    ),
    'hinge.xml': mjcf('hinge', '0 1 0', f'limited="true" range="-1 {UP}" damping="6"'),
    'slide.urdf': urdf(
        'prismatic',
        '0 0 -1',
        f'<limit lower="-1" upper="{UP}" effort="0" velocity="9"/><dynamics damping="60"/>',
    ),
    'slide.xml': mjcf('slide', '0 0 -1', f'limited="true" range="-1 {UP}" damping="60"'),
}


@pytest.mark.parametrize('name', thinned(LIMITED, keep=['hinge.urdf', 'slide.xml']))
def test_a_stop_carries_the_weight(name: str, tmp_path: Path) -> None:
    """k δ^1.5 is m g, or of a hinge m g l cos(UP + δ)."""
    if name.endswith('.xml'):
        pytest.importorskip('mujoco')
    text = imported(saved(tmp_path, name, LIMITED[name]), scene=True, stops=STOPS)
    is_hinge = name.startswith('hinge')

    def missing(depth: float) -> float:
        load = M * G * (L * math.cos(UP + depth) if is_hinge else 1.0)
        return load - STOPS * depth**1.5

    depth = brentq(missing, 0.0, 0.1, xtol=1e-16)
    assert depth > 5e-3
    scene = scene_from_text(text)
    rest = equilibrium(scene)
    assert rest.joints['j'].position == pytest.approx(UP + depth, abs=1e-12)
    assert rest.notes == ('joint_stop.j: a stop carries load here',)
    sim = Simulation(scene)
    sim.step(3000)
    joint = sim.sample().joints['j']
    assert joint.position == pytest.approx(UP + depth, abs=1e-7)
    assert abs(joint.velocity) < 1e-6
