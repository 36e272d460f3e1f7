"""Masses of bodies of a USD stage: closed formulas, quadrature, and what usd-core computes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import support.usd_robots as usd
from alf_ros.arrays import Floats
from support.usd_robots import FULL, body, made, placed, prim, robot_of, stage

pxr = pytest.importorskip('pxr')
Numbers = tuple[float, ...]

SHAPES = {  # kind: attributes, volume, moments about x, y and z of density 1
    'Cube': ('double size = 3', 27.0, (40.5, 40.5, 40.5)),
    'Sphere': ('double radius = 2', 32.0 * math.pi / 3.0, (1.6 * 32.0 * math.pi / 3.0,) * 3),
    'Cylinder': (
        'double radius = 2\ndouble height = 3\nuniform token axis = "X"',
        12.0 * math.pi,
        (24.0 * math.pi, 21.0 * math.pi, 21.0 * math.pi),
    ),
}
DENSITIES = {  # on the body, on the shape, on its material -> kg/m^3
    'default': (0.0, 0.0, 0.0, 1000.0),
    'material': (0.0, 0.0, 7.0, 7.0),
    'body': (6.0, 0.0, 7.0, 6.0),
    'shape': (6.0, 5.0, 7.0, 5.0),
}


@pytest.mark.parametrize('kind', SHAPES)
def test_mass_of_shapes(kind: str, tmp_path: Path) -> None:
    attributes, volume, moments = SHAPES[kind]
    for given in DENSITIES.values():
        of_body, own, of_material, density = given
        material = prim('Material', 'stuff', 'Material', f'float physics:density = {of_material}')
        shape = prim(
            kind,
            'shape',
            'Collision Mass',
            attributes,
            placed((1.0, 0.0, 0.0)),
            f'float physics:density = {own}',
            'rel material:binding:physics = </stuff>',
        ).replace('"PhysicsCollisionAPI"', '"MaterialBindingAPI", "PhysicsCollisionAPI"')
        text = stage(material, body('b', f'float physics:density = {of_body}', shape))
        (part,) = robot_of(tmp_path, text).parts
        assert part.mass == pytest.approx(density * volume, rel=1e-14)
        assert part.com == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
        assert part.inertia == pytest.approx(density * np.diag(moments), rel=1e-14, abs=1e-9)


def spread(kind: str, radius: float, height: float) -> tuple[float, float, Floats]:
    """Volume, middle along z, and second moments about it, by quadrature."""
    inner = {
        'Cone': lambda z: radius * (0.5 - z / height),
        'Capsule': lambda z: math.sqrt(max(0.0, radius**2 - max(0.0, abs(z) - height / 2.0) ** 2)),
    }[kind]
    end = height / 2.0 + (radius if kind == 'Capsule' else 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    parts = [-end, -height / 2.0, height / 2.0, end]
    volume = first = along = across = 0.0
    for low, high in itertools.pairwise(parts):
        for node, weight in zip(nodes, weights, strict=True):
            z = low + (high - low) * (1.0 + node) / 2.0
            area = math.pi * inner(z) ** 2 * weight * (high - low) / 2.0
            volume += area
            first += area * z
            along += area * z * z
            across += area * inner(z) ** 2 / 4.0
    middle = first / volume
    return volume, middle, np.diag([across, across, along - volume * middle**2])


@pytest.mark.parametrize('kind', ['Cone', 'Capsule'])
def test_mass_of_round_shapes_that_are_scaled(kind: str, tmp_path: Path) -> None:
    """Unequal scales on the shape, the body and between: the affine map of its second moments."""
    volume, middle, second = spread(kind, 0.3, 0.8)
    scales, turn = np.array([1.5, 0.7, 2.0]), Rotation.from_rotvec([0.4, -0.2, 0.9])
    shape = prim(
        kind,
        'shape',
        'Collision',
        'double radius = 0.3\ndouble height = 0.8\nuniform token axis = "Z"',
        f'double3 xformOp:scale = {usd.numbers(scales)}',
        placed((0.2, 0.0, 0.1), turn).replace('"]', '", "xformOp:scale"]'),
    )
    (part,) = robot_of(tmp_path, stage(body('b', shape))).parts
    A = turn.as_matrix() @ np.diag(scales)
    factor = abs(np.linalg.det(A))
    S = factor * A @ second @ A.T
    assert part.mass == pytest.approx(1000.0 * factor * volume, rel=1e-9)
    assert part.com == pytest.approx(A @ (0.0, 0.0, middle) + (0.2, 0.0, 0.1), abs=1e-9)
    assert part.inertia == pytest.approx(1000.0 * (np.trace(S) * np.eye(3) - S), abs=1e-8)


CORNERS = list(itertools.product((0.0, 2.0), (0.0, 3.0), (0.0, 4.0)))
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def mesh(*lines: str, faces: tuple[tuple[int, ...], ...] = FACES) -> str:
    counts = ', '.join(str(len(face)) for face in faces)
    indices = ', '.join(str(n) for face in faces for n in face)
    points = ', '.join(usd.numbers(corner) for corner in CORNERS)
    return prim(
        'Mesh',
        'shape',
        'Collision MeshCollision',
        f'int[] faceVertexCounts = [{counts}]\nint[] faceVertexIndices = [{indices}]',
        f'point3f[] points = [{points}]',
        *lines,
    )


def test_mass_of_meshes(tmp_path: Path) -> None:
    """A closed mesh is a solid, whichever way its faces turn; the hull closes an open one."""
    hull = 'uniform token physics:approximation = "convexHull"'
    inside_out = tuple(face[::-1] for face in FACES)
    for shape in (mesh(), mesh(faces=inside_out), mesh(hull), mesh(hull, faces=FACES[:5])):
        (part,) = robot_of(tmp_path, stage(body('b', shape))).parts
        assert part.mass == pytest.approx(24e3, rel=1e-14)
        assert part.com == pytest.approx([1.0, 1.5, 2.0], rel=1e-14)
        J = 24e3 / 12.0 * np.diag([9.0 + 16.0, 4.0 + 16.0, 4.0 + 9.0])
        assert part.inertia == pytest.approx(J, rel=1e-13, abs=1e-9)
    # a mass does without the shape
    whole = stage(body('b', FULL, mesh(faces=FACES[:5])))
    assert robot_of(tmp_path, whole).parts[0].mass == 2.0


def oracle(
    folder: Path, kinds: Mapping[str, tuple[Numbers, Numbers]]
) -> tuple[float, Floats, Floats]:
    """Mass, place and inertia about the centre of mass by usd-core, of boxes with these edges."""
    from pxr import Gf, Usd, UsdPhysics

    opened = Usd.Stage.Open(str(folder / 'it.usda'))

    def information(shape: Any) -> Any:
        place, edges = kinds[shape.GetName()]
        found = UsdPhysics.RigidBodyAPI.MassInformation()
        found.volume = float(np.prod(edges))
        squares = np.array(edges) ** 2
        moments = found.volume / 12.0 * (squares.sum() - squares)
        found.inertia = Gf.Matrix3f(*np.diag(moments).ravel().tolist())
        found.centerOfMass, found.localRot = Gf.Vec3f(0.0), Gf.Quatf(1.0)
        found.localPos = Gf.Vec3f(*place)
        return found

    api = UsdPhysics.RigidBodyAPI(opened.GetPrimAtPath('/b'))
    mass, moments, com, axes = api.ComputeMassProperties(information)
    turn = Rotation.from_quat([*axes.GetImaginary(), axes.GetReal()]).as_matrix()
    return mass, np.array(com), turn @ np.diag(moments) @ turn.T


MASSES = {
    'mass of the body': 'float physics:mass = 3',
    'mass and inertia': 'float physics:mass = 3\nfloat3 physics:diagonalInertia = (1, 2, 2)\n'
    'quatf physics:principalAxes = (0.8, 0, 0.6, 0)',
    'centre of the body': 'point3f physics:centerOfMass = (0.1, 0.2, 0.3)',
    'density of the body': 'float physics:density = 20',
    'nothing': '',
}
OF_SHAPES = {
    'none': '',
    'mass': 'float physics:mass = 4',
    'density': 'float physics:density = 30',
    'centre': 'point3f physics:centerOfMass = (0, 0.1, 0)',
    'inertia': 'float physics:mass = 4\nfloat3 physics:diagonalInertia = (3, 2, 2)',
}


@pytest.mark.parametrize('given', MASSES.values(), ids=MASSES)
def test_what_is_left_open_is_as_usd_core_computes_it(given: str, tmp_path: Path) -> None:
    """Two boxes, of which one says more."""
    for own in OF_SHAPES.values():
        first = prim('Cube', 'one', 'Collision Mass', 'double size = 1', own)
        second = prim('Cube', 'two', 'Collision', placed((1.0, 0.5, 0.0)), 'double size = 0.5')
        text = stage(body('b', given, first, second))
        (part,) = robot_of(tmp_path, text).parts
        sizes = {'one': ((0.0,) * 3, (1.0,) * 3), 'two': ((1.0, 0.5, 0.0), (0.5,) * 3)}
        mass, com, inertia = oracle(tmp_path, sizes)
        assert part.mass == pytest.approx(mass, rel=1e-6)
        assert part.com == pytest.approx(com, abs=1e-6)
        assert part.inertia == pytest.approx(inertia, abs=1e-5 * np.abs(inertia).max())


def test_a_disabled_shape_has_no_mass(tmp_path: Path) -> None:
    """As the specification has it from OpenUSD 26.11 on; earlier it left this open, and usd-core
    counted such shapes."""
    off = 'double size = 0.5\nbool physics:collisionEnabled = false'
    shapes = (
        prim('Cube', 'one', 'Collision', 'double size = 1'),
        prim('Cube', 'two', 'Collision', off),
    )
    robot = robot_of(tmp_path, stage(body('b', '', *shapes)))
    assert robot.parts[0].mass == pytest.approx(1000.0, rel=1e-12)
    assert robot.left_out.names['mass of disabled shapes'] == ['b']
    whole = robot_of(tmp_path, stage(body('b', FULL, *shapes)))
    assert 'mass of disabled shapes' not in whole.left_out.names


def test_a_mass_without_shapes(tmp_path: Path) -> None:
    """The sphere that usd-core takes; without a mass a body moves nothing, and is left out."""
    arm = stage(body('b', 'float physics:mass = 5', at=(1.0, 0.0, 0.0)), metre=0.01)
    robot = robot_of(tmp_path, arm)
    assert robot.parts[0].inertia == pytest.approx(0.02 * np.eye(3))
    assert robot.left_out.names['inertia: default of USD'] == ['b']
    pins = (
        usd.joint('Revolute', 'pin', (('', (0, 0, 0)), ('/b', (0, 0, 0)))),
        usd.joint('Revolute', 'end', (('/b', (0, 0, 0)), ('/c', (0, 0, 0)))),
    )
    text = made(tmp_path, stage(body('b', FULL), body('c'), *pins))
    assert '#   joints of massless ends: they and their links do not move' in text
