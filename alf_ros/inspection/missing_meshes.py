"""Files of meshes that viewers will not find. No file is opened, and no simulation needs one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from alf_ros.mechanism import GROUND, Mechanism, VisualShape
from alf_ros.mechanism.visual_shapes import PACKAGE


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
            fault = _fault(shape.file) if shape.kind == 'mesh' else ''
            if fault:
                found.setdefault(shape.file, f'{name}: {fault}: {shape.file}')
    return list(found.values())


def _fault(file: str) -> str:
    """The reason why a viewer will not find a file; '' if it will."""
    if not file.startswith(PACKAGE):
        return '' if _is_file(Path(file)) else 'no such file'
    package, _, inner = file.removeprefix(PACKAGE).partition('/')
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    shares = [Path(prefix, 'share', package) for prefix in prefixes if prefix]
    if not any(share.is_dir() for share in shares):
        return f'no package {package} in AMENT_PREFIX_PATH'
    return '' if any(_is_file(share / inner) for share in shares) else 'no such file'


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
