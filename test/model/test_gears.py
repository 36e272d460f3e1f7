"""Gears and racks: refused input, and relations that a run keeps. Motions are in test_library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene.scene import scene_from_text

PAIR = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    C: {at: [0.5, 0], fixed: true}
    A: {at: [0.1, 0]}
    B: {at: [0.6, 0]}
    Q: {at: [1, 1]}
  bodies:
    one: {points: [O, A], mass: 1, inertia: {about_com: 0.02}, com: [0, 0]}
    two: {points: [C, B], mass: 1, inertia: {about_com: 0.03}, com: [0, 0]}
    dot: {points: [Q], mass: 1, inertia: point}
  joints:
    left: {type: revolute, between: [ground, one], at: O}
    right: {type: revolute, between: [ground, two], at: C}
    mesh: {type: gear, between: [one, two], centres: [O, C], radii: [0.2, 0.3]}
initial:
  velocities: {A: [0, 3]}
"""


@pytest.mark.parametrize(
    'old, new, said',
    [
        ('[0.2, 0.3]', '[0.2, 0.4]', 'mesh.radii: the centres are drawn 0.5 m apart.*0.6 m'),
        ('[0.2, 0.3]', '[0.2, -0.3]', 'not a radius'),
        ('[0.2, 0.3]}', '[0.3, 0.2], internal: true}', 'the radii ask for 0.1 m'),
        ('[0.2, 0.3]}', '[0.2, 0.2], internal: true}', 'the radii ask for 0 m'),
        ('[O, C], radii', '[O, B, C], radii', 'centres: a list of 3 given'),
        ('[O, C], radii', '[C, O], radii', "body 'one' does not carry it"),
        ('[one, two], centres: [O, C]', '[one, dot], centres: [O, Q]', 'cannot turn'),
        ('[one, two], centres: [O, C]', '[ground, two], centres: [A, C]', 'not a fixed point'),
        (
            'gear, between: [one, two], centres: [O, C], radii: [0.2, 0.3]',
            'rack, between: [one, two], at: C, radius: 0.2, '
            'on: {through: [0, -0.3], direction: [1, 0]}',
            'mesh.radius: the centre is drawn 0.3 m on the left of the line',
        ),
        ('centres: [O, C], ', '', "missing key 'centres'"),
        ('type: gear', 'type: gears', "did you mean 'gear'"),
    ],
)
def test_refused(old: str, new: str, said: str) -> None:
    assert old in PAIR
    with pytest.raises(InputError, match=said):
        scene_from_text(PAIR.replace(old, new))


@pytest.mark.parametrize(
    'radii, ratio',
    [
        ('[0.2, 0.3]', -2.0 / 3.0),
        ('[0.8, 0.3], internal: true', 8.0 / 3.0),
        ('[0.3, 0.8], internal: true', 3.0 / 8.0),
    ],
    ids=['external', 'in a ring', 'round a wheel'],
)
def test_ratio_and_phase(radii: str, ratio: float) -> None:
    """The phase is not corrected, and stays: 10 s, 48 turns."""
    scene = scene_from_text(PAIR.replace('[0.2, 0.3]', radii))
    sim = Simulation(scene, integrator='dop853', step=2e-3)
    assert sim.sample().joints['left'].velocity == pytest.approx(30.0)
    assert sim.sample().joints['right'].velocity == pytest.approx(30.0 * ratio, rel=1e-12)
    energy = 0.5 * (0.02 + 0.03 * ratio**2) * 30.0**2
    for sample in sim.run(10.0, every=1000):
        left, right = (sample.joints[name].position for name in ('left', 'right'))
        assert right == pytest.approx(ratio * left, abs=1e-9)
        assert sample.diagnostics.velocity_violation < 1e-11
        assert sample.energy == pytest.approx(energy, rel=1e-9)
    assert left == pytest.approx(300.0, abs=1e-6)


def test_a_rack_on_a_turning_arm() -> None:
    """A wheel rolls on the edge of an arm that turns; a slide along the edge keeps it there."""
    text = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [1, 0]}
    C: {at: [0.3, 0.2]}
    D: {at: [0.4, 0.2]}
    T: {at: [0.5, 0.2]}
  bodies:
    arm: {points: [O, A], mass: 1, inertia: rod}
    wheel: {points: [C, D], mass: 0.5, inertia: {about_com: 0.01}, com: [0, 0]}
    slide: {points: [C, T], mass: 0.1, inertia: rod}
  joints:
    hub: {type: revolute, between: [ground, arm], at: O}
    axle: {type: revolute, between: [slide, wheel], at: C}
    guide: {type: prismatic, between: [arm, slide], at: C, axis: [1, 0]}
    edge: {type: rack, between: [arm, wheel], at: C, radius: 0.2,
           on: {through: [0, 0], direction: [1, 0]}}
effects: {gravity: {acceleration: [0, -9.81]}}
initial: {velocities: {A: [0, 2], C: [-0.4, ~]}}
"""
    sim = Simulation(scene_from_text(text), integrator='dop853', step=2e-3)
    first = sim.sample()
    assert sim.model.n - first.diagnostics.rank == 2
    for sample in sim.run(0.5, every=25):
        turned = sample.joints['axle'].position - first.joints['axle'].position
        rolled = sample.joints['guide'].position - first.joints['guide'].position
        # to the left of the edge: rolling on turns the wheel clockwise, relative to the arm
        assert turned == pytest.approx(-rolled / 0.2, abs=1e-10)
        assert sample.energy == pytest.approx(first.energy, abs=1e-10)
    assert np.abs(rolled) > 0.05


CYLINDER = """
mechanism:
  alf: 1
  parameters: {R: 0.5, r: 0.1, start: 1.4, apart: R + r}
  points:
    O: {at: [0, 0], fixed: true}
    C: {at: [apart*cos(start), apart*sin(start)]}
    S: {at: [apart*cos(start) + r, apart*sin(start)]}
  bodies:
    disk: {points: [C, S], mass: 2, inertia: {about_com: r**2}, com: [0, 0]}
  joints:
    contact: {type: rolling, between: [ground, disk], centres: [O, C], radii: [R, r]}
effects: {gravity: {acceleration: [0, -9.81]}}
"""


@pytest.mark.parametrize('inside', [False, True])
def test_a_cylinder_rolls_on_a_fixed_one(inside: bool) -> None:
    """φ̈ = -(2/3) g cos φ / (R ± r), and the normal force balances weight and the path."""
    text = CYLINDER
    if inside:
        text = text.replace('R + r', 'R - r').replace('start: 1.4', 'start: -0.4')
        text = text.replace('radii: [R, r]', 'radii: [R, r], internal: true')
    sim = Simulation(scene_from_text(text), integrator='dop853', step=5e-3)
    apart, start = (0.4, -0.4) if inside else (0.6, 1.4)

    def rates(t: float, y: Floats) -> list[float]:
        return [y[1], -2.0 / 3.0 * 9.81 * np.cos(y[0]) / apart]

    wanted = solve_ivp(
        rates, (0, 0.6), [start, 0.0], 'DOP853', rtol=1e-13, atol=1e-13, dense_output=True
    )
    energy = sim.sample().energy
    for sample in sim.run(0.6, at=[0.2, 0.4, 0.6]):
        angle, rate = wanted.sol(sample.t)
        along = np.array([np.cos(angle), np.sin(angle)])
        assert sample.points['C'] == pytest.approx(apart * along, abs=1e-10)
        # it turns as the arc it has rolled along says
        turned = (angle - start) * apart / (-0.1 if inside else 0.1)
        assert sample.body_poses[0, 2] == pytest.approx(turned, abs=1e-9)
        force = sample.reactions['contact'].force
        normal = 2.0 * (9.81 * np.sin(angle) - apart * rate**2)
        assert force @ along == pytest.approx(normal, abs=1e-7)
        assert sample.energy == pytest.approx(energy, abs=1e-10)
