"""Robots far from the origin move as at the origin, or say that they are too far away."""

from __future__ import annotations

import copy
import re

import numpy as np
import pytest

from alf_ros import AlfError, Simulation
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.side_by_side import SideBySide
from support.thorough import thinned

FINGERS = 3


def hand(away: float, solver: str = 'step: 0.001, integrator: dop853_adaptive') -> Simulation:
    """Three short fingers of two links on a palm, all axes oblique, in free fall."""
    points: dict[str, Floats] = {}
    bodies: dict[str, str] = {}
    joints: dict[str, str] = {}
    for n in range(FINGERS):
        base = np.array([0.03 * (n - 1), 0.04, 0.0])
        knuckle = base + [0.02, 0.03, 0.01]
        points |= {f'a{n}': base, f'b{n}': knuckle}
        bodies |= {f'one{n}': f'[a{n}, b{n}]', f'two{n}': f'[b{n}]'}
        joints |= {f'j{n}': f'[palm, one{n}], at: a{n}', f'k{n}': f'[one{n}, two{n}], at: b{n}'}
    moved = np.array([away, -0.7 * away, 0.3 * away])
    text = 'mechanism:\n  alf: 1\n  name: hand\n  space: spatial\n  points:\n'
    for name, at in points.items():
        text += f'    {name}: {{at: {(at + moved).tolist()}}}\n'
    text += '  bodies:\n'
    whole = {'palm': '[a0, a1, a2]'} | bodies
    for k, (name, of) in enumerate(whole.items()):
        mass, com = (0.5, 0.04) if name == 'palm' else (0.02 + 0.003 * k, 0.01)
        J = [round(mass * com**2 * f, 12) for f in (1.0, 1.2, 0.9)]
        text += f'    {name}: {{points: {of}, mass: {mass}, com: [{com}, {com / 2}, {com}], '
        text += f'inertia: {{about_com: {[*J, 0.0, 0.0, 0.0]}}}}}\n'
    text += '  joints:\n'
    for k, (name, of) in enumerate(joints.items()):
        axis = [1.0, 0.3 + 0.1 * k, 0.2]
        text += f'    {name}: {{type: revolute, between: {of}, axis: {axis}}}\n'
    text += 'effects:\n  torsion_spring:\n'
    for name in joints:
        text += f'    {name}: {{joint: {name}, stiffness: 0.01, free_position: 0.8}}\n'
    return Simulation(scene_from_text(f'{text}solver: {{{solver}, tolerance: 1.0e-8}}\n'))


def angles(simulation: Simulation) -> list[float]:
    return [each.position for each in simulation.sample().joints.values()]


def test_a_hand_at_a_place_of_a_map() -> None:
    """Five thousand times its size from the origin: products of places have no digits left there.
    It was refused, as a mechanism that cannot be closed."""
    expected, there = hand(0.0), hand(500.0)
    for simulation in (expected, there):
        simulation.step(200)
    assert np.abs(angles(expected)).max() > 0.3
    assert angles(there) == pytest.approx(angles(expected), abs=1e-7)


def test_side_by_side_far_away() -> None:
    """Members keep the bits of their single runs."""
    made = [hand(away) for away in (500.0, 501.0, 502.0, 0.0, 503.0)]
    alone = [copy.copy(each) for each in made]
    assert SideBySide(made).step(20) == {}  # as many lanes as other tests have compiled
    for one, other in zip(made, alone, strict=True):
        other.step(20)
        assert np.array_equal(one.state.q, other.state.q)


@pytest.mark.parametrize('away', thinned([2e5, 1e7], keep=[1e7]))
def test_a_hand_too_far_away_says_so(away: float) -> None:
    """The first one closes, and no step is small enough; the second one does not close."""
    message = r'the mechanism nearer to the origin: it is \d.*e\+0\d times its size away'
    with pytest.raises(AlfError) as caught:
        hand(away).step(10)
    assert re.search(message, str(caught.value))
