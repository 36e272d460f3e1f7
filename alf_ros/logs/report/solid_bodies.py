"""Solid bodies on pages: the library that draws them, and triangles of meshes for it.

The library is three.js. trimesh ships it with its MIT license inside the template of a page.
"""

from __future__ import annotations

import base64
import gzip
import importlib.util
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.inspection.mesh_triangles import INSTALL, MeshTriangles

# How bodies become solid where they are not.
HINT = f'{INSTALL} shows solid bodies'
_TEMPLATE = ('resources/templates/viewer.zip', 'viewer.html.template')
_LICENSE, _END = '/**\n * @license', '\n(function(){'


@cache
def three_js() -> str:
    """The text of three.js; empty without a trimesh that has it. trimesh is not imported."""
    found = importlib.util.find_spec('trimesh')
    for folder in (found and found.submodule_search_locations) or ():
        try:
            with zipfile.ZipFile(Path(folder, _TEMPLATE[0])) as archive:
                text = archive.read(_TEMPLATE[1]).decode()
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            continue
        _, license_, after = text.partition(_LICENSE)
        # Behind it come controls and loaders of the page, each in a function of its own.
        script, end, _ = after.partition(_END)
        if end and 'WebGLRenderer' in script and '</script' not in script:
            return license_ + script
    return ''


@cache
def packed_script() -> str:
    """The same compressed with gzip, as base64."""
    data = gzip.compress(three_js().encode(), mtime=0) if three_js() else b''
    return base64.b64encode(data).decode()


def mesh_data(mesh: MeshTriangles) -> dict[str, Any]:
    """A mesh for the pages, numbers as in `html.array`."""
    colors = None if mesh.colors is None else _text(mesh.colors, '<f4', 'f32')
    return {
        'vertices': _text(mesh.vertices, '<f4', 'f32'),
        'faces': _text(mesh.faces, '<u4', 'u32'),
        'colors': colors,
        # Edges are found in true proportions; of merged triangles they would be noise.
        'edges': None if mesh.is_reduced else mesh.halves.tolist(),
        'extremes': _text(mesh.extremes, '<f4', 'f32'),
    }


def _text(numbers: Any, kind: str, key: str) -> dict[str, str]:
    return {key: base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode()}
