"""`alf_ros.equilibrium_path`: the positions of rest of a scene over one of its numbers."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from alf_ros import paths
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.inspection.run import Run
from alf_ros.logs.progress import Report, silent
from alf_ros.model.compile import Model
from alf_ros.model.constraints.rotors import rotor_blocks
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.scene.text.yaml_document import LARGEST, SMALLEST
from alf_ros.simulation.input_checks import number, truth, whole
from alf_ros.simulation.named_values import NamedValues
from alf_ros.simulation.quantities import groups
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.connected_parts import one_part
from alf_ros.studies.statics.descent import Landing
from alf_ros.studies.statics.path_course import PathCourse, PathLimits, branched
from alf_ros.studies.statics.path_events import BRANCH, FLUTTER, TURN
from alf_ros.studies.statics.path_point import PathDirection, PathPoint, PathScales
from alf_ros.studies.statics.positions_of_rest import (
    Equilibrium,
    equilibrium,
    found_at,
    in_order,
)
from alf_ros.studies.statics.sparse_rows import Sparse, mass_matrix
from alf_ros.studies.statics.varied_scene import TIME, VariedScene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SAME = 1e-5  # distance, without unit, of points that are the same


@dataclass(frozen=True, eq=False)
class PathEvent:
    """A turning point, a branch point or a flutter point of a path.

    name: 'turn 1', 'branch 1', … in the order of the path. kind: 'turn', 'branch' or 'flutter'.
    value: of the number. index: of the point in the arrays of the path. direction (n,): the motion
    that has no stiffness, or that flutters, in the order of `Sample.q`, its largest number 1.
    before, after: stability on both sides. count: how many eigenvalues of the stiffness vanish.
    smooth: False if they jump there.
    """

    name: str
    kind: str
    value: float
    index: int
    direction: Floats
    before: str
    after: str
    count: int
    smooth: bool


class EquilibriumPath:
    """Positions of rest in their order along a path, k of them.

    Quantities have their names as in a `Run`: 'points.B.y', 'knee.position', 'crank_pin.force.x'.
    """

    def __init__(self, varied: VariedScene, course: PathCourse) -> None:
        self._varied, self._course = varied, course

    def __repr__(self) -> str:
        return f'<EquilibriumPath over {self.over}, {len(self)} points, {len(self.events)} events>'

    def __len__(self) -> int:
        return len(self._course.points)

    @property
    def over(self) -> str:
        """The name of the number."""
        return self._varied.over

    @property
    def unit(self) -> str:
        """Of the number, if it is an input or the time; otherwise ''."""
        return self._varied.unit

    @property
    def ending(self) -> str:
        """Why the path ends."""
        return self._course.ending

    @cached_property
    def values(self) -> Floats:
        """(k,) of the number."""
        return np.array([point.value for point in self._course.points])

    @cached_property
    def q(self) -> Floats:
        """(k, n) as `Sample.q`."""
        return np.array([self.rest(k).q for k in range(len(self))])

    @cached_property
    def stability(self) -> tuple[str, ...]:
        """(k,) 'stable', 'unstable' or 'neutral'."""
        return tuple(point.stability.verdict for point in self._course.points)

    @cached_property
    def stiffness(self) -> Floats:
        """(k, f) eigenvalues of the reduced Hessian, 1/s², ascending."""
        return np.array([point.stability.stiffness for point in self._course.points])

    @property
    def points(self) -> Mapping[str, Floats]:
        """(k, D) position of each point, m."""
        model = self._course.points[0].instant.model
        D, block = model.layout.dimension, model.point_block
        blocks = np.array([each.instant.q.reshape(-1, D) for each in self._course.points])
        return NamedValues(model.point_names, lambda n: blocks[:, block[n]])

    @property
    def reactions(self) -> Mapping[str, Floats]:
        """(k, D) force of the reaction of each joint, N."""
        names = tuple(self.rest(0).reactions)
        rests = [self.rest(k) for k in range(len(self))]
        return NamedValues(
            names, lambda n: np.array([each.reactions[names[n]].force for each in rests])
        )

    @cached_property
    def _run(self) -> Run:
        """Positions, joints and reactions of all points."""
        samples = [self.rest(k).sample for k in range(len(self))]
        known = [name for group in groups(samples[0]) for name in group.names]
        return Run(samples, only=[name for name in known if _is_usual(name)])

    def __getitem__(self, name: str) -> Floats:
        """(k,) or (k, components) of a position, joint or reaction. Raises InputError."""
        return self._run[name]

    def columns(self, *names: str) -> dict[str, Floats]:
        """(k,) each number by name; of all positions, joints and reactions without names. Raises
        InputError for an unknown name."""
        return self._run.columns(*names)

    def unit_of(self, name: str) -> str:
        """The unit of a quantity. Raises InputError for an unknown name."""
        return self._run.unit(name)

    @cached_property
    def events(self) -> tuple[PathEvent, ...]:
        """Turning points, branch points and flutter points in the order of the path."""
        found, counts, stability = [], {TURN: 0, BRANCH: 0, FLUTTER: 0}, self.stability
        for index, each in sorted(self._course.critical.items()):
            counts[each.kind] += 1
            moving = in_order(each.point.instant.model, each.soft.q[None])[0]
            found.append(
                PathEvent(
                    name=f'{each.kind} {counts[each.kind]}',
                    kind=each.kind,
                    value=each.point.value,
                    index=index,
                    direction=moving / moving[np.argmax(np.abs(moving))],
                    before=stability[index - 1],
                    after=stability[min(index + 1, len(stability) - 1)],
                    count=each.count,
                    smooth=each.smooth,
                )
            )
        return tuple(found)

    @property
    def turns(self) -> tuple[PathEvent, ...]:
        """The turning points (limit points): the path turns back in the number."""
        return tuple(event for event in self.events if event.kind == TURN)

    @property
    def branch_points(self) -> tuple[PathEvent, ...]:
        """The branch points (bifurcations): another path crosses."""
        return tuple(event for event in self.events if event.kind == BRANCH)

    @property
    def flutter_points(self) -> tuple[PathEvent, ...]:
        """The flutter points (Hopf): an oscillation begins to grow, or ends to."""
        return tuple(event for event in self.events if event.kind == FLUTTER)

    @cached_property
    def _rests(self) -> dict[int, Equilibrium]:
        return {}

    def rest(self, k: int) -> Equilibrium:
        """Point k as an `Equilibrium`, with reactions, notes, and a state to restore."""
        k = range(len(self))[k]
        if k not in self._rests:
            point = self._course.points[k]
            simulation, _ = self._varied.simulation(point.value)
            whole, left = one_part(simulation.model.n), np.array([point.left])
            # at a critical point, forces may have no size of their own
            beside = self._course.points[max(k - 1, 0) : k + 2]
            scale = np.array([max(each.scale for each in beside)])
            landing = Landing(point.instant, point.lam, whole, left, scale, 0)
            self._rests[k] = found_at(simulation, landing)
        return self._rests[k]

    def follow(self, name: str) -> tuple[EquilibriumPath, ...]:
        """The other path through a branch point of this name, to both sides; only one path if it
        comes back to this point.

        Raises InputError for an unknown name, and if no other path is found there.
        """
        known = {event.name: event for event in self.branch_points}
        if name not in known:
            raise InputError('no such branch point', key='branch', value=name, choices=known)
        critical = self._course.critical[known[name].index]
        courses = branched(critical, self._course.limits)
        return tuple(EquilibriumPath(self._varied, course) for course in courses)

    def branches(self, report: Report = silent) -> dict[str, tuple[EquilibriumPath, ...]]:
        """The paths that `follow` finds at each branch point, by name; a path that passes several
        branch points counts once. `report` takes the part of the branch points that is done."""
        found: dict[str, tuple[EquilibriumPath, ...]] = {}
        for k, event in enumerate(self.branch_points):
            report(k / len(self.branch_points))
            here = self._course.points[event.index]
            sides = [side for each in found.values() for side in each]
            if not any(side._meets(here) for side in sides):
                found[event.name] = self.follow(event.name)
        return found

    def _meets(self, point: PathPoint) -> bool:
        """Whether a point is one of the branch points."""
        places = (self._course.points[event.index] for event in self.branch_points)
        return any(point.scales.size(place.since(point)) < _SAME for place in places)

    def plot(
        self,
        *names: str,
        file: str | Path | None = None,
        branches: Iterable[Sequence[EquilibriumPath]] = (),
    ) -> tuple[Axes, ...]:
        """Draw quantities over the number, the two positions or joints that change most without
        names: stable parts solid, the others dashed, events with names. `branches`: from `follow`.

        With `file` the picture is written without a display. Returns the axes. Raises InputError
        for an unknown name, without matplotlib, and if the file cannot be written.
        """
        from alf_ros.studies.statics import path_plot

        place = None if file is None else paths.named(file, 'file')
        return path_plot.draw(self, names, [each for side in branches for each in side], place)

    def write(self, path: str | Path) -> None:
        """Write a CSV file: the number, stability, the smallest stiffness, the name of an event,
        then all positions, joints and reactions. Raises OSError if it cannot be written."""
        columns, names = self.columns(), {event.index: event.name for event in self.events}
        lowest = self.stiffness[:, 0]
        with (
            paths.replacing(paths.named(path, 'path')) as target,
            open(target, 'w', encoding='utf-8', newline='') as stream,
        ):
            table = csv.writer(stream)
            table.writerow([self.over, 'stability', 'stiffness', 'event', *columns])
            for k, value in enumerate(self.values):
                own = [repr(float(value)), self.stability[k], repr(float(lowest[k]))]
                numbers = [repr(float(column[k])) for column in columns.values()]
                table.writerow([*own, names.get(k, ''), *numbers])


def equilibrium_path(
    scene: SceneSource | Simulation,
    *,
    over: str,
    end: float,
    start: float | None = None,
    back: float | None = None,
    t: float | None = None,
    nearest: bool = False,
    most: int = 2000,
    report: Report = silent,
) -> EquilibriumPath:
    """Positions of rest while one number changes, also where the number turns back.

    over: a number of the scene as `fork --set` names it ('spring.stiffness',
    'gravity.acceleration.1', 'coupler.mass', 'L'), an input as `linearise` names it
    ('joints.crank_pin.effort', 'wrenches.B.force.x'), which adds to the held input, or 't', the
    instant at which drives and signals are frozen. t (s): this instant, over another number.

    The path begins with the position of rest that `equilibrium` finds at `start` (the present
    value if absent; `nearest` as there). It ends where the number is `end`, or on the other side
    `back` (as far from `start` as `end` if absent), or after `most` points. `report` takes the
    largest part of the way that was done, 0 to 1: a path may turn back.

    Raises InputError for unknown names, where nothing is free, with rows that bind velocities
    only, from a singular position, for more than 1200 coordinates, and what `equilibrium` raises.
    """
    simulation = scene if isinstance(scene, Simulation) else _at_rest(scene)
    t = None if t is None else number(t, 't', 0.0)
    if not isinstance(over, str) or not over:
        raise InputError('no name', key='over', value=over, expected='spring.stiffness')
    varied = VariedScene(simulation, over, simulation.t if t is None else t)
    first = varied.present if start is None else _value(start, 'start')
    last = _value(end, 'end')
    if first == last:
        raise InputError('a path has two ends', key='end', value=end, expected='not the start')
    limits = PathLimits(
        last, 2.0 * first - last if back is None else _value(back, 'back'), whole(most, 'most', 2)
    )
    if (limits.back - first) * (last - first) > 0.0:
        raise InputError(
            'on the same side of the start as the end', key='back', value=back, expected='beyond'
        )
    begun, now = varied.simulation(first)
    driven = None if t is None and over != TIME else now
    rest = equilibrium(begun, t=driven, nearest=truth(nearest, 'nearest'))
    _check(rest)
    model = rest.simulation.model
    mass = _metric(model)
    length = np.sqrt(float(mass.diagonal().sum()) / model.layout.dimension)
    there = varied.at(first).instant(rest.state.q, rest.state.turns)
    scales = PathScales(mass, length * there.loads.tangents.length, abs(last - first))
    point = PathPoint(varied, scales, first, there)
    course = PathCourse(limits, report=report)
    course.follow(point, point.tangent(PathDirection(np.zeros(model.n), last - first)))
    return EquilibriumPath(varied, course)


def _value(given: float, key: str) -> float:
    """A value of the number, as large as numbers of files are. Raises InputError."""
    value = number(given, key)
    if value and not SMALLEST <= abs(value) <= LARGEST:
        expected = f'0, or {SMALLEST:g} to {LARGEST:g} in magnitude'
        raise InputError('not usable', key=key, value=given, expected=expected)
    return value


def _at_rest(scene: SceneSource) -> Simulation:
    return Simulation(load_scene(scene).at_rest())


def _metric(model: Model) -> Sparse:
    """(n, n) kg, of distances: M, but rotors lend their mass to all other blocks, for a path that
    comes back after a turn leaves them at another place."""
    mass, layout = mass_matrix(model), model.layout
    rotors, D = rotor_blocks(layout), layout.dimension
    if not rotors:
        return mass
    own = mass.diagonal()[::D][rotors]
    lent = np.full(layout.movable, own.sum() / (layout.movable - len(rotors)))
    lent[rotors] = -own
    return mass + sparse.diags(np.repeat(lent, D), format='csr')


def _check(rest: Equilibrium) -> None:
    """Raises InputError where a path cannot begin."""
    if not rest.has_stiffness:
        raise InputError(f'a path cannot begin here: {"; ".join(rest.notes)}', key='start')
    if not rest.stiffness.size:
        raise InputError('nothing is free: drives and loops decide each position', key='scene')
    if any('rows bind velocities only' in note for note in rest.notes):
        raise InputError('rows bind velocities only: positions of rest are no path', key='scene')


def _is_usual(name: str) -> bool:
    kind, _, rest = name.partition('.')
    if kind == 'points':
        return True
    return kind in ('joints', 'reactions') and rest.endswith(
        ('.position', '.effort', '.force', '.torque')
    )
