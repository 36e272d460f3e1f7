"""Triangles of mesh files, few enough to be drawn many times a second.

Read by trimesh, which is optional. Nothing but the file itself is read: textures and material
files beside it are left out. Numbers are metres, as RViz takes them: the unit that a COLLADA file
states is applied, its upward axis is not.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.inspection.missing_meshes import mesh_path

FORMATS = ('.dae', '.glb', '.gltf', '.obj', '.ply', '.stl')
INSTALL = "pip install 'alf_ros[view]'"
# Of a file with more triangles, places that are close together are drawn as one.
MOST_TRIANGLES = 20_000
LARGEST_FILE = 64_000_000  # bytes
# Cells along an edge of the bounding box: the first as fine as the numbers of a page, and those of
# which the finest is taken that leaves few enough triangles.
_FINEST, _GRIDS = 2.0**20, tuple(1000.0 * 0.8**n for n in range(24))
_DIRECTIONS = 200
_METRES = ' * meters'


@dataclass(frozen=True)
class MeshTriangles:
    """A mesh in the box around it. middle, halves (3,): middle and half edges of that box in the
    axes of the file (m); vertices (n, 3): places in it, from -1 to 1; faces (m, 3): numbers of
    vertices; colors (n, 3): red, green, blue from 0 to 1, None if the file has none; is_reduced:
    whether triangles were merged because there were too many."""

    middle: Floats
    halves: Floats
    vertices: Floats
    faces: NDArray[np.uint32]
    colors: Floats | None
    is_reduced: bool

    @cached_property
    def extremes(self) -> Floats:
        """(k, 3) vertices whose convex hull is close to the hull of all: the farthest along 200
        directions."""
        k = np.arange(_DIRECTIONS) + 0.5
        up, turn = 1.0 - 2.0 * k / _DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * k
        level = np.sqrt(1.0 - up**2)
        directions = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
        found: Floats = self.vertices[np.unique(np.argmax(self.vertices @ directions.T, axis=0))]
        return found


def read_meshes(files: Iterable[str]) -> tuple[dict[str, MeshTriangles], list[str]]:
    """Meshes by file, and a line for each file that cannot be drawn. files: as in shapes."""
    found, faults = dict[str, MeshTriangles](), list[str]()
    for file in dict.fromkeys(files):
        try:
            found[file] = read_mesh(file)
        except InputError as error:
            faults.append(f'{Path(file).name}: {error.message}')
    return found, faults


def read_mesh(file: str) -> MeshTriangles:
    """The triangles of a file. file: an absolute path, or a URI with `package://`.

    Raises InputError if trimesh is not there, and if the file is absent, too large, of another
    format, or without triangles.
    """
    path = mesh_path(file)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f'only {", ".join(FORMATS)} are drawn', file=file)
    try:
        import trimesh
    except ImportError:
        raise InputError(f'meshes need trimesh: {INSTALL}', file=file) from None
    try:
        with path.open('rb') as stream:
            data = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise InputError(f'cannot be read: {error.strerror}', file=file) from None
    if len(data) > LARGEST_FILE:
        raise InputError(f'more than {LARGEST_FILE / 1e6:g} MB', file=file)
    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False)
        vertices, faces, colors = _joined(scene)
    except Exception as error:  # parsers raise anything
        raise InputError(f'cannot be read as {suffix[1:]}: {_line(error)}', file=file) from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError('has no triangles', file=file)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    halves = 0.5 * (high - low)
    middle = 0.5 * (high + low)
    inside = (vertices - middle) / np.where(halves, halves, 1.0)
    return MeshTriangles(middle, halves, *_fewer(inside, faces, colors))


def _line(error: Exception) -> str:
    return ' '.join(f'{type(error).__name__}: {error}'.split())[:120]


def _joined(scene: Any) -> tuple[Floats, NDArray[np.int64], Floats | None]:
    """Vertices (n, 3) m, faces (m, 3) and colours (n, 3) of all parts of a file."""
    vertices: list[Floats] = [np.zeros((0, 3))]
    colors: list[Floats] = [np.zeros((0, 3))]
    faces: list[NDArray[np.int64]] = [np.zeros((0, 3), dtype=np.int64)]
    colored, count = False, 0
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not len(getattr(part, 'faces', ())):
            continue  # lines and clouds of points
        places = np.asarray(part.vertices, dtype=float) * _unit(part)
        # As written: a translation of a COLLADA file has the same unit as its places.
        turned = places @ transform[:3, :3].T + _unit(part) * transform[:3, 3]
        vertices.append(turned)
        faces.append(np.asarray(part.faces, dtype=np.int64) + count)
        count += len(places)
        colored = colored or bool(part.visual.defined)
        colors.append(_colors(part))
    return np.vstack(vertices), np.vstack(faces), np.vstack(colors) if colored else None


def _unit(part: Any) -> float:
    """Metres in the unit of a file; 1 if it states none."""
    text = str(part.metadata.get('units', ''))
    return float(text.removesuffix(_METRES)) if text.endswith(_METRES) else 1.0


def _colors(part: Any) -> Floats:
    """(n, 3) of the vertices of a part, or the colour of its material for all."""
    visual = part.visual
    if visual.kind == 'vertex':
        found = np.asarray(visual.vertex_colors)[:, :3]
    else:
        material = getattr(visual, 'material', visual)
        found = np.tile(np.asarray(material.main_color)[:3], (len(part.vertices), 1))
    return np.asarray(found / 255.0, dtype=float)


def _fewer(
    vertices: Floats, faces: NDArray[np.int64], colors: Floats | None
) -> tuple[Floats, NDArray[np.uint32], Floats | None, bool]:
    """The same with one vertex for each cell of a grid, coarse enough for MOST_TRIANGLES, and
    whether the grid is coarse.

    vertices: from -1 to 1.
    """
    first, kept = _merged(vertices, faces, _FINEST)
    vertices, colors = vertices[first], None if colors is None else colors[first]
    if len(kept) <= MOST_TRIANGLES:
        return vertices, kept.astype(np.uint32), colors, False
    whole, fine, coarse = kept, 0, len(_GRIDS) - 1
    first, kept = _merged(vertices, whole, _GRIDS[coarse])
    while fine < coarse:  # each takes a second for a million triangles
        middle = (fine + coarse) // 2
        found = _merged(vertices, whole, _GRIDS[middle])
        if len(found[1]) <= MOST_TRIANGLES:
            coarse, (first, kept) = middle, found
        else:
            fine = middle + 1
    shades = None if colors is None else colors[first]
    return vertices[first], kept.astype(np.uint32), shades, True


def _merged(
    vertices: Floats, faces: NDArray[np.int64], cells: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first vertex in each cell of a grid, and the triangles (m, 3) that are left between
    them."""
    grid = np.rint(0.5 * cells * (vertices + 1.0)).astype(np.int64)
    key = (grid[:, 0] << 42) + (grid[:, 1] << 21) + grid[:, 2]
    _, first, of = np.unique(key, return_index=True, return_inverse=True)
    kept = of[faces]
    a, b, c = kept.T
    return first, kept[(a != b) & (b != c) & (c != a)]
