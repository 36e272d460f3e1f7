"""The mass matrix in natural coordinates against the rigid body, whatever carries the body."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Simulation, kernel
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.scene import load_scene, scene_from_text

# what carries the body: points, and vectors; all that can stand in a file
SPATIAL = {
    'one point': (1, 0),
    'two points': (2, 0),
    'three points': (3, 0),
    'four points': (4, 0),
    'seven points': (7, 0),
    'a point and a vector': (1, 1),
    'a point and two vectors': (1, 2),
    'a point and three vectors': (1, 3),
    'two points and two vectors': (2, 2),
    'three points and three vectors': (3, 3),
}
SEEDS = range(3)


def tensor(random: np.random.Generator) -> Floats:
    """An inertia that a body can have: of five random point masses about their centre."""
    places = random.standard_normal((5, 3))
    places -= places.mean(axis=0)
    return np.asarray(sum((p @ p) * np.eye(3) - np.outer(p, p) for p in places))


def spatial(points: int, vectors: int, inertia: str, com: str, mass: float, seed: int) -> Model:
    random = np.random.default_rng(seed)
    lines = ['mechanism:', '  alf: 1', '  space: spatial', '  points:']
    lines += [
        f'    P{k}: {{at: {random.standard_normal(3).round(3).tolist()}}}' for k in range(points)
    ]
    lines.append('    G: {at: [3, 0, 0], fixed: true}')
    if vectors:
        lines.append('  vectors:')
        lines += [
            f'    v{k}: {{along: {random.standard_normal(3).tolist()}}}' for k in range(vectors)
        ]
    P, v = [f'P{k}' for k in range(points)], [f'v{k}' for k in range(vectors)]
    lines += [
        '  bodies:',
        f'    body: {{points: [{", ".join(P)}], vectors: [{", ".join(v)}], mass: {mass},',
        f'           inertia: {inertia}, {com}}}',
    ]
    return compile_model(scene_from_text('\n'.join(lines)).mechanism, 1e8)


def kinetic(model: Model, qd: Floats) -> float:
    out = np.zeros(model.n)
    kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd, out)
    return 0.5 * float(out @ qd[: model.n])


def turned(model: Model, R: Floats, shift: Floats) -> Floats:
    """(blocks, D) the drawing, moved as a rigid body: points and vectors."""
    q = model.q.reshape(-1, R.shape[0])
    moved = q @ R.T
    for name, block in model.layout.of_point.items():
        if name != 'G':
            moved[block] += shift
    return np.asarray(moved)


def twist_of(model: Model, places: Floats, velocity: Floats, spin: Floats) -> Floats:
    """(blocks, D) velocities of a rigid motion with `velocity` at the origin."""
    cross = (
        np.cross(spin, places)
        if spin.size == 3
        else spin[0] * np.stack([-places[:, 1], places[:, 0]], axis=1)
    )
    for block in model.layout.of_point.values():
        cross[block] += velocity
    cross[model.layout.movable :] = 0.0
    return np.asarray(cross)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('points, vectors', SPATIAL.values(), ids=SPATIAL)
def test_kinetic_energy_in_space(points: int, vectors: int, seed: int) -> None:
    """½ q̇ᵀ M q̇ = ½ m |v|² + ½ ω·R J Rᵀ ω for every position and every motion."""
    random = np.random.default_rng(100 + seed)
    J, com, m = tensor(random), random.standard_normal(3), 1.7
    rows = [row.tolist() for row in 0.5 * (J + J.T)]
    model = spatial(points, vectors, f'{{about_com: {rows}}}', f'com: {com.tolist()}', m, seed)
    body = model.layout.body['body']
    # as many rows as leave the six freedoms of a body, and none of them says what others say
    assert len(model.row_names) == Linearised(model, model.q).rank == model.n - 6
    for R in Rotation.random(4, random_state=seed).as_matrix():
        places = turned(model, R, random.standard_normal(3))
        velocity, spin = random.standard_normal((2, 3))
        qd = twist_of(model, places, velocity, spin)
        # the frame of the body, made here from its first point and what else it carries
        frame = frame_of(model, places)
        centre = places[model.layout.of_point['P0']] + frame.T @ np.array(body.com)
        v = velocity + np.cross(spin, centre)
        w = frame @ spin
        wanted = 0.5 * m * v @ v + 0.5 * w @ J @ w
        assert kinetic(model, qd.ravel()) == pytest.approx(wanted, rel=1e-11)


def frame_of(model: Model, places: Floats) -> Floats:
    """Axes (rows): x to the second point, else along the first vector; y in the plane of the next
    direction, vectors before further points. What the file leaves open, the vectors added say."""
    layout = model.layout
    P = layout.body['body'].points
    given = [v for v in layout.body['body'].vectors if v.startswith('v')]
    first = places[layout.of_point['P0']]
    directions = [places[layout.of_point[name]] - first for name in P[1:2]]
    directions += [places[layout.of_vector[name]] for name in given]
    directions += [places[layout.of_point[name]] - first for name in P[2:]]
    if len(P) == 1 and not given:
        names = [f'body_{axis}' for axis in 'xyz']
        size = layout.length
        return np.array([places[layout.of_vector[name]] / size for name in names])
    x = directions[0] / np.linalg.norm(directions[0])
    if len(directions) > 1:
        y = directions[1] - (directions[1] @ x) * x
        y /= np.linalg.norm(y)
    else:
        y = places[layout.of_vector['body_y']] / layout.length
    return np.array([x, y, np.cross(x, y)])


@pytest.mark.parametrize('kind', ['rod', 'point'])
def test_kinetic_energy_of_rods_and_points_in_space(kind: str) -> None:
    random = np.random.default_rng(5)
    model = spatial(2, 0, kind, 'com: [0.3, 0, 0]', 2.0, 7)
    assert model.n == 6  # nothing but the points
    L = np.linalg.norm(np.diff(model.q.reshape(-1, 3)[:2], axis=0))
    for R in Rotation.random(4, random_state=2).as_matrix():
        places = turned(model, R, random.standard_normal(3))
        velocity, spin = random.standard_normal((2, 3))
        qd = twist_of(model, places, velocity, spin)
        a, b = (places[model.layout.of_point[name]] for name in ('P0', 'P1'))
        axis = (b - a) / L
        v = velocity + np.cross(spin, a + 0.3 * axis)
        across = spin - (spin @ axis) * axis
        J = 2.0 * L**2 / 12.0 if kind == 'rod' else 0.0
        assert kinetic(model, qd.ravel()) == pytest.approx(
            v @ v + 0.5 * J * across @ across, rel=1e-12
        )


def test_an_inertia_is_symmetric_to_rounding() -> None:
    """One that was turned is not more than that; the mean of both halves counts."""
    R = Rotation.random(random_state=1).as_matrix()
    J = R @ np.diag([0.2, 0.3, 0.4]) @ R.T
    assert (J != J.T).any()
    model = spatial(3, 0, f'{{about_com: {J.tolist()}}}', 'com: [0, 0, 0]', 1.0, 1)
    (body,) = model.layout.bodies
    assert np.array_equal(body.inertia, 0.5 * (J + J.T))
    J[0, 1] += 1e-6
    with pytest.raises(InputError, match='not symmetric'):
        spatial(3, 0, f'{{about_com: {J.tolist()}}}', 'com: [0, 0, 0]', 1.0, 1)


@pytest.mark.parametrize('points', [1, 2, 3, 5])
def test_kinetic_energy_in_the_plane(points: int) -> None:
    random = np.random.default_rng(points)
    J, com, m = (0.7, random.standard_normal(2), 1.3) if points > 1 else (0.0, np.zeros(2), 1.3)
    lines = ['mechanism:', '  alf: 1', '  points:', '    G: {at: [3, 0], fixed: true}']
    lines += [f'    P{k}: {{at: {random.standard_normal(2).tolist()}}}' for k in range(points)]
    names = ', '.join(f'P{k}' for k in range(points))
    inertia = f'{{about_com: {J}}}, com: {com.tolist()}' if points > 1 else 'point'
    lines += ['  bodies:', f'    body: {{points: [{names}], mass: {m}, inertia: {inertia}}}']
    model = compile_model(scene_from_text('\n'.join(lines)).mechanism, 1e8)
    for angle in random.uniform(0.0, 6.0, 4):
        c, s = np.cos(angle), np.sin(angle)
        places = turned(model, np.array([[c, -s], [s, c]]), random.standard_normal(2))
        velocity, spin = random.standard_normal(2), random.standard_normal(1)
        qd = twist_of(model, places, velocity, spin)
        first = places[model.layout.of_point['P0']]
        centre = first
        if points > 1:
            x = places[model.layout.of_point['P1']] - first
            x /= np.linalg.norm(x)
            centre = first + com[0] * x + com[1] * np.array([-x[1], x[0]])
        v = velocity + spin[0] * np.array([-centre[1], centre[0]])
        turning = J * spin[0] ** 2 if points > 1 else 0.0
        wanted = 0.5 * m * v @ v + 0.5 * turning
        if points == 1:  # it has no orientation: only the velocity of the point counts
            wanted = 0.5 * m * v @ v
        assert kinetic(model, qd.ravel()) == pytest.approx(wanted, rel=1e-11)


@pytest.mark.parametrize('sine', [0.3, 0.03, 3e-4])
def test_points_nearly_in_a_line_carry_a_body_as_well_as_others(sine: float) -> None:
    """A torque-free body of three or four nearly collinear points keeps its energy and spin."""
    for flat in ('', ', S'):
        text = f"""
mechanism:
  alf: 1
  space: spatial
  points:
    P: {{at: [0, 0, 0]}}
    Q: {{at: [1, 0, 0]}}
    R: {{at: [0.9, {0.9 * sine}, 0]}}
    S: {{at: [0.5, {0.2 * sine}, {0.5 * sine}]}}
    G: {{at: [3, 0, 0], fixed: true}}
  bodies:
    body:
      points: [P, Q, R{flat}]
      mass: 1
      inertia: {{about_com: [0.1, 0.2, 0.25]}}
      com: [0.5, 0, 0]
    {'' if flat else 'other: {points: [S], mass: 1, inertia: point}'}
initial:
  velocities: {{P: [0, 0, 0], Q: [0, 2, 1], R: [{-1.8 * sine}, 1.8, {2.7 * sine + 0.9}]}}
"""
        sim = Simulation(scene_from_text(text), integrator='dop853', step=5e-3)
        first = sim.sample()
        assert first.energy == pytest.approx(
            0.5 * (5 / 4 + 0.1 * 9 + 0.2 * 1 + 0.25 * 4), rel=1e-9
        )
        sim.step(400)
        last = sim.sample()
        assert last.energy == pytest.approx(first.energy, rel=1e-10)
        assert last.diagnostics.redundant == 0
        assert last.diagnostics.position_violation < 1e-13


@pytest.mark.parametrize('length', [0.1, 1 / 3, 0.7, 1.1, 49.0])
def test_a_point_that_carries_a_body_is_its_block(length: float) -> None:
    scene = with_changes(load_scene('slider_crank'), {'L': repr(length)})
    layout = compile_model(scene.mechanism, 1e8).layout
    for body in layout.bodies:
        for point, local in zip(body.points, body.local, strict=True):
            place = layout.place(body.name, local)
            assert list(place.parts) == [layout.of_point[point]] and not place.constant.any()
            assert np.array_equal(place.parts[layout.of_point[point]], np.eye(2))
