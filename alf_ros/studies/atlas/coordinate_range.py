"""The range of a coordinate on a motion with several freedoms, by going up and down along it."""

from __future__ import annotations

import math

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model import assembly
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.studies.atlas.coordinate_reader import CoordinateReader
from alf_ros.studies.atlas.map_coordinate import MapCoordinate

_MOST = 2000  # steps of one way
_LEAST = 1e-7  # step, of the longest, at which a way ends
_STARTS = 6
_AWAY = 0.5  # of the size


def range_of(
    model: Model, coordinate: MapCoordinate, q: Floats, longest: float, seed: int
) -> tuple[float, float]:
    """Least and largest value, from q (blocks D, m) and random places; of an angle that turns all
    the way round -π and π. longest: step, m."""
    reader, random = CoordinateReader(model), np.random.default_rng(seed)
    low, high = math.inf, -math.inf
    for n in range(_STARTS):
        start = np.array(q)
        if n:
            start[: model.n] += _AWAY * model.size * random.standard_normal(model.n)
            try:
                start = assembly.close(model, {}, start)
            except AssemblyError:
                continue
        ends = [_end(reader, coordinate, start, sign, longest) for sign in (1.0, -1.0)]
        if coordinate.is_angle and ends[0] - ends[1] > 2.0 * math.pi:
            return -math.pi, math.pi
        low, high = min(low, ends[1]), max(high, ends[0])
    return low, high


def _end(
    reader: CoordinateReader, coordinate: MapCoordinate, q: Floats, sign: float, longest: float
) -> float:
    """The value at the end of a way on which it rises (sign 1) or falls."""
    model = reader.model
    at, h = Linearised(model, q), longest
    value, last = _value(reader, coordinate, q), _value(reader, coordinate, q)
    first = value
    for _ in range(_MOST):
        d = sign * _gradient(reader, coordinate, at)
        size = float(np.linalg.norm(d))
        if (
            size < 1e-9
            or h < _LEAST * longest
            or abs(value - first) > 2.1 * math.pi * _turns(coordinate)
        ):
            break
        ahead = at.closed(h * d / size, at.rank)
        now = math.nan if ahead is None else _value(reader, coordinate, ahead.q)
        change = now - last
        if coordinate.is_angle:
            change -= 2.0 * math.pi * np.round(change / (2.0 * math.pi))
        if ahead is None or not sign * change > 0.0:
            h *= 0.5
            continue
        at, last, value, h = ahead, now, value + change, min(1.5 * h, longest)
    return value


def _turns(coordinate: MapCoordinate) -> float:
    return 1.0 if coordinate.is_angle else math.inf


def _value(reader: CoordinateReader, coordinate: MapCoordinate, q: Floats) -> float:
    return coordinate.read(reader, q, np.zeros_like(q))[0]


def _gradient(reader: CoordinateReader, coordinate: MapCoordinate, at: Linearised) -> Floats:
    """(n,) the direction of the free motion along which the coordinate rises fastest."""
    found = np.zeros(at.model.n)
    for z in at.free.T:
        v = np.zeros_like(at.q)
        v[: z.size] = z
        found += coordinate.read(reader, at.q, v)[1] * z
    return found
