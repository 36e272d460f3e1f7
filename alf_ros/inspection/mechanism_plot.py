"""Draw a mechanism: bodies as bars and plates, joints as symbols, fixed points on hatched ground.

Planar mechanisms are drawn as they are, spatial ones from the side above and from the front. The
paths of points in the sweep are pale, and the first singular position is red.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.convex_outline import outline
from alf_ros.inspection.joint_pen import PALE, JointPen, hatched
from alf_ros.inspection.mesh_lines import MeshLines
from alf_ros.inspection.mesh_triangles import read_meshes
from alf_ros.inspection.plot_axes import INK, Plane, Space
from alf_ros.inspection.shape_edges import edges
from alf_ros.inspection.soundness import Soundness
from alf_ros.mechanism import Joint, VisualShape
from alf_ros.mechanism.affine import Form
from alf_ros.model.joints import type_of
from alf_ros.paths import replacing

# Okabe & Ito: told apart by all eyes
COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#56b4e9', '#e69f00')
RED = '#c0272d'
MOST_NAMES = 24  # points; with more there are none written
_AROUND = 0.1  # m: half of the side of a drawing of one place
_VIEWS = ((22.0, -60.0, 'from the side above'), (0.0, -90.0, 'from the front, along y'))


def draw(path: Path, found: Soundness) -> None:
    """Write the picture.

    Raises ImportError without matplotlib, OSError if it cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    model = found.model
    picture = Picture(found)
    width, height = (picture.high - picture.low)[[0, -1]]
    scale = min(9.0 / width, 7.5 / height)
    canvases: list[Plane | Space]
    if model.layout.dimension == 2:
        size = max(5.0, scale * width + 1.0), max(2.5, scale * height + 1.2)
        figure = Figure(figsize=size, layout='constrained')
        canvases = [Plane(figure.add_subplot())]
    else:
        figure = Figure(figsize=(15.0, 7.5))
        canvases = [
            Space(figure.add_subplot(1, 2, n + 1, projection='3d'), *view)
            for n, view in enumerate(_VIEWS)
        ]
        figure.subplots_adjust(left=0.0, right=0.95, bottom=0.04, top=0.9, wspace=0.2)
    FigureCanvasAgg(figure)
    for canvas in canvases:
        picture.on(canvas)
        canvas.finish(picture.low, picture.high)
    verdict = 'sound' if found.sound else 'NOT SOUND'
    freedoms = next((a.answer for a in found.answers if a.question == 'mobility'), '')
    title = f'{model.mechanism.name}: {verdict}. {freedoms}'
    if len(picture.way):
        title += '\npale: where the points go'
        title += '; red: a singular position' if picture.singular is not None else ''
    if picture.missing:
        others = f', and {len(picture.missing) - 1} more' if picture.missing[1:] else ''
        title += f'\nnot drawn: {picture.missing[0]}{others}'
    figure.suptitle(title, color=INK, fontsize=11)
    with replacing(path) as target:
        figure.savefig(target, dpi=110)


@dataclass(frozen=True, eq=False)
class _Frame:
    """Of a body in the drawing: its origin (D,), m, and its axes in rows (D, D)."""

    colour: str
    origin: Floats
    axes: Floats

    def placed(self, places: Floats) -> Floats:
        """(k, D) of places (k, 3) in the frame of the body, m."""
        moved: Floats = self.origin + places[:, : len(self.origin)] @ self.axes
        return moved


@dataclass(frozen=True, eq=False)
class _PlacedMesh:
    """A mesh on its body."""

    lines: MeshLines
    shape: VisualShape
    frame: _Frame

    @property
    def corners(self) -> Floats:
        """(n, D) m, all its vertices."""
        return self._placed(self.lines.places)

    def seen(self, towards: Floats) -> Floats:
        """(k, D) its lines for an eye in a direction, with rows of NaN between them."""
        D = len(self.frame.origin)
        inside = self.frame.axes @ towards if D == 3 else towards
        return self._placed(self.lines.seen_along(self.shape.turn.T @ inside))

    def _placed(self, places: Floats) -> Floats:
        return self.frame.placed(np.array(self.shape.at) + places @ self.shape.turn.T)


class Picture:
    """One drawing of the findings. `low` and `high` (D,) are the box it needs, m."""

    def __init__(self, found: Soundness) -> None:
        self.model, self.layout = found.model, found.model.layout
        self.canvas: Any = None
        D = self.layout.dimension
        self.q = found.q.reshape(-1, D)
        self.places = {name: self.q[block] for name, block in self.layout.of_point.items()}
        walk = found.walk
        self.way = np.array(walk.positions if walk.whole else []).reshape(-1, len(self.q), D)
        self.singular = walk.singular[0].reshape(-1, D) if walk.whole and walk.singular else None
        them = np.array(list(self.places.values()))
        points = self.way[:, list(self.layout.of_point.values())].reshape(-1, D)
        rims = [
            place + sign * abs(radius)
            for joint in self.model.mechanism.joints
            if type_of(joint).is_round
            for place, radius in zip(
                self.places_of(joint)[::-1], (joint.value, joint.of_parent), strict=True
            )
            for sign in (1.0, -1.0)
        ]
        self.shapes = self._edges_of_shapes()
        self.meshes = self._lines_of_meshes()
        drawn = [line for _, line in self.shapes] + [mesh.corners for mesh in self.meshes]
        heavy = [body for body in self.layout.bodies if body.mass > 0.0]
        coms = [self.value(self.layout.place(body.name, body.com)) for body in heavy]
        them = np.vstack([them, points, *rims, *drawn, *coms])
        middle, half = 0.5 * (them.max(axis=0) + them.min(axis=0)), 0.5 * np.ptp(them, axis=0)
        half = half if half.any() else np.full_like(half, _AROUND)
        bars = [np.linalg.norm(body.local[1]) for body in self.layout.bodies if body.local[1:]]
        self.size = min(0.03 * float(half.max()), 0.1 * float(min(bars, default=np.inf)))  # m
        half = np.maximum(1.1 * half, 0.25 * half.max()) + 3.0 * self.size
        self.low, self.high = middle - half, middle + half

    def on(self, canvas: Plane | Space) -> None:
        """Draw all of it."""
        self.canvas = canvas
        self.draw_way()
        self.draw_shapes()
        self.draw_bodies()
        for point in self.model.mechanism.points:
            if point.fixed:
                self._foot(np.array(point.at))
        for joint in self.model.mechanism.joints:
            self.draw_joint(joint)
        self.write_names()

    def places_of(self, joint: Joint) -> tuple[Floats, Floats]:
        """(D,) where the parent has it, and where the child."""
        base, tip = joint.frames
        return (
            self.value(self.layout.place(joint.parent, base.origin)),
            self.value(self.layout.place(joint.child, tip.origin)),
        )

    def value(self, f: Form) -> Floats:
        """Of a form at this position."""
        return f.value(self.q)

    # --------------------------------------------------------------------------------------- parts

    def draw_way(self) -> None:
        """The paths of the points, and the first singular position."""
        for point in self.model.mechanism.points:
            if len(self.way) and not point.fixed:
                block = self.layout.of_point[point.name]
                path = np.vstack([self.way[:, block], self.way[:1, block]])
                self.canvas.line(path, color=PALE, linewidth=0.8, alpha=0.7, zorder=1)
        if self.singular is not None:
            for body in self.layout.bodies:
                bar = self.singular[[self.layout.of_point[name] for name in body.points]]
                self.canvas.line(bar, color=RED, linewidth=1.2, alpha=0.7, zorder=2)

    def _edges_of_shapes(self) -> list[tuple[str, Floats]]:
        """Colour and edges (k, D) of the shapes of bodies; shapes of the ground may be large."""
        return [
            (frame.colour, frame.placed(line))
            for shape, frame in self._shapes()
            for line in edges(shape)
        ]

    def _lines_of_meshes(self) -> list[_PlacedMesh]:
        """Of all that can be read."""
        found = [(shape, frame) for shape, frame in self._shapes() if shape.kind == 'mesh']
        read, self.missing = read_meshes(shape.file for shape, _ in found)
        return [
            _PlacedMesh(MeshLines(read[shape.file], np.array(shape.size)), shape, frame)
            for shape, frame in found
            if shape.file in read
        ]

    def _shapes(self) -> Iterator[tuple[VisualShape, _Frame]]:
        """Shapes of bodies that have axes, each with the frame of its body."""
        D = self.layout.dimension
        for number, body in enumerate(self.layout.bodies):
            shapes = self.model.mechanism.body[body.name].shapes
            if not shapes or not self.layout.turns(body.name):
                continue
            origin = self.value(self.layout.place(body.name, (0.0,) * D))
            axes = [self.value(self.layout.direction(body.name, tuple(e))) for e in np.eye(D)]
            frame = _Frame(COLOURS[number % len(COLOURS)], origin, np.array(axes))
            for shape in shapes:
                yield shape, frame

    def draw_shapes(self) -> None:
        """Their edges, pale."""
        lines = self.shapes + [
            (mesh.frame.colour, mesh.seen(self.canvas.towards)) for mesh in self.meshes
        ]
        for colour, line in lines:
            self.canvas.line(line, color=colour, linewidth=0.7, alpha=0.45, zorder=2)

    def draw_bodies(self) -> None:
        """A bar between two points, a plate through more, from the place of a joint if it has one
        point only."""
        for number, body in enumerate(self.layout.bodies):
            colour = COLOURS[number % len(COLOURS)]
            corners = [self.places[name] for name in body.points]
            corners += [
                self.value(
                    self.layout.place(body.name, joint.frames[joint.child == body.name].origin)
                )
                for joint in self.model.mechanism.joints
                if body.name in (joint.parent, joint.child) and joint.point is None
            ]
            if body.mass > 0.0:
                corners.append(self.value(self.layout.place(body.name, body.com)))
            hull = outline(np.array(corners))
            if len(hull) > 2:
                self.canvas.plate(hull, colour)
                hull = np.vstack([hull, hull[:1]])
            width = 4.0 if len(hull) == 2 else 1.5
            self.canvas.line(
                hull, color=colour, linewidth=width, solid_capstyle='round', alpha=0.85, zorder=4
            )
            if body.mass > 0.0:
                com = self.value(self.layout.place(body.name, body.com))
                self.canvas.line(com[None], color=colour, marker='x', markersize=5, zorder=5)

    def _foot(self, at: Floats) -> None:
        s = 1.3 * self.size
        across, up = np.eye(self.layout.dimension)[[0, -1]]
        left, right = at - 1.8 * s * up - s * across, at - 1.8 * s * up + s * across
        style = {'color': INK, 'linewidth': 1.0, 'zorder': 6}
        self.canvas.line(np.array([at, left, right, at]), **style)
        hatched(self.canvas, left - 0.6 * s * across, right + 0.6 * s * across, -up, self.size)

    def write_names(self) -> None:
        """Points by name, if there are not too many."""
        if len(self.places) > MOST_NAMES:
            return
        at: dict[tuple[float, ...], list[str]] = {}
        for name, place in self.places.items():
            key = tuple(np.round(place / self.size, 1).tolist())
            at.setdefault(key, []).append(name)
        for names in at.values():
            self.canvas.text(
                self.places[names[0]], ', '.join(names), color=INK, fontsize=9, zorder=9
            )

    def draw_joint(self, joint: Joint) -> None:
        """Its symbol, where the child has it."""
        type_of(joint).draw(JointPen(self, joint))
