"""The atlas of a mechanism: all positions over one or two coordinates, as curves with nodes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from os import PathLike, fspath

import numpy as np

from alf_ros import paths
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.logs.progress import Report, silent
from alf_ros.mechanism import Mechanism
from alf_ros.model.compile import Model
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import number, text, whole
from alf_ros.studies.atlas.curve_search import Node
from alf_ros.studies.atlas.map_coordinate import MapCoordinate, coordinate_named
from alf_ros.studies.atlas.map_search import Held, MapRequest, Sheet, consistent, searched
from alf_ros.studies.atlas.mapped_piece import TRAVEL_LIMIT, MappedPiece, Turning
from alf_ros.studies.atlas.search_certainty import in_words, most_missing
from alf_ros.studies.atlas.transmission import Bar, bar_between
from alf_ros.studies.closing.actuated import refuse_velocity_rows, scene_of
from alf_ros.studies.closing.stops import stopped

_ALONE, _SHEET = 200, 40  # random starts in vain: without neighbours, and with them
_LEVELS = 25  # of the second coordinate
_SAME = 1e-9  # rad, or of the size: two values that are one


@dataclass(frozen=True, eq=False)
class Atlas:
    """All positions that a search found, over one coordinate or two.

    sheets: one, or one for each value of the second coordinate. statement: how the search was
    made, and how much it may have missed.
    """

    name: str
    model: Model
    over: MapCoordinate
    second: MapCoordinate | None
    output: MapCoordinate | None
    bar: Bar | None
    sheets: tuple[Sheet, ...]
    statement: str

    def __repr__(self) -> str:
        pieces = sum(len(sheet.pieces) for sheet in self.sheets)
        over = self.over.name + (f' and {self.second.name}' if self.second else '')
        return f'<Atlas of {self.name} over {over}: {pieces} pieces>'

    @property
    def pieces(self) -> tuple[MappedPiece, ...]:
        """The pieces of all sheets."""
        return tuple(piece for sheet in self.sheets for piece in sheet.pieces)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The singular positions of the mechanism, of all sheets."""
        return tuple(node for sheet in self.sheets for node in sheet.nodes)

    @property
    def turnings(self) -> tuple[Turning, ...]:
        """Travel limits of the input and dead points of the output, of all sheets."""
        return tuple(turning for piece in self.pieces for turning in piece.turnings)

    @property
    def boundary(self) -> Floats:
        """(positions, 2) values of both coordinates at all travel limits of the first.

        Over x and y of one point these lie on the boundary of its workspace, or on a curve inside
        it where two ways to reach a place become one. Raises InputError with one coordinate only.
        """
        if self.second is None:
            raise InputError('one coordinate has no boundary', key='second', expected='two')
        found = [
            (turning.value, sheet.level)
            for sheet in self.sheets
            for piece in sheet.pieces
            for turning in piece.turnings
            if turning.kind == TRAVEL_LIMIT
        ]
        return np.array(found).reshape(-1, 2)

    def limits(self, sheet: int = 0) -> dict[int, tuple[float, float]]:
        """Least and largest value of the input by circuit; infinite for full turns."""
        circuits = dict.fromkeys(piece.circuit for piece in self.sheets[sheet].pieces)
        return {circuit: self._limits(self._ranges(sheet, circuit)) for circuit in circuits}

    def counts(self, sheet: int = 0) -> list[tuple[float, float, int]]:
        """Ranges of the input (from, to) and the number of positions at each value in them."""
        return self._counts(self._ranges(sheet))

    def _ranges(self, sheet: int, circuit: int | None = None) -> list[tuple[float, float]]:
        """The input on each branch; angles with turns."""
        return [
            (min(pair), max(pair))
            for piece in self.sheets[sheet].pieces
            for pair in pairwise(piece.ends())
            if circuit in (None, piece.circuit)
        ]

    def _limits(self, ranges: Sequence[tuple[float, float]]) -> tuple[float, float]:
        if not self.over.is_angle:
            return min(low for low, _ in ranges), max(high for _, high in ranges)
        gaps = [(low, high) for low, high, count in self._counts(ranges) if not count]
        if not gaps:
            return -math.inf, math.inf
        if len(gaps) > 1:
            return gaps[0][1], gaps[-1][0]
        ((low, high),) = gaps  # over ±π
        turn = 2.0 * math.pi
        return (high, low + turn) if high < math.pi else (high - turn, low)

    def _counts(self, ranges: Sequence[tuple[float, float]]) -> list[tuple[float, float, int]]:
        if not ranges:
            return []
        if self.over.is_angle:
            edges = [_principal(edge) for pair in ranges for edge in pair] + [-math.pi, math.pi]
        else:
            edges = [edge for pair in ranges for edge in pair]
        same = _SAME * (1.0 if self.over.is_angle else self.model.size)
        kept: list[float] = []
        for edge in sorted(edges):
            if not kept or edge - kept[-1] > 100.0 * same:
                kept.append(edge)
        found: list[tuple[float, float, int]] = []
        for low, high in pairwise(kept):
            count = sum(_times(0.5 * (low + high), *pair, self.over.is_angle) for pair in ranges)
            if found and found[-1][2] == count:
                found[-1] = found[-1][0], high, count
            else:
                found.append((low, high, count))
        return found

    def write_csv(self, file: str | PathLike[str]) -> None:
        """Write all positions as a table, a line each."""
        from alf_ros.studies.atlas.map_table import lines

        paths.put(paths.named(fspath(file), 'file'), '\n'.join(lines(self)) + '\n')

    def write_html(self, file: str | PathLike[str]) -> None:
        """Write one HTML page that needs nothing else."""
        from alf_ros.studies.atlas.map_page import page

        paths.put(paths.named(fspath(file), 'file'), page(self))


def atlas(
    mechanism: SceneSource,
    over: str | Sequence[str] | None = None,
    *,
    levels: int | Sequence[float] | None = None,
    hold: Mapping[str, float] | None = None,
    output: str | None = None,
    bar: Sequence[str] | None = None,
    starts: int | None = None,
    seed: int = 0,
    report: Report = silent,
) -> Atlas:
    """All positions of a mechanism over one or two of its coordinates.

    mechanism: a scene, the name or path of a scene or a mechanism, or a mapping of either; drives
    and effects do not count, and neither do stops of joints; `Atlas.statement` names them. over:
    the input, a joint coordinate or a component of a point ('B.x'), and a second one for a
    mechanism with two freedoms; the first joint coordinate without it. levels: values of the
    second coordinate, or how many, 25 if absent. hold: other coordinates kept at a value (rad or
    m), each of which takes a freedom. output: the coordinate for the velocity ratio and the
    mechanical advantage; bar: the two points of a bar for the transmission angle, the output end
    last (`transmission` defines them). starts: each sheet is searched from random places until so
    many in a row find nothing new; 200, or 40 a sheet over two coordinates. report: takes the part
    done.

    Raises InputError for names and numbers that are none, for another number of freedoms than
    coordinates, and for rows that bind velocities only; AssemblyError if the loops do not close,
    or redundant rows contradict each other.
    """
    scene = scene_of(mechanism)
    bare = replace(scene.mechanism, drives=(), rotors=())
    refuse_velocity_rows(bare)
    bare, adjusted = consistent(scene, bare)
    first, second = _inputs(bare, over)
    if levels is not None and second is None:
        raise InputError('there is no second coordinate', key='levels', value=levels)
    request = MapRequest(
        first,
        second,
        None if output is None else coordinate_named(bare, output, 'output'),
        None if bar is None else bar_between(bare, bar),
        (_ALONE if second is None else _SHEET)
        if starts is None
        else whole(starts, 'starts', 1, 100_000),
        whole(seed, 'seed', 0),
    )
    held, stops = _held(bare, hold, (first, second)), stopped(scene)
    wanted = _LEVELS if levels is None else levels
    model, sheets = searched(scene, bare, held, request, wanted, report)
    return Atlas(
        scene.name,
        model,
        first,
        second,
        request.output,
        request.bar,
        tuple(sheets),
        _statement(sheets, request)
        + (f'; {adjusted}' if adjusted else '')
        + (f'; stops do not end a curve: those of {stops}' if stops else ''),
    )


def _inputs(mechanism: Mechanism, over: object) -> tuple[MapCoordinate, MapCoordinate | None]:
    if over is None:
        if not mechanism.coordinates:
            raise InputError('no joint coordinate', key='over', expected="a point, 'B.x'")
        over = next(iter(mechanism.coordinate))
    names = list(over) if isinstance(over, (list, tuple)) else [over]
    if not 1 <= len(names) <= 2 or len({*map(str, names)}) < len(names):
        raise InputError('not one or two coordinates', key='over', value=over)
    found = [coordinate_named(mechanism, text(name, 'over'), 'over') for name in names]
    return found[0], found[1] if len(found) == 2 else None


def _held(
    mechanism: Mechanism,
    hold: Mapping[str, float] | None,
    inputs: tuple[MapCoordinate, MapCoordinate | None],
) -> Held:
    if hold is not None and not isinstance(hold, Mapping):
        raise InputError('not numbers by name', key='hold', value=hold)
    found = []
    for name, value in (hold or {}).items():
        coordinate = coordinate_named(mechanism, name, 'hold')
        if coordinate in inputs:
            raise InputError('held and mapped over', key='hold', value=name)
        found.append((coordinate, number(value, f'hold.{name}')))
    return found


def _principal(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


def _times(value: float, low: float, high: float, is_angle: bool) -> int:
    """How often a range has a value; an angle counts modulo full turns."""
    if not is_angle:
        return int(low < value < high)
    turn = 2.0 * math.pi
    return math.floor((high - value) / turn) - math.ceil((low - value) / turn) + 1


def _statement(sheets: Sequence[Sheet], request: MapRequest) -> str:
    """How the search was made, and how many further starts would find more at most."""
    tried = sum(sheet.starts for sheet in sheets)
    fitting = sum(sheet.closed_starts - sheet.mirrored - sheet.rigid for sheet in sheets)
    circuits = sum(len(sheet.hits) for sheet in sheets)
    cut = sum(1 for sheet in sheets for piece in sheet.pieces if not piece.piece.complete)
    told = f'a search: {tried} random starts, until {request.starts} in a row found nothing new '
    told += f'(seed {request.seed}); {fitting} closed, on {circuits} circuits; '
    told += in_words(
        max(most_missing(sheet.vain, sheet.finds + 1, len(sheets)) for sheet in sheets)
    )
    if len(sheets) > 1:
        told += ', at each level'
    rigid = sum(sheet.rigid for sheet in sheets)
    if rigid:
        told += f'; {rigid} closed where redundant constraints let nothing move, of no circuit'
    return told + (f'; {cut} pieces end where they were not followed further' if cut else '')
