"""Kinds of singular positions: crossings of branches, infinitesimal mobility, redundancy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model import singular_branches, singular_start
from alf_ros.model.branch_words import moving
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.quadratic_cones import echelon
from alf_ros.model.singular_branches import Branch, Position
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.start import assembled

INFINITESIMAL = 'infinitesimal mobility only'
WIDER = 'more freedoms'  # of a finite motion
HIGHER = 'higher order'  # decides, which is not examined
_NAMED = 1e-9  # part of the largest component, below which a component is not listed
_AWAY = (0.02, 0.005)  # of the size: displacements that tell a finite motion from one at once
_NAMES = 6  # in a message
_DENSE = 4000  # coordinates, up to which that is tried

Components = Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class NamedBranch:
    """A branch: `name` ('1', '2' ...) is its number in `Branches`.

    directions: of each freedom on it, velocities of the points (D,), m/s, and of the vectors (D,),
    1/s, by name; orthonormal in the metric of the mass matrix. drift: velocities that drives
    ask for on it, of least kinetic energy; zero without drives.
    """

    name: str
    directions: tuple[Components, ...]
    drift: Components

    @property
    def dimension(self) -> int:
        """Freedoms of velocity on the branch."""
        return len(self.directions)


@dataclass(frozen=True, eq=False)
class Branches:
    """A singular position and what can begin there.

    kind: 'crossing', 'infinitesimal mobility only', 'more freedoms', 'higher order', 'curved' or
    'many'; gained: freedoms of velocity more than at ordinary positions; branches: in
    the order of their names; null_vectors: combinations of rows, scaled to length 1 as drawn, that
    vanish here, by name of the row; redundant: combinations that vanish everywhere (permanent
    redundancy), or have no effect to second order. points: where the points are, m. text: all of
    it in words, as `check` prints it.
    """

    kind: str
    gained: int
    branches: tuple[NamedBranch, ...]
    null_vectors: tuple[Mapping[str, float], ...]
    redundant: tuple[Mapping[str, float], ...]
    points: Components
    text: str

    def __getitem__(self, name: str | int) -> NamedBranch:
        """The branch of a name. Raises InputError for an unknown one."""
        names = [branch.name for branch in self.branches]
        if str(name) not in names:
            raise InputError('no such branch', key='branch', value=str(name), choices=names)
        return self.branches[names.index(str(name))]

    def __repr__(self) -> str:
        return f'<Branches: {self.text}>'

    def as_data(self) -> dict[str, Any]:
        """All of it as numbers, text and lists, for a JSON file."""
        return {
            'kind': self.kind,
            'freedoms_gained': self.gained,
            'text': self.text,
            'points': _listed(self.points),
            'branches': [
                {
                    'name': branch.name,
                    'directions': [_listed(each) for each in branch.directions],
                    'drift': _listed(branch.drift),
                }
                for branch in self.branches
            ],
            'null_vectors': [dict(each) for each in self.null_vectors],
            'redundant': [dict(each) for each in self.redundant],
        }


def branches(at: SceneSource | Simulation) -> Branches:
    """The branches at the present position of a Simulation, or where a scene starts.

    The velocities do not matter. Raises InputError, with the distance σ, for a position that is
    not singular; with the names of the rows if these are redundant everywhere.
    """
    if isinstance(at, Simulation):
        model, q, dependent, t = at.model, at.state.q, at.dependent_rows, at.t
    else:
        scene = load_scene(at)
        found = assembled(scene, scene.solver)
        model, q, dependent, t = found.model, found.q, found.dependent_rows, 0.0
    here = singular_branches.position(model, q, t)
    is_smooth = here.kind == singular_branches.SMOOTH
    if len(here.lost) > dependent or not is_smooth or (dependent and not _is_finite(here)):
        return reported(here, dependent)
    distance = singular_start.distance(model, q, dependent)
    text = f'not in a singular position: its distance σ is {distance:.3g}'
    if dependent:
        # in the order of the file: which of the null vectors is first is a matter of rounding
        named = {name for each in _by_row(model, here.lost) for name in each}
        names = [name for name in dict.fromkeys(model.row_names) if name in named]
        shown = ', '.join(names[:_NAMES]) + ('' if len(names) <= _NAMES else ' ...')
        count = len(here.lost)
        rows = '1 row depends' if count == 1 else f'{count} rows depend'
        text += f'; {rows} on others everywhere, among them {shown}'
    raise InputError(text, key='branches')


def reported(here: Position, dependent: int) -> Branches:
    """Kind, branches and null vectors of a singular position.

    dependent: rows that depend on others in ordinary positions.
    """
    model, gained = here.model, max(0, len(here.lost) - dependent)
    kind, text = _kind(here, gained)
    active, void = here.split()
    return Branches(
        kind,
        gained,
        tuple(_named(here, b) for b in here.branches if b.dimension or b.drift.any()),
        tuple(_by_row(model, active)),
        tuple(_by_row(model, void)),
        _points(model, here.q),
        text,
    )


def _kind(here: Position, gained: int) -> tuple[str, str]:
    """The kind of a position, in one word or two and in a sentence."""
    usual = len(here.free) - gained
    if here.kind in (singular_branches.CURVED, singular_branches.MANY):
        return here.kind, f'branches not enumerated ({here.kind})'
    if here.kind == singular_branches.SHAKY and not any(b.dimension for b in here.branches):
        names = ', '.join(moving(here.model, here.free)[:6])
        return INFINITESIMAL, f'{INFINITESIMAL}: {names} may yield, but no motion begins'
    if here.kind == singular_branches.SMOOTH:
        if gained and _is_finite(here):
            more = f'{len(here.free)} freedoms in place of {usual}'
            return WIDER, f'{WIDER}: a motion with {more} begins or passes here'
        text = f'to second order nothing rules out any of {_count(len(here.free))}'
        return HIGHER, f'{HIGHER} decides: {text}'
    if here.kind == singular_branches.TOUCHING:
        text = f'to second order there is one branch, {here.described()}'
        return HIGHER, f'{HIGHER} decides: {text}; two may touch there'
    if len(here.branches) == 1:
        text = f'{INFINITESIMAL}, in {gained} of {len(here.free)} directions'
        return INFINITESIMAL, f'{text}; the motion goes on along {here.described()}'
    return here.kind, f'{here.kind}, {len(here.branches)} branches: {here.described()}'


def _count(freedoms: int) -> str:
    return f'{freedoms} freedom{"" if freedoms == 1 else "s"}'


def _is_finite(here: Position) -> bool:
    """Whether all directions of a position in which no condition is felt are motions: positions at
    a distance along random ones close, and have as many freedoms."""
    model = here.model
    if model.n > _DENSE:
        return False
    at, random = Linearised(model, here.q), np.random.default_rng(0)
    rank = model.n - len(here.free)
    for away in _AWAY:
        step = random.standard_normal(len(here.free)) @ here.free[:, : model.n]
        there = at.closed(away * model.size * step / np.abs(step).max(), rank)
        if there is None or there.rank > rank:
            return False
    return True


def _named(here: Position, branch: Branch) -> NamedBranch:
    return NamedBranch(
        str(here.number(branch)),
        tuple(_velocities(here.model, v) for v in branch.directions),
        _velocities(here.model, branch.drift),
    )


def _velocities(model: Model, v: Floats) -> Components:
    layout, D = model.layout, model.layout.dimension
    places = v.reshape(-1, D)
    movable = {item.name for item in model.mechanism.blocks if not item.fixed}
    found = {n: places[b] + 0.0 for n, b in layout.of_point.items() if n in movable}
    found |= {n: places[b] / layout.length for n, b in layout.of_vector.items() if n in movable}
    return found


def _points(model: Model, q: Floats) -> Components:
    places = q.reshape(-1, model.layout.dimension)
    return {name: places[block] + 0.0 for name, block in model.layout.of_point.items()}


def _by_row(model: Model, vectors: Floats) -> list[dict[str, float]]:
    """Left null vectors (k, rows) by name of the row, each a combination of few rows, the largest
    component 1."""
    if not len(vectors):
        return []
    scaled = (vectors / model.system.rows.scale)[:, model.row]
    sparse, _ = echelon(scaled, scaled.shape[1])
    found = []
    for vector in sparse:
        vector = vector / vector[np.argmax(np.abs(vector))]
        kept = np.flatnonzero(np.abs(vector) > math.sqrt(_NAMED))
        found.append({model.row_names[n]: float(vector[n]) for n in kept})
    return found


def _listed(components: Components) -> dict[str, list[float]]:
    return {name: np.asarray(value).tolist() for name, value in components.items()}
