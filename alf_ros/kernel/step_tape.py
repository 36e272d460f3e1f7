"""Steps written down as they are taken, and the stages of one of them as it is taken again."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, StepRecord, Tangents, Tape, Work
from alf_ros.kernel.numba_ext.jit import ONE, TWO, inner

# of a stage: its tangents are taken as the step adds them up; projected; interpolated
REGULAR, PROJECTED, INTERPOLATED = 0, 1, 2
BEGIN, END, LENGTH, SIGMA, NEAREST = 0, 1, 2, 3, 4  # of `StepRecord.span`
SPAN = 5


@inner
def record_step(
    record: StepRecord, phase: Phase, work: Work, t: float, end: float, h: float, sigma: float
) -> None:
    """Write down an accepted step of h (s) that began at `phase`, at t, and ended in `work`. Steps
    that do not fit are counted."""
    k, whole = np.uint64(record.count[0]), work.q.size
    record.count[0] += 1
    if (k + ONE) * whole > record.q.size:
        return
    for a in range(whole):
        at = k * whole + a
        record.q[at], record.qd[at] = phase.q[a], phase.qd[a]
        record.ended_q[at], record.ended_qd[at] = work.q[a], work.qd[a]
    for a in range(phase.turns.size):
        record.turns[k * phase.turns.size + a] = phase.turns[a]
    for a in range(phase.sums.size):
        record.sums[k * phase.sums.size + a] = phase.sums[a]
    first = k * np.uint64(SPAN)
    record.span[first], record.span[first + ONE], record.span[first + TWO] = t, end, h
    record.span[first + TWO + ONE] = sigma
    record.span[first + TWO + TWO] = work.nearest[0]


@inner
def restore_step(record: StepRecord, k: np.uint64, phase: Phase) -> None:
    """The state where step k began, into `phase`."""
    whole = phase.q.size
    for a in range(whole):
        phase.q[a], phase.qd[a] = record.q[k * whole + a], record.qd[k * whole + a]
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
