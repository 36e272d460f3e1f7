"""Random open chains in space: as many freedoms as their joints have, no row too many, energy."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.scene.scene import Scene, scene_from_text
from support.thorough import thinned

FREE = {
    'spherical': 3,
    'revolute': 1,
    'universal': 2,
    'cylindrical': 2,
    'prismatic': 1,
    'planar': 3,
    'weld': 0,
}
SHARING = ('spherical', 'revolute', 'universal', 'weld')


def chain(seed: int) -> tuple[Scene, int]:
    """Two to four bodies of two to five points anywhere; and their freedoms."""
    random = np.random.default_rng(seed)
    places = random.uniform(-1.0, 1.0, (5, 3)).round(3)
    points, bodies, joints = [f'    P0: {{at: {places[0].tolist()}, fixed: true}}'], [], []
    previous, freedoms = 'ground', 0
    for k in range(random.integers(2, 5)):
        kind = str(random.choice(list(FREE)))
        freedoms += FREE[kind]
        start = f'P{k}'
        if kind not in SHARING or random.random() < 0.4:
            start = f'S{k}'
            points.append(f'    S{k}: {{at: {places[k].tolist()}}}')
        carried = [start, f'P{k + 1}', *(f'X{k}_{n}' for n in range(random.integers(0, 4)))]
        points.append(f'    P{k + 1}: {{at: {places[k + 1].tolist()}}}')
        points += [f'    {x}: {{at: {random.uniform(-1, 1, 3).tolist()}}}' for x in carried[2:]]
        moments = random.uniform(0.3, 0.5, 3).tolist()
        com = random.uniform(-0.3, 0.3, 3).tolist()
        bodies.append(
            f'    b{k}: {{points: [{", ".join(carried)}], mass: {random.uniform(0.5, 2.0)}, '
            f'inertia: {{about_com: {moments}}}, com: {com}}}'
        )
        z = random.standard_normal(3)
        x = np.cross(z, random.standard_normal(3))
        axis = '' if kind in ('spherical', 'weld') else f', axis: {z.tolist()}'
        if kind == 'universal':
            axis = f', axes: [{z.tolist()}, {x.tolist()}]'
        joints.append(
            f'    j{k}: {{type: {kind}, between: [{previous}, b{k}], at: {start}{axis}}}'
        )
        previous = f'b{k}'
    text = ['mechanism:', '  alf: 1', '  space: spatial', '  points:', *points]
    text += ['  bodies:', *bodies, '  joints:', *joints]
    text.append('effects: {gravity: {acceleration: [0.3, 0, -9.81]}}')
    return scene_from_text('\n'.join(text)), freedoms


@pytest.mark.parametrize('seed', thinned(range(50), keep=range(20)))
def test_a_random_chain(seed: int) -> None:
    scene, freedoms = chain(seed)
    sim = Simulation(scene, integrator='dop853', step=1e-3)
    first = sim.sample()
    sim.step(200)
    last = sim.sample()
    for sample in (first, last):
        assert sim.model.n - sample.diagnostics.rank == freedoms
        assert sample.diagnostics.redundant == 0
    assert last.energy == pytest.approx(first.energy, abs=1e-8)
    assert last.diagnostics.position_violation < 1e-12
    weight = 9.81 * sum(body.mass for body in scene.mechanism.bodies)
    if freedoms == 0:
        assert sample.reactions['j0'].force[2] == pytest.approx(weight, rel=1e-9)
