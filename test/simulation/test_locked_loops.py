"""Loops in space that rows of velocities hold, couplings and threads, with rows that depend on
others: against the same mechanisms with welds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.simulation.sample import Sample
from support.thorough import thinned

STEP, STEPS = 1e-3, 500
ROW = {  # of an axis z and one normal to it, x
    'revolute': lambda z, x: {'axis': z},
    'prismatic': lambda z, x: {'axis': z},
    'screw': lambda z, x: {'axis': z, 'pitch': 0.3},
    'universal': lambda z, x: {'axes': [z, x]},
    'weld': lambda z, x: {},
}


class Loop:
    """Bodies anywhere in a row from the ground to the ground, and a pendulum on one of them.

    kinds: of the joints in their order. held: which of them couplings hold.
    """

    def __init__(self, seed: int, kinds: list[str], held: list[int]) -> None:
        random = np.random.default_rng(seed)
        self.kinds, self.held, count = kinds, held, len(kinds)
        self.places = random.uniform(-1.0, 1.0, (count, 2, 3))
        self.z = random.standard_normal((count + 1, 3))
        self.x = np.cross(self.z, random.standard_normal((count + 1, 3)))
        self.masses = random.uniform(0.5, 2.0, count)
        self.moments = random.uniform(0.3, 0.5, (count, 3))

    def mechanism(self, welded: list[int], couplings: list[int]) -> dict[str, Any]:
        """With welds in place of some joints, and couplings that hold others."""
        points, bodies, joints = dict[str, Any](), dict[str, Any](), dict[str, Any]()
        last = len(self.kinds) - 1
        for k, (place, other) in enumerate(self.places.tolist()):
            # the last of these bodies is the pendulum, which hangs on the one before it in the row
            own = {f'A{k}': place, f'B{k}': other, f'C{k}': self.places[k - 1, 1].tolist()}
            points |= {name: {'at': at} for name, at in own.items()}
            about = {'about_com': self.moments[k].tolist()}
            body = {'mass': float(self.masses[k]), 'inertia': about, 'com': [0.2, 0.1, 0.0]}
            bodies[f'b{k}'] = {'points': [*own], **body}
        for k, kind in enumerate(self.kinds):
            there = {
                'between': [f'b{k - 1}' if 0 < k < last else 'ground', f'b{min(k, last - 1)}'],
                'at': f'A{k}' if k < last else f'B{last - 1}',
            }
            kind = 'weld' if k in welded else kind
            joints[f'j{k}'] = {
                'type': kind,
                **there,
                **ROW[kind](self.z[k].tolist(), self.x[k].tolist()),
            }
        swing = {'between': [f'b{last // 2}', f'b{last}'], 'at': f'A{last}'}
        joints['swing'] = {'type': 'revolute', **swing, 'axis': self.z[-1].tolist()}
        return {
            'alf': 1,
            'space': 'spatial',
            'points': points,
            'bodies': bodies,
            'joints': joints,
            'couplings': {f'c{k}': {'joints': {f'j{k}': 1}} for k in couplings},
        }


def simulated(mechanism: dict[str, Any]) -> Simulation:
    gravity = {'gravity': {'acceleration': [0.3, 0.0, -9.81]}}
    scene = load_scene({'mechanism': mechanism, 'effects': gravity})
    return Simulation(scene, integrator='rk4', step=STEP)


def differing(one: Sample, other: Sample) -> float:
    """The largest difference of places (m) and velocities (m/s) of the points."""
    return max(
        float(np.abs(getattr(one, what)[name] - getattr(other, what)[name]).max())
        for what in ('points', 'velocities')
        for name in one.points
    )


R, P, S, U = 'revolute', 'prismatic', 'screw', 'universal'
# here errors grow if the rows are gradients of their sums along motions of rigid bodies only
GROWING: list[tuple[list[str], list[int], int]] = [
    ([R, R, R], [1, 2], 75),
    ([P, R, R, R], [2, 3], 20),
    ([R, R, R, R, P, P], [1, 3], 219),
    ([R, R, R, R, P, P], [2, 3], 164),
    ([R, R, S, U, R], [1], 35),
    ([R, S, P, R, S], [2, 3, 4], 17),
]
RANDOM = [(kinds, held, seed) for kinds, held, _ in GROWING for seed in range(20)]
RANDOM += [([U, S, P], [], seed) for seed in range(20)]


@pytest.mark.parametrize(
    ('kinds', 'held', 'seed'), [*GROWING, *thinned(RANDOM, keep=lambda _, held, seed: seed == 3)]
)
def test_a_loop_without_freedom_stands_still(kinds: list[str], held: list[int], seed: int) -> None:
    """The pendulum swings as on welded bodies; rounding does not grow."""
    loop = Loop(seed, kinds, held)
    simulation = simulated(loop.mechanism([], held))
    welded = simulated(loop.mechanism([*range(len(kinds))], []))
    first = simulation.sample()
    assert simulation.model.n - first.diagnostics.rank == 1
    assert first.diagnostics.redundant > 0
    moved = 0.0
    for _ in range(5):
        simulation.step(STEPS // 5)
        welded.step(STEPS // 5)
        sample = simulation.sample()
        assert differing(sample, welded.sample()) < 1e-10
        assert np.abs(sample.phi).max() < 1e-13
        moved = max(moved, differing(sample, first))
    assert moved > 1e-3
