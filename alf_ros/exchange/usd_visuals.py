"""Shapes of a USD stage that renderers show: visible, with the purpose `default` or `render`."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange.robot import FramePose, Robot
from alf_ros.exchange.usd_solids import along, sizes
from alf_ros.exchange.usd_stage import UsdStage
from alf_ros.exchange.visuals import shape, show
from alf_ros.mechanism import VisualShape

_SHOWN = ('default', 'render')
_UNEQUAL = 1e-5  # between scales that must be equal, of single precision
_DIGITS = 6  # of colours, which have single precision


def add(stage: UsdStage, robot: Robot, prim: Any, part: str, motion: FramePose) -> None:
    """Give a part, which `motion` moves from where it is drawn, the shape of a prim."""
    from pxr import UsdGeom

    if not UsdGeom.Gprim(prim):
        return
    found = UsdGeom.Imageable(prim)
    purpose, visible = found.ComputePurpose(), found.ComputeVisibility()
    if purpose not in _SHOWN or visible == 'invisible':
        return
    try:
        made, frame = _shape(stage, prim)
        show(robot, part, made, motion @ frame)
    except (ValueError, InputError):
        robot.leave('shapes', str(prim.GetPath()))


def _shape(stage: UsdStage, prim: Any) -> tuple[VisualShape, FramePose]:
    """Raises ValueError or InputError for one that no mechanism can have."""
    kind, color = str(prim.GetTypeName()), _color(prim)
    matrix, origin = stage.affine(prim)
    turn = stage.rotation(matrix, kind)
    scales = np.linalg.norm(matrix, axis=0)
    if kind == 'Cube':
        (edge,) = sizes(stage, prim)
        return shape('box', edge * scales, color), FramePose(origin, turn)
    if kind == 'Sphere':
        (radius,) = sizes(stage, prim)
        return shape('sphere', (radius * _equal(scales),), color), FramePose(origin, turn)
    if kind not in ('Cylinder', 'Capsule'):
        raise ValueError(kind)
    axes = along(stage, prim)
    x, y, z = (float(scales @ axes[:, n]) for n in range(3))
    across, length = _equal(np.array([x, y])), z
    if kind == 'Capsule':
        across = length = _equal(scales)
    radius, height = sizes(stage, prim)
    size = (radius * across, height * length)
    return shape(kind.lower(), size, color), FramePose(origin, turn @ axes)


def _equal(scales: Floats) -> float:
    """The one scale of all. Raises ValueError if there are several."""
    if np.ptp(scales) > _UNEQUAL * scales.max():
        raise ValueError('unequal scales')
    return float(scales.mean())


def _color(prim: Any) -> tuple[float, ...] | None:
    """Red, green, blue and opacity of a prim that has one colour."""
    from pxr import UsdGeom

    shown = UsdGeom.Gprim(prim)
    color, opacity = (
        np.ravel(each.Get())
        for each in (shown.GetDisplayColorAttr(), shown.GetDisplayOpacityAttr())
    )
    if color.size != 3 or color.dtype == object:
        return None
    alpha = opacity[0] if opacity.size == 1 and opacity.dtype != object else 1.0
    return tuple(round(float(x), _DIGITS) for x in (*color, alpha))
