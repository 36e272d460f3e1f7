"""In space only bodies that turn about a steady axis have arcs; all others move in places."""

import numpy as np
import pytest
from numba import njit

from alf_ros import Simulation, kernel, load_scene
from alf_ros.kernel.steady_axes import STEADY, mark_steady
from alf_ros.model.arm_tree import arms_of
from alf_ros.model.compile import compile_model
from alf_ros.scene.scene import scene_from_text

# what a body is made of: its points, of which P may be fixed, and its vectors
KINDS = {
    'points': ['P', 'A', 'B', 'C'],
    'points-and-vectors': ['P', 'A', 'u', 'v'],
    'vectors': ['P', 'u', 'v'],
}
PLACES: dict[str, list[float]] = {
    'P': [0.3, -0.2, 0.5],
    'A': [0.8, 0.1, 0.4],
    'B': [0.2, 0.6, 0.1],
    'C': [0, 0, 1],
}
VECTORS: dict[str, list[float]] = {'u': [0.6, 0, 0.8], 'v': [0, 1, 0]}


def body(names, held, size):
    """A mechanism with one body of these points and vectors, in a unit of length."""
    spots = {name: size * np.array(PLACES[name]) for name in names if name in PLACES}
    points = [
        f'    {name}: {{at: {spot.tolist()}, fixed: {str(held and name == "P").lower()}}}'
        for name, spot in spots.items()
    ]
    vectors = [f'    {name}: {{along: {VECTORS[name]}}}' for name in names if name in VECTORS]
    inertia = (size**2 * np.array([0.1, 0.2, 0.15])).tolist()
    own = f'points: [{", ".join(spots)}]'
    if vectors:
        own += f', vectors: [{", ".join(name for name in names if name in VECTORS)}]'
    weight = f'mass: 1, com: [0, 0, 0], inertia: {{about_com: {inertia}}}'
    joints = '  joints: {j: {type: spherical, between: [ground, body], at: P}}' if held else ''
    return '\n'.join(
        ['mechanism:', '  alf: 1', '  space: spatial', '  points:', *points]
        + (['  vectors:', *vectors] if vectors else [])
        + [f'  bodies: {{body: {{{own}, {weight}}}}}', joints]
    )


@njit
def marked(unit, arms, phase, qdd, marks):
    mark_steady(unit, arms, phase, qdd, marks)


@pytest.mark.parametrize('size', [1e-6, 1.0, 1e5])
@pytest.mark.parametrize('held', [True, False], ids=['held', 'free'])
@pytest.mark.parametrize('kind', KINDS)
def test_the_axis_of_a_body_is_found_from_its_blocks(kind, held, size):
    """Rigid motions with known ω and ω̇, whose axis turns by just less and just more."""
    model = compile_model(scene_from_text(body(KINDS[kind], held, size)).mechanism, 1e7)
    layout, random = model.layout, np.random.default_rng(5)
    places, movable = model.q.reshape(-1, 3), layout.movable
    vectors = [block for block in layout.of_vector.values() if block < movable]
    for part in (0.98, 1.02):
        for _ in range(10):
            omega, carried, pulled = random.normal(size=(3, 3))
            across = np.cross(omega, random.normal(size=3))
            across *= part * STEADY * (omega @ omega) / np.linalg.norm(across)
            rate = across + random.normal() * omega
            arms = places - places[layout.of_point['P']]
            arms[vectors] = places[vectors]
            qd = np.cross(omega, arms)
            qdd = np.cross(rate, arms) + np.cross(omega, qd)
            if not held:
                points = [block for block in range(movable) if block not in vectors]
                qd[points] += size * carried
                qdd[points] += size * pulled
            qd[movable:], qdd[movable:] = 0.0, 0.0
            phase = kernel.Phase(
                model.q.copy(), qd.ravel(), np.zeros(0, dtype=np.int64), np.ones(1), np.zeros(0)
            )
            marks = np.full(movable, 7.0)
            marked(model.unit, model.system.arms, phase, qdd.ravel(), marks)
            turning = model.system.arms.about != kernel.FREE
            assert marks.tolist() == (turning & (part < 1.0)).tolist()


def test_in_the_plane_nothing_is_asked():
    arms = arms_of(compile_model(load_scene('four_bar').mechanism, 1e7).layout)
    assert arms.first.tolist() == [0] and arms.spoke.size == 0


LEG = """
mechanism:
  alf: 1
  space: spatial
  points:
    H: {at: [0, 0, 0]}
    K: {at: [0.2, 0, -0.1]}
    F: {at: [0.2, 0.15, -0.3]}
  vectors: {x: {along: [1, 0, 0]}, y: {along: [0, 1, 0]}, z: {along: [0, 0.6, 0.8]}}
  bodies:
    trunk: {points: [H], vectors: [x, y], mass: 2, inertia: {about_com: [0.02, 0.03, 0.04]}}
    thigh: {points: [H, K], vectors: [x], mass: 0.3, inertia: {about_com: [1e-3, 2e-3, 2e-3]}, com: [0.05, 0.02, 0]}
    shank: {points: [K, F], vectors: [z], mass: 0.1, inertia: {about_com: [4e-4, 3e-4, 2e-4]}, com: [0.07, 0, 0.01]}
  joints:
    hip: {type: revolute, between: [trunk, thigh], at: H, axis: x}
    knee: {type: revolute, between: [thigh, shank], at: K, axis: z}
"""  # noqa: E501


def test_a_robot_that_starts_from_rest_is_as_exact_as_in_places():
    """With an arc for every block that turns it would not be."""
    scene = scene_from_text(LEG)

    def angles(**options):
        simulation = Simulation(scene, **options)
        simulation.apply_effort('hip', 0.009)
        simulation.apply_effort('knee', -0.003)
        *_, last = simulation.run(1.0)
        return np.array(last.joint_positions)

    exact = angles(integrator='dop853_adaptive', tolerance=1e-13, step=0.1)
    assert np.abs(exact).min() > 2.0  # rad
    coarse = angles(integrator='dop853', step=0.05)
    assert np.abs(coarse - exact).max() < 1e-10
