"""Charts of an ensemble as SVG: histogram, fan over time, scatter and bars."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats

_WIDTH, _HEIGHT = 360, 200
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 10, 24, 26
MOST_POINTS = 2000


class _Frame:
    """A chart with axes; x and y: least and largest value."""

    def __init__(self, title: str, x: tuple[float, float], y: tuple[float, float]) -> None:
        self._x, self._y = _widened(*x), _widened(*y)
        self._parts = [f'<text x="{_LEFT}" y="14" class="title">{html.escape(title)}</text>']
        for value, anchor in zip(self._x, ('start', 'end'), strict=True):
            at = self.x(value)
            text = (
                f'<text x="{at:.1f}" y="{_HEIGHT - 8}" text-anchor="{anchor}">{value:.5g}</text>'
            )
            self._parts.append(text)
        for value in self._y:
            at = self.y(value) + 4
            text = f'<text x="{_LEFT - 4}" y="{at:.1f}" text-anchor="end">{value:.5g}</text>'
            self._parts.append(text)

    def x(self, value: float) -> float:
        return _LEFT + _along(value, *self._x) * (_WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        return _HEIGHT - _BOTTOM - _along(value, *self._y) * (_HEIGHT - _TOP - _BOTTOM)

    def add(self, part: str) -> None:
        self._parts.append(part)

    def points(self, xs: Floats, ys: Floats) -> str:
        pairs = zip(xs.tolist(), ys.tolist(), strict=True)
        return ' '.join(f'{self.x(x):.1f},{self.y(y):.1f}' for x, y in pairs)

    @property
    def svg(self) -> str:
        box = (
            f'<rect x="{_LEFT}" y="{_TOP}" width="{_WIDTH - _LEFT - _RIGHT}" '
            f'height="{_HEIGHT - _TOP - _BOTTOM}" class="box"/>'
        )
        return (
            f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}">'
            f'{box}{"".join(self._parts)}</svg>'
        )


def _along(value: float, low: float, high: float) -> float:
    """How far along a range a value is, from 0 to 1. Of halves: a difference of numbers may be too
    large for 64 bits."""
    return (0.5 * value - 0.5 * low) / (0.5 * high - 0.5 * low)


def _widened(low: float, high: float) -> tuple[float, float]:
    """A range that is one."""
    room = 1e-12 * max(abs(low), abs(high)) or 1.0
    return (low, high) if high - low > room else (low - room, high + room)


def histogram(title: str, values: Floats) -> str:
    """How many members have which value; (members,), finite."""
    low, high = _widened(float(values.min()), float(values.max()))
    bins, halves = min(40, max(5, values.size // 5)), (0.5 * low, 0.5 * high)
    counts, edges = np.histogram(0.5 * values, bins=bins, range=halves)
    edges = 2.0 * edges
    frame = _Frame(title, (low, high), (0.0, float(counts.max())))
    for count, left, right in zip(counts, edges[:-1], edges[1:], strict=True):
        x, y = frame.x(left), frame.y(float(count))
        frame.add(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{frame.x(right) - x:.1f}" '
            f'height="{frame.y(0.0) - y:.1f}" class="bar"/>'
        )
    return frame.svg


def fan(title: str, t: Floats, values: Floats) -> str:
    """Over t (s): the median, and bands with a half and with nine tenths of the members; values
    (members, t), of which each column has finite ones."""
    bands = 2.0 * np.nanquantile(0.5 * values, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0)
    spread = (float(bands.min()), float(bands.max()))
    frame = _Frame(title, (float(t[0]), float(t[-1])), spread)
    for low, high, kind in ((0, 4, 'wide'), (1, 3, 'narrow')):
        there, back = frame.points(t, bands[low]), frame.points(t[::-1], bands[high][::-1])
        frame.add(f'<polygon points="{there} {back}" class="{kind}"/>')
    frame.add(f'<polyline points="{frame.points(t, bands[2])}" class="line"/>')
    return frame.svg


def scatter(title: str, x: Floats, y: Floats) -> str:
    """One number against another, of `MOST_POINTS` members at most; (members,), finite."""
    x, y = x[:MOST_POINTS], y[:MOST_POINTS]
    frame = _Frame(title, (float(x.min()), float(x.max())), (float(y.min()), float(y.max())))
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        frame.add(f'<circle cx="{frame.x(a):.1f}" cy="{frame.y(b):.1f}" r="2"/>')
    return frame.svg


def bars(title: str, rows: Sequence[tuple[str, float, str]]) -> str:
    """One bar from 0 to 1 for each row: its name, length, and text."""
    height = _TOP + 18 * len(rows) + 6
    parts = [f'<text x="4" y="14" class="title">{html.escape(title)}</text>']
    for n, (name, length, text) in enumerate(rows):
        y = _TOP + 18 * n
        wide = 120 * min(1.0, max(0.0, length)) if length == length else 0.0
        parts += [
            f'<text x="4" y="{y + 11}">{html.escape(name[:32])}</text>',
            f'<rect x="160" y="{y}" width="{wide:.1f}" height="13" class="bar"/>',
            f'<text x="{164 + wide:.1f}" y="{y + 11}">{html.escape(text)}</text>',
        ]
    return (
        f'<svg viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}">'
        f'{"".join(parts)}</svg>'
    )
