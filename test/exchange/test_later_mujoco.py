"""Features of MuJoCo from 3.11 on in an imported MJCF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.errors import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

mujoco = pytest.importorskip('mujoco')

BAR = '<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>'
BARS = f"""<mujoco><compiler angle="radian"/><option gravity="0 0 0"/>
<worldbody><body name="b1"><joint name="j1" axis="0 1 0" {{joint}}/>{BAR}
<body name="b2" pos="0.3 0 0"><joint name="j2" axis="0 1 0"/>{BAR}</body></body></worldbody>
{{more}}</mujoco>"""


def test_actuators_behind_one_with_two_controls(tmp_path: Path) -> None:
    """Their controls and gears stand further behind than they do themselves: at the start both
    joints accelerate as in MuJoCo, the gains of the first being zero."""
    source = BARS.format(
        joint='',
        more="""<actuator><pid name="two" joint="j1" kp="0" ki="0" kv="0"/>
<motor name="push" joint="j2" gear="2" ctrlrange="-0.7 0.7" ctrllimited="true"/>
<motor name="pull" joint="j1" gear="-1.5"/></actuator>
<keyframe><key name="k" ctrl="0 0 0.9 0.2"/></keyframe>""",
    )
    model = mujoco.MjModel.from_xml_string(source)
    assert model.nu == 4
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, key='k')
    assert 'actuators: they apply no force: two' in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-5)
    simulation.step(1)
    joints = simulation.sample().joints
    found = [joints[name].velocity / 1e-5 for name in ('j1', 'j2')]
    assert np.abs(data.qacc).min() > 1.0
    assert found == pytest.approx(data.qacc, rel=1e-6)


def test_surfaces_that_move_or_stick_are_listed(tmp_path: Path) -> None:
    source = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<geom name="belt" type="box" size="1 1 1" pos="5 0 0" surfacevel="1 0 0 0 0 0"/>
<body pos="0 0 1"><freejoint/><geom name="foot" size="0.1" adhesion="3"/></body></worldbody>
</mujoco>"""
    text = imported(saved(tmp_path, 'it.xml', source), scene=True, contact=1e4)
    told = 'adhesion and moving surfaces: these neither stick to the ground nor carry along: '
    assert told + 'belt, foot\n' in text


def test_springs_that_yield_are_listed(tmp_path: Path) -> None:
    """MuJoCo before 4.0 does not know them, and refuses the file."""
    source = BARS.format(
        joint='stiffness="2" springyield="0.3"',
        more="""<tendon><fixed name="t" stiffness="1" springyield="0.2">
<joint joint="j2" coef="1"/></fixed></tendon>""",
    )
    file = saved(tmp_path, 'it.xml', source)
    if int(mujoco.__version__.partition('.')[0]) < 4:
        with pytest.raises(InputError, match='springyield'):
            imported(file, scene=True)
        return
    text = imported(file, scene=True)
    assert 'springs that yield: they do not yield here, however far they are bent: j1, t\n' in text
