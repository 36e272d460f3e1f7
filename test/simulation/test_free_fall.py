"""Free fall of a heavy body with arms of light links: no joint carries anything, so λ is zero.

All that the solves leave of the rows is then rounding. It was taken for a singular position.
"""

from __future__ import annotations

import pytest

from alf_ros import Simulation
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.side_by_side import SideBySide
from support.thorough import combined

G, DURATION = 9.81, 0.1
AXES = ([0, 1, 0], [1, 0, 0], [0, 0, 1])


def walker(arms: int, links: int, mass: float, light: float) -> str:
    """A scene: a body of `mass` (kg) with `arms` of `links`, of `light` kg the first, at rest."""
    points = ['O: {at: [0, 0, 1]}', 'X: {at: [1, 0, 1]}']
    bodies: list[tuple[str, list[str], float]] = [('hub', ['O', 'X'], mass)]
    joints = []
    for arm in range(arms):
        for k in range(links):
            parent, name, point = bodies[-1] if k else bodies[0], f'l{arm}_{k}', f'P{arm}_{k}'
            points.append(f'{point}: {{at: [{0.1 * k}, {0.1 * arm}, {1 - 0.1 * k}]}}')
            parent[1].append(point)
            bodies.append((name, [point], light / (k + 1)))
            sides = f'between: [{parent[0]}, {name}], at: {point}'
            joints.append(f'j{arm}_{k}: {{type: revolute, {sides}, axis: {AXES[k % 3]}}}')
    made = []
    for name, of, m in bodies:
        J = 1e-4 * m  # kg m^2
        inertia = f'com: [0.05, 0, 0], inertia: {{about_com: [{J:.9f}, {J:.9f}, {J:.9f}]}}'
        made.append(f'{name}: {{points: [{", ".join(of)}], mass: {m!r}, {inertia}}}')
    parts = {'points': points, 'bodies': made, 'joints': joints}
    lines = (f'  {key}: {{{", ".join(each)}}}\n' for key, each in parts.items())
    head = 'mechanism:\n  alf: 1\n  space: spatial\n'
    return f'{head}{"".join(lines)}effects: {{gravity: {{acceleration: [0, 0, {-G}]}}}}\n'


SIZES = [(1, 6, 10.0, 0.05), (2, 6, 10.0, 0.05), (1, 6, 30.0, 1e-3), (2, 8, 30.0, 0.01)]


@pytest.mark.parametrize(
    ('size', 'integrator'),
    combined([pytest.param(size) for size in SIZES], ['rk4', 'dop853_adaptive', 'esdirk43']),
)
def test_it_falls_as_one_body(size: tuple[int, int, float, float], integrator: str) -> None:
    simulation = Simulation(scene_from_text(walker(*size)), step=1e-3, integrator=integrator)
    assert simulation.sample().points['X'][2] == 1.0
    simulation.step(round(DURATION / simulation.h))
    sample = simulation.sample()
    assert sample.points['X'][2] == pytest.approx(1.0 - 0.5 * G * DURATION**2, abs=1e-12)
    assert max(abs(joint.position) for joint in sample.joints.values()) < 1e-12


def test_side_by_side() -> None:
    """The same bits, in vector registers."""
    scenes = [scene_from_text(walker(1, 6, mass, 0.05)) for mass in (8.0, 9.0, 10.0)]
    together = [Simulation(scene, step=1e-3, integrator='rk4') for scene in scenes]
    alone = [Simulation(scene, step=1e-3, integrator='rk4') for scene in scenes]
    SideBySide(together).step(20)
    for one, other in zip(together, alone, strict=True):
        other.step(20)
        assert one.state.q.tobytes() == other.state.q.tobytes()
