"""Rows that depend on others, in short links far from the origin: what rounding leaves of them is
no slow mode."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.exchange.import_file import imported
from alf_ros.inspection.soundness import examine
from alf_ros.scene.scene import scene_from_text
from support.hinge_loop import about_a_line, hinge_loop
from support.imported_motions import saved
from support.thorough import thinned

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
        Simulation(scene, integrator='dop853_adaptive', tolerance=1e-9),
    )
    assert simulation.sample().diagnostics.redundant == 1
    steps = round(DURATION / simulation.h)
    simulation.step(steps)
    exact.step(steps)
    sample, reference = simulation.sample(), exact.sample()
    assert np.isfinite(sample.qdd).all()
    assert simulation.evaluations <= 15 * steps  # a step has 12 stages, and few are refused
    assert np.abs(sample.q - reference.q).max() < 1e-5


INERTIA = {'about_com': [0.05, 0.06, 0.07]}
HINGES = [  # places (m) and axes of three
    (
        [[-0.2, 0.43, -0.44], [-0.83, 0.94, 0.13], [0.29, 0.15, -0.05]],
        [[0.9, -0.29, 0.34], [0.42, -0.23, 0.88], [0.39, 0.83, -0.4]],
    ),
    (
        [[-0.03, -0.5, 0.44], [0.27, 0.87, -0.92], [0.67, -0.01, -0.12]],
        [[0.57, 0.06, 0.82], [0.77, 0.55, -0.32], [-0.71, 0.24, -0.66]],
    ),
]


def falling(places: Any, axes: Any, masses: Sequence[float]) -> Simulation:
    """A linkage of Bricard under its weight; its rods have their mass half a length on."""
    P, U = about_a_line(np.array(places), np.array(axes))
    scene = hinge_loop(P, U, (0.0, 0.0, -9.81), masses, inertia=INERTIA)
    for k, body in enumerate(scene['mechanism']['bodies'].values()):
        body['com'] = [0.5 * float(np.linalg.norm(P[k + 1] - P[k])), 0, 0]
    return Simulation(load_scene(scene), step=1e-3, integrator='rk4')


@pytest.mark.parametrize(('places', 'axes'), HINGES, ids=['one', 'other'])
def test_six_hinges_on_a_line_of_symmetry_turn_on(
    places: list[list[float]], axes: list[list[float]]
) -> None:
    """Fast, and with soft rows: of rows that depend on others rounding leaves more than ε there.
    The run ended in an ordinary position. Opposite hinges of such a linkage turn alike."""
    simulation = falling(places, axes, (1.0, 1.3, 1.6, 1.9, 2.2))
    begun = simulation.sample()
    simulation.step(1500)
    ended = simulation.sample()
    assert ended.energy == pytest.approx(begun.energy, abs=1e-6)
    assert ended.diagnostics.position_violation < 1e-12
    turned = [ended.joints[f'j{k}'].position - begun.joints[f'j{k}'].position for k in range(6)]
    whole = 2.0 * np.pi
    for one, other in zip(turned[:3], turned[3:], strict=True):
        apart = min(abs(one - other), abs(one + other))  # j5 has its sides the other way round
        assert abs(apart - whole * round(apart / whole)) < 1e-9


@pytest.mark.parametrize('seed', thinned([244, *range(40)], keep=[244]))
def test_what_rounding_leaves_of_rows_is_no_direction_to_go_on_in(seed: int) -> None:
    """In the first case rows are nearly singular for a second, and five depend on others. Steps of
    conjugate gradients became as long as rounding makes them: the run ended, or lost all speed."""
    random, own = np.random.default_rng(seed), np.random.default_rng(seed)
    places, axes = random.uniform(-1.0, 1.0, (3, 3)), random.standard_normal((3, 3))
    simulation = falling(places, axes, own.uniform(0.5, 2.0, 5).tolist())
    begun = simulation.sample().energy
    simulation.step(1000)
    ended = simulation.sample()
    assert ended.energy == pytest.approx(begun, abs=1e-5)
    assert ended.diagnostics.position_violation < 1e-12
    assert not ended.diagnostics.trouble


@pytest.mark.parametrize('seed', thinned([224, 64], keep=[224]))
def test_a_mechanism_is_not_the_rigid_assembly_beside_it(seed: int) -> None:
    """A step away from the drawing closes in a structure, which hid the mechanism."""
    random = np.random.default_rng(seed)
    places, axes = random.uniform(-1.0, 1.0, (3, 3)), random.standard_normal((3, 3))
    scene = load_scene(hinge_loop(*about_a_line(places, axes), (0.0, 0.0, -9.81)))
    found = examine(scene)
    assert found.freedoms == 1
    simulation = Simulation(scene, step=1e-3, integrator='rk4')
    begun = simulation.sample()
    simulation.step(1500)
    ended = simulation.sample()
    assert ended.energy == pytest.approx(begun.energy, abs=1e-8)
    assert begun.diagnostics.redundant == ended.diagnostics.redundant == 1
