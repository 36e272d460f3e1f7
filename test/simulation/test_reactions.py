"""Joint reactions against closed forms and free-body balances made in the test."""

from __future__ import annotations

import json

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.scene.scene import scene_from_text
from support.paths import DATA

G = 9.81


def scene(points: str, bodies: str, joints: str, rest: str = ''):
    mechanism = f'{{alf: 1, space: planar, points: {points}, bodies: {bodies}, joints: {joints}}}'
    return scene_from_text(
        f'mechanism: {mechanism}\neffects: {{gravity: {{acceleration: [0, -{G}]}}}}\n{rest}'
    )


def test_slider_crank_reactions_are_its_multipliers() -> None:
    """Closed form: the guide carries the remainder of the coupler's balance; the pins follow."""
    path = DATA / 'slider_crank_6_2.json'
    wanted = json.loads(path.read_text())['samples'][37]
    th, thd, thdd = wanted['theta'], wanted['thetad'], wanted['thetadd']
    sim = Simulation(load_scene('slider_crank'), step=2.5e-4)
    (sample,) = sim.run(wanted['t'], at=[wanted['t']])
    c, s = np.cos(th), np.sin(th)
    a_knee = np.array([-c * thd**2 - s * thdd, -s * thd**2 + c * thdd])
    a_crank, a_coupler = 0.5 * a_knee, a_knee * [1.5, 0.5]
    # coupler about its centre, its angle is -θ: what knee and guide exert on it
    x, y = 0.5 * c, 0.5 * s
    knee_x = a_coupler[0]
    total_y = a_coupler[1] + G
    # moment about the centre: knee at (-x, y), guide at (x, -y) with force (0, N)
    N = (-thdd / 12.0 + y * knee_x + x * total_y) / (2.0 * x)
    knee = np.array([knee_x, total_y - N])
    pin = a_crank + [0.0, G] + knee
    assert sample.reactions['guide'].force == pytest.approx([0.0, N], abs=2e-5)
    assert sample.reactions['knee'].force == pytest.approx(knee, abs=2e-5)
    assert sample.reactions['crank_pin'].force == pytest.approx(pin, abs=2e-5)
    assert not any(reaction.indeterminate for reaction in sample.reactions.values())


def test_hanging_chain_at_rest_carries_its_weight() -> None:
    sim = Simulation(
        scene(
            '{O: {at: [0, 0], fixed: true}, A: {at: [0, -1]}, B: {at: [0, -2]}}',
            '{one: {points: [O, A], mass: 2, inertia: rod},'
            ' two: {points: [A, B], mass: 3, inertia: rod}}',
            '{top: {type: revolute, between: [ground, one], at: O},'
            ' mid: {type: revolute, between: [one, two], at: A}}',
        )
    )
    sim.step(50)
    reactions = sim.sample().reactions
    assert reactions['top'].force == pytest.approx([0.0, 5 * G], rel=1e-10)
    assert reactions['mid'].force == pytest.approx([0.0, 3 * G], rel=1e-10)


def test_three_bodies_at_one_pin_balance() -> None:
    """The reaction of each joint of a shared pin, against the bodies' own balances."""
    sim = Simulation(load_scene('double_four_bar'))
    sim.step(300)
    sample = sim.sample()
    a = {n: sample.qdd.reshape(-1, 2)[k] for k, n in enumerate(('B0', 'B1', 'B2'))}
    joints = {joint.name: joint for joint in sim.scene.mechanism.joints}
    need = {
        body.name: body.mass
        * (sum((a.get(p, np.zeros(2)) for p in body.points), np.zeros(2)) / 2 + [0.0, G])
        for body in sim.scene.mechanism.bodies
    }
    got = {name: np.zeros(2) for name in need}
    for name, joint in joints.items():
        force = sample.reactions[name].force
        got[joint.child] += force
        if joint.parent != 'ground':
            got[joint.parent] -= force
    for name in need:
        assert got[name] == pytest.approx(need[name], abs=1e-7)


def test_applied_wrench_is_no_reaction() -> None:
    """A force at the free end of a hanging rod shows up at its pin, once, with the other sign."""
    sim = Simulation(
        scene(
            '{O: {at: [0, 0], fixed: true}, A: {at: [0, -1]}}',
            '{rod: {points: [O, A], mass: 2, inertia: rod}}',
            '{pin: {type: revolute, between: [ground, rod], at: O}}',
        )
    )
    sim.apply_wrench('rod', force=[0.0, -7.0], at='A')
    assert sim.sample().reactions['pin'].force == pytest.approx([0.0, 2 * G + 7.0], rel=1e-10)
    sim.clear_inputs()
    sim.apply_wrench('A', force=[0.0, -7.0])
    assert sim.sample().reactions['pin'].force == pytest.approx([0.0, 2 * G + 7.0], rel=1e-10)


def test_redundant_bars_are_flagged_and_the_rest_is_not() -> None:
    """Two sliders in a line hold a plate; the hanging rod below is determinate.

    The shares of the sliders along the normal are not unique: the plate is one rigid body on three
    supports.
    """
    sim = Simulation(
        scene(
            '{A: {at: [0, 0]}, B: {at: [1, 0]}, C: {at: [2, 0]}, D: {at: [1, -1]}}',
            '{beam: {points: [A, C, B], mass: 1, inertia: rod, com: [1, 0]},'
            ' rod: {points: [B, D], mass: 1, inertia: rod}}',
            '{a: {type: slider, point: A, on: {through: [0, 0], direction: [1, 0]}},'
            ' c: {type: slider, point: C, on: {through: [0, 0], direction: [1, 0]}},'
            ' b: {type: slider, point: B, between: [ground, beam],'
            '     on: {through: [0, 0], direction: [1, 0]}},'
            ' hinge: {type: revolute, between: [beam, rod], at: B}}',
        )
    )
    sim.step(10)
    sample = sim.sample()
    assert sample.diagnostics.redundant == 1
    assert not sample.diagnostics.singular  # so it is everywhere
    flags = {name: reaction.indeterminate for name, reaction in sample.reactions.items()}
    assert flags == {'a': True, 'b': True, 'c': True, 'hinge': False}
    total = sum(sample.reactions[name].force[1] for name in 'abc')
    assert total == pytest.approx(2 * G, rel=1e-9)
    assert sample.reactions['hinge'].force == pytest.approx([0.0, G], abs=1e-9)
