"""Steps written down as they are taken, and the stages of one of them as it is taken again."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.companion import (
    ADDED_UP,
    BEGIN_STEP,
    END_STEP,
    FIRST_STAGE,
    STAGE,
    told,
)
from alf_ros.kernel.data import Phase, Problem, StepRecord, Tangents, Tape, Work
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, by_address, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.status import OK

# of a stage: its tangents are taken as the step adds them up; projected; interpolated
REGULAR, PROJECTED, INTERPOLATED = 0, 1, 2
BEGIN, END, LENGTH, SIGMA = 0, 1, 2, 3  # of `StepRecord.span`
SPAN = 4


def _write_down(
    record: StepRecord,
    problem: Problem,
    phase: Phase,
    what: np.uint64,
    s: np.uint64,
    t: float,
    x: float,
) -> int:
    """The companion that keeps the steps of an explicit method."""
    work, stages = problem.work, problem.method.b.size
    if what == FIRST_STAGE:
        store_multipliers(record.lam, work.y)
    elif what == BEGIN_STEP:
        _begin_record(record, s > 0)
    elif what == STAGE:
        _record_stage(record, work, stages, s, x)
    elif what == ADDED_UP:
        _record_axes(record, work, stages, s)
    elif what == END_STEP:
        _record_step(record, phase, work, stages, x)
    return OK


def _write_down_implicitly(
    record: StepRecord,
    problem: Problem,
    phase: Phase,
    what: np.uint64,
    s: np.uint64,
    t: float,
    x: float,
) -> int:
    """The same of an implicit method."""
    if what == END_STEP:
        _record_implicit_step(record, phase, problem.work, problem.method.b.size)
    return OK


@cache
def writing_down(dimension: int, implicit: bool) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Work` holds."""
    kind = told(StepRecord._numba_type(), dimension)
    return by_address(kind)(_write_down_implicitly if implicit else _write_down)


@inner
def _record_step(
    record: StepRecord, phase: Phase, work: Work, stages: np.uint64, sigma: float
) -> None:
    """Write down an accepted step that began at `phase`, and ended in `work`.

    Its stages are written down already. Steps that do not fit are counted.
    """
    k = np.uint64(record.count[0])
    if not _record_ends(record, phase, work):
        return
    followed = record.followed[0] != 0 and record.followed[1] != 0
    record.regular[k] = 1 if followed and not is_beside(work, work.nearest[0]) else 0
    _record_chart(record, work, stages, k)
    if record.wd.size > 0:
        rows = work.sigma.size
        at = (k * (stages + ONE) + stages) * rows
        copy(work.sigma, section(record.sigma, at, rows))
    first = k * np.uint64(SPAN)
    record.span[first + np.uint64(SIGMA)] = sigma


@inner
def _record_implicit_step(record: StepRecord, phase: Phase, work: Work, stages: np.uint64) -> None:
    """The same of an implicit method, with v and k of its stages."""
    k, n = np.uint64(record.count[0]), work.p.size
    if not _record_ends(record, phase, work):
        return
    record.regular[k] = 0 if is_beside(work, np.inf) else 1
    for s in range(stages):
        at = (k * stages + s) * n
        for a in range(n):
            record.stage_qd[at + a] = work.k[THREE * s * n + a]
            record.stage_qdd[at + a] = work.k[THREE * s * n + n + a]


@inner
def store_multipliers(lam: Floats, y: Floats) -> None:
    """-λ of the stage, from where it was solved for."""
    for r in range(y.size):
        lam[r] = -y[r]


@inner
def restore_rates(record: StepRecord, work: Work, stages: np.uint64, k: np.uint64) -> None:
    """v and k of the stages of implicit step k, back into `work`."""
    n = work.p.size
    for s in range(stages):
        at = (k * stages + s) * n
        for a in range(n):
            work.k[THREE * s * n + a] = record.stage_qd[at + a]
            work.k[THREE * s * n + n + a] = record.stage_qdd[at + a]


@inner
def is_beside(work: Work, nearest: float) -> bool:
    """Whether a step ended beside a singular position, or a stage of it was so: at a distance
    `nearest`."""
    return work.aside[0] != 0 or work.aside[1] != 0 or nearest < np.inf


@inner
def _record_ends(record: StepRecord, phase: Phase, work: Work) -> bool:
    """Where a step began and ended, and when; whether it fits."""
    k, whole = np.uint64(record.count[0]), work.q.size
    record.count[0] += 1
    if (k + ONE) * whole > record.q.size:
        return False
    copy(phase.q, section(record.q, k * whole, whole))
    copy(phase.qd, section(record.qd, k * whole, whole))
    copy(work.q, section(record.ended_q, k * whole, whole))
    copy(work.qd, section(record.ended_qd, k * whole, whole))
    for a in range(phase.turns.size):
        record.turns[k * phase.turns.size + a] = phase.turns[a]
    for a in range(phase.sums.size):
        record.sums[k * phase.sums.size + a] = phase.sums[a]
    first = k * np.uint64(SPAN)
    for n in range(THREE):
        record.span[first + n] = work.interval[n]
    return True


@inner
def _record_chart(record: StepRecord, work: Work, stages: np.uint64, k: np.uint64) -> None:
    """The coordinates of step k, and their rates in its stages."""
    chart, n = work.chart, work.p.size
    blocks = chart.sin.size
    for i in range(blocks):
        record.curvature[k * blocks + i] = chart.curvature[i]
    if chart.arcs[0] == 0:
        return
    for a in range(n):
        record.t[k * n + a], record.n[k * n + a] = chart.t[a], chart.n[a]
    for a in range(chart.b.size):
        record.b[k * n + a] = chart.b[a]
    for s in range(stages):
        at, first = (k * stages + s) * n, s * THREE * n
        copy(section(work.k, first, n), section(record.xid, at, n))
        if record.wd.size > 0:
            copy(section(work.k, first + TWO * n, n), section(record.wd, at, n))
    if record.wd.size > 0:  # of the first stage, in these coordinates
        copy(chart.momentum, section(record.w, k * (stages + ONE) * n, n))


@inner
def has_room(record: StepRecord, work: Work) -> bool:
    """Whether one more step fits."""
    return (np.uint64(record.count[0]) + ONE) * work.q.size <= record.q.size


@inner
def _begin_record(record: StepRecord, begun: bool) -> None:
    """Begin a step; `begun`: stage 0 comes from a step that was too long."""
    record.followed[1] = 1
    if not begun:
        record.followed[0] = 1


@inner
def _record_stage(
    record: StepRecord, work: Work, stages: np.uint64, s: np.uint64, x: float
) -> None:
    """Write down stage s of the step that is being taken; x: its distance to a singular
    position."""
    if x < np.inf:
        record.followed[min(s, ONE)] = 0
        return
    if not has_room(record, work):
        return
    whole, rows = work.q.size, work.y.size
    at = np.uint64(record.count[0]) * stages + s
    copy(work.q, section(record.stage_q, at * whole, whole))
    copy(work.qd, section(record.stage_qd, at * whole, whole))
    copy(work.qdd, section(record.stage_qdd, at * whole, whole))
    for r in range(rows):
        record.stage_lam[at * rows + r] = -work.y[r] if s > 0 else record.lam[r]
    _record_axes(record, work, stages, s)


@inner
def _record_axes(record: StepRecord, work: Work, stages: np.uint64, s: np.uint64) -> None:
    """Where stage s is on its arcs, or past the last stage the end of the step."""
    blocks, n = work.chart.sin.size, work.p.size
    at = np.uint64(record.count[0]) * (stages + ONE) + s
    if work.chart.arcs[0] == 0 or not has_room(record, work):
        return
    for i in range(blocks):
        record.sin[at * blocks + i] = work.chart.sin[i]
        record.cos[at * blocks + i] = work.chart.cos[i]
    if record.wd.size > 0:
        copy(section(work.total, 0, n), section(record.xi, at * n, n))
        copy(work.chart.w, section(record.w, at * n, n))
        copy(work.sigma, section(record.sigma, at * work.sigma.size, work.sigma.size))


@inner
def restore_stages(record: StepRecord, tape: Tape, work: Work, k: np.uint64) -> bool:
    """Step k, whose stages are read from the record (`restore_recorded`): its coordinates into
    `work`, and on the tape where the stages are in them. Returns whether tangents are added up
    along its arcs."""
    chart, n, rows = work.chart, work.p.size, work.sigma.size
    blocks, stages = chart.sin.size, tape.kind.size
    for s in range(stages):
        tape.kind[s] = REGULAR
    tape.projected[0] = 1
    arcs = False
    for i in range(blocks):
        chart.curvature[i] = record.curvature[k * blocks + i]
        arcs = arcs or chart.curvature[i] != 0.0
    if not arcs:
        return False
    for a in range(n):
        chart.t[a], chart.n[a] = record.t[k * n + a], record.n[k * n + a]
    for a in range(chart.b.size):
        chart.b[a] = record.b[k * n + a]
    for i in range((stages + ONE) * blocks):
        at = k * (stages + ONE) * blocks + i
        tape.sin[i], tape.cos[i] = record.sin[at], record.cos[at]
    for s in range(stages):
        copy(section(record.xid, (k * stages + s) * n, n), section(work.k, s * THREE * n, n))
    if record.wd.size == 0:
        return False
    for s in range(stages):
        to = section(work.k, (s * THREE + TWO) * n, n)
        copy(section(record.wd, (k * stages + s) * n, n), to)
    at = k * (stages + ONE)
    copy(section(record.w, at * n, n), chart.momentum)
    copy(section(record.xi, at * n, tape.xi.size), tape.xi)
    copy(section(record.w, at * n, tape.w.size), tape.w)
    copy(section(record.sigma, at * rows, tape.sigma.size), tape.sigma)
    return True


@inner
def restore_recorded(
    record: StepRecord, tangents: Tangents, stages: np.uint64, k: np.uint64, s: np.uint64
) -> None:
    """Stage s of step k into `work`."""
    work = tangents.problem.work
    whole, rows, at = work.q.size, tangents.lam.size, k * stages + s
    copy(section(record.stage_q, at * whole, whole), work.q)
    copy(section(record.stage_qd, at * whole, whole), work.qd)
    copy(section(record.stage_qdd, at * whole, whole), work.qdd)
    copy(section(record.stage_lam, at * rows, rows), tangents.lam)


@inner
def restore_step(record: StepRecord, k: np.uint64, phase: Phase) -> None:
    """The state where step k began, into `phase`."""
    whole = phase.q.size
    copy(section(record.q, k * whole, whole), phase.q)
    copy(section(record.qd, k * whole, whole), phase.qd)
    for a in range(phase.turns.size):
        phase.turns[a] = record.turns[k * phase.turns.size + a]
    for a in range(phase.sums.size):
        phase.sums[a] = record.sums[k * phase.sums.size + a]


@inner
def store_axes(tape: Tape, work: Work, s: np.uint64) -> None:
    """How far the axes of the arcs have turned, where `work` was unfolded last."""
    blocks = work.chart.sin.size
    for i in range(blocks):
        tape.sin[s * blocks + i], tape.cos[s * blocks + i] = work.chart.sin[i], work.chart.cos[i]


@inner
def restore_axes(tape: Tape, work: Work, s: np.uint64) -> None:
    """The same back into `work`."""
    blocks = work.chart.sin.size
    for i in range(blocks):
        work.chart.sin[i], work.chart.cos[i] = tape.sin[s * blocks + i], tape.cos[s * blocks + i]


@inner
def restore_arcs(tape: Tape, work: Work, s: np.uint64) -> None:
    """ξ, w and σ of stage s, or past the last stage of the end, of a step along arcs in the
    plane."""
    chart, n, rows = work.chart, work.p.size, work.sigma.size
    copy(section(tape.xi, s * n, n), section(work.total, 0, n))
    copy(section(tape.w, s * n, n), chart.w)
    copy(section(tape.sigma, s * rows, rows), work.sigma)
    for i in range(chart.rho.size):
        chart.rho[i] = 1.0 - chart.curvature[i] * work.total[i * TWO + ONE]
        chart.per_rho[i] = 1.0 / chart.rho[i]


@inner
def store_stage(tape: Tape, tangents: Tangents, s: np.uint64, kind: int) -> None:
    """A stage whose tangents have just been computed, in `work` of the tangents."""
    work = tangents.problem.work
    whole, n, rows = work.q.size, work.p.size, tangents.lam.size
    tape.kind[s] = kind
    for a in range(whole):
        at = s * whole + a
        tape.q[at], tape.qd[at], tape.qdd[at] = work.q[a], work.qd[a], work.qdd[a]
        tape.given[at] = work.given[a]
    for r in range(rows):
        tape.lam[s * rows + r] = tangents.lam[r]
    if kind == INTERPOLATED:
        for a in range(n):
            tape.sum_q[s * n + a], tape.sum_qd[s * n + a] = work.sum_q[a], work.sum_qd[a]
        for a in range(work.places.size):
            tape.places[s * work.places.size + a] = work.places[a]
        for k in range(work.place_weights.size):
            tape.place_weights[s * work.place_weights.size + k] = work.place_weights[k]
        tape.place_step[s], tape.place_shift[s] = work.place_step[0], work.place_shift[0]


@inner
def restore_stage(tape: Tape, tangents: Tangents, s: np.uint64) -> None:
    """The same back into `work`."""
    work = tangents.problem.work
    whole, n, rows = work.q.size, work.p.size, tangents.lam.size
    for a in range(whole):
        at = s * whole + a
        work.q[a], work.qd[a], work.qdd[a] = tape.q[at], tape.qd[at], tape.qdd[at]
        work.given[a] = tape.given[at]
    for r in range(rows):
        tangents.lam[r] = tape.lam[s * rows + r]
    if tape.kind[s] == INTERPOLATED:
        for a in range(n):
            work.sum_q[a], work.sum_qd[a] = tape.sum_q[s * n + a], tape.sum_qd[s * n + a]
        for a in range(work.places.size):
            work.places[a] = tape.places[s * work.places.size + a]
        for k in range(work.place_weights.size):
            work.place_weights[k] = tape.place_weights[s * work.place_weights.size + k]
        work.place_step[0], work.place_shift[0] = tape.place_step[s], tape.place_shift[s]
