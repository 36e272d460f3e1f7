"""Simulations of one mechanism with other numbers, stepped side by side in vector registers.

Each has the bits of its steps alone, and remains a Simulation: between two calls it can be read,
restored, or stepped by itself.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Container, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Addresses
from alf_ros.errors import AlfError, BusyError, InputError, StepError
from alf_ros.kernel import Effects, Status
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, progress_of
from alf_ros.kernel.lanes.advance_lanes import advance_lanes
from alf_ros.kernel.lanes.advance_lanes_adaptively import advance_lanes_adaptively
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.kernel.numba_ext.lane_structs import LaneStruct
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.lane_crews import are_alike, crew_of
from alf_ros.simulation.listening import Listener
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.step_failures import failure

WIDTHS = 2, 4, 8, 16  # members of a group: one register of them, or two
_PARTS = 'problem', 'phase', 'progress', 'crew'  # of `LaneGroups`


class _Members:
    """The members of all groups, by their numbers: the simulations, the forces that crews have,
    steps that the simulations do not count yet, and steps at the begin of a call."""

    def __init__(self, simulations: Sequence[Simulation]) -> None:
        count = len(simulations)
        self.simulations = simulations
        self.effects: list[Effects | None] = [None] * count
        self.taken, self.begun = np.zeros(count), np.zeros(count)


class _Group:
    """As many members as a register has lanes, of one pattern. Lanes without a member hold a copy
    of the first, which has no steps to take. Groups exchange members."""

    def __init__(self, of: _Members, numbers: Sequence[int], lanes: int) -> None:
        self._of = of
        count = len(numbers)
        first = of.simulations[numbers[0]]
        self._spare = [copy.copy(first) for _ in range(lanes - count)]
        self._numbers = np.array([*numbers, *[-1] * len(self._spare)], dtype=np.int64)
        problems, phases = self._structs()
        self.problem, self.phase = LaneStruct(problems), LaneStruct(phases)
        size = problems[0].work.q.size
        self.progress = LaneStruct([progress_of(size) for _ in problems])
        self._is_adaptive, self._pattern = is_adaptive(first), _pattern(first)
        self.crew = self._crew(problems, phases)
        self.listener = Listener(self.problem.work)
        # (lanes,) number of steps, targets, most iterations: of the kernel
        progress = self.progress
        self._index, self._target, self._most = (
            progress.index[0],
            progress.target[0],
            progress.most[0],
        )

    def _lanes(self) -> list[Simulation]:
        """The simulation in each lane."""
        spare = iter(self._spare)
        each = self._numbers.tolist()
        return [self._of.simulations[k] if k >= 0 else next(spare) for k in each]

    def _structs(self) -> tuple[list[Problem], list[Phase]]:
        runs = [each._run for each in self._lanes()]
        problems = [run.stepper.problem_of(run.present) for run in runs]
        return problems, [run.present.phase for run in runs]

    def _crew(self, problems: Sequence[Problem], phases: Sequence[Phase]) -> LaneCrew:
        effects = [each.forces.effects for each in problems]
        for k, own in zip(self._numbers.tolist(), effects, strict=True):
            if k >= 0:
                self._of.effects[k] = own
        applied = [each._run.present.applied for each in self._lanes()]
        crew = crew_of(
            _addresses(problems),
            _addresses(phases),
            applied,
            effects,
            [each.system.prescribed for each in problems],
            len(problems[0].unit),
            self._is_adaptive,
            self.problem.columns(without='work') if self._is_adaptive else [],
            self._numbers.tolist(),
        )
        self._numbers = crew.member
        self._likeness = self._alike(crew, problems)
        return crew

    def _alike(self, crew: LaneCrew, problems: Sequence[Problem]) -> object:
        """Equal for groups whose members may change places: of one pattern, with the same
        functions of numbers in the same places. With fixed steps none change."""
        if not self._is_adaptive:
            return object()
        forces = [each.forces for each in problems]
        first, search = forces[0].effects, forces[0].kinks.search
        for each in forces:
            alike = are_alike(first, each.effects) and np.array_equal(search, each.kinks.search)
            if not alike:
                return object()
        effects = first.force, first.side, first.slots, first.slots_at, first.params_at
        arrays = (*effects, search, crew.sizes, crew.lane_force, crew.lane_drives, crew.steady)
        return self._pattern, tuple(each.tobytes() for each in arrays)

    def bind(self) -> None:
        """Take the members as they are now."""
        self.of, self.of_phase = self._structs()
        effects = [each.forces.effects for each in self.of]
        each = zip(self._numbers.tolist(), effects, strict=True)
        if all(k < 0 or self._of.effects[k] is own for k, own in each):
            self.crew.problem[:] = _addresses(self.of)
            self.crew.phase[:] = _addresses(self.of_phase)
        else:
            self.crew = self._crew(self.of, self.of_phase)
        self.crew.dated[0] = any(each.forces.kinks.instants.size for each in self.of)
        self._index[:] = [each.step_index for each in self._lanes()]

    @property
    def kind(self) -> object:
        """Equal for groups whose members may change places."""
        return self._likeness, int(self.crew.dated[0])

    def begin(self, n: int, moving: NDArray[np.bool_]) -> None:
        """Set the targets of the moving members n steps ahead."""
        crew = self.crew
        crew.apart[:] = crew.result[:] = 0
        own = self._numbers >= 0
        numbers = self._numbers[own]
        self._most[:], self._of.begun[numbers] = 0.0, self._index[own]
        self._target[:] = self._index
        self._target[own] += n * moving[numbers]
        if (self._target > self._index)[self._index == 0].any():
            for m, k in enumerate(self._numbers.tolist()):
                if k >= 0 and self._index[m] == 0 and self._target[m] > 0:
                    self._start(m, self._of.simulations[k])

    def _start(self, m: int, member: Simulation) -> None:
        """The first step of a scene that starts in a singular position is taken alone."""
        stepper, present = member._run.stepper, member._run.present
        if stepper.begins_within(present):
            status = stepper.advance(present, 1)
            self.crew.result[m], self.crew.apart[m] = status, present.step
            self._index[m] = present.step
            if status != Status.OK:
                self._target[m] = present.step

    def end(self) -> None:
        """Count the steps since `begin`."""
        own = self._numbers >= 0
        numbers = self._numbers[own]
        taken = self._index[own] - self._of.begun[numbers] - self.crew.apart[own]
        self._of.taken[numbers] += taken

    @property
    def apart(self) -> int:
        """How many steps members took alone."""
        return int(self.crew.apart[self._numbers >= 0].sum())

    def failures(self) -> dict[int, AlfError]:
        """By member. Raises what stopped one."""
        if not self.crew.result.any():
            return {}
        self.settle()
        failed: dict[int, AlfError] = {}
        for k, result in zip(self._numbers.tolist(), self.crew.result.tolist(), strict=True):
            status = Status(result)
            if k >= 0 and status != Status.OK:
                run = self._of.simulations[k]._run
                failed[k] = failure(run.stepper, status, run.present)
        return failed

    def settle(self, cost: float = math.nan) -> None:
        """Let the members count the steps since the last time; `cost` (s) of a step."""
        for m, k in enumerate(self._numbers.tolist()):
            if k < 0:
                continue
            each, taken = self._of.simulations[k], int(self._of.taken[k])
            stepper = each._run.stepper
            if not self._is_adaptive:  # whose stages the kernel counts
                stepper.work.evaluations[0] += each.stages * taken
            if self._index[m] > self._of.begun[k]:
                stepper.iterations, each._run.step_cost = int(self._most[m]), cost
            self._of.taken[k] = 0.0


class SideBySide:
    """Simulations that are stepped together, as many at once as a register has numbers.

    They have one step and method, and may differ in all else; those whose mechanisms have one
    pattern share registers. `no_place` says which simulations have none here. `lanes`: how many
    numbers a register holds; by default the width of this processor. Raises InputError for a
    simulation that has no place here.
    """

    def __init__(self, simulations: Sequence[Simulation], lanes: int | None = None) -> None:
        self.simulations = tuple(simulations)
        self.lanes = width() if lanes is None else lanes
        if self.lanes not in WIDTHS:
            raise InputError('not usable', key='lanes', value=lanes, expected='2, 4, 8 or 16')
        patterns: dict[bytes, list[int]] = {}
        if len({id(each) for each in self.simulations}) < len(self.simulations):
            raise InputError('a simulation is given twice', key='simulations')
        for k, each in enumerate(self.simulations):
            if not isinstance(each, Simulation):
                raise InputError('not a simulation', key=f'simulations[{k}]', value=each)
            why = no_place(each)
            if why:
                raise InputError(why, key=f'simulations[{k}]', value=each.solver.integrator)
            patterns.setdefault(_pattern(each), []).append(k)
        if len({(each.h, each.solver.integrator) for each in self.simulations}) > 1:
            raise InputError('not of one step and integrator', key='simulations')
        self.patterns = len(patterns)
        members = _Members(self.simulations)
        self._groups: list[_Group] = []
        for places in patterns.values():
            for first in range(0, len(places), self.lanes):
                some = places[first : first + self.lanes]
                self._groups.append(_Group(members, some, self.lanes))

    def step(self, n: int = 1, without: Container[int] = ()) -> dict[int, AlfError]:
        """n steps of each simulation in one compiled call, `without` some by their numbers.

        Returns the failures, StepErrors, by number of the simulation: these stand at the end of
        their last whole step. Raises StoppedError or the exception of a signal handler if the call
        is interrupted, and BusyError if another thread uses one of the simulations.
        """
        last = max((each.step_index for each in self.simulations), default=0)
        n = check.whole(n, 'n', 0, check.MOST_STEPS - last)
        started = time.perf_counter()
        with ExitStack() as stack:
            for each in self.simulations:
                if each._lock.locked():
                    raise BusyError(type(self).__name__, 'step')
                stack.enter_context(each._lock)
            self.bind()
            try:
                return self.advance(n, without)
            finally:
                taken = time.perf_counter() - started
                self.settle(taken / max(1, n * len(self.simulations)))

    def bind(self) -> None:
        """Take the simulations as they are now, for calls of `advance` between which nobody else
        uses them."""
        self._where: dict[int, tuple[list[_Group], LaneGroups]] = {}
        kinds: dict[object, int] = {}
        for group in self._groups:
            group.bind()
            group.crew.kind[0] = kinds.setdefault(group.kind, len(kinds))
            D = len(group.of[0].unit)
            self._where.setdefault(D, ([], LaneGroups.empty()))[0].append(group)
        for D, (groups, _) in self._where.items():
            parts = ([getattr(group, part) for group in groups] for part in _PARTS)
            self._where[D] = groups, LaneGroups(*map(_addresses, parts))

    def advance(self, n: int, without: Container[int] = ()) -> dict[int, AlfError]:
        """`step`, of simulations that are bound, which count their steps at `settle`."""
        failed: dict[int, AlfError] = {}
        moving = np.array([k not in without for k in range(len(self.simulations))], dtype=bool)
        for groups, where in self._where.values():
            for group in groups:
                group.begin(n, moving)
            first = groups[0]
            kernel = advance_lanes
            if is_adaptive(self.simulations[0]):
                kernel = advance_lanes_adaptively
            stopped = kernel(
                first.problem,
                first.phase,
                first.progress,
                first.crew,
                first.of[0],
                first.of_phase[0],
                where,
                self.simulations[0].h,
            )
            for group in groups:
                group.end()
            for group in groups:
                failed |= group.failures()
            if stopped >= 0:
                groups[stopped].listener.answer()
        return failed

    @property
    def apart(self) -> int:
        """How many steps of the last call members took alone, beside singular positions."""
        return sum(group.apart for group in self._groups)

    def settle(self, cost: float = math.nan) -> None:
        """Let the simulations count what `advance` has done; `cost` (s) of a step."""
        for group in self._groups:
            group.settle(cost)

    def run(
        self, duration: float, at: Sequence[float], look: Callable[[int, Sample], None]
    ) -> dict[int, AlfError]:
        """`Simulation.run` of each, in turns: `look` gets the number of a simulation and its
        samples at the times `at` (s), one by one. Returns what ended simulations early."""
        if not self.simulations:
            return {}
        first = self.simulations[0]
        h, index = first.h, first.step_index
        last = index + check.steps_of(duration, h, index)
        failed: dict[int, AlfError] = {}
        for t in check.times(at, first.t, h):
            ahead = math.floor(t / h + check.CLOSE) - index
            if ahead > 0:
                failed |= self.step(ahead, failed)
                index += ahead
            for k, each in enumerate(self.simulations):
                if k not in failed:
                    try:
                        look(k, each._sample_at(t))
                    except StepError as error:
                        failed[k] = error
        if index < last:
            failed |= self.step(last - index, failed)
        return failed


def no_place(simulation: Simulation) -> str:
    """Why a simulation cannot be stepped side by side with others; empty if it can."""
    stepper = simulation._run.stepper
    if PLAIN:
        return 'code that is not compiled has no lanes'
    if simulation.yields or stepper.is_implicit:
        return 'only explicit integrators have lanes'
    if stepper.formulation is not None:
        return 'only alf2 has lanes'
    if simulation._run.is_watched or simulation.following is not None:
        return 'a watched run, or one with tangents, has no lanes'
    if simulation.ledger or stepper.applied.load_count:
        return 'works, and friction that depends on reactions, have no lanes'
    if stepper.may_jump:
        return 'drives with corners have no lanes'
    return ''


def is_adaptive(simulation: Simulation) -> bool:
    """Whether the lengths of its steps depend on their errors."""
    return simulation._run.stepper.method.embedded.size > 0


def _pattern(simulation: Simulation) -> bytes:
    """The common part of the members of a group: the whole numbers of the mechanism, the
    iterations of a solve, the tolerance of an adaptive method, the number of kinks over time."""
    system, method = simulation._run.stepper.system, simulation._run.stepper.method
    tolerance = float(method.tolerance) if is_adaptive(simulation) else 0.0
    instants = simulation._run.applied.assembled.kinks.instants
    parts = [repr((int(method.iterations), tolerance, instants.size)).encode()]
    for struct in (system.mass, system.rows, system.pattern, system.arms, system.angles):
        for name, value in sorted(vars(struct).items()):
            if name.startswith('_'):
                continue
            if isinstance(value, np.ndarray):
                whole = value.dtype.kind != 'f'
                parts.append(repr((name, value.shape)).encode())
                parts.append(value.tobytes() if whole else b'')
            else:
                parts.append(repr(value).encode())
    parts.append(
        repr((simulation._run.present.phase.q.size, system.prescribed.slots.size)).encode()
    )
    return b'|'.join(parts)


def _addresses(structs: Sequence[Any]) -> Addresses:
    return np.array([each._address for each in structs], dtype=np.uint64)
