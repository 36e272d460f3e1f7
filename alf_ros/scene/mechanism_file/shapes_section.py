"""`shapes` of a body, or of the ground: what viewers show, and no simulation reads.

    shapes:
      - {box: {size: [0.3, 0.02, 0.01]}, at: [0.15, 0, 0]}
      - {mesh: {file: meshes/hand.stl, scale: 0.001}, rpy: [0, 0, pi/2], color: [0.2, 0.4, 0.8]}

A file is named, and not opened. `inspection.missing_meshes` finds the files that are absent.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.mechanism import VisualShape
from alf_ros.scene.references import References
from alf_ros.scene.text import repetition
from alf_ros.scene.text.yaml_document import Entry

KEY = 'shapes'
KINDS = {  # the keys of each kind, with their meaning; all but `scale` are required
    'box': {'size': 'edges along x, y and z (m)'},
    'cylinder': {'radius': 'm', 'length': 'along z (m)'},
    'capsule': {'radius': 'm', 'length': 'along z, without the half-spheres (m)'},
    'sphere': {'radius': 'm'},
    'mesh': {
        'file': 'path, relative to the file that names it, or package://PACKAGE/PATH',
        'scale': 'factor, or one for each of x, y and z; 1 if absent',
    },
}
POSE = ('at', 'rpy', 'color')
MESHES = ('.3ds', '.dae', '.fbx', '.glb', '.gltf', '.mesh', '.obj', '.ply', '.stl')
_PACKAGE = re.compile(r'package://[A-Za-z0-9][A-Za-z0-9_.-]*/.+')
_ENDINGS = ', '.join(MESHES)


def is_mesh(name: str) -> bool:
    """Whether an absolute path, or a URI with `package://`, can be one of a mesh: what no viewer
    draws is refused before one opens it, such as a device."""
    located = _PACKAGE.fullmatch(name) if '://' in name else name.startswith('/')
    return bool(located) and name.isprintable() and _suffix(name) in MESHES


def _suffix(name: str) -> str:
    return PurePosixPath(name).suffix.lower()


class ShapeReader:
    """Reads shapes in a mechanism of this dimension. `named`: what to put in place of entries, by
    identity, so that a mechanism elsewhere names the same files."""

    def __init__(self, dimension: int, references: References) -> None:
        self.named: dict[int, Entry] = {}
        self._dimension, self._references = dimension, references

    def read(self, section: Entry, names: Mapping[str, float]) -> tuple[VisualShape, ...]:
        """The shapes of a list; `names` are parameters. Raises InputError."""
        return tuple(self._shape(entry, names) for entry in section.sequence())

    def _shape(self, entry: Entry, names: Mapping[str, float]) -> VisualShape:
        fields = entry.mapping((*KINDS, *POSE))
        kinds = [kind for kind in KINDS if kind in fields]
        if len(kinds) != 1:
            given = ' and '.join(kinds) or None
            raise entry.error(
                'a shape has one kind', value=given, expected=f'one of {", ".join(KINDS)}'
            )
        (kind,) = kinds
        keys = KINDS[kind]
        parts = fields[kind].mapping(keys, [key for key in keys if key != 'scale'])
        size: tuple[float, ...] = (1.0, 1.0, 1.0) if kind == 'mesh' else ()
        if kind != 'mesh':
            size = tuple(
                length for key in keys for length in _lengths(parts[key], key == 'size', names)
            )
        elif 'scale' in parts:
            size = _factors(parts['scale'], names)
        at = self._place(fields['at'], names) if 'at' in fields else (0.0, 0.0, 0.0)
        rpy = fields['rpy'].vector(3, names) if 'rpy' in fields else (0.0, 0.0, 0.0)
        color = _color(fields['color'], names) if 'color' in fields else None
        file = self._file(parts['file'], names) if kind == 'mesh' else ''
        return VisualShape(kind, size, at, rpy, color, file)

    def _place(self, entry: Entry, names: Mapping[str, float]) -> tuple[float, ...]:
        """Three numbers; in the plane two do."""
        flat = self._dimension == 2 and len(entry.sequence()) == 2
        return (*entry.vector(2, names), 0.0) if flat else entry.vector(3, names)

    def _file(self, entry: Entry, names: Mapping[str, float]) -> str:
        text = entry.text()
        if '://' not in text:
            text = self._whole(entry, text)
        elif not _PACKAGE.fullmatch(text):
            raise entry.error('not a file of a mesh', expected='a path, or package://')
        file = repetition.filled(text, entry, names)
        if not is_mesh(file):
            raise entry.error('not a file of a mesh', expected=f'one that ends in {_ENDINGS}')
        return file

    def _whole(self, entry: Entry, text: str) -> str:
        """The absolute path; a scene keeps it, so that its text says the same anywhere."""
        try:
            path = paths.named(text)
        except InputError as error:
            raise entry.error(error.message) from None
        if path.is_absolute():
            whole = str(path)
        elif self._references.folder is None:
            raise entry.error('a file elsewhere', expected='an absolute path, or package://')
        else:
            folder = Path(entry.file).parent if entry.file is not None else Path()
            whole = os.path.abspath(folder / path)
        if whole != text:
            self.named[id(entry)] = Entry(whole, entry.file, entry.line, entry.path, plain=False)
        return whole


def _lengths(entry: Entry, edges: bool, names: Mapping[str, float]) -> Iterator[float]:
    for each in entry.sequence(3) if edges else (entry,):
        length = each.number(names)
        if length <= 0.0:
            raise each.error('not a length', expected='m, more than zero')
        yield length


def _factors(entry: Entry, names: Mapping[str, float]) -> tuple[float, ...]:
    several = isinstance(entry.value, tuple)
    factors = entry.vector(3, names) if several else 3 * (entry.number(names),)
    if not all(factors):
        raise entry.error('a mesh without extent', expected='factors that are not zero')
    return factors


def _color(entry: Entry, names: Mapping[str, float]) -> tuple[float, ...]:
    parts = entry.sequence()
    if len(parts) not in (3, 4):
        raise entry.wrong('red, green, blue, and opacity if wanted')
    color = tuple(part.number(names) for part in parts)
    for part, value in zip(parts, color, strict=True):
        if not 0.0 <= value <= 1.0:
            raise part.error('not a part of a colour', expected='a number from 0 to 1')
    return color if len(color) == 4 else (*color, 1.0)
