"""Charts of an optimisation as SVG: a quantity or a path before and after, and the objective."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats

_WIDTH, _HEIGHT = 480, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 12, 46, 34
_MOST = 2000  # places of a line
LOOK = """
.before { fill: none; stroke: #8a5a00; stroke-width: 1.5; stroke-dasharray: 6 4 }
.after { fill: none; stroke: #1f5fa8; stroke-width: 2 }
.limit { fill: none; stroke: #b3261e; stroke-width: 1; stroke-dasharray: 2 3 }
circle.wanted { fill: none; stroke: #111; stroke-width: 1.5; opacity: 1 }
circle.tried { fill: #1f5fa8; opacity: 1 } .refused { stroke: #b3261e; stroke-width: 1.5 }
.off { fill: none; stroke: #1f5fa8; stroke-width: 1 }
.reasons td:last-child { min-width: 22em }
.grid { stroke: #ddd }
.figures { display: flex; flex-wrap: wrap; gap: 0 1.5em }
figure { margin: 0 0 1.5em; max-width: 480px; flex: 1 1 300px }
figure svg { width: 100%; height: auto; margin: 0 }
"""


@dataclass(frozen=True)
class Line:
    """Places (N, 2), the class of their look, and what the legend calls them, if anything.

    The classes are 'before', 'after', 'limit', 'off', and, drawn as circles, 'wanted', 'tried'.
    """

    kind: str
    label: str
    places: Floats


def chart(
    title: str,
    lines: Sequence[Line],
    axes: tuple[str, str],
    is_map: bool = False,
    refused: Sequence[float] = (),
    is_log: bool = False,
) -> str:
    """Lines in one frame. is_map: both axes have one scale; refused: x of marks at the lower edge;
    is_log: y are decimal logarithms."""
    every = np.concatenate([line.places for line in lines])
    low, high = every.min(axis=0), every.max(axis=0)
    middle, half = 0.5 * (low + high), np.array([0.5 if not is_map else 0.53, 0.53]) * (high - low)
    half = np.where(half > 1e-12 * np.maximum(np.abs(middle), 1e-300), half, 1.0)
    size = np.array([_WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM])
    if is_map:
        half = size * (half / size).max()
    low, high = middle - half, middle + half
    origin = np.array([_LEFT, _HEIGHT - _BOTTOM])
    scale = size / (high - low) * np.array([1.0, -1.0])

    def at(places: Floats) -> Floats:
        return origin + (places - low) * scale

    parts = [_frame(title, axes), *_ticks(at, low, high, is_log)]
    for line in lines:
        places = at(line.places[:: max(1, len(line.places) // _MOST)])
        if line.kind in ('wanted', 'tried'):
            radius = 4 if line.kind == 'wanted' else 2.5
            parts += [
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" class="{line.kind}"/>'
                for x, y in places.tolist()
            ]
        else:
            pairs = ' '.join(f'{x:.1f},{y:.1f}' for x, y in places.tolist())
            parts.append(f'<polyline points="{pairs}" class="{line.kind}"/>')
    for x in refused:
        left = float(at(np.array([x, low[1]]))[0])
        foot = _HEIGHT - _BOTTOM
        parts.append(f'<path d="M{left - 3:.1f},{foot - 9} l6,6 m0,-6 l-6,6" class="refused"/>')
    parts += _legend(lines, bool(refused))
    name = html.escape(title, quote=True)
    return (
        f'<figure><svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{name}">'
        f'{"".join(parts)}</svg></figure>'
    )


def _frame(title: str, axes: tuple[str, str]) -> str:
    foot, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    return (
        f'<rect x="{_LEFT}" y="{_TOP}" width="{right - _LEFT}" height="{foot - _TOP}" '
        f'class="box"/><text x="{_LEFT}" y="14" class="title">{html.escape(title)}</text>'
        f'<text x="{right}" y="{_HEIGHT - 6}" text-anchor="end">{html.escape(axes[0])}</text>'
        f'<text x="4" y="{_TOP + 10}">{html.escape(axes[1])}</text>'
    )


def _ticks(
    at: Callable[[Floats], Floats], low: Floats, high: Floats, is_log: bool
) -> Iterator[str]:
    """Numbers and thin lines at round values of both axes."""
    foot, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    for value in _round_values(low[0], high[0], False):
        x = float(at(np.array([value, low[1]]))[0])
        yield f'<path d="M{x:.1f},{_TOP}V{foot}" class="grid"/>'
        yield f'<text x="{x:.1f}" y="{foot + 14}" text-anchor="middle">{value:.6g}</text>'
    for value in _round_values(low[1], high[1], is_log):
        y = float(at(np.array([low[0], value]))[1])
        text = f'{10.0**value:g}' if is_log else f'{value:.6g}'
        yield f'<path d="M{_LEFT},{y:.1f}H{right}" class="grid"/>'
        yield f'<text x="{_LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'


def _round_values(low: float, high: float, is_log: bool) -> list[float]:
    """Two to six round values between two."""
    rough = (high - low) / 5.0
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough)
    if is_log:
        step = max(1.0, np.ceil(step))
    first = np.ceil(low / step)
    return [float(k * step) + 0.0 for k in np.arange(first, np.floor(high / step) + 1.0)]


def _legend(lines: Sequence[Line], refused: bool) -> list[str]:
    parts, x = [], _LEFT
    entries = [(line.kind, line.label) for line in lines if line.label]
    if refused:
        entries.append(('refused', 'cannot be'))
    for kind, label in dict.fromkeys(entries):
        if kind in ('wanted', 'tried'):
            mark = f'<circle cx="{x + 8}" cy="32" r="4" class="{kind}"/>'
        elif kind == 'refused':
            mark = f'<path d="M{x + 5},29 l6,6 m0,-6 l-6,6" class="refused"/>'
        else:
            mark = f'<path d="M{x},32 h18" class="{kind}"/>'
        parts.append(f'{mark}<text x="{x + 23}" y="36">{html.escape(label)}</text>')
        x += 40 + 7 * len(label)
    return parts
