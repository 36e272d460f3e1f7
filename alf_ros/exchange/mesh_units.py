"""Meshes that are so large beside the robot that their files hold other units than metres.

STL and OBJ state no unit, and many drawing programs write millimetres. Such a mesh needs a scale
of 0.001. Only the size of a file is read, and of a long one only the beginning: the size that is
found can only be too small.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange.robot import GROUND, Robot
from alf_ros.inspection.missing_meshes import mesh_path

KIND = 'meshes far larger than the robot'
_FAR = 50.0  # times the robot: a thousand divided by the number of links in a row
_LEAST = (
    10.0  # m: below that a body may be as large as its mesh, with joints and inertia at a point
)
_BINARY, _TEXT = 64_000_000, 1_000_000  # bytes that are read of a file
_HEAD, _RECORD = 84, 50  # bytes of a binary STL
_TRIANGLE = np.dtype([('normal', '<3f4'), ('corners', '<(3,3)f4'), ('rest', '<u2')])
_NUMBER = rb'[ \t]+([-+.\deE]+)'
_PLACE = re.compile(rb'^[ \t]*(?:vertex|v)' + 3 * _NUMBER, re.MULTILINE)


def noted(robot: Robot) -> None:
    """Note the meshes of moving parts that are far larger than everything else in the robot."""
    least = max(_LEAST, _FAR * _size(robot))
    edges: dict[str, Floats] = {}
    for part, shape in robot.shapes:
        if part == GROUND or shape.kind != 'mesh':
            continue  # a building or a landscape may be as large
        if shape.file not in edges:
            edges[shape.file] = _edges(shape.file)
        size = float(np.max(np.abs(shape.size) * edges[shape.file]))
        if size > least:
            robot.leave(KIND, f'{Path(shape.file).name} ({size:.3g} m)')


def _size(robot: Robot) -> float:
    """How far joints, bodies and their masses are apart, and how large other shapes are, m."""
    places = [each.place for each in robot.connections]
    lengths = [0.0]
    for part in robot.parts:
        places += [part.origin, part.com]
        if part.mass > 0.0:  # twice the radius of gyration
            lengths.append(2.0 * math.sqrt(float(np.abs(part.inertia).max()) / part.mass))
    touching = (each.shape for each in robot.colliders)
    for shape in (*(shape for _, shape in robot.shapes), *touching):
        if shape is not None and shape.kind != 'mesh':
            lengths.append(max(shape.size))
    if places:
        lengths.append(float(np.ptp(np.array(places), axis=0).max()))
    return max(lengths)


def _edges(file: str) -> Floats:
    """(3,) edges of the box around the places in a file; 0 of one that cannot be read."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    try:
        for places in _places(mesh_path(file)):
            known = places[np.isfinite(places).all(axis=1)]
            if known.size:
                low, high = np.minimum(low, known.min(axis=0)), np.maximum(high, known.max(axis=0))
    except (InputError, OSError, ValueError):  # viewers say what is wrong with it
        return np.zeros(3)
    return np.asarray(np.maximum(high - low, 0.0))


def _places(path: Path) -> Iterator[Floats]:
    """Pieces (n, 3) of the places in a file, in its unit."""
    suffix, size = path.suffix.lower(), path.stat().st_size
    if suffix not in ('.stl', '.obj'):
        return  # COLLADA states its unit, and glTF has metres
    with path.open('rb') as stream:
        head = stream.read(_HEAD)
        count = int.from_bytes(head[80:84], 'little')
        if suffix == '.stl' and size == _HEAD + _RECORD * count:
            left = min(count, _BINARY // _RECORD)
            while left > 0:
                some = np.fromfile(stream, _TRIANGLE, min(left, 100_000))
                if not some.size:
                    return
                left -= some.size
                yield some['corners'].reshape(-1, 3).astype(float)
            return
        found = _PLACE.findall(head + stream.read(_TEXT))
        yield np.array([[float(x) for x in place] for place in found], dtype=float).reshape(-1, 3)
