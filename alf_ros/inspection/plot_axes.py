"""Axes for drawings of mechanisms: matplotlib axes of two or of three dimensions, used alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats

INK = '#22303c'


class Plane:
    """Axes of two dimensions."""

    towards = np.array([0.0, 0.0, 1.0])  # to the eye

    def __init__(self, axes: Any) -> None:
        self.axes = axes

    def line(self, places: Floats, **style: Any) -> None:
        """A line, or a marker, through (k, D) places."""
        self.axes.plot(*places.T, **style)

    def plate(self, corners: Floats, colour: str) -> None:
        """A filled polygon."""
        from matplotlib.patches import Polygon

        patch = Polygon(corners, facecolor=colour, edgecolor=colour, alpha=0.3, zorder=3)
        self.axes.add_patch(patch)

    def text(self, place: Floats, name: str, **style: Any) -> None:
        """A name beside a place."""
        self.axes.annotate(name, place, (6, 6), textcoords='offset points', **_halo(), **style)

    def finish(self, low: Floats, high: Floats) -> None:
        """Show this box (m), to scale."""
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel='x, m', ylabel='y, m')
        self.axes.set_aspect('equal')
        self.axes.grid(True, color='0.93')
        self.axes.set_axisbelow(True)


class Space:
    """Axes of three dimensions, seen from a side."""

    def __init__(self, axes: Any, elevation: float, azimuth: float, title: str) -> None:
        self.axes, self.front = axes, elevation == 0.0
        axes.view_init(elevation, azimuth)
        up, turn = np.radians(elevation), np.radians(azimuth)
        self.towards = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
        axes.set_proj_type('ortho')
        axes.set_title(title, color=INK, fontsize=10)

    def line(self, places: Floats, **style: Any) -> None:
        """A line through places (k, 3), m."""
        style.pop('zorder', None)  # matplotlib sorts by depth
        self.axes.plot(*places.T, **style)

    def plate(self, corners: Floats, colour: str) -> None:
        """A filled polygon with corners (k, 3), m."""
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

        collection = Poly3DCollection([corners], alpha=0.25)
        collection.set_facecolor(colour)
        collection.set_edgecolor(colour)
        self.axes.add_collection3d(collection)

    def text(self, place: Floats, name: str, **style: Any) -> None:
        """A name beside a place (3,), m."""
        self.axes.text(*place, f'  {name}', **_halo(), **style)

    def finish(self, low: Floats, high: Floats) -> None:
        """Show this box (m), to scale; axes that are seen end on have no labels."""
        from matplotlib.ticker import MaxNLocator, NullLocator

        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        box = high - low
        if self.front:  # seen end on, the depth needs no room
            box[1] = min(box[1], box[0], box[2])
        zoom = 1.0
        if box[2] > box[:2].max():
            zoom = 0.9  # labels below need room
        elif self.front and box[0] > box[2]:
            zoom = min(1.2, np.linalg.norm(box) / box[0])  # so that the width fits
        self.axes.set_box_aspect(box, zoom=zoom)
        self.axes.set_xlabel('x, m', labelpad=8)
        self.axes.set_zlabel('z, m', labelpad=12)
        if self.front:  # the axis would cross its labels
            self.axes.tick_params(axis='z', pad=9)
        if not self.front:
            self.axes.set_ylabel('y, m', labelpad=8)
        for axis in (self.axes.xaxis, self.axes.yaxis, self.axes.zaxis):
            hidden = self.front and axis is self.axes.yaxis
            axis.set_major_locator(NullLocator() if hidden else MaxNLocator(4))
            axis.pane.set_facecolor('white')
            axis._axinfo['grid']['color'] = '0.93'


def _halo() -> dict[str, Any]:
    """Names stay readable on bars."""
    from matplotlib.patheffects import withStroke

    return {'path_effects': [withStroke(linewidth=2.5, foreground='white')]}
