"""Rows that depend on others, in short links far from the origin: what rounding leaves of them is
no slow mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

pytest.importorskip('mujoco')  # reads the leg

# A leg below a free pelvis: a planar loop of short links with parallel hinges, whose rows depend
# on others, and a rod between two balls.
LEG = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="pelvis" pos="0 0 1" quat="0.95 0.1 0.2 0.1"><freejoint/>
<inertial mass="15" pos="0.01 0 0.1" fullinertia="0.3 0.25 0.2 0.01 0.02 0.005"/>
<body name="lroll" pos="0 0.1 0">
<inertial mass="1.8" pos="0.02 0 -0.03" diaginertia="0.018 0.0216 0.0144"/>
<joint name="ljroll" axis="1 0 0" damping="0.5" armature="0.17"/>
<body name="lhip" pos="0 0 -0.08" quat="0.9 0.1 0.2 0.05">
<inertial mass="5" pos="0.03 0 -0.1" diaginertia="0.05 0.06 0.04"/>
<joint name="ljhip" axis="0 1 0" damping="0.3" armature="0.1"/>
<body name="lrod" pos="0.02 0.04 -0.05">
<inertial mass="0.3" pos="0.1 0 -0.2" diaginertia="0.003 0.0036 0.0024"/>
<joint name="ljrod" type="ball" damping="0"/></body>
<body name="lknee" pos="0.1 0 -0.25">
<inertial mass="0.8" pos="0.02 0 -0.02" diaginertia="0.008 0.0096 0.0064"/>
<joint name="ljknee" axis="0 1 0" damping="0.2" armature="0.05" frictionloss="0.4"/>
<body name="lshin" pos="0.05 0 -0.1">
<inertial mass="0.6" pos="0.05 0 -0.15" diaginertia="0.006 0.0072 0.0048"/>
<joint name="ljshin" axis="0 1 0" stiffness="150" damping="0.1" springref="0.03"/>
<body name="ltarsus" pos="0.1 0 -0.3">
<inertial mass="0.8" pos="-0.1 0 -0.1" diaginertia="0.008 0.0096 0.0064"/>
<joint name="ljtarsus" axis="0 1 0" damping="0.1"/>
<body name="lheel" pos="0.03 0 0.02">
<inertial mass="0.1" pos="0.02 0 0.02" diaginertia="0.001 0.0012 0.0008"/>
<joint name="ljheel" axis="0 1 0" stiffness="200" damping="0.05"/></body>
<body name="lcrank" pos="-0.06 0 -0.05">
<inertial mass="0.12" pos="-0.01 0 -0.02" diaginertia="0.0012 0.00144 0.00096"/>
<joint name="ljcrank" axis="0 1 0" damping="0.05" armature="0.03"/>
<body name="lplantar" pos="-0.02 0 -0.06">
<inertial mass="0.12" pos="-0.1 0 -0.1" diaginertia="0.0012 0.00144 0.00096"/>
<joint name="ljplantar" axis="0 1 0"/></body></body>
<body name="lfoot" pos="-0.25 0 -0.25">
<inertial mass="0.25" pos="0.02 0 -0.03" diaginertia="0.0025 0.003 0.002"/>
<joint name="ljfoot" axis="0 1 0" damping="0.05"/></body>
<body name="lbell" pos="-0.1 0.02 -0.1">
<inertial mass="0.15" pos="0.02 0.01 0.01" diaginertia="0.0015 0.0018 0.0012"/>
<joint name="ljbell" axis="0 1 0" armature="0.02"/>
<body name="llink" pos="0.03 0 0.02">
<inertial mass="0.1" pos="-0.05 0 -0.05" diaginertia="0.001 0.0012 0.0008"/>
<joint name="ljlink" type="ball"/></body></body></body></body></body></body></body></body>
</worldbody><equality><connect body1="lplantar" body2="lfoot" anchor="-0.18 0 -0.17"/>
<connect body1="llink" body2="lfoot" anchor="-0.15 0.01 -0.14"/></equality></mujoco>"""
DURATION = 0.55  # s: it has fallen by 1.5 m, at 5 m/s


def test_falling_leg_with_dependent_rows(tmp_path: Path) -> None:
    """It stopped at 0.5 s, because "the loops cannot be closed within the step"."""
    text = imported(saved(tmp_path, 'leg.xml', LEG), scene=True)
    scene = scene_from_text(text)
    simulation, exact = (
        Simulation(scene),
        Simulation(scene, integrator='dop853_adaptive', tolerance=1e-12),
    )
    assert simulation.sample().diagnostics.redundant == 1
    steps = round(DURATION / simulation.h)
    simulation.step(steps)
    exact.step(steps)
    sample, reference = simulation.sample(), exact.sample()
    assert np.isfinite(sample.qdd).all()
    assert simulation.evaluations <= 15 * steps  # a step has 12 stages, and few are refused
    assert np.abs(sample.q - reference.q).max() < 1e-5
