"""Shapes of bodies as markers: one each, in the namespace `shapes`, at the pose of its body."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros.arrays import Floats
from alf_ros.inspection.mesh_triangles import MeshTriangles
from alf_ros.inspection.shape_places import half_axis_ends
from alf_ros.mechanism import VisualShape
from alf_ros.ros.messages.templates import STAMP, WORLD

NUMBERS = 7  # of a pose
_TYPES = {
    'box': Marker.CUBE,
    'cylinder': Marker.CYLINDER,
    'sphere': Marker.SPHERE,
    'mesh': Marker.MESH_RESOURCE,
}
_KINDS = {kind: name for name, kind in _TYPES.items()}
_GREY = (0.7, 0.72, 0.75, 1.0)


def shape_marker(shape: VisualShape, number: int, mark: float) -> Marker:
    """The marker of a shape that is no capsule, with `mark` for each number of its pose."""
    marker = Marker(header=Header(stamp=STAMP, frame_id=WORLD), ns='shapes', id=number)
    marker.type, marker.action = _TYPES[shape.kind], Marker.ADD
    marker.pose = Pose(
        position=Point(x=mark, y=mark, z=mark),
        orientation=Quaternion(x=mark, y=mark, z=mark, w=mark),
    )
    size = shape.size
    if shape.kind == 'sphere':
        size = 3 * (2.0 * size[0],)
    elif shape.kind == 'cylinder':
        size = (2.0 * size[0], 2.0 * size[0], size[1])
    x, y, z = size
    marker.scale = Vector3(x=x, y=y, z=z)
    color = shape.color or _GREY
    if shape.kind == 'mesh':
        marker.mesh_resource = shape.uri
        if shape.color is None:  # the colours in its file; all zero: not tinted
            marker.mesh_use_embedded_materials, color = True, (0.0, 0.0, 0.0, 0.0)
    r, g, b, a = color
    marker.color = ColorRGBA(r=r, g=g, b=b, a=a)
    return marker


def shape_outline(
    marker: Marker, mesh: MeshTriangles | None = None
) -> tuple[dict[str, Any], Floats] | None:
    """Kind and colour of a marker of a shape, and (4, 3) m its middle and the ends of its half
    axes. mesh: the triangles of a marker of a mesh, whose colour is None if its file has it. None
    for a mesh without triangles, and for a marker of nothing that can be drawn."""
    kind = _KINDS.get(marker.type)
    if kind == 'mesh' and mesh is None:
        return None
    p, r, size, c = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
    pose = np.array([p.x, p.y, p.z, r.x, r.y, r.z, r.w])
    color = [min(max(x, 0.0), 1.0) for x in (c.r, c.g, c.b, c.a)]
    extent = np.array([size.x, size.y, size.z])
    numbers = np.array([*pose, *extent, *color])
    if kind is None or not np.isfinite(numbers).all() or not pose[3:].any():
        return None
    if marker.action != Marker.ADD:
        return None
    if mesh is None:
        box = np.array([np.zeros(3), 0.5 * extent])
    else:
        box = extent * [mesh.middle, mesh.halves]
    own = mesh is not None and marker.mesh_use_embedded_materials
    about = {'kind': kind, 'color': None if own else color}
    return about, half_axis_ends(pose[None], box[None])


def nothing() -> MarkerArray:
    """Removes all markers of viewers, which would keep those that another scene does not have."""
    marker = Marker(header=Header(stamp=STAMP, frame_id=WORLD), action=Marker.DELETEALL)
    marker.pose.orientation.w = 1.0
    return MarkerArray(markers=[marker])
