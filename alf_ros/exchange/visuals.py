"""Shapes that other formats have for a link, placed as drawn.

Shapes are for looking at. One that cannot be used is left out and listed, and stops no import.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from alf_ros.exchange.nearby_packages import nearby_package
from alf_ros.exchange.robot import FramePose, Robot
from alf_ros.mechanism import VisualShape
from alf_ros.mechanism.visual_shapes import PACKAGE, roll_pitch_yaw
from alf_ros.scene.mechanism_file.shapes_section import KINDS, is_mesh
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.yaml_document import LARGEST, SMALLEST

# sizes of shapes about an axis, by the names that URDF and SDF have
ROUND = {'cylinder': ('radius', 'length'), 'capsule': ('radius', 'length'), 'sphere': ('radius',)}
_DIGITS = 9  # of m and rad: meshes of other formats are placed with rounding of single precision


def numbers(text: str | None, count: int, default: Sequence[float] | None = None) -> list[float]:
    """So many numbers of a text. Raises ValueError if there are not."""
    if text is None and default is not None:
        return list(default)
    found = [decimal(word) for word in (text or '').split()]
    if len(found) != count or not all(map(math.isfinite, found)):
        raise ValueError(text)
    return found


def shape(
    kind: str, size: Iterable[float], color: Sequence[float] | None = None, file: str = ''
) -> VisualShape:
    """A shape at the origin of its frame. Raises ValueError for one that no mechanism can have."""
    size = tuple(map(float, size))
    if not all(SMALLEST <= abs(x) <= LARGEST and (x > 0.0 or kind == 'mesh') for x in size):
        raise ValueError(size)
    given = None if color is None else tuple(_rounded(min(max(x, 0.0), 1.0) for x in color))
    if given is not None and not all(map(math.isfinite, given)):
        raise ValueError(given)
    return VisualShape(kind, size, color=given, file=file)


def mesh_file(text: str, folder: Path) -> str:
    """The absolute path or the `package://` URI of a mesh that a file in `folder` names: a path if
    ROS does not find the package, and its folder is around the file. Raises ValueError for
    what no mechanism can name."""
    name = unquote(text.removeprefix('file://')) if text.startswith('file://') else text
    if name.startswith(PACKAGE):
        package, _, inner = name.removeprefix(PACKAGE).partition('/')
        nearby = nearby_package(package, folder / 'file')
        name = name if nearby is None else os.path.abspath(nearby / inner)
    elif '://' in name:
        raise ValueError(text)
    else:
        name = os.path.abspath(folder / name)
    if not is_mesh(name) or '<' in name:  # which stands for an index
        raise ValueError(text)
    return name


def show(robot: Robot, part: str, found: VisualShape, frame: FramePose) -> None:
    """Give a part a shape, whose frame is drawn at `frame` in the world. Raises ValueError for a
    place that no mechanism can have."""
    drawn = moved(found, frame)
    if not all(abs(x) <= LARGEST for x in (*drawn.at, *drawn.rpy)):
        raise ValueError(drawn.at)
    robot.shapes.append((part, drawn))


def moved(found: VisualShape, frame: FramePose) -> VisualShape:
    """The shape in the outer frame, of a shape in the inner one; `frame`: the inner in the
    outer."""
    at = tuple(frame.place(found.at).tolist())
    return replace(found, at=at, rpy=roll_pitch_yaw(frame.turn @ found.turn))


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(x, _DIGITS) + 0.0 for x in values]


def shape_fields(found: VisualShape) -> dict[str, Any]:
    """The entry of a shape in a mechanism file."""
    size = list(found.size)
    if found.kind == 'mesh':
        about: dict[str, Any] = {'file': found.file}
        if found.size != (1.0, 1.0, 1.0):
            about['scale'] = size[0] if len(set(size)) == 1 else size
    else:
        keys = KINDS[found.kind]
        about = {'size': size} if 'size' in keys else dict(zip(keys, size, strict=True))
    fields: dict[str, Any] = {found.kind: about}
    for key, values in (('at', _rounded(found.at)), ('rpy', _rounded(found.rpy))):
        if any(values):
            fields[key] = values
    if found.color is not None:
        fields['color'] = list(found.color[:3] if found.color[3] == 1.0 else found.color)
    return fields
