"""Forces on each axis of a universal joint of an SDF, against MuJoCo's M and bias forces.

The test states the laws of the forces independently of the package.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError, Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.thorough import combined

DAMPING, FRICTION = np.array([0.03, 0.05]), np.array([0.0, 0.08])
STIFFNESS, REST = np.array([2.0, 8.0]), np.array([-0.5, 1.2])
LOWER, UPPER = np.array([-0.1, -np.inf]), np.array([0.4, 0.3])
STOPS, SLIP = 2e2, 1e-2  # N m/rad^1.5; rad/s below which dry friction fades
DURATION = 0.8  # s

ARM = """<link name="arm"><pose>0.1 0.2 1 0 0 0</pose><inertial><pose>0.1 0.05 -0.3 0 0 0</pose>
<mass>2</mass><inertia><ixx>0.06</ixx><iyy>0.05</iyy><izz>0.04</izz></inertia></inertial></link>"""
BODY = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.8"/><worldbody>
<body name="arm" pos="0.1 0.2 1">{}<inertial pos="0.1 0.05 -0.3" mass="2"
diaginertia="0.06 0.05 0.04"/></body></worldbody></mujoco>"""
X, Y = '0.8 0.6 0', '-0.6 0.8 0'


def forces(n: int) -> str:
    """Limits and dynamics of an axis."""
    ends = ''
    if np.isfinite(LOWER[n]):
        ends += f'<lower>{LOWER[n]}</lower>'
    if np.isfinite(UPPER[n]):
        ends += f'<upper>{UPPER[n]}</upper>'
    return f"""<limit>{ends}</limit><dynamics><damping>{DAMPING[n]}</damping>
<friction>{FRICTION[n]}</friction><spring_stiffness>{STIFFNESS[n]}</spring_stiffness>
<spring_reference>{REST[n]}</spring_reference></dynamics>"""


def sdf(kind: str, parent: str, child: str) -> str:
    return f"""<sdf version="1.9"><model name="m">{ARM}<joint name="u" type="{kind}">
<pose relative_to="arm"/><parent>{parent}</parent><child>{child}</child>
<axis><xyz expressed_in="__model__">{X}</xyz>{forces(0)}</axis>
<axis2><xyz expressed_in="__model__">{Y}</xyz>{forces(1)}</axis2></joint></model></sdf>"""


def reference(order: list[int], sign: float) -> Floats:
    """Both angles at the end, of the first axis and of the second. order: the axes from the world
    to the arm; sign: of the angles against MuJoCo's."""
    axes = [(X, Y)[n] for n in order]
    hinges = ''.join(f'<joint axis="{axis}"/>' for axis in axes)
    model = mujoco.MjModel.from_xml_string(BODY.format(hinges))
    data = mujoco.MjData(model)

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[order], data.qvel[order] = sign * y[:2], sign * y[2:]
        q, v = y[:2], y[2:]
        mujoco.mj_forward(model, data)
        M = np.zeros((2, 2))
        for row, unit in zip(M, np.eye(2), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        effort = -DAMPING * v - FRICTION * v / np.sqrt(v**2 + SLIP**2) - STIFFNESS * (q - REST)
        effort += STOPS * np.maximum(LOWER - q, 0.0) ** 1.5
        effort -= STOPS * np.maximum(q - UPPER, 0.0) ** 1.5
        whole = np.zeros(2)
        whole[order] = sign * effort
        turned = np.linalg.solve(M, whole - data.qfrc_bias)
        return np.concatenate([v, sign * turned[order]])

    found = solve_ivp(
        rate, (0.0, DURATION), np.zeros(4), 'DOP853', rtol=1e-11, atol=1e-12, max_step=2e-3
    )
    assert found.y[0].min() < LOWER[0] - 1e-3
    assert found.y[1].max() > UPPER[1] + 1e-3
    return np.asarray(found.y[:2, -1])


@pytest.mark.parametrize(
    ('kind', 'moves'), combined(['universal', 'revolute2'], ['child', 'parent'])
)
def test_each_axis_has_its_forces(tmp_path: Path, kind: str, moves: str) -> None:
    """Also where the parent is what moves: the second axis is then on the ground, and comes
    first."""
    sides, order, sign = ('world', 'arm'), [0, 1], 1.0
    names = ['u_first', 'u_second']
    if moves == 'parent':
        sides, order, sign = ('arm', 'world'), [1, 0], -1.0
        names = ['u_second', 'u_first']
    text = imported(saved(tmp_path, 'it.sdf', sdf(kind, *sides)), scene=True, stops=STOPS)
    assert 'these joints have none' not in text
    assert ('the second axis of u is u_first' in text) == (moves == 'parent')
    simulation = Simulation(scene_from_text(text), integrator='dop853_adaptive', tolerance=1e-11)
    simulation.step(round(DURATION / simulation.h))
    joints = simulation.sample().joints
    found = [joints[name].position for name in names]
    assert found == pytest.approx(reference(order, sign), abs=1e-8)


def test_what_is_left_out_is_named_by_axis(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.sdf', sdf('universal', 'world', 'arm')))
    for kind, names in (
        ('damping', 'u_first, u_second'),
        ('dry friction', 'u_second'),
        ('springs', 'u_first, u_second'),
        ('limits', 'u_first, u_second'),
    ):
        assert any(
            line.startswith(f'#   {kind} (see') and line.endswith(f': {names}')
            for line in text.splitlines()
        )


def test_a_negative_damping_of_the_second_axis(tmp_path: Path) -> None:
    source = sdf('universal', 'world', 'arm').replace('<damping>0.05', '<damping>-1')
    message = 'u_second: negative damping, got -1'
    with pytest.raises(InputError, match=message):
        imported(saved(tmp_path, 'it.sdf', source), scene=True)
