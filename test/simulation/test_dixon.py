"""Dixon's mechanism of the first kind (1899): bars from each point of one line to each point of a
line across. By the count of its bars it is a structure with bars to spare, and it moves."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats


def dixon(one: Floats, other: Floats, angle: float) -> dict[str, Any]:
    """A scene with points on two lines through the origin (m), turned by an angle (rad). The first
    ones of both stand still."""
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    places = {f'A{k}': x * along for k, x in enumerate(one)}
    places |= {f'B{k}': x * across for k, x in enumerate(other)}
    points = {
        name: {'at': place.tolist(), 'fixed': name in {'A0', 'B0'}}
        for name, place in places.items()
    }
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    held = {'A0': 'ground', 'B0': 'ground'}
    for i, k in itertools.product(range(one.size), range(other.size)):
        ends, name = (f'A{i}', f'B{k}'), f'bar{i}{k}'
        if not i and not k:
            continue
        bodies[name] = {'points': list(ends), 'mass': 0.5 + 0.1 * i + 0.07 * k, 'inertia': 'rod'}
        for end in ends:
            if end in held:
                pin = {'type': 'revolute', 'between': [held[end], name], 'at': end}
                joints[f'{name}_{end}'] = pin
            else:
                held[end] = name
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    return {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [3.0, -9.81]}}}


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_it_moves_on_its_two_lines(seed: int) -> None:
    """With s and t along the lines, each s² grows by as much as each t² falls."""
    random = np.random.default_rng(seed)
    one, other = (np.sort(random.uniform(0.4, 2.0, n)) for n in (3, 4))
    scene = load_scene(dixon(one, other, random.uniform(0.0, 6.0)))
    sim = Simulation(scene, integrator='dop853', step=1e-3)
    start, moved = sim.sample(), 0.0
    for sample in sim.run(1.0, every=100):
        lines = [
            np.array([sample.points[f'{letter}{k}'] for k in range(count)])
            for letter, count in (('A', one.size), ('B', other.size))
        ]
        ways = [np.linalg.svd(line - line.mean(axis=0)) for line in lines]
        assert max(s[1] for _, s, _ in ways) < 1e-13  # straight
        u, v = (vectors[0] for _, _, vectors in ways)
        assert abs(u @ v) < 1e-13  # and across
        # where they cross: s u from the first line, t v from the second
        foot = np.linalg.solve(np.array([u, -v]).T, lines[1][0] - lines[0][0])
        crossing = lines[0][0] + foot[0] * u
        s, t = ((line - crossing) @ way for line, way in zip(lines, (u, v), strict=True))
        grown = s**2 - one**2
        assert grown == pytest.approx(np.full(one.size, grown[0]), abs=1e-12)
        assert t**2 - other**2 == pytest.approx(np.full(other.size, -grown[0]), abs=1e-12)
        moved = max(moved, abs(grown[0]))
        assert sample.energy == pytest.approx(start.energy, abs=1e-9)
    assert moved > 0.05
