"""Files of USD: references, instances, shapes, mistakes and hostile content; the command."""

from __future__ import annotations

import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

import support.usd_robots as usd
from alf_ros import InputError
from alf_ros.commands.import_ import main
from alf_ros.exchange import corpus
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.robot import GROUND
from alf_ros.exchange.usd_stage import MOST_BYTES
from support.imported_motions import saved
from support.paths import DATA
from support.usd_robots import (
    FULL,
    body,
    gravity,
    joint,
    made,
    massive,
    placed,
    prim,
    robot_of,
    stage,
)

pxr = pytest.importorskip('pxr')
ORIGIN = (0.0, 0.0, 0.0)
PIN = joint('Revolute', 'pin', (('', ORIGIN), ('/b', ORIGIN)), usd.axis('Y'))
PENDULUM = stage(body('b', FULL), PIN)


# ------------------------------------------------------------------------------------- composition


def test_references_payloads_and_instances(tmp_path: Path) -> None:
    """Two robots of one file, one of them an instance; a binary file and an archive read alike."""
    from pxr import Sdf, UsdUtils

    robot = prim('Xform', 'robot', '', body('b', FULL), PIN.replace('</b>', '</robot/b>'))
    saved(tmp_path, 'part.usda', stage(robot).replace('upAxis', 'defaultPrim = "robot"\nupAxis'))
    part = '@./part.usda@'
    of = f'references = {part}', f'payload = {part}\ninstanceable = true'
    whole = stage(*(f'def Xform "r{n}" (\n{each}\n)\n{{\n}}' for n, each in enumerate(of)))
    text = made(tmp_path, whole)
    for name in ('b', 'r1_b', 'pin', 'r1_pin'):
        assert f'  {name}:' in text
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / 'it.usda'))
    assert layer.Export(str(tmp_path / 'it.usdc')) and layer.Export(str(tmp_path / 'it.usd'))
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / 'it.usda'), str(tmp_path / 'it.usdz'))
    for ending in ('usdc', 'usd', 'usdz'):
        again = imported(str(tmp_path / f'it.{ending}'))
        assert again.split('\n')[1:] == text.split('\n')[1:]


def test_content_that_is_missing_is_listed_and_nothing_is_printed(tmp_path: Path, capfd) -> None:
    saved(tmp_path, 'broken.usda', '#usda 1.0\nsecret words\n')
    lost = [
        '@./nowhere.usda@',
        '@./broken.usda@',
        '</nobody>',
        '@omniverse://server/robot.usd@',
    ]
    lost += ['</p5>', '</p4>']  # of each other
    prims = [f'def Xform "p{n}" (references = {each})\n{{\n}}' for n, each in enumerate(lost)]
    text = made(tmp_path, stage(body('b', FULL), PIN, *prims))
    (line,) = (each for each in text.split('\n') if 'includes: their content is omitted' in each)
    assert all(f'(/p{n})' in line for n in range(6)) and 'secret' not in text
    printed = capfd.readouterr()
    assert not printed.out and not printed.err


# ------------------------------------------------------------------------------------------ shapes


def test_shapes(tmp_path: Path) -> None:
    color = 'color3f[] primvars:displayColor = [(0.25, 0.5, 1)]'
    scaled = placed((0, 0, 0.5)).replace('"]', '", "xformOp:scale"]')
    shapes = (
        prim('Cube', 'box', '', color, 'double3 xformOp:scale = (1, 2, 3)', scaled),
        prim('Sphere', 'ball', '', 'token purpose = "render"'),
        prim('Cylinder', 'bar', '', 'uniform token axis = "X"\ndouble height = 4'),
        prim('Capsule', 'pill', '', 'token visibility = "invisible"'),
        prim('Capsule', 'guide', 'Collision', 'uniform token purpose = "guide"'),
        prim('Cone', 'hat', ''),
        prim('Mesh', 'mesh', ''),
    )
    ground = prim('Capsule', 'post', '', 'uniform token axis = "Y"\ndouble radius = 25')
    robot = robot_of(tmp_path, stage(body('b', FULL, *shapes), ground, PIN, metre=0.01))
    found = {shape.kind: (part, shape) for part, shape in robot.shapes}
    assert list(found) == ['box', 'sphere', 'cylinder', 'capsule']
    part, box = found['box']
    assert (part, box.at, box.color) == ('b', (0.0, 0.0, 0.005), (0.25, 0.5, 1.0, 1.0))
    assert box.size == pytest.approx((0.02, 0.04, 0.06), rel=1e-15)
    assert found['cylinder'][1].size == pytest.approx((0.01, 0.04), rel=1e-15)
    assert found['cylinder'][1].turn[:, 2] == pytest.approx([1, 0, 0], abs=1e-15)
    assert found['capsule'][0] == GROUND
    assert found['capsule'][1].size == pytest.approx((0.25, 0.01), rel=1e-15)
    assert robot.left_out.names['shapes'] == ['/b/hat', '/b/mesh']


# ---------------------------------------------------------------------------------------- refusals

UNKNOWN = 'expected physics:mass, centerOfMass and diagonalInertia of its body'
SKEW = prim(
    'Xform',
    'above',
    '',
    'double3 xformOp:scale = (1, 2, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]',
    prim('Xform', 'b', 'RigidBody Mass', placed(ORIGIN, usd.TILTED.turn), FULL),
)
MIRROR = (
    body('b', FULL)
    .replace('uniform', 'double3 xformOp:scale = (1, -1, 1)\nuniform')
    .replace('"]\nfloat', '", "xformOp:scale"]\nfloat')
)
TO_ITSELF = joint('Revolute', 'j', (('/b', ORIGIN), ('/b', ORIGIN)))
TO_NOBODY = joint('Revolute', 'j', (('', ORIGIN), ('/c', ORIGIN)))
OPEN = prim(
    'Mesh',
    'shell',
    'Collision',
    'point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n'
    'int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]',
)
CUBE = 'uniform token physics:approximation = "boundingCube"'
DRIVEN = PIN.replace('"pin"', '"pin" (prepend apiSchemas = ["PhysicsDriveAPI:angular"])').replace(
    'rel physics:body1', 'float drive:angular:physics:stiffness = -1\nrel physics:body1'
)
MISTAKES = {
    'no body': (stage(prim('Xform', 'x', '')), 'no part of it can move: no prim is a rigid body'),
    'fixed': (stage(body('b', 'bool physics:kinematicEnabled = true')), 'no part of it can move'),
    'skewed': (stage(SKEW), '/above/b: its axes are skewed; expected scales of its parents'),
    'mirrored': (stage(MIRROR), '/b: it is mirrored; expected positive scales'),
    'itself': (stage(body('b', FULL), TO_ITSELF), "/j: both sides are of one body, '/b'"),
    'nobody': (stage(body('b', FULL), TO_NOBODY), "/j body1: no such prim, got '/c'"),
    'open mesh': (stage(body('b', OPEN)), '/b/shell: its mesh encloses no volume; ' + UNKNOWN),
    'plane': (
        stage(body('b', prim('Plane', 'p', 'Collision'))),
        '/b/p: no mass is computed of Plane; ' + UNKNOWN,
    ),
    'bounding': (
        stage(
            body(
                'b',
                OPEN.replace(
                    'int[] faceVertexC',
                    'uniform token physics:approximation = "boundingCube"\nint[] faceVertexC',
                ),
            )
        ),
        r'/b/shell: no mass is computed of Mesh \(boundingCube\)',
    ),
    'radius': (
        stage(body('b', prim('Sphere', 's', 'Collision', 'double radius = -1'))),
        '/b/s radius: not a size, got -1.0',
    ),
    'nan': (stage(body('b', massive(float('nan'), ORIGIN, ORIGIN))), 'physics:mass: not usable'),
    'mass below zero': (
        stage(body('b', massive(-2.0, ORIGIN, ORIGIN))),
        '/b physics:mass: below zero, got -2.0; expected more than 0',
    ),
    'density below zero': (
        stage(body('b', 'float physics:density = -3\n' + prim('Sphere', 's', 'Collision'))),
        '/b physics:density: below zero, got -3.0',
    ),
    'huge': (stage(body('b', FULL, at=(1e300, 0, 0)), PIN), '/b: not a usable transformation'),
    'unit': (stage(body('b', FULL), metre=0.0), 'metersPerUnit: not a unit, got 0.0'),
    'inertia': (
        stage(body('b', massive(1.0, ORIGIN, (1.0, 1.0, 3.0))), PIN),
        'b: no body has such an inertia.*--repair-inertia',
    ),
    'gravity': (
        stage(body('b', FULL), gravity((0, 0, 1), float('inf'))),
        '/scene gravityMagnitude: not a usable number',
    ),
    'two bodies': (
        stage(body('b', FULL), PIN.replace('= </b>', '= [</b>, </c>]')),
        "/pin body1: more than one body, got '/c'",
    ),
    'drive': (stage(body('b', FULL), DRIVEN), 'stiffness, damping and maxForce are not'),
    'text': ('#usda 1.0\n\nsecret\n', 'not a USD file: an error in line 3$'),
    'words': ('secret', 'it.usda: not a USD file$'),
    'empty': ('', 'it.usda: not a USD file$'),
}


@pytest.mark.parametrize(('text', 'message'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes(text: str, message: str, tmp_path: Path, capfd) -> None:
    path = saved(tmp_path, 'it.usda', text)
    with pytest.raises(InputError, match=message) as caught:
        imported(path, scene=True)
    assert path in str(caught.value) and '\n' not in str(caught.value)
    assert 'secret' not in str(caught.value)
    printed = capfd.readouterr()
    assert not printed.out and not printed.err
    assert caught.value.exit_code == 2


def test_files_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(0)
    for name, data, message in (
        ('a.usdc', b'PXR-USDC' + random.bytes(2000), 'not a USD file: damaged'),
        ('b.usdc', random.bytes(2000), 'b.usdc: not a USD file'),
        ('c.usdz', b'PK\x03\x04' + random.bytes(500), 'not a USD file: damaged'),
        ('d.usd', struct.pack('<I', 7), 'd.usd: not a USD file'),
        ('e.usda', b'#usda 1.0\n' + random.bytes(500), 'not a USD file'),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=message):
            imported(str(tmp_path / name))
    with pytest.raises(InputError, match=r'x\.usda: no such file'):
        imported(str(tmp_path / 'x.usda'))
    os.mkfifo(tmp_path / 'pipe.usd')
    with pytest.raises(InputError, match='pipe.usd: no such file'):
        imported(str(tmp_path / 'pipe.usd'))
    for name, head, size in (
        ('f.usda', b'#usda 1.0\n', 1 << 26),
        ('g.usdc', b'PXR-USDC', MOST_BYTES),
    ):
        with open(tmp_path / name, 'wb') as stream:  # without content, so without space on disk
            stream.write(head)
            stream.truncate(size + 1)
        with pytest.raises(InputError, match=f'{name}: larger than {size >> 20} MB'):
            imported(str(tmp_path / name))
    monkeypatch.setitem(sys.modules, 'pxr', None)
    with pytest.raises(InputError, match='`pip install usd-core` reads it'):
        imported(saved(tmp_path, 'it.usda', PENDULUM))


def test_a_file_that_ends_the_process_which_opens_it(tmp_path: Path) -> None:
    """Two bytes of a binary stage are changed: usd-core faults, also where a text refers to it."""
    fault = DATA / 'usd_fault.usdc'
    with pytest.raises(InputError, match='damaged: usd-core cannot survive it'):
        imported(str(fault))
    text = f'#usda 1.0\n(subLayers = [@{fault}@])\n'
    with pytest.raises(InputError, match='damaged: usd-core cannot survive it'):
        made(tmp_path, text)


def test_sizes_of_nothing(tmp_path: Path) -> None:
    flat = placed(ORIGIN).replace('uniform', 'double3 xformOp:scale = (1, 0, 1)\nuniform')
    flat = flat.replace('"]', '", "xformOp:scale"]')
    for shape in (
        prim('Cube', 'c', 'Collision', flat),
        mesh_of('[(0, 0, 0), (1, 0, 0), (0, 1, 0)]', hull=True),
        mesh_of('[]', hull=True),
        mesh_of('(1, 2)', hull=False),
    ):
        with pytest.raises(InputError, match='no volume|no usable points|enclose'):
            made(tmp_path, stage(body('b', shape)))


def mesh_of(points: str, hull: bool) -> str:
    how = 'convexHull' if hull else 'none'
    return prim(
        'Mesh',
        'c',
        'Collision',
        f'point3f[] points = {points}' if points.startswith('[') else f'float2 points = {points}',
        f'uniform token physics:approximation = "{how}"',
    )


def test_options_of_other_formats(tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.usda', PENDULUM)
    for wishes, message in (
        ({'positions': {'pin': 1.0}}, '--set: not for USD, which places each body'),
        ({'floating': True}, '--floating: for URDF only'),
        ({'key': 'home'}, '--key: for MJCF only'),
    ):
        with pytest.raises(InputError, match=message):
            imported(path, **wishes)


# ----------------------------------------------------------------------------------------- command


def test_the_command_and_a_folder(tmp_path: Path, capsys) -> None:
    robots = tmp_path / 'robots'
    robots.mkdir()
    text = (DATA / 'robots/four_bar_cm.usda').read_text(encoding='utf-8')
    path = saved(robots, 'four_bar.usda', text)
    saved(robots, 'words.usda', 'secret')
    assert main([path, '--scene', '-o', str(tmp_path / 'out.yaml')]) == 0
    assert 'Changes of readings only' in capsys.readouterr().err
    limits = corpus.ExaminationLimits(seconds=600.0, duration=0.02)
    first, second = corpus.examined(robots, {'scene': True}, limits)
    assert (first.result, first.loops, first.freedoms) == (corpus.OK, 1, 1)
    assert (second.result, second.why) == (corpus.REFUSED, 'not a USD file')
