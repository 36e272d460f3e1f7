"""Draws what the symbols of joints are made of: `alf_ros.model.joints.contract.Pen`."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.plot_axes import INK, Plane, Space
from alf_ros.mechanism import Joint
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout

PALE = '#9aa5af'
_COLOURS = {'ink': INK, 'pale': PALE, 'white': 'white'}


class PenTarget(Protocol):
    """Interface of the drawing that a pen needs; `size` of symbols, m."""

    size: float
    layout: Layout
    canvas: Any

    def places_of(self, joint: Joint) -> tuple[Floats, Floats]:
        """(D,) where the parent has it, and where the child."""

    def value(self, f: Form) -> Floats:
        """Of a form at this position."""


class JointPen:
    """The pen of one joint of a picture."""

    def __init__(self, picture: PenTarget, joint: Joint) -> None:
        self.joint, self.size = joint, picture.size
        self._picture, self._layout, self._canvas = picture, picture.layout, picture.canvas
        base, tip = joint.frames
        direction = self._layout.direction
        self.there, self.at = picture.places_of(joint)
        self.axes = [picture.value(direction(joint.parent, axis)) for axis in base.axes]
        self.own = [picture.value(direction(joint.child, axis)) for axis in tip.axes]
        planar = self._layout.dimension == 2
        self.along, self.side = self.axes[0 if planar else 2], self.axes[1 if planar else 0]

    def dot(self, colour: str, size: float) -> None:
        style = {'markeredgecolor': INK, 'color': _COLOURS[colour], 'zorder': 8}
        self._canvas.line(self.at[None], **style, marker='o', markersize=size)

    def square(self) -> None:
        self._canvas.line(self.at[None], color=INK, marker='s', markersize=6, zorder=8)

    def bar(self, along: Floats, half: float, width: float = 1.5) -> None:
        line = np.array([self.at - half * along, self.at + half * along])
        self._canvas.line(line, color=INK, linewidth=width, zorder=7)

    def box(self, along: Floats, side: Floats, long: float, wide: float) -> None:
        corners = [(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)]
        line = np.array([self.at + a * long * along + b * wide * side for a, b in corners])
        self._canvas.line(line, color=INK, linewidth=1.2, zorder=7)

    def rail(self, middle: Floats, along: Floats, side: Floats, half: float) -> None:
        ends = middle - half * along, middle + half * along
        hatched(self._canvas, *ends, -side, self.size)

    def line(self, places: Floats, style: str = '-', width: float = 1.0) -> None:
        self._canvas.line(places, color=INK, linewidth=width, linestyle=style, zorder=5)

    def dots(self, places: Floats) -> None:
        self._canvas.line(places, color=INK, linestyle='', marker='o', markersize=5, zorder=8)

    def circle(self, at: Floats, radius: float) -> None:
        angle = np.linspace(0.0, 2.0 * np.pi, 91)[:, None]
        self.line(at + radius * np.hstack([np.cos(angle), np.sin(angle)]), '-.')

    def across(self, axle: Floats | None, leans: bool) -> tuple[Floats, Floats]:
        """Two unit vectors (D,) across the axle of a wheel: where it rolls, and upwards."""
        x, up = self.axes[0], self.axes[-1]
        y = up
        if axle is not None:  # it rolls across its axle
            across = np.asarray(np.cross(axle, up), dtype=float)
            size = float(np.linalg.norm(across))
            x = across / size if size > 1e-6 else x
            if leans:
                y = np.asarray(np.cross(x, axle), dtype=float)
        return x, y

    def wheel(self, axle: Floats | None, leans: bool = False) -> None:
        R, up, (x, y) = self.joint.value, self.axes[-1], self.across(axle, leans)
        angle = np.linspace(0.0, 2.0 * np.pi, 61)[:, None]
        self.line(self.at + R * (np.cos(angle) * x + np.sin(angle) * y), width=1.5)
        self.rail(self.at - R * y, x, up, 1.5 * R)

    def stiffest(self) -> Floats:
        J = np.array(self._layout.body[self.joint.child].inertia)
        axis = np.linalg.eigh(J)[1][:, 2]
        return self._picture.value(self._layout.direction(self.joint.child, tuple(axis)))


def hatched(
    canvas: Plane | Space | Any, start: Floats, end: Floats, below: Floats, size: float
) -> None:
    """A line of the ground, hatched below; size: of symbols, m."""
    along = (end - start) / np.linalg.norm(end - start)
    canvas.line(np.array([start, end]), color=INK, linewidth=1.2, zorder=6)
    for distance in np.arange(0.4 * size, float(np.linalg.norm(end - start)) + 1e-9, 0.7 * size):
        top = start + distance * along
        stroke = np.array([top, top + 0.7 * size * (below - 0.7 * along)])
        canvas.line(stroke, color=INK, linewidth=0.8, zorder=6)
