"""`~/markers`: the mechanism as RViz and Foxglove draw it, in the world frame.

Four markers, told apart by their namespace: `links` (lines between the points of each body),
`joints` (balls), `reactions` (of parent on child) and `applied` (wrenches held), as arrows. A
mechanism that has some also has `wheels`: their rims, with a line that shows them turn, and
`symbols` of joints (sliders with their rails, hinges in space, rods). Each is one list of points,
so that a large mechanism stays one message of few markers. `shapes` has a marker for each shape of
a body.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros.arrays import Floats
from alf_ros.inspection.shape_places import ShapePlaces, shape_places
from alf_ros.inspection.symbol_places import limb_lines, symbol_lines
from alf_ros.inspection.wheel_places import wheel_places
from alf_ros.logs.cdr import Template
from alf_ros.mechanism.affine import FormArray
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
    reaction_places,
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
    'symbols': (0.55, 0.6, 0.65),
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
    layout, D = model.layout, model.layout.dimension
    limbs, rims = limb_lines(mechanism, layout), wheel_places(mechanism, layout, model.q)
    symbols = symbol_lines(mechanism, layout, model.q)
    sliding = list(reaction_places(mechanism, layout).values())
    parts = (limbs, sliding, rims, symbols)
    ends_of = np.cumsum([len(part) for part in parts])[:-1]
    forms = FormArray([form for part in parts for form in part], D)
    shown = shape_places(mechanism)
    posed = [NUMBERS] * len(shown.shapes) if shown else []
    templates: dict[int, Template] = {}  # by number of arrows of wrenches held

    def by_arrows(held: int) -> Template:
        if held not in templates:
            templates.clear()  # one at a time: commands rarely come and go
            counts = {
                'links': len(ends) + len(limbs),
                'joints': len(pins),
                'reactions': POINTS_PER_ARROW * len(known),
                'applied': POINTS_PER_ARROW * held,
            }
            optional = {'wheels': len(rims) // 3 * len(_WHEEL), 'symbols': len(symbols)}
            counts |= {name: count for name, count in optional.items() if count}
            templates[held] = template(
                lambda marks: _message(marks, counts, width, shown),
                [*(3 * n for n in counts.values() if n), *posed],
            )
        return templates[held]

    def write(sample: Sample, ns: int) -> bytes:
        scale = display.force_scale or standard
        places, forces = held_forces(sample)
        forces_of = in_space(sample.reaction_forces)
        reactions = np.vstack([forces_of[known], forces_of[~known]])
        q = sample.state.q.reshape(-1, D)
        limbs_at, sliding_at, rims_at, symbols_at = np.split(in_space(forms.values(q)), ends_of)
        filled = by_arrows(len(places))
        filled.stamp(ns)
        lists = [
            np.vstack([_places(sample, ends), limbs_at]),
            _places(sample, pins),
            arrows(np.vstack([_places(sample, at), sliding_at]), scale * reactions),
            arrows(places, scale * forces),
            (_WHEEL @ rims_at.reshape(-1, 3, 3)).reshape(-1, 3),
            symbols_at,
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


def _message(
    marks: list[float], counts: Mapping[str, int], width: float, shown: ShapePlaces | None
) -> MarkerArray:
    marks = list(marks)
    array = MarkerArray()
    for name, count in counts.items():
        marker = Marker(header=Header(stamp=STAMP, frame_id=WORLD), ns=name, id=0)
        balls = name == 'joints'
        marker.type = Marker.SPHERE_LIST if balls else Marker.LINE_LIST
        # A marker without points is removed: viewers complain of an empty list.
        marker.action = Marker.ADD if count else Marker.DELETE
        marker.pose.orientation.w = 1.0
        thick = 3.0 * width if balls else width
        marker.scale = Vector3(x=thick, y=thick, z=thick) if balls else Vector3(x=thick)
        r, g, b = _COLORS[name]
        marker.color = ColorRGBA(r=r, g=g, b=b, a=1.0)
        if count:
            mark = marks.pop(0)
            marker.points = [Point(x=mark, y=mark, z=mark)] * count
        array.markers.append(marker)
    for number, shape in enumerate(shown.shapes if shown is not None else ()):
        array.markers.append(shape_marker(shape, number, marks[number]))
    return array
