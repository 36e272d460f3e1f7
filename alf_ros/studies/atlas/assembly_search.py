"""All positions in which the loops of a mechanism close, at fixed values of its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError, InputError
from alf_ros.model import assembly
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.handedness import Handedness
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import number, whole
from alf_ros.studies.atlas.coordinate_reader import CoordinateReader
from alf_ros.studies.atlas.map_coordinate import coordinate_named
from alf_ros.studies.atlas.map_search import LARGEST
from alf_ros.studies.atlas.random_places import RandomPlaces
from alf_ros.studies.atlas.search_certainty import in_words, most_missing
from alf_ros.studies.closing.actuated import refuse_velocity_rows, scene_of
from alf_ros.studies.closing.stops import Stops, stops_of

_SAME = 1e-7  # of the size: positions that are one
_CLOSED = 1e-12  # of the size: by how much a row may stay open
_MOST_STARTS = 100  # times the patience


@dataclass(frozen=True, eq=False)
class FoundAssembly:
    """One assembly: q (blocks D, m), points (D,) m and joint coordinates (rad, or m) by name.

    sigma: the least singular value of the scaled Φ_q with the rows of the inputs; about the
    distance to another assembly. hits: how many starts ended here. within_stops: whether no joint
    is beyond a stop of the scene, angles after some turns.
    """

    q: Floats
    points: Mapping[str, Floats]
    joints: Mapping[str, float]
    sigma: float
    hits: int
    within_stops: bool = True


@dataclass(frozen=True, eq=False)
class Assemblies:
    """All assemblies that a search found, the most frequent first.

    starts: random starts; closed: of these that closed; missing: the largest part of further
    starts that would find another one, with 95 % confidence (`search_certainty`). It is never 0: a
    search proves nothing about positions that hardly any start leads to. statement: all of this in
    words.
    """

    positions: tuple[FoundAssembly, ...]
    starts: int
    closed: int
    missing: float
    statement: str

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, n: int) -> FoundAssembly:
        return self.positions[n]

    def __repr__(self) -> str:
        return f'<Assemblies: {self.statement}>'


def assemblies(
    mechanism: SceneSource,
    values: Mapping[str, float] | None = None,
    *,
    starts: int = 300,
    seed: int = 0,
) -> Assemblies:
    """All positions of a mechanism whose inputs have fixed values.

    mechanism: a scene, the name or path of a scene or a mechanism, or a mapping of either; drives
    and effects do not count; `within_stops` tells about stops of joints. values: of as many
    coordinates as it has freedoms, joint coordinates (rad or m) or components of points ('B.x');
    none for a structure. starts: the search closes the loops from random places until so many in a
    row find nothing new.

    It is a search: `statement` says how often each was found. Bodies that are mirrored or turned
    round in a guide do not count. A position that is singular itself may be missed, since the
    loops close to half of the digits there. Raises InputError for names and numbers that are none,
    and for positions that are not isolated; AssemblyError if no start closes.
    """
    scene = scene_of(mechanism)
    bare = replace(scene.mechanism, drives=(), rotors=())
    refuse_velocity_rows(bare)
    if values is not None and not isinstance(values, Mapping):
        raise InputError('not numbers by name', key='values', value=values)
    drives = tuple(
        coordinate_named(bare, name, 'values').held(bare, number(value, f'values.{name}'))
        for name, value in (values or {}).items()
    )
    patience, seed = whole(starts, 'starts', 1, 1_000_000), whole(seed, 'seed', 0)
    model = compile_model(replace(bare, drives=drives), scene.solver.penalty)
    if model.n > LARGEST:
        text = f'{model.n} coordinates, too many to search: {LARGEST} at most'
        raise InputError(text, key='mechanism')
    search = _AssemblySearch(model, seed, stops_of(scene, model.coordinate_names))
    search.run(patience)
    if not search.found:
        raise AssemblyError(
            f'no assembly: {search.starts} random starts, {search.why or "none closed"}',
            key='values',
        )
    return search.result(seed)


class _AssemblySearch:
    """Closes loops from random places, and keeps each position once."""

    def __init__(self, model: Model, seed: int, stops: Stops) -> None:
        self._model, self._places = model, RandomPlaces(model, model.q, seed)
        self._stops = stops
        self._handedness = Handedness(model)
        self.found: list[Floats] = []
        self.hits: list[int] = []
        self.starts = self.closed = self.vain = 0
        self.why = ''

    def run(self, patience: int) -> None:
        """Start until `patience` places in a row found nothing new."""
        while self.vain < patience and self.starts < _MOST_STARTS * patience:
            self.vain = 0 if self._start() else self.vain + 1

    def _start(self) -> bool:
        """Whether the next place leads to a new position."""
        model = self._model
        q = self._places.place(self.starts, self.found)
        self.starts += 1
        try:
            q = assembly.close(model, {}, q, least=0.0)
        except AssemblyError as error:
            if not str(error.key).startswith('drives.'):  # closed, with an input turned round
                self.why = str(error.message)
            return False
        at = Linearised(model, q)
        if np.abs(at.phi).max(initial=0.0) > _CLOSED * model.size:
            return False
        if self._handedness.is_mirrored(q):
            return False
        self.closed += 1
        for n, other in enumerate(self.found):
            if np.abs(q - other).max() < _SAME * model.size:
                self.hits[n] += 1
                return False
        if at.rank < model.n:
            freedoms = model.n - at.rank
            raise InputError(
                f'positions are not isolated: {freedoms} freedom{"" if freedoms == 1 else "s"} '
                'left, or a singular position',
                key='values',
                expected='as many values as freedoms',
            )
        self.found.append(q)
        self.hits.append(1)
        return True

    def result(self, seed: int) -> Assemblies:
        """The positions in order, and what the search was."""
        order = sorted(range(len(self.found)), key=lambda n: -self.hits[n])
        reader = CoordinateReader(self._model)
        missing = most_missing(self.vain, len(order))
        told = f'{len(order)} found by a search: {self.starts} random starts, until {self.vain} '
        told += f'in a row found nothing new (seed {seed}); {self.closed} closed, each position '
        told += f'{min(self.hits)} to {max(self.hits)} times; {in_words(missing)}'
        positions = tuple(self._assembly(reader, self.found[n], self.hits[n]) for n in order)
        if self._stops:
            within = sum(each.within_stops for each in positions)
            told += f'; {within} of them within the stops of joints'
        return Assemblies(
            positions,
            self.starts,
            self.closed,
            missing,
            told,
        )

    def _assembly(self, reader: CoordinateReader, q: Floats, hits: int) -> FoundAssembly:
        model = self._model
        places = q.reshape(-1, model.layout.dimension)
        values: Any = reader.read(q, np.zeros_like(q))[0]
        return FoundAssembly(
            q,
            {name: places[block].copy() for name, block in model.layout.of_point.items()},
            dict(zip(model.coordinate_names, values.tolist(), strict=True)),
            float(Linearised(model, q).singular_values[-1]),
            hits,
            self._stops.holds(values, [each.is_angle for each in model.coordinates]),
        )
