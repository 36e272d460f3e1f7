"""`~/markers`: the mechanism as RViz and Foxglove draw it, in the world frame.

Four markers, told apart by their namespace: `links` (lines between the points of each body),
`joints` (balls), `reactions` (of parent on child) and `applied` (wrenches held), as arrows; and
`wheels`, of a mechanism that has some: their rims, with a line that shows them turn. Each is one
list of points, so that a large mechanism stays one message of few markers. `shapes` has a marker
for each shape of a body.
"""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros.arrays import Floats
from alf_ros.inspection.shape_places import ShapePlaces, shape_places
from alf_ros.inspection.wheel_places import wheel_places
from alf_ros.logs.cdr import Template
from alf_ros.mechanism.affine import Form
from alf_ros.model.compile import Model
from alf_ros.ros.messages.shape_markers import NUMBERS, shape_marker
from alf_ros.ros.messages.templates import STAMP, WORLD, Write, template
from alf_ros.simulation.display_geometry import (
    POINTS_PER_ARROW,
    Display,
    arrows,
    held_forces,
    in_space,
    poses,
    reaction_points,
    segments,
    size,
    standard_scale,
)
from alf_ros.simulation.sample import Sample

# Width of a line as a part of the mechanism's size; balls are three times as large.
_WIDTH = 0.01
_COLORS = {
    'links': (0.55, 0.6, 0.65),
    'joints': (0.9, 0.9, 0.9),
    'reactions': (0.9, 0.45, 0.1),
    'applied': (0.1, 0.6, 0.9),
    'wheels': (0.55, 0.6, 0.65),
}
_RIM = 36  # straight pieces of a rim


def _wheel() -> Floats:
    """(points, 3): weights of the centre and of both places on the rim in each end of a line."""
    turns = np.linspace(0.0, 2.0 * np.pi, _RIM + 1)
    c, s = np.cos(turns), np.sin(turns)
    rim = np.stack([1.0 - c - s, c, s], axis=1)
    pieces = np.stack([rim[:-1], rim[1:]], axis=1).reshape(-1, 3)
    return np.vstack([pieces, [[0.3, 0.7, 0.0], [0.0, 1.0, 0.0]]])


_WHEEL = _wheel()


def markers(model: Model, display: Display) -> Write:
    """The writer of `~/markers`; arrows are drawn to `display.force_scale`."""
    mechanism = model.mechanism
    width, standard = _WIDTH * size(mechanism), standard_scale(mechanism)
    ends = [name for body in mechanism.bodies for name in segments(body)]
    pins = [joint.point for joint in mechanism.joints if joint.point is not None]
    acting = reaction_points(mechanism)
    known = np.array([joint.name in acting for joint in mechanism.joints], dtype=bool)
    at = list(acting.values())
    rims = wheel_places(mechanism, model.layout, model.q)
    shown = shape_places(mechanism)
    posed = [NUMBERS] * len(shown.shapes) if shown else []
    templates: dict[int, Template] = {}  # by number of arrows of wrenches held

    def by_arrows(held: int) -> Template:
        if held not in templates:
            templates.clear()  # one at a time: commands rarely come and go
            counts = [len(ends), len(pins), *(POINTS_PER_ARROW * n for n in (len(at), held))]
            if rims:
                counts.append(len(rims) // 3 * len(_WHEEL))
            templates[held] = template(
                lambda marks: _message(marks, counts, width, shown),
                [*(3 * n for n in counts if n), *posed],
            )
        return templates[held]

    def write(sample: Sample, ns: int) -> bytes:
        scale = display.force_scale or standard
        places, forces = held_forces(sample)
        reactions = in_space(sample.reaction_forces[known])
        filled = by_arrows(len(places))
        filled.stamp(ns)
        lists = [
            _places(sample, ends),
            _places(sample, pins),
            arrows(_places(sample, at), scale * reactions),
            arrows(places, scale * forces),
            _wheels(sample, rims),
        ]
        blocks = iter(filled.blocks)
        for points in lists:
            if points.size:
                next(blocks)[:] = points.ravel()
        if shown is not None:
            for block, pose in zip(blocks, shown.poses(poses(sample)), strict=True):
                block[:] = pose
        return filled.bytes()

    return write


def _places(sample: Sample, names: list[str]) -> Floats:
    """(n, 3) m."""
    points = sample.points
    dimension = sample.model.mechanism.dimension
    return in_space(np.array([points[name] for name in names]).reshape(-1, dimension))


def _wheels(sample: Sample, rims: list[Form]) -> Floats:
    """(n, 3) m, ends of lines."""
    D = sample.model.mechanism.dimension
    at = np.array([form.value(sample.state.q.reshape(-1, D)) for form in rims]).reshape(-1, 3, D)
    return in_space((_WHEEL @ at).reshape(-1, D))


def _message(
    marks: list[float], counts: list[int], width: float, shown: ShapePlaces | None
) -> MarkerArray:
    marks = list(marks)
    array = MarkerArray()
    for (name, color), count in zip(_COLORS.items(), counts, strict=False):
        marker = Marker(header=Header(stamp=STAMP, frame_id=WORLD), ns=name, id=0)
        balls = name == 'joints'
        marker.type = Marker.SPHERE_LIST if balls else Marker.LINE_LIST
        # A marker without points is removed: viewers complain of an empty list.
        marker.action = Marker.ADD if count else Marker.DELETE
        marker.pose.orientation.w = 1.0
        thick = 3.0 * width if balls else width
        marker.scale = Vector3(x=thick, y=thick, z=thick) if balls else Vector3(x=thick)
        r, g, b = color
        marker.color = ColorRGBA(r=r, g=g, b=b, a=1.0)
        if count:
            mark = marks.pop(0)
            marker.points = [Point(x=mark, y=mark, z=mark)] * count
        array.markers.append(marker)
    for number, shape in enumerate(shown.shapes if shown is not None else ()):
        array.markers.append(shape_marker(shape, number, marks[number]))
    return array
