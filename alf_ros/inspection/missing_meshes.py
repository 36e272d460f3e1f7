"""Files of meshes that viewers will not find. No file is opened, and no simulation needs one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND, Mechanism, VisualShape
from alf_ros.mechanism.visual_shapes import PACKAGE
from alf_ros.resources import shares


def shown_parts(mechanism: Mechanism) -> Iterator[tuple[str, tuple[VisualShape, ...]]]:
    """The ground and the bodies that have shapes, by name, each with its shapes."""
    if mechanism.shapes:
        yield GROUND, mechanism.shapes
    for body in mechanism.bodies:
        if body.shapes:
            yield body.name, body.shapes


def missing_meshes(mechanism: Mechanism) -> list[str]:
    """A line for each file that is not there, with the body that it would show."""
    found: dict[str, str] = {}
    for name, shapes in shown_parts(mechanism):
        for shape in shapes:
            if shape.kind != 'mesh':
                continue
            try:
                mesh_path(shape.file)
            except InputError as error:
                found.setdefault(shape.file, f'{name}: {error.message}: {shape.file}')
    return list(found.values())


def mesh_path(file: str) -> Path:
    """The regular file of a mesh, an absolute path or a URI with `package://`.

    Raises InputError if viewers will not find it.
    """
    if not file.startswith(PACKAGE):
        candidates = [Path(file)]
    else:
        package, _, inner = file.removeprefix(PACKAGE).partition('/')
        candidates = [share / inner for share in shares(package)]
        if not candidates:
            raise InputError(f'no package {package} in AMENT_PREFIX_PATH')
    for path in candidates:
        if _is_file(path):
            return path
    raise InputError('no such file')


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
