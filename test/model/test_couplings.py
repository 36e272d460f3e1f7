"""Linear couplings of joint coordinates, against equations of motion by hand, in phase."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros import InputError, Simulation, StepError
from alf_ros.arrays import Floats
from alf_ros.exchange.export import exported, tree
from alf_ros.inspection.soundness import examine
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.sample import Sample
from support.coupled_bars import two_bars

# a crank, 2 kg m^2 about its pin, and a slider of 3 kg on a rail through the ground
CAM = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0.5, 0]}
    P: {at: [2, 0]}
    Q: {at: [2.5, 0]}
  bodies:
    crank: {points: [O, A], mass: 1, inertia: {about_com: 2}, com: [0, 0]}
    slide: {points: [P, Q], mass: 3, inertia: {about_com: 1}, com: [0, 0]}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    rail: {type: prismatic, between: [ground, slide], at: P, axis: [1, 0]}
  couplings:
    cam: {joints: {pin: 0.3, rail: -2}}
effects: {joint_effort: {joint: pin, effort: 1.5}}
"""

CHAIN = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [1, 0, 0]}
    B: {at: [1.7, 0, 0.2]}
  bodies:
    upper: {points: [O, A], mass: 1.5, inertia: {about_com: [0.1, 0.2, 0.2]}, com: [0.5, 0, 0]}
    lower: {points: [A, B], mass: 0.8, inertia: {about_com: [0.1, 0.1, 0.1]}, com: [0.3, 0, 0]}
  joints:
    one: {type: revolute, between: [ground, upper], at: O, axis: [0, -1, 0]}
    two: {type: revolute, between: [upper, lower], at: A, axis: [0, -1, 0]}
  couplings:
    finger: {joints: {one: RATIO, two: -1}}
effects: {gravity: {acceleration: [0, 0, -9.81]}}
"""


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive', 'esdirk43'])
def test_an_angle_with_a_length(integrator: str) -> None:
    """x = 0.15 θ: (J + m 0.15²) θ̈ = τ, over turns; the reactions hold the slider back."""
    sim = Simulation(scene_from_text(CAM), integrator=integrator, step=1e-3)
    alpha = 1.5 / (2.0 + 3.0 * 0.15**2)
    for sample in sim.run(6.0, every=1500):
        theta = 0.5 * alpha * sample.t**2
        pin, rail = sample.joints['pin'], sample.joints['rail']
        assert pin.position == pytest.approx(theta, abs=1e-6)
        assert rail.position == pytest.approx(0.15 * theta, abs=1e-6)
        assert 0.3 * pin.velocity - 2.0 * rail.velocity == pytest.approx(0.0, abs=1e-12)
        assert sample.energy == pytest.approx(1.5 * theta, abs=1e-5)
    assert theta > 4.0 * math.pi


@pytest.mark.parametrize('ratio', [1.0, -0.5, 3.0])
def test_two_angles_of_a_chain(ratio: float) -> None:
    """A finger whose second joint mimics the first: Lagrange's equation, and the phase."""
    text = CHAIN.replace('RATIO', repr(ratio))
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    sim.step(1500)
    sample = sim.sample()
    found = sample.joints['one'].position, sample.joints['two'].position
    assert abs(found[0]) > 1.0
    assert found == pytest.approx(two_bars(ratio, 1.5), abs=1e-9)
    assert found[1] == pytest.approx(ratio * found[0], abs=1e-10)


def test_reactions_and_check() -> None:
    """One freedom is left, and what the ground carries is the weight and the momentum's rate."""
    scene = scene_from_text(CHAIN.replace('RATIO', '1.0'))
    found = examine(scene)
    assert found.sound and found.freedoms == 1
    sim, h = Simulation(scene, integrator='dop853', step=1e-4), 1e-4
    sim.step(1999)
    before, now, after = (sim.step(1) or sim.sample() for _ in range(3))
    length = math.hypot(0.7, 0.2)

    def momentum(sample: Sample) -> Floats:
        v = sample.velocities
        lower = v['A'] + 0.3 / length * (v['B'] - v['A'])
        return 1.5 * 0.5 * np.asarray(v['A']) + 0.8 * lower

    rate = (momentum(after) - momentum(before)) / (2.0 * h)
    reaction = now.reactions['one']
    assert not reaction.indeterminate
    assert reaction.force == pytest.approx(rate + [0.0, 0.0, 2.3 * 9.81], abs=1e-5)


def test_put_elsewhere_in_phase() -> None:
    """`place` moves the coupled bodies with the body that it places, over several turns."""
    sim = Simulation(scene_from_text(CAM), step=1e-3)
    for angle in (2.0, 4.0, 6.0, 8.0):
        sim.place('crank', [0.0, 0.0, angle])
        sample = sim.sample()
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-9)
        assert sample.joints['rail'].position == pytest.approx(0.15 * angle, abs=1e-9)


def test_export_lists_it() -> None:
    """The tree and the loops of a URDF have no place for it."""
    scene = scene_from_text(CHAIN.replace('RATIO', '1.0'))
    assert 'couplings: finger' in tree(scene)[1] and 'couplings: finger' in exported(scene)[2]


MISTAKES = {
    'joint': (('pin: 0.3', 'pn: 0.3'), "no such joint coordinate, got 'pn'; did you mean 'pin'"),
    'zero': (('pin: 0.3', 'pin: 0'), 'no joint with a factor'),
    'none': (('{pin: 0.3, rail: -2}', '{}'), 'no coordinate; expected'),
    'key': (('joints: {pin', 'joint: {pin'), "unknown key, got 'joint'; did you mean 'joints'"),
    'name': (('cam:', 'slide:'), 'this name already belongs to'),
}


@pytest.mark.parametrize(('change', 'message'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes(change: tuple[str, str], message: str) -> None:
    assert change[0] in CAM
    with pytest.raises(InputError, match=message) as caught:
        scene_from_text(CAM.replace(*change))
    assert '\n' not in str(caught.value)


def test_one_of_two_angles_is_refused() -> None:
    text = CHAIN.replace(
        'type: revolute, between: [ground, upper], at: O, axis: [0, -1, 0]',
        'type: universal, between: [ground, upper], at: O, axes: [[0, 1, 0], [1, 0, 0]]',
    ).replace('one: RATIO', 'one_first: 1')
    with pytest.raises(InputError, match="'one_first' is one of two angles: neither"):
        scene_from_text(text)


@pytest.mark.parametrize(
    ('slide', 'error', 'told'),
    [
        # x = 0.15 θ would be a motion
        ('0.3*t', InputError, 'drives: the rates of drives and constraints contradict'),
        ('0.15*t + 0.01*t**3', StepError, 'at t = 0.01 s the rates of drives and constraints'),
    ],
)
def test_drives_that_it_does_not_permit(slide: str, error: type[Exception], told: str) -> None:
    """They and the coupling are named, at the start and later."""
    push = f'{{joint: rail, length: {slide}}}'
    drives = f'drives: {{turn: {{joint: pin, angle: t}}, push: {push}}}\n'
    scene = scene_from_text(CAM + drives + 'solver: {step: 0.01}\n')
    with pytest.raises(error) as refused:
        Simulation(scene).step()
    said = str(refused.value)
    assert told in said and all(f'{name} is off by' in said for name in ('cam', 'push'))
