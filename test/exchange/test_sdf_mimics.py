"""Mimics of the axes of universal joints of an SDF, against MuJoCo's M and bias forces."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

LINK = """<link name="{}"><pose>{} 0 0 0</pose><inertial><pose>0.1 0.05 -0.2 0 0 0</pose>
<mass>{}</mass><inertia><ixx>0.06</ixx><iyy>0.05</iyy><izz>0.04</izz></inertia></inertial></link>"""
JOINT = """<joint name="{}" type="{}">{}<parent>{}</parent><child>{}</child>{}</joint>"""
MIMIC = """<mimic joint="{}" axis="{}"><multiplier>{}</multiplier><offset>0.2</offset>
<reference>{}</reference></mimic>"""
BODY = (
    """<body pos="{}">{}<inertial pos="0.1 0.05 -0.2" mass="{}" diaginertia="0.06 0.05 0.04"/>"""
)
PLACES, MASSES = ('0 0 0', '0.3 0.1 0', '0.5 0 -0.2'), (2.0, 1.5, 0.8)
HINGE, FIRST, SECOND, SLIDE = '0 1 0', '1 0 0', '0 0.6 0.8', '0.6 0 0.8'
DAMPING, DURATION = 0.05, 0.4


def axis(tag: str, direction: str, inner: str = '', damping: float = 0.0) -> str:
    return f"""<{tag}><xyz expressed_in="__model__">{direction}</xyz>{inner}
<dynamics><damping>{damping}</damping></dynamics></{tag}>"""


def mimic(joint: str, tag: str, multiplier: float) -> str:
    return MIMIC.format(joint, tag, multiplier, 0.2 / multiplier)


def sdf(kind: str, turned: bool, mimics: dict[str, str]) -> str:
    """A hinge, a universal joint and a slide in a row; turned: the first parent is the child."""
    links = ''.join(map(LINK.format, 'abc', PLACES, MASSES))
    ends = ('a', 'world') if turned else ('world', 'a')
    axes = axis('axis', FIRST, mimics.get('first', ''), DAMPING)
    axes += axis('axis2', SECOND, mimics.get('second', ''))
    hinge, slide = (
        axis('axis', along, mimics.get(name, '')) for name, along in (('h', HINGE), ('s', SLIDE))
    )
    return f"""<sdf version="1.11"><model name="m">{links}
{JOINT.format('h', 'revolute', '<pose relative_to="a"/>', *ends, hinge)}
{JOINT.format('u', kind, '', 'a', 'b', axes)}{JOINT.format('s', 'prismatic', '', 'b', 'c', slide)}
</model></sdf>"""


def expected(free: Floats) -> Floats:
    """(h, first, second, s) at the end, of coordinates that depend on fewer: q = free · y."""
    joints = (HINGE,), (FIRST, SECOND), (SLIDE,)
    between = [np.array(each.split(), dtype=float) for each in PLACES]
    steps = [between[0], between[1] - between[0], between[2] - between[1]]
    bodies = ''
    for step, own, mass in zip(steps, joints, MASSES, strict=True):
        kind = 'type="slide"' if own == (SLIDE,) else ''
        hinges = ''.join(f'<joint {kind} axis="{each}"/>' for each in own)
        bodies += BODY.format(' '.join(map(str, step)), hinges, mass)
    source = f"""<mujoco><option gravity="0 0 -9.8"/><worldbody>{bodies}
</body></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    count = free.shape[1]

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = free @ y[:count], free @ y[count:]
        mujoco.mj_forward(model, data)
        M = np.zeros((4, 4))
        for row, unit in zip(M, np.eye(4), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        forces = -data.qfrc_bias - [0.0, DAMPING, 0.0, 0.0] * data.qvel
        turned = np.linalg.solve(free.T @ M @ free, free.T @ forces)
        return np.concatenate([y[count:], turned])

    start = np.zeros(2 * count)
    found = solve_ivp(rate, (0.0, DURATION), start, 'DOP853', rtol=1e-11, atol=1e-12)
    return np.asarray(free @ found.y[:count, -1])


NAMES = ('h', 'u_first', 'u_second', 's')
# by what mimics: what it mimics, with the factor; and how all depend on what is free
CASES = {
    'second': ({'second': ('h', 'axis', 0.7)}, [[1, 0, 0], [0, 1, 0], [0.7, 0, 0], [0, 0, 1]]),
    'led': ({'s': ('u', 'axis2', 0.3)}, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0.3]]),
    'own': ({'first': ('u', 'axis2', -2.0)}, [[1, 0, 0], [0, -2, 0], [0, 1, 0], [0, 0, 1]]),
    'chain': (
        {'second': ('u', 'axis', 0.5), 'h': ('u', 'axis2', 3.0)},
        [[1.5, 0], [1, 0], [0.5, 0], [0, 1]],
    ),
}


@pytest.mark.parametrize('kind, turned', [('universal', False), ('revolute2', True)])
@pytest.mark.parametrize('case', CASES)
def test_the_motion_is_that_of_the_chain(
    case: str, kind: str, turned: bool, tmp_path: Path
) -> None:
    given, free = CASES[case]
    mimics = {name: mimic(*each) for name, each in given.items()}
    source = sdf(kind, turned, mimics)
    text = imported(saved(tmp_path, 'it.sdf', source), scene=True)
    assert 'Changes of the motion' not in text
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    joints = simulation.sample().joints
    signs = np.array([-1.0 if turned else 1.0, 1.0, 1.0, 1.0])  # of the angle of `a`
    wanted = signs * expected(signs[:, None] * free)
    assert [joints[name].position for name in NAMES] == pytest.approx(wanted, abs=1e-8)
    assert abs(wanted[1]) > 0.01


def test_without_a_mimic_it_stays_universal(tmp_path: Path) -> None:
    """Also where a multiplier of zero mimics nothing: the axis that has it stays as drawn."""
    text = imported(saved(tmp_path, 'it.sdf', sdf('universal', False, {})))
    assert 'type: universal' in text and 'u_link' not in text
    still = MIMIC.format('u', 'axis', 0, 0)
    text = imported(saved(tmp_path, 'it.sdf', sdf('universal', False, {'s': still})), scene=True)
    assert 'type: universal' in text and 's_mimic: {joints: {s: 1.0}}' in text
    assert 'phase of mimic: it stays as drawn, not as in the file: s\n' in text


def test_names_that_are_taken(tmp_path: Path) -> None:
    source = sdf('universal', False, {'second': mimic('u_first', 'axis', 0.7)})
    source = source.replace('name="h"', 'name="u_first"').replace('name="c"', 'name="u_link"')
    source = source.replace('<child>c<', '<child>u_link<')
    text = imported(saved(tmp_path, 'it.sdf', source), scene=True)
    assert '#   names, changed: u_first of u is u_first_2\n' in text
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    joints = simulation.sample().joints
    wanted = expected(np.array(CASES['second'][1], dtype=float))
    names = ('u_first', 'u_first_2', 'u_second', 's')
    assert [joints[name].position for name in names] == pytest.approx(wanted, abs=1e-8)


def test_axes_that_mimic_each_other_are_refused(tmp_path: Path) -> None:
    mimics = {'first': mimic('u', 'axis2', 2.0), 'second': mimic('u', 'axis', 0.5)}
    with pytest.raises(InputError, match='u: it mimics itself'):
        imported(saved(tmp_path, 'it.sdf', sdf('universal', False, mimics)))


def test_a_joint_of_fixed_parts_holds_what_it_mimics(tmp_path: Path) -> None:
    """`k` keeps its angle, since both of its parts are fixed: so `h` keeps its own. The slide
    follows nothing that moves."""
    still = '<model name="wall"><static>true</static><link name="w"/></model>'
    ends = 'world', 'wall::w', axis('axis', HINGE, mimic('h', 'axis', 0.5))
    source = sdf('universal', False, {'s': mimic('k', 'axis', 2.0)})
    held = JOINT.format('k', 'revolute', '', *ends)
    source = source.replace('</model></sdf>', f'{still}{held}</model></sdf>')
    text = imported(saved(tmp_path, 'it.sdf', source), scene=True)
    assert 'k_mimic: {joints: {h: -0.5}}' in text and 's_mimic: {joints: {s: 1.0}}' in text
    assert '#   elements: joint k of a fixed part\n' in text
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    joints = simulation.sample().joints
    free = np.array([[0, 0], [1, 0], [0, 1], [0, 0]], dtype=float)
    assert [joints[name].position for name in NAMES] == pytest.approx(expected(free), abs=1e-8)
