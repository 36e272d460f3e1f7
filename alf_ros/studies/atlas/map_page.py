"""The page of an atlas: one HTML file, with map, mechanism and tables; nothing is fetched."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.logs.report.html import PAGE as REPORT
from alf_ros.simulation.display_geometry import in_space, segments
from alf_ros.studies.atlas.mapped_piece import TRAVEL_LIMIT, MappedPiece
from alf_ros.studies.atlas.position_map import Atlas

PAGE = Path(__file__).with_name('page')
MOST_POSITIONS = 12_000  # on the page: of more, every second, third ... one
_MOST_MARKS = 2000
_NOTHING = 1e-13  # rounding of numbers of any unit
_DRIVEN = 'travel limit (singular with the input held)'
_NOTES = (
    'A circuit is a set of positions that the mechanism can go through without being taken apart. '
    'A piece of it ends in singular positions of the mechanism. Along a piece every travel limit '
    'begins another branch.',
    'Velocity ratio: rate of the output over rate of the input. Mechanical advantage: the '
    'inverse, the effort of the output that balances one unit of effort of the input, without '
    'friction and weights. Transmission angle: between the bar and the path of its pin at the '
    'output end, '
    'sin μ = |e · v| / |v|.',
    'Dashed: every position on the curve is singular.',
)

Json = dict[str, Any]


def page(atlas: Atlas) -> str:
    """The text of the file."""
    parts = {
        '/*LOOK*/': (REPORT / 'look.css').read_text('utf-8'),
        '/*SCRIPT*/': '\n'.join(
            path.read_text('utf-8') for path in (REPORT / 'stage.js', PAGE / 'atlas.js')
        ),
        # '</script>' in a name must not end the data
        '/*DATA*/': json.dumps(_data(atlas), allow_nan=False).replace('<', '\\u003c'),
    }
    text = (PAGE / 'atlas.html').read_text('utf-8')
    for mark, part in parts.items():
        before, after = text.split(mark)
        text = before + part + after
    return text


def _data(atlas: Atlas) -> Json:
    model, drawn = atlas.model, atlas.model.mechanism
    points = model.point_names
    over = atlas.over.name + (f' and {atlas.second.name}' if atlas.second else '')
    every_one = _series(atlas)
    series = [every_one[n] for n in _once(every_one)]
    total = sum(len(piece.q) for piece in atlas.pieces)
    every = max(1, -(-total // MOST_POSITIONS))
    numbered = [(n, piece) for n, sheet in enumerate(atlas.sheets) for piece in sheet.pieces]
    return {
        'title': f'{atlas.name}: positions over {over}',
        'spatial': drawn.dimension == 3,
        'links': [points.index(end) for body in drawn.bodies for end in segments(body)],
        'pins': [points.index(joint.point) for joint in drawn.joints if joint.point],
        'series': series,
        'up': 1 if len(series) > 1 else 0,
        'sheets': [_short(sheet.level) for sheet in atlas.sheets] if atlas.second else [''],
        'pieces': [_piece(atlas, n, piece, every) for n, piece in numbered],
        'marks': list(_marks(atlas, every))[:_MOST_MARKS],
        'markHead': ['kind', atlas.over.name, atlas.second.name if atlas.second else '', ''],
        'tables': _tables(atlas),
        'notes': [atlas.statement + '.', *_NOTES],
    }


def _series(atlas: Atlas) -> list[Json]:
    """The quantities that the map can show, the input first."""

    def one(name: str, unit: str, angle: bool = False, unbounded: bool = False) -> Json:
        return {'name': name, 'unit': unit, 'angle': angle, 'unbounded': unbounded}

    found = [one(atlas.over.name, atlas.over.unit, atlas.over.is_angle)]
    if atlas.second:
        found.append(one(atlas.second.name, atlas.second.unit, atlas.second.is_angle))
    if atlas.output:
        found.append(one(atlas.output.name, atlas.output.unit, atlas.output.is_angle))
        found.append(one('velocity ratio', '', unbounded=True))
        found.append(one('mechanical advantage', '', unbounded=True))
    if atlas.bar:
        found.append(one('transmission angle', '°'))
    mechanism = atlas.model.mechanism
    for each in mechanism.coordinates:
        found.append(one(each.name, 'rad' if each.is_angle else 'm', each.is_angle))
    axes = 'xyz'[: mechanism.dimension]
    found += [one(f'{p}.{axis}', 'm') for p in _moving(atlas) for axis in axes]
    found.append(one('distance σ / ordinary σ', ''))
    return found


def _once(series: Sequence[Json]) -> list[int]:
    """The places of series that are not there twice, as the input among the joints."""
    names = [each['name'] for each in series]
    return [n for n, name in enumerate(names) if names.index(name) == n]


def _moving(atlas: Atlas) -> list[str]:
    fixed = {point.name for point in atlas.model.mechanism.points if point.fixed}
    return [name for name in atlas.model.point_names if name not in fixed]


def _columns(atlas: Atlas, piece: MappedPiece, level: float) -> list[Floats]:
    """The quantities of `_series` at all positions of a piece."""
    layout = atlas.model.layout
    found = [piece.over]
    if atlas.second:
        found.append(np.full(piece.over.size, level))
    if atlas.output:
        found += [piece.output, piece.velocity_ratio, piece.advantage]
    if atlas.bar:
        found.append(np.degrees(piece.transmission))
    found += list(piece.joints.T)
    places = piece.q.reshape(len(piece.q), -1, layout.dimension)
    for name in _moving(atlas):
        found += list(places[:, layout.of_point[name]].T)
    found.append(piece.sigma)
    return [found[n] for n in _once(_series(atlas))]


def _piece(atlas: Atlas, sheet: int, piece: MappedPiece, every: int) -> Json:
    kept = _kept(len(piece.q), every)
    level = atlas.sheets[sheet].level
    places = np.array([_places(atlas, q) for q in piece.q[kept]])
    return {
        'sheet': sheet,
        'circuit': piece.circuit,
        'number': piece.number,
        'singular': piece.piece.singular,
        'values': [_numbers(column[kept]) for column in _columns(atlas, piece, level)],
        'places': [_numbers(each.ravel(), 5) for each in places],
        'box': [places.min(axis=(0, 1)).tolist(), places.max(axis=(0, 1)).tolist()],
    }


def _kept(count: int, every: int) -> list[int]:
    return sorted({*range(0, count, every), count - 1})


def _places(atlas: Atlas, q: Floats) -> Floats:
    return in_space(q.reshape(-1, atlas.model.layout.dimension)[atlas.model.point_block])


def _marks(atlas: Atlas, every: int) -> Iterable[Json]:
    """Singular positions of the mechanism, and of its input and output, on the map."""
    for n, sheet in enumerate(atlas.sheets):
        level = _short(sheet.level) if atlas.second else ''
        for k, node in enumerate(sheet.nodes):
            piece = next((p for p in sheet.pieces if k in p.piece.ends), None)
            if piece is not None:
                at = 0 if piece.piece.ends[0] == k else len(piece.q) - 1
                text = ('singular position', _value(atlas, piece, at), level, node.report.text)
                yield _mark(atlas, n, piece, at, every, 'node', 'bad', text, node.q)
        for piece in sheet.pieces:
            for turning in piece.turnings:
                at = min(len(piece.q) - 1, math.floor(turning.place + 0.5))
                is_limit = turning.kind == TRAVEL_LIMIT
                colour = 'warn' if is_limit else 'energy'
                what = _DRIVEN if is_limit else 'dead point of the output'
                text = (what, _shown(turning.value), level, f'circuit {piece.circuit}')
                yield _mark(atlas, n, piece, at, every, 'turning', colour, text, turning.q)


def _mark(
    atlas: Atlas,
    sheet: int,
    piece: MappedPiece,
    at: int,
    every: int,
    kind: str,
    colour: str,
    text: tuple[str, str, str, str],
    q: Floats,
) -> Json:
    columns = _columns(atlas, piece, atlas.sheets[sheet].level)
    numbers = [float(column[at]) for column in columns]
    number = next(n for n, p in enumerate(atlas.pieces) if p is piece)
    kept = _kept(len(piece.q), every)
    return {
        'sheet': sheet,
        'kind': kind,
        'colour': colour,
        'what': text[0],
        'cells': list(text[1:]),
        'piece': number,
        'n': int(np.argmin(np.abs(np.array(kept) - at))),
        'values': _numbers(np.array(numbers)),
        'places': _numbers(_places(atlas, q).ravel(), 5),
    }


def _value(atlas: Atlas, piece: MappedPiece, at: int) -> str:
    value = float(piece.over[at])
    if atlas.over.is_angle:
        value -= 2.0 * math.pi * math.floor(value / (2.0 * math.pi) + 0.5)
    return _shown(value)


def _tables(atlas: Atlas) -> list[Json]:
    unit = atlas.over.unit
    counts, limits = [], []
    for n, sheet in enumerate(atlas.sheets):
        level = [_short(sheet.level)] if atlas.second else []
        for low, high, count in atlas.counts(n):
            counts.append([*level, _shown(low), _shown(high), str(count)])
        for circuit, (low, high) in atlas.limits(n).items():
            cells = ['full turns', ''] if math.isinf(high) else [_shown(low), _shown(high)]
            limits.append([*level, str(circuit), *cells])
    second = [atlas.second.name] if atlas.second else []
    head = [f'{atlas.over.name} from, {unit}', 'to']
    return [
        {
            'title': 'Assembly modes',
            'head': [*second, *head, 'positions'],
            'rows': counts[:200],
        },
        {'title': 'Travel', 'head': [*second, 'circuit', *head], 'rows': limits[:200]},
    ]


def _numbers(values: Floats, digits: int = 7) -> list[float | None]:
    exact = np.where(np.abs(values) < _NOTHING, 0.0, values).tolist()
    return [float(f'{x:.{digits}g}') if math.isfinite(x) else None for x in exact]


def _short(value: float) -> str:
    return _shown(value, 6)


def _shown(value: float, digits: int = 9) -> str:
    return f'{0.0 if abs(value) < _NOTHING else value:.{digits}g}'
