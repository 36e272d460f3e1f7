"""The positions of an atlas as lines of CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator

import numpy as np

from alf_ros.studies.atlas.mapped_piece import MappedPiece
from alf_ros.studies.atlas.position_map import Atlas


def lines(atlas: Atlas) -> Iterator[str]:
    """The head, then a line for each position, piece by piece; SI units."""
    model = atlas.model
    points = [name for name in model.point_names if name in _moving(atlas)]
    axes = 'xyz'[: model.layout.dimension]
    head = [_unit(atlas.second.name, atlas.second.unit)] if atlas.second else []
    head += ['circuit', 'piece', 'branch', _unit(atlas.over.name, atlas.over.unit)]
    if atlas.output:
        head.append(_unit(f'output {atlas.output.name}', atlas.output.unit))
        head += ['velocity ratio', 'mechanical advantage']
    head += ['transmission angle, rad'] if atlas.bar else []
    head.append('sigma')
    head += [
        _unit(each.name, 'rad' if each.is_angle else 'm') for each in model.mechanism.coordinates
    ]
    head += [_unit(f'{name}.{axis}', 'm') for name in points for axis in axes]
    yield _line(head)
    blocks = [model.layout.of_point[name] for name in points]
    for sheet in atlas.sheets:
        for piece in sheet.pieces:
            for n, branch in _branches(piece):
                row: list[object] = [_number(sheet.level)] if atlas.second else []
                row += [piece.circuit, piece.number, branch, _number(piece.over[n])]
                if atlas.output:
                    row += map(
                        _number, (piece.output[n], piece.velocity_ratio[n], piece.advantage[n])
                    )
                row += [_number(piece.transmission[n])] if atlas.bar else []
                row.append(_number(piece.sigma[n]))
                row += map(_number, piece.joints[n])
                places = piece.q[n].reshape(-1, model.layout.dimension)[blocks]
                row += map(_number, places.ravel())
                yield _line(row)


def _branches(piece: MappedPiece) -> Iterator[tuple[int, int]]:
    """Each position and the number of its branch: a part in which the input goes one way."""
    for branch, (first, last) in enumerate(piece.branches(), 1):
        for n in range(first, last + 1):
            yield n, branch


def _moving(atlas: Atlas) -> set[str]:
    return {point.name for point in atlas.model.mechanism.points if not point.fixed}


def _unit(name: str, unit: str) -> str:
    return f'{name}, {unit}'


def _number(value: float | np.floating) -> str:
    return '' if math.isnan(value) else f'{value:.12g}'


def _line(row: list[object] | list[str]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator='').writerow(row)
    return stream.getvalue()
