"""One four-bar, modelled in many ways: the same motion to 1e-9."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text

LENGTHS = 1.0, 2.0, 2.2, 2.5  # crank, coupler, rocker, ground; m
RATE = 4.0  # rad/s
TIMES = [0.25 * k for k in range(1, 9)]
MASS = {'crank': 1.0, 'coupler': 2.0, 'rocker': 1.5}


def places() -> dict[str, Floats]:
    """The drawing: the crank stands up."""
    a, b, c, d = LENGTHS
    A, C = np.array([0.0, a]), np.array([d, 0.0])
    gap = C - A
    size = np.linalg.norm(gap)
    along = (b**2 - c**2 + size**2) / (2.0 * size)
    across = np.sqrt(b**2 - along**2)
    u = gap / size
    B = A + along * u + across * np.array([-u[1], u[0]])
    return {'O': np.zeros(2), 'A': A, 'B': B, 'C': C}


def scene(
    joints: dict[str, str],
    spatial: bool,
    scale: float = 1.0,
    turn: Floats | None = None,
    inertia: str = 'rod',
    more: str = '',
) -> str:
    R = np.eye(3) if turn is None else turn
    D = 3 if spatial else 2

    def world(flat: Floats) -> list[float]:
        return list(map(float, (R @ np.array([*flat, 0.0]))[:D]))

    lines = [
        'mechanism:',
        '  alf: 1',
        f'  space: {"spatial" if spatial else "planar"}',
        '  points:',
    ]
    for name, at in places().items():
        fixed = ', fixed: true' if name in 'OC' else ''
        lines.append(f'    {name}: {{at: {world(scale * at)}{fixed}}}')
    lines.append('  bodies:')
    for body, ends in (('crank', 'O, A'), ('coupler', 'A, B'), ('rocker', 'C, B')):
        lines.append(f'    {body}: {{points: [{ends}], mass: {MASS[body]}, inertia: {inertia}}}')
    if more:
        lines.append(more)
    lines.append('  joints:')
    axis = f', axis: {(R @ [0.0, 0.0, 1.0]).tolist()}' if spatial else ''
    bar = places()['B'] - places()['A']  # the cross of a universal joint stands across it
    upright, across = R @ [0.0, 0.0, 1.0], R @ [-bar[1], bar[0], 0.0]
    cross = f', axes: [{upright.tolist()}, {across.tolist()}]'
    between = {'pin': ('ground', 'crank', 'O'), 'knee': ('crank', 'coupler', 'A')}
    between |= {'wrist': ('coupler', 'rocker', 'B'), 'foot': ('ground', 'rocker', 'C')}
    for name, (parent, child, where) in between.items():
        kind = joints[name]
        along = {'spherical': '', 'universal': cross}.get(kind, axis)
        lines.append(
            f'    {name}: {{type: {kind}, between: [{parent}, {child}], at: {where}{along}}}'
        )
    if more:
        lines.append('    second: {type: revolute, between: [crank, double], at: A}')
        lines.append('    third: {type: revolute, between: [rocker, double], at: B}')
    speed = world(np.array([-RATE * LENGTHS[0] * scale, 0.0]))
    lines += [
        f'effects: {{gravity: {{acceleration: {world(np.array([0.0, -9.81 * scale]))}}}}}',
        f'initial: {{velocities: {{A: {speed}}}}}',
    ]
    return '\n'.join(lines)


REVOLUTE = dict.fromkeys(('pin', 'knee', 'wrist', 'foot'), 'revolute')
MINIMAL = {**REVOLUTE, 'knee': 'universal', 'wrist': 'spherical'}
TILT = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix()
WAYS = {
    # text, rows too many, metres per unit, from the frame of the model to that of the plane
    'in millimetres': (scene(REVOLUTE, False, 1e3), 0, 1e-3, np.eye(3)),
    'in space, all revolute': (scene(REVOLUTE, True), 3, 1.0, np.eye(3)),
    'in space, minimal': (scene(MINIMAL, True), 0, 1.0, np.eye(3)),
    'in space, tilted': (scene(REVOLUTE, True, turn=TILT), 3, 1.0, TILT.T),
    'in space, tilted, minimal': (scene(MINIMAL, True, turn=TILT), 0, 1.0, TILT.T),
    'in space, in millimetres': (scene(REVOLUTE, True, 1e3), 3, 1e-3, np.eye(3)),
    'in space, minimal, in millimetres': (scene(MINIMAL, True, 1e3), 0, 1e-3, np.eye(3)),
}


@pytest.fixture(scope='module')
def reference() -> list[dict[str, Floats]]:
    sim = Simulation(scene_from_text(scene(REVOLUTE, False)), integrator='dop853', step=5e-3)
    found = []
    for sample in sim.run(TIMES[-1], at=TIMES):
        forces = {name: reaction.force for name, reaction in sample.reactions.items()}
        found.append({**sample.points, **forces, 'energy': np.array(sample.energy)})
    return found


@pytest.mark.parametrize('text, redundant, unit, back', WAYS.values(), ids=WAYS)
def test_same_motion(
    text: str, redundant: int, unit: float, back: Floats, reference: list[dict[str, Floats]]
) -> None:
    sim = Simulation(scene_from_text(text), integrator='dop853', step=5e-3)
    D = sim.model.layout.dimension
    for sample, wanted in zip(sim.run(TIMES[-1], at=TIMES), reference, strict=True):
        for name in 'AB':
            place = back[:D, :D] @ sample.points[name] * unit
            assert place[:2] == pytest.approx(wanted[name], abs=1e-9)
            assert place[2:] == pytest.approx(0.0, abs=1e-12)
        assert sample.energy * unit**2 == pytest.approx(float(wanted['energy']), abs=1e-8)
        assert sample.diagnostics.redundant == redundant
        if not redundant:
            for joint in REVOLUTE:
                force = back[:D, :D] @ sample.reactions[joint].force * unit
                assert force[:2] == pytest.approx(wanted[joint], abs=1e-6)


def test_a_bar_twice_or_one_bar_of_both_masses(reference: list[dict[str, Floats]]) -> None:
    """The coupler split into two bars on the same pins: a row too many, and the same motion."""
    half = scene(REVOLUTE, False, more='    double: {points: [A, B], mass: 1.0, inertia: rod}')
    half = half.replace(
        'coupler: {points: [A, B], mass: 2.0', 'coupler: {points: [A, B], mass: 1.0'
    )
    sim = Simulation(scene_from_text(half), integrator='dop853', step=5e-3)
    for sample, wanted in zip(sim.run(TIMES[-1], at=TIMES), reference, strict=True):
        for name in 'AB':
            assert sample.points[name] == pytest.approx(wanted[name], abs=1e-9)
        assert sample.reactions['pin'].force == pytest.approx(wanted['pin'], abs=1e-6)
        assert sample.diagnostics.redundant == 1
        assert sample.reactions['second'].indeterminate
        assert not sample.reactions['pin'].indeterminate
