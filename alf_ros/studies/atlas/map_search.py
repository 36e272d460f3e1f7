"""The search of an atlas: a sheet of curves for each value of the second coordinate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError, InputError
from alf_ros.inspection.position_sweep import shortest
from alf_ros.logs.progress import Report, silent
from alf_ros.mechanism import Mechanism
from alf_ros.model import assembly, ordinary_positions
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.consistency import made_consistent
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.prescribed import prescribed
from alf_ros.scene.scene import Scene
from alf_ros.simulation.input_checks import number, whole
from alf_ros.studies.atlas.configuration_curve import CurveSpace
from alf_ros.studies.atlas.coordinate_range import range_of
from alf_ros.studies.atlas.coordinate_reader import CoordinateReader
from alf_ros.studies.atlas.curve_search import CurveSearch, Node
from alf_ros.studies.atlas.map_coordinate import MapCoordinate
from alf_ros.studies.atlas.mapped_piece import MappedPiece, Quantities, mapped
from alf_ros.studies.atlas.transmission import Bar

LARGEST = 400  # coordinates: matrices are dense here
_STEP = 0.05  # of the shortest bar: longest step along a curve

Held = Sequence[tuple[MapCoordinate, float]]


@dataclass(frozen=True)
class MapRequest:
    """The coordinates of an atlas, and the quantities that it reads.

    The search of a sheet ends when `starts` random places in a row, from a seed, find nothing new.
    """

    over: MapCoordinate
    second: MapCoordinate | None
    output: MapCoordinate | None
    bar: Bar | None
    starts: int
    seed: int


@dataclass(frozen=True, eq=False)
class Sheet:
    """The curves at one value of the second coordinate (`level`, NaN without one).

    starts: random places; closed_starts: starts that closed, known ones included; hits: of them on
    each circuit, by its number; mirrored: of them with a body as its mirror image; rigid: where
    redundant rows let nothing move. vain: random starts since the last that found something new;
    finds: how many did.
    """

    level: float
    pieces: tuple[MappedPiece, ...]
    nodes: tuple[Node, ...]
    hits: Mapping[int, int]
    starts: int
    closed_starts: int
    mirrored: int
    rigid: int
    vain: int
    finds: int


@dataclass(frozen=True, eq=False)
class _Ground:
    """The space of curves, its dependent rows, and an ordinary position (blocks D, m) in it."""

    space: CurveSpace
    dependent: int
    usual: Floats


def consistent(scene: Scene, bare: Mechanism) -> tuple[Mechanism, str]:
    """The mechanism without drives, with shapes whose redundant rows agree, as a simulation has
    it; and the changes in words, '' without any. Raises AssemblyError where the rows contradict
    each other by more: strictly such a mechanism is a structure."""
    model = compile_model(bare, scene.solver.penalty)
    if model.n > LARGEST:
        return bare, ''
    q = assembly.close(model, scene.positions)
    dependent, _, sigma = ordinary_positions.ordinary(model, q)
    found = made_consistent(model.accustomed(sigma, dependent), q, dependent)
    return (bare, '') if found is None else (found[0], str(found[1]))


def searched(
    scene: Scene,
    bare: Mechanism,
    held: Held,
    request: MapRequest,
    levels: int | Sequence[float],
    report: Report = silent,
) -> tuple[Model, list[Sheet]]:
    """The model of the sheets, and the sheets.

    bare: the mechanism without drives; `report` takes the part that is done, 0 to 1. Raises
    InputError for another number of freedoms than coordinates, AssemblyError if the loops do not
    close.
    """
    penalty = scene.solver.penalty
    free = compile_model(_holding(bare, held), penalty)
    if free.n > LARGEST:
        text = f'{free.n} coordinates, too many to map: {LARGEST} at most'
        raise InputError(text, key='mechanism')
    q = assembly.close(free, scene.positions)
    ground = _ground(free, q)
    _refuse_freedoms(free.n - ground.space.rank, 1 if request.second is None else 2)
    if request.second is None:
        return free, [_sheet(ground, request, [q, ground.usual], math.nan, free.q, report)]
    second = request.second
    values = _levels(free, second, ground, levels, request.seed)
    here = second.read(CoordinateReader(free), q, np.zeros_like(q))[0]
    model = compile_model(_holding(bare, [*held, (second, here)]), penalty)
    known = [assembly.close(model, {}, _carried(free, q, model))]
    ground, sheets = _ground(model, known[0]), list[Sheet]()
    for n, level in enumerate(values):
        drawn = np.array(model.q)
        second.hold_at(model, drawn, level)
        moved = [_moved(ground.space, second, each, level) for each in known]
        starts = [each for each in moved if each is not None]
        told = partial(_tell, report, n, len(values))
        sheets.append(_sheet(ground, request, starts, level, drawn, told))
        pieces = sheets[-1].pieces
        known = [piece.q[len(piece.q) // part] for piece in pieces for part in (2, 5)] or known
    return model, sheets


def _tell(report: Report, done: int, sheets: int, part: float) -> None:
    """Report a part of a sheet as one of all sheets."""
    report((done + part) / sheets)


def _holding(bare: Mechanism, held: Held) -> Mechanism:
    return replace(bare, drives=tuple(each.held(bare, value) for each, value in held))


def _refuse_freedoms(freedoms: int, wanted: int) -> None:
    if freedoms != wanted:
        expected = f'{freedoms} of them' if freedoms in (1, 2) else 'hold others at a value'
        text = f'{freedoms} freedom{"" if freedoms == 1 else "s"}, but {wanted} to map over'
        raise InputError(text, key='over', expected=expected)


def _ground(model: Model, q: Floats) -> _Ground:
    """The space of curves around q (blocks D, m)."""
    dependent, usual, sigma = ordinary_positions.ordinary(model, q)
    at = Linearised(model, usual)
    known = model.accustomed(sigma, dependent)
    # held coordinates stay in their blocks, where the search puts them
    nothing = prescribed(replace(model.layout, mechanism=replace(model.mechanism, drives=())))
    known = replace(known, system=replace(known.system, prescribed=nothing))
    weakest = float(at.singular_values[at.rank - 1]) if at.rank else 1.0
    space = CurveSpace(model, known, at.rank, weakest, _STEP * shortest(at))
    return _Ground(space, dependent, usual)


def _sheet(
    ground: _Ground,
    request: MapRequest,
    known: Sequence[Floats],
    level: float,
    drawn: Floats,
    report: Report,
) -> Sheet:
    """The curves that a search from known positions and from random ones around `drawn` finds."""
    search = CurveSearch(ground.space, ground.dependent, drawn)
    for q in known:
        search.start_at(q)
    search.search(request.starts, request.seed, report)
    reader = CoordinateReader(ground.space.model)
    reads = Quantities(reader, request.over, request.output, request.bar)
    circuits = search.circuits()
    pieces = tuple(
        mapped(ground.space, piece, reads, n + 1, circuits[n])
        for n, piece in enumerate(search.pieces)
    )
    hits = dict.fromkeys(circuits, 0)
    for circuit, count in zip(circuits, search.hits, strict=True):
        hits[circuit] += count
    return Sheet(
        level,
        pieces,
        tuple(search.nodes),
        hits,
        search.starts,
        search.closed_starts,
        search.mirrored,
        search.rigid_starts,
        search.vain,
        search.finds,
    )


def _moved(space: CurveSpace, second: MapCoordinate, q: Floats, level: float) -> Floats | None:
    """A position near q at another level; None if there is none."""
    there = np.array(q)
    second.hold_at(space.model, there, level)
    try:
        return assembly.close(space.known, {}, there)
    except AssemblyError:
        return None


def _carried(before: Model, q: Floats, after: Model) -> Floats:
    """q of a model as q of one with more blocks; those are as drawn."""
    found, D = np.array(after.q), before.layout.dimension
    for kind in ('of_point', 'of_vector', 'of_auxiliary', 'of_prescribed'):
        own = getattr(before.layout, kind)
        for name, block in getattr(after.layout, kind).items():
            if name in own:
                found.reshape(-1, D)[block] = q.reshape(-1, D)[own[name]]
    return found


def _levels(
    model: Model,
    second: MapCoordinate,
    ground: _Ground,
    levels: int | Sequence[float],
    seed: int,
) -> list[float]:
    if isinstance(levels, (list, tuple, np.ndarray)):
        return [number(value, 'levels') for value in levels]
    count = whole(levels, 'levels', 1, 10_000)
    low, high = range_of(model, second, ground.usual, ground.space.longest, seed)
    return [low + (k + 0.5) * (high - low) / count for k in range(count)]
