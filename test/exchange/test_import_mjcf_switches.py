"""Switches of `<option>` in an imported MJCF: the motion is MuJoCo's own, and they are listed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved, simulate

mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 1e-4, 0.3
JOINTS = ('j1', 'j2')
SPRING, DAMPER = 'stiffness="5" springref="1"', 'damping="0.5"'
CORD = """<tendon><fixed name="cord" stiffness="3" damping="0.4" springlength="0.2" %s>
 <joint joint="j1" coef="1"/><joint joint="j2" coef="-0.5"/></fixed></tendon>"""
SERVO = '<actuator><position name="servo" joint="j1" kp="5" %s/></actuator>'
KEY = '<keyframe><key name="k" qpos="0 0" ctrl="1"/></keyframe>'
TIED = """<equality><joint name="tied" joint1="j1" joint2="j2" polycoef="0.1 1 0 0 0" %s/>
</equality>"""
STOPS, RUBS = 'range="-0.1 0.05" limited="true"', 'frictionloss="0.4"'

# flags, attributes of <option>, attributes of the first joint, more elements, what is listed
CASES = {
    'gravity': ('gravity', '', SPRING, '', 'gravity'),
    'springs': ('spring', '', f'{SPRING} {DAMPER}', CORD % '', 'springs'),
    'dampers': ('damper', '', f'{SPRING} {DAMPER}', CORD % '', 'damping'),
    'both': (
        'spring damper',
        'density="300" viscosity="2"',
        f'{SPRING} {DAMPER}',
        CORD % '',
        'springs, damping, compensation of gravity, fluid',
    ),
    'actuation': ('actuation', '', '', SERVO % '' + KEY, 'servo'),
    'a group': ('', 'actuatorgroupdisable="2"', '', SERVO % 'group="2"' + KEY, 'servo'),
    'equalities': ('equality', '', '', TIED % '', 'tied'),
    'one equality': ('', '', '', TIED % 'active="false"', 'tied'),
    'limits': ('limit', '', STOPS, CORD % STOPS, 'limits'),
    'friction': ('frictionloss', '', RUBS, CORD % RUBS, 'dry friction'),
    'constraints': (
        'constraint',
        '',
        f'{STOPS} {RUBS}',
        CORD % f'{STOPS} {RUBS}' + TIED % '',
        'tied, dry friction, limits',
    ),
    'controls': (
        'clampctrl',
        '',
        '',
        SERVO % 'ctrlrange="-0.1 0.1"' + KEY,
        'ranges of controls',
    ),
}


def robot(flags: str, option: str, joint: str, more: str, compensated: str = '') -> str:
    """Two bars."""
    off = ' '.join(f'{flag}="disable"' for flag in ['contact', *flags.split()])
    bar = '<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>'
    return f"""<mujoco model="bars"><compiler angle="radian"/>
<option timestep="{STEP}" integrator="RK4" {option}><flag {off}/></option><worldbody>
<body name="b1" euler="0 0.3 0"><joint name="j1" axis="0 1 0" {joint}/>{bar}
<body name="b2" pos="0.3 0 0" euler="0 0.5 0" {compensated}><joint name="j2" axis="0 1 0"/>{bar}
</body></body></worldbody>{more}</mujoco>"""


def positions(source: str) -> Floats:
    """Of the joints after the motion, rad, by MuJoCo itself."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    return np.array([float(data.joint(name).qpos[0]) for name in JOINTS])


@pytest.mark.parametrize(('flags', 'option', 'joint', 'more', 'listed'), CASES.values(), ids=CASES)
def test_what_is_off_does_nothing(
    flags: str, option: str, joint: str, more: str, listed: str, tmp_path: Path
) -> None:
    compensated = 'gravcomp="0.7"' if flags in ('gravity', 'spring damper') else ''
    source = robot(flags, option, joint, more, compensated)
    key = 'k' if 'keyframe' in source else None
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, stops=1e5, key=key)
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    sample = simulation.sample()
    found = [sample.joints[name].position for name in JOINTS]
    assert found == pytest.approx(positions(source), abs=1e-9)
    assert np.abs(found).max() > 0.05
    assert f'#   switched off in the file: not imported: {listed}\n' in text
    assert '# Changes of the motion' not in text


def test_a_switch_without_anything_to_turn_off_is_not_listed(tmp_path: Path) -> None:
    source = robot('spring damper limit frictionloss equality clampctrl', '', '', '')
    assert 'switched off' not in imported(saved(tmp_path, 'it.xml', source), scene=True)
