"""Members of one structure, made and stepped together: the usual members of a study.

Lengths, masses, numbers of effects and velocities differ; names, joints and what each row binds do
not. Then most of a simulation is the same, and the rest are rows of arrays: `MemberStructs` has
the tables of all members, one call finds where they start (`model/member_starts.py`), groups of
lanes step them, and one call reads them. Each has the bits of its single run. A member that does
not start in the usual way, or whose steps fail, is left out: it is to be run alone, which says
why.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, LaneProgress, progress_of
from alf_ros.kernel.lanes.advance_lanes import advance_lanes
from alf_ros.kernel.lanes.advance_lanes_adaptively import advance_lanes_adaptively
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.model.member_structs import LanesOfMembers, MemberStructs
from alf_ros.model.member_systems import NUMBERS, SOLVES, MemberSystems
from alf_ros.model.penalty import LEAST_PENALTY
from alf_ros.model.tableaux import first_pace
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.lane_crews import crew_of
from alf_ros.simulation.member_numbers import Likeness, MemberNumbers
from alf_ros.simulation.member_readings import MemberReadings
from alf_ros.simulation.quantities import Quantity
from alf_ros.simulation.side_by_side import is_adaptive
from alf_ros.simulation.simulation import Simulation

_FEW, _MANY = 8, 32  # registers of members at a time
_OFTEN = 2  # times from which on there are many
_SMALL = 24  # coordinates: two registers of members of larger mechanisms leave the fast memory
_SYSTEM = tuple(f'system.{name}' for name in (*NUMBERS, *SOLVES, 'ordinary', 'close', 'patience'))
_OWN = (*_SYSTEM, 'forces.effects.params', 'work')
_LOOKING = 'forces.kinks.path', 'forces.kinks.doubt'  # where contacts are looked for
_SHARED = 'work.pulse', 'work.caller'  # a member that is stopped stops all


class AlikeMembers:
    """Members like a simulation, some at a time: `most` of them.

    simulation: one for which `member_numbers.unlike` and `side_by_side.no_place` find nothing; it
    is not to be used elsewhere. quantities: the readings of each member. `likely`: how many
    members come at a time.
    """

    def __init__(
        self, simulation: Simulation, quantities: Sequence[Quantity], likely: int = 0
    ) -> None:
        many = likely >= _OFTEN * _MANY * width()
        two = many and simulation.model.n <= _SMALL
        self._lanes = 2 * width() if two else width()
        self.most = (_MANY if many else _FEW) * width()
        self.quantities = tuple(quantities)
        self._of, stepper = simulation, simulation._run.stepper
        likeness = Likeness(simulation)
        self.numbers_of = likeness.numbers_of
        self.numbers_of_columns = likeness.numbers_of_columns
        bodies = [own for _, own in likeness.bodies]
        given, penalty = simulation.scene.velocities, simulation.solver.penalty
        self._systems = MemberSystems(
            simulation.model,
            likeness.rows,
            bodies,
            given,
            max(penalty, LEAST_PENALTY),
            self.most,
        )
        problem, phase = stepper.problem_of(simulation._run.present), simulation._run.present.phase
        own = (*_OWN, *_LOOKING) if problem.forces.kinks.search.size else _OWN
        self._problems = MemberStructs(problem, self.most, own, _SHARED)
        every = [name for name, _, _ in vars(phase)['_numba_type_'].parts]
        self._phases = MemberStructs(phase, self.most, every)
        self._readings = MemberReadings(
            simulation, quantities, likeness.rows, self._problems, self._phases
        )
        progress = MemberStructs(
            progress_of(problem.work.q.size), self.most, LaneProgress.__dataclass_fields__
        )
        self._of_problems = LanesOfMembers(self._problems, self._lanes)
        self._of_phases = LanesOfMembers(self._phases, self._lanes)
        self._progress = LanesOfMembers(progress, self._lanes)
        self._adaptive = is_adaptive(simulation)
        self._crews = [self._crew(g) for g in range(self.most // self._lanes)]
        self._where = LaneGroups(
            problem=self._of_problems.addresses,
            phase=self._of_phases.addresses,
            progress=self._progress.addresses,
            crew=np.array([crew._address for crew in self._crews], dtype=np.uint64),
        )

    def _crew(self, g: int) -> LaneCrew:
        own, applied = self._lanes_of(g), self._of._run.applied
        return crew_of(
            self._problems.addresses[own].copy(),
            self._phases.addresses[own].copy(),
            [applied],
            [applied.assembled.effects],
            [self._of._run.stepper.system.prescribed],
            self._of.model.layout.dimension,
            self._adaptive,
            [each[g] for each in self._of_problems.columns(without='work')],
            range(own.start, own.stop),
        )

    def _lanes_of(self, g: int) -> slice:
        return slice(g * self._lanes, (g + 1) * self._lanes)

    def run(
        self, numbers: Sequence[MemberNumbers], duration: float, at: Sequence[float]
    ) -> tuple[Floats, list[Floats], NDArray[np.bool_]]:
        """Run members with these numbers, `most` of them at most, for a duration (s).

        Returns the instants of `at` on the grid of the steps (N,) s; of each quantity (members, N)
        or (members, N, D); and which members came to the end.
        Raises InputError, and the exception that stopped the run.
        """
        count, first = len(numbers), self._of
        good = self._begin(numbers)
        self._index, last = 0, check.steps_of(duration, first.h, 0)
        t, rows = [], []
        for instant in check.times(at, 0.0, first.h):
            self._step_to(math.floor(instant / first.h + check.CLOSE), good)
            t.append(self._index * first.h)
            rows.append(self._readings.at(t[-1]))
        self._step_to(last, good)
        values = [np.stack(each, axis=1)[:count] for each in zip(*rows, strict=True)]
        return np.array(t), values, good[:count]

    def _begin(self, numbers: Sequence[MemberNumbers]) -> NDArray[np.bool_]:
        """Put members at their starts; returns which are there. Places without a member have the
        numbers of the last one, and make no steps."""
        every = [*numbers, *[numbers[-1]] * (self.most - len(numbers))]
        bound = np.array([each.bound for each in every]).reshape(self.most, -1, 2)
        given = np.array([each.given for each in every])
        geometry = [each.geometry for each in every]
        masses = np.array([each.masses for each in every])
        starts = self._systems.start(geometry, masses, bound, given)
        self._readings.take(geometry)
        problems, phases, h = self._problems, self._phases, self._of.h
        self._systems.put_into(problems.system, starts)
        problems.forces.effects.params[:] = [each.params for each in every]
        for part in _arrays(problems.work):
            part[:] = 0
        for part in _arrays(phases):
            part[:] = 0
        phases.q[:], phases.qd[:] = starts.q, starts.qd
        sizes = (each.size for each in geometry)
        phases.pace[:, 0] = [
            first_pace(h, size, qd) for size, qd in zip(sizes, starts.qd, strict=True)
        ]
        good = starts.usual.copy()
        good[len(numbers) :] = False
        self._of_problems.take()
        self._of_phases.take()
        for g, crew in enumerate(self._crews):  # members of the last run have changed places
            own = self._lanes_of(g)
            crew.member[:] = range(own.start, own.stop)
            crew.problem[:], crew.phase[:] = problems.addresses[own], phases.addresses[own]
        return good

    def _step_to(self, index: int, good: NDArray[np.bool_]) -> None:
        """Take the good members to a number of steps; those that fail are good no more."""
        if index <= self._index:
            return
        progress = self._progress
        progress.most[:] = 0.0
        progress.index[:, 0] = self._index
        moving = good[[crew.member for crew in self._crews]]
        progress.target[:, 0] = np.where(moving, index, progress.index[:, 0])
        for crew in self._crews:
            crew.apart[:] = crew.result[:] = 0
        kernel = advance_lanes_adaptively if self._adaptive else advance_lanes
        stopped = kernel(
            self._of_problems.group(0),
            self._of_phases.group(0),
            progress.group(0),
            self._crews[0],
            self._problems.member(0),
            self._phases.member(0),
            self._where,
            self._of.h,
        )
        if stopped >= 0:
            self._of._run.stepper.listener.answer()
        for crew in self._crews:
            good[crew.member] &= crew.result == 0
        self._index = index


def _arrays(structs: MemberStructs) -> list[NDArray[np.generic]]:
    """All arrays of these structs and of those in them."""
    found: list[NDArray[np.generic]] = []
    for part in structs.parts.values():
        found += _arrays(part) if isinstance(part, MemberStructs) else [part]
    return found
