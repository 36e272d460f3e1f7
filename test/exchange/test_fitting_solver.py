"""The solver section that `import` writes: it fits the effects, and says why."""

from __future__ import annotations

import re

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import Simulation, StepError
from alf_ros.exchange import fitting_solver
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import Scene, scene_from_text
from alf_ros.simulation.stiffness import stiffest
from support.imported_motions import saved
from support.paths import DATA
from support.thorough import thinned

pytest.importorskip('mujoco')

EXPLICIT, IMPLICIT = 'dop853_adaptive', 'esdirk43_adaptive'
MASS, LENGTH = 0.02, 0.03  # of a phalanx, kg and m


def finger(joints: str, links: int = 3) -> str:
    """A finger on a base that is held; `joints` are attributes of all of its joints."""
    inner = ''
    for k in reversed(range(links)):
        inner = f"""<body name="link{k}" pos="{LENGTH if k else 0.0} 0 0">
 <joint name="joint{k}" axis="0 1 0" {joints}/>
 <geom type="capsule" fromto="0 0 0 {LENGTH} 0 0" size="0.006" mass="{MASS}"/>{inner}</body>"""
    return f"""<mujoco model="finger"><compiler angle="radian"/>
<option><flag contact="disable"/></option><worldbody>{inner}</worldbody></mujoco>"""


def reasons(text: str) -> str:
    """The comment above the solver section."""
    found = re.search(r'((?:^# .*\n)+)solver: ', text, re.MULTILINE)
    assert found
    return ' '.join(line.removeprefix('# ') for line in found[1].splitlines())


def steps_of_rk4(scene: Scene, h: float) -> None:
    Simulation(scene, step=h, integrator='rk4').step(round(0.2 / h))


STIFF = {
    'damping': ('damping="0.05"', 'joint_friction.joint2'),
    'armature': ('damping="1" armature="1e-4"', r'joint_friction.joint\d'),
    'spring': ('stiffness="4e2"', r'torsion_spring.joint\d'),
    'dry friction': ('frictionloss="0.02" armature="1e-5"', r'joint_friction.joint\d'),
}


@pytest.mark.parametrize('name', thinned(STIFF, keep=['spring', 'dry friction']))
def test_stiff_fingers(tmp_path, name: str) -> None:
    """The section is implicit and names the effect; it runs, and keeps to its accuracy. rk4 with
    1 ms fails and says so, or lets dry friction creep."""
    attributes, effect = STIFF[name]
    text = imported(saved(tmp_path, 'finger.xml', finger(attributes)), scene=True)
    scene = scene_from_text(text)
    assert scene.solver.integrator == IMPLICIT
    told = reasons(text)
    assert re.search(f'implicit because of the stiff effect {effect}, which changes motions', told)
    assert f'keeps to {fitting_solver.ACCURACY:g} m' in told
    chosen, finer = Simulation(scene), Simulation(scene, step=1e-3, integrator=IMPLICIT)
    finer = finer.with_solver(scene.solver.integrator, tolerance=1e-11)
    for simulation in (chosen, finer):
        simulation.step(100)
    assert np.abs(chosen.state.q - finer.state.q).max() < fitting_solver.ACCURACY
    if name == 'dry friction':
        return  # its force has a limit: too long steps do not grow
    with pytest.raises(StepError) as caught:
        steps_of_rk4(scene, 1e-3)
    message = str(caught.value)
    assert re.search(f'the step is too long for the stiff effect {effect}, which changes', message)
    assert 'loops' not in message and f'take the integrator {IMPLICIT}' in message
    longest = re.search(r'or a step of (\S+) s or less', message)
    assert longest
    steps_of_rk4(scene, float(longest[1]))


def test_the_limit_in_the_message(tmp_path) -> None:
    """c/m of one damped link by hand, and 2.7853 m/c for rk4."""
    damping, armature = 0.4, 1e-5
    source = finger(f'damping="{damping}" armature="{armature}"', links=1)
    scene = scene_from_text(imported(saved(tmp_path, 'finger.xml', source), scene=True))
    _, whole = stiffest([Simulation(scene).sample()])
    with pytest.raises(StepError) as caught:
        steps_of_rk4(scene, 1e-3)
    found = re.search(
        r'motions at (\S+) 1/s: rk4 is stable up to steps of (\S+) s', str(caught.value)
    )
    assert found
    assert float(found[1]) == pytest.approx(whole.rate, rel=5e-3)
    assert damping / whole.rate - armature == pytest.approx(MASS * LENGTH**2 / 3.0, rel=0.3)
    assert 0.9 * 2.7853 / whole.rate < float(found[2]) <= 2.7853 / whole.rate


def test_soft_robots_keep_the_explicit_method(tmp_path) -> None:
    for text in (
        imported(saved(tmp_path, 'it.urdf', robots.double_pendulum()), scene=True),
        imported(str(DATA / 'robots' / 'leg.xml'), scene=True),
    ):
        scene = scene_from_text(text)
        assert (scene.solver.step, scene.solver.integrator) == (1e-3, EXPLICIT)
        assert f'The tolerance keeps to {fitting_solver.ACCURACY:g} m' in reasons(text)
    assert 'solver:' not in imported(saved(tmp_path, 'it.urdf', robots.double_pendulum()))


def test_stops_count_as_pressed(tmp_path) -> None:
    """Free as drawn, they are stiff where something presses them."""
    source = finger('range="-0.5 0.5" limited="true" damping="1e-4"')
    for stiffness, integrator in ((1e-2, EXPLICIT), (1e6, IMPLICIT)):
        text = imported(saved(tmp_path, 'it.xml', source), stops=stiffness)
        assert scene_from_text(text).solver.integrator == integrator
        assert ('torsion_spring as joint_stop.joint' in reasons(text)) == (integrator == IMPLICIT)


def test_stops_of_tendons_count_as_pressed(tmp_path) -> None:
    cord = '<tendon><fixed name="cord" range="-0.5 0.5" limited="true">'
    cord += '<joint joint="joint2" coef="1"/></fixed></tendon></mujoco>'
    source = finger('damping="1e-4"').replace('</mujoco>', cord)
    text = imported(saved(tmp_path, 'it.xml', source), stops=1e6)
    assert scene_from_text(text).solver.integrator == IMPLICIT
    assert 'tendon as the stop of tendon.cord' in reasons(text)


def test_what_cannot_be_kept_is_said() -> None:
    text = imported(str(DATA / 'robots' / 'leg.xml'), scene=True)
    scene = scene_from_text(text.partition('# The tolerance')[0])
    assert not scene.says_solver
    section = fitting_solver.section(scene, accuracy=1e-18)
    assert (
        '# The tolerance does not keep to 1e-18 m: for 0.5 s from the start the error' in section
    )
    assert 'tolerance: 1e-10}' in section  # the smallest one
