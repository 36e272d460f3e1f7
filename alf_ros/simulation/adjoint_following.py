"""The adjoint of a run: steps that are written down, and taken back from the last to the first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import AlfError, StepError
from alf_ros.kernel import Adjoint, ForceColumns, ForceTrace, Problem, Status, StepRecord, Tape
from alf_ros.kernel.data.tangents import DIRECTIONS
from alf_ros.kernel.numba_ext.lane_structs import aligned
from alf_ros.kernel.step_tape import SPAN
from alf_ros.model.compile import Model
from alf_ros.model.prescribed import program_apart
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.force_columns import (
    COLUMNS,
    by_params,
    columns_of,
    fit_columns,
    no_columns,
)
from alf_ros.simulation.force_traces import OPERATIONS, empty_trace, leaves_of, traced_forces
from alf_ros.simulation.present import Present
from alf_ros.simulation.slope_products import SlopeProducts
from alf_ros.simulation.step_failures import failure, told
from alf_ros.simulation.stepping import Stepper
from alf_ros.simulation.tangent_following import drives_of, seeds, tangents_of

SUMS = ('mass_diagonal', 'mass_k', 'mass_w', 'length2', 'b', 'term', 'c')


class NoRoom(AlfError):
    """The steps were more, or a trace longer, than the memory set aside; it is larger now."""


class TakenBack(NamedTuple):
    """∂J/∂ the arrays of a motion, for a number J; in the units of J over the units of the array.

    q, qd (all blocks D,): by the state where the steps began; of fixed blocks the sum over the
    steps. arrays: by arrays of the problem, as `ParameterSlopes.arrays` names them. params: by the
    numbers of the effects.
    """

    q: Floats
    qd: Floats
    arrays: Mapping[str, Floats]
    params: Floats


class Begun(NamedTuple):
    """Where a step began."""

    q: Floats
    qd: Floats
    turns: Integers
    sums: Floats


class AdjointFollowing:
    """Takes steps of a stepper, and takes them back. The steps stay as they are, bit for bit.

    products: of the numbers of the scene that count; without them all arrays do. Raises InputError
    for an effect without a derivative.
    """

    def __init__(
        self, stepper: Stepper, model: Model, products: SlopeProducts | None = None
    ) -> None:
        self._stepper, self._model, self._products = stepper, model, products
        self._stages = stepper.method.b.size
        self._numbers_of_drives = program_apart(model.layout)[1].size
        self._steps, self._operations = 0, OPERATIONS
        self._record = self._empty_record()
        self._adjoint: Adjoint | None = None
        self._made_for: tuple[Applied, StepRecord, int] | None = None
        self._forces(self._placed(stepper.applied))

    @property
    def bytes_of_step(self) -> int:
        """Memory that one step takes."""
        return sum(x.nbytes for x in _arrays_of(self._record_of(1)))

    def provide(self, steps: int) -> None:
        """Memory for so many steps."""
        if steps > self._steps:
            self._steps = steps
            self._record = self._empty_record()

    def _empty_record(self) -> StepRecord:
        return self._record_of(self._steps)

    def _record_of(self, steps: int) -> StepRecord:
        return _record(self._model, steps, self._stages, self._stepper.is_implicit)

    def write_down(self, present: Present, n: int) -> None:
        """Take n steps of the grid. Raises StepError, and NoRoom if an adaptive method took more
        steps than fit: the present is behind them then."""
        self._record.count[0] = 0
        status = self._stepper.advance_recorded(present, n, self._record)
        if status != Status.OK:
            raise failure(self._stepper, status, present)
        if int(self._record.count[0]) > self._steps:
            self.provide(2 * int(self._record.count[0]))
            raise NoRoom('more steps than there was room for')
        self._begin(present)
        self._taken = int(self._record.count[0])

    def _begin(self, present: Present) -> None:
        """Sums of zero, for the inputs of the present."""
        of, made = self._made_for, (present.applied, self._record, self._operations)
        if of is not None and of[0] is made[0] and of[1] is made[1] and of[2] == made[2]:
            assert self._adjoint is not None
            for name in (*SUMS, 'drive', 'of_trace'):
                getattr(self._adjoint, name)[:] = 0.0
            self._adjoint.columns.own[:] = 0.0
            return
        self._adjoint = self._made(*self._with_places(present))
        self._made_for = made

    def _placed(self, applied: Applied) -> Applied:
        """The same forces, with a place for each input that is a parameter."""
        return applied if self._products is None else self._products.places.applied(applied)

    def _with_places(self, present: Present) -> tuple[Problem, Applied]:
        problem, applied = self._stepper.problem_aside(present), self._placed(present.applied)
        if applied is not present.applied:
            problem = replace(problem, forces=applied.assembled)
        return problem, applied

    def ends(self) -> Floats:
        """(steps,) s: the ends of the steps that are written down."""
        return self._record.span[: self._taken * SPAN].reshape(-1, SPAN)[:, 1]

    def begun(self, k: int) -> Begun:
        """Where written step k began."""
        of, model = self._record, self._model
        sizes = {
            'q': model.q.size,
            'qd': model.q.size,
            'turns': model.system.angles.c.size // 2,
            'sums': model.system.integrals.row.size,
        }
        return Begun(*(getattr(of, name)[k * n : (k + 1) * n].copy() for name, n in sizes.items()))

    def begin(self, q: Floats, qd: Floats) -> None:
        """∂J/∂q and ∂J/∂q̇ (all blocks D,) behind the last step."""
        assert self._adjoint is not None
        self._adjoint.bar_q[:], self._adjoint.bar_qd[:] = q, qd

    def add(self, q: Floats, qd: Floats) -> None:
        """Add to ∂J/∂q and ∂J/∂q̇ where the steps have been taken back to."""
        assert self._adjoint is not None
        for bar, more in ((self._adjoint.bar_q, q), (self._adjoint.bar_qd, qd)):
            bar += more

    def take_back(self, to: int) -> None:
        """Take back the written steps down to number `to`. Raises StepError, and NoRoom if a trace
        was longer than its memory: all must begin again then."""
        assert self._adjoint is not None
        if to >= self._taken:
            return
        back = kernel.take_steps_back
        if self._stepper.is_implicit:
            back = kernel.take_implicit_steps_back
        status = Status(back(self._adjoint, self._taken - 1, to))
        if status == Status.NO_ROOM:
            self._operations *= 4
            raise NoRoom(status.reason)
        if status == Status.STOPPED:
            self._stepper.listener.answer()
        if status != Status.OK:
            at = int(self._adjoint.at[0])
            reason, remedy = told(self._stepper, status)
            raise StepError(reason, remedy, float(self._record.span[at * SPAN]))
        self._taken = to

    def taken_back(self) -> TakenBack:
        """The derivatives, once all steps are taken back."""
        of = self._adjoint
        assert of is not None
        whole, effects = self._model.q.size, of.tangents.problem.forces.effects
        if of.columns.force.size > 0:
            params = by_params(of.columns, effects)
        else:
            params = of.of_trace[2 * whole :][: effects.params.size].copy()
        arrays = {name: getattr(of, name).copy() for name in SUMS}
        arrays['prescribed'] = of.drive.copy()
        return TakenBack(of.bar_q.copy(), of.bar_qd.copy(), arrays, params)

    def _forces(self, applied: Applied) -> tuple[ForceColumns, ForceTrace]:
        """The columns or the traces by which forces are differentiated; the other one is empty.
        In an implicit stage, a trace is written once and read several times."""
        model = self._model
        numbers, whole = leaves_of(model, applied, self._products), model.q.size
        fit = not self._stepper.is_implicit
        if fit and fit_columns(applied.assembled.effects, whole, numbers):
            none = np.zeros_like(applied.assembled.effects.force)
            return columns_of(applied, whole, numbers), empty_trace(model, none, numbers, 0)
        force = traced_forces(applied)
        return no_columns(), empty_trace(model, force, numbers, self._operations)

    def _made(self, problem: Problem, applied: Applied) -> Adjoint:
        model, work = self._model, problem.work
        system, stages = problem.system, problem.method.b.size
        n, whole, blocks = model.n, model.q.size, work.chart.sin.size
        columns, trace = self._forces(applied)
        leaves, plane = trace.numbers.size, model.layout.dimension == 2
        angles = system.angles.c.size // 2
        sizes = {
            **{name: getattr(system.mass, name.removeprefix('mass_')).size for name in SUMS[:3]},
            **{name: getattr(system.rows, name).size for name in SUMS[3:]},
            'of_trace': leaves + trace.slopes.size // 2,
            'search': 2 * DIRECTIONS * whole if self._stepper.is_implicit else 0,
            'start': 2 * n,
            **dict.fromkeys(('xi', 'axes'), 2 * n if plane else 0),
            'bend': blocks if plane else 0,
            **dict.fromkeys(('first_q', 'first_qd'), whole if plane else 0),
            'rates': 2 * stages * n,
            'ended': system.rows.alpha.size,
            'g': work.g.size,
            'g2': work.g2.size,
            'g2v': work.g2.size,
            **dict.fromkeys(_WHOLE, whole),
        }
        tape = {
            **dict.fromkeys(('q', 'qd', 'qdd', 'given'), stages * whole),
            'lam': stages * system.rows.alpha.size,
            **dict.fromkeys(('sin', 'cos'), (stages + 1) * blocks),
            **dict.fromkeys(('xi', 'w'), (stages + 1) * n if plane else 0),
            'sigma': (stages + 1) * system.rows.alpha.size if plane else 0,
            'places': stages * work.places.size,
            'place_weights': stages * work.place_weights.size,
            **dict.fromkeys(('place_step', 'place_shift'), stages),
            **dict.fromkeys(('sum_q', 'sum_qd'), stages * n),
        }
        terms = self._products is None or self._products.changes('term')
        tangents = tangents_of(model, problem, work, 0, np.zeros_like(trace.force), COLUMNS)
        driven = self._products is None or self._products.changes('prescribed')
        if driven and model.system.prescribed.program.size:
            tangents = replace(tangents, **drives_of(model, COLUMNS, 0))
        numbers = tangents.drive_params.size
        moved = whole if numbers else 0
        return Adjoint(
            unit=model.unit,
            tangents=tangents,
            phase=kernel.Phase(
                np.zeros(whole),
                np.zeros(whole),
                np.zeros(angles, dtype=np.int64),
                np.zeros(1),
                np.zeros(0),
                sums=np.zeros(system.integrals.row.size),
            ),
            record=self._record,
            tape=Tape(
                kind=np.zeros(stages, dtype=np.int64),
                projected=np.zeros(1, dtype=np.int64),
                **{name: np.zeros(size) for name, size in tape.items()},
            ),
            at=np.zeros(1, dtype=np.int64),
            terms_count=np.array([int(terms)]),
            drive=np.zeros(self._numbers_of_drives),
            drive_seeds=seeds(numbers, COLUMNS),
            drive_q=aligned(moved, COLUMNS),
            drive_qd=aligned(moved, COLUMNS),
            drive_qdd=aligned(moved, COLUMNS),
            columns=columns,
            trace=trace,
            **{name: np.zeros(size) for name, size in sizes.items()},
        )


_WHOLE = (
    *('bar_q', 'bar_qd', 'q', 'qd', 'qdd', 'whole_q', 'whole_qd', 'whole_qdd'),
    *('begun_q', 'begun_qd', 'pushed', 'u', 'f', 'x'),
)


def _record(model: Model, steps: int, stages: int, implicit: bool) -> StepRecord:
    system, whole, n, D = model.system, model.q.size, model.n, model.layout.dimension
    blocks, rows = n // D, system.rows.alpha.size
    sizes = {
        **dict.fromkeys(('q', 'qd', 'ended_q', 'ended_qd'), whole),
        **dict.fromkeys(('stage_q', 'stage_qd', 'stage_qdd'), stages * whole),
        'stage_lam': stages * rows,
        **dict.fromkeys(('sin', 'cos'), (stages + 1) * blocks),
        'xid': stages * n,
        'wd': stages * n if D == 2 else 0,
        **dict.fromkeys(('xi', 'w'), (stages + 1) * n if D == 2 else 0),
        'sigma': (stages + 1) * rows if D == 2 else 0,
        'curvature': blocks,
        **dict.fromkeys(('t', 'n'), n),
        'b': n if D == 3 else 0,
    }
    if implicit:
        kept = ('q', 'qd', 'ended_q', 'ended_qd')
        sizes = {name: size if name in kept else 0 for name, size in sizes.items()}
        sizes.update(stage_qd=stages * n, stage_qdd=stages * n)
    return StepRecord(
        count=np.zeros(1, dtype=np.int64),
        turns=np.zeros(steps * (system.angles.c.size // 2), dtype=np.int64),
        sums=np.zeros(steps * system.integrals.row.size),
        span=np.zeros(steps * SPAN),
        regular=np.zeros(steps, dtype=np.int64),
        followed=np.zeros(2, dtype=np.int64),
        lam=np.zeros(rows),
        **{name: np.zeros(steps * size) for name, size in sizes.items()},
    )


def _arrays_of(record: StepRecord) -> list[Floats]:
    return [x for x in vars(record).values() if isinstance(x, np.ndarray)]
