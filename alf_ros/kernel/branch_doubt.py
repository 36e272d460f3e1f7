"""Whether the motion tells on which of two branches it continues, where both meet in a dead point.

Beside a dead point the softest mode v of Φ_q, with Φ_q v = s u, leads to the other branch: along v
the rows open by u (s x + ½ k x²), and close again at x = -2 s / k. A steady motion tells the
branches apart. If it misses the place where it led by more than a part of the way, as behind a
rest or with calls in the wrong order, and the other branch is as close as that, it is a guess.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.branch_change import begin_mode
from alf_ros.kernel.branch_end import leads_past
from alf_ros.kernel.constraints import jacobian, times_jacobian
from alf_ros.kernel.data import NOTHING
from alf_ros.kernel.data.closing import CALLS, FACTORED, Closing
from alf_ros.kernel.line_tracking import go_along
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.posture_newton import LEAP, settle

_ASIDE = 1e-4  # of the size: where the change of Φ_q along its mode is seen
STEADY = 0.3  # of the way, by which a steady motion misses the place where it leads
_REACH = 3.0  # times the way or the miss: another branch so close may be the one of the motion
_UNSURE = 0.2  # of a velocity, its standard deviation


@inner
def _opens(closing: Closing, x: float) -> float:
    """The softest mode's part of Φ_q v at a distance x from the q in `line` along the mode v."""
    work, rows, n = closing.work, closing.tight.rows, closing.ahead.size
    for a in range(n):
        work.q[a] = closing.line[a] + x * closing.mode[a]
    jacobian(closing.unit, rows, work.q, work.gf, work.g2f)
    for a in range(n):
        work.delta[a] = closing.mode[a]
    times_jacobian(closing.unit, rows, work.gf, work.g2f, work.delta, work.w)
    part = 0.0
    for r in range(work.w.size):
        part += closing.image[r] * np.sqrt(rows.alpha[r]) * work.w[r]
    return part


@inner
def _leads_across(closing: Closing) -> float:
    """The distance (m) of the q in `line` from the branch across its softest mode, in `other`."""
    work, n = closing.work, closing.ahead.size
    begin_mode(closing, closing.line)
    x = _ASIDE * closing.tight.size / (largest(closing.mode, n) + NOTHING)
    below, above = _opens(closing, -x), _opens(closing, x)
    bend = (above - below) / (2.0 * x)
    across = -(above + below) / (bend + NOTHING)
    for a in range(n):
        closing.other[a] = closing.line[a] + across * closing.mode[a]
    copy(closing.line, work.q)
    closing.counts[FACTORED] = 0
    return abs(across) * largest(closing.mode, n)


@inner
def _meets_another(closing: Closing, near: float) -> bool:
    """Whether the branch of the q in `line`, at the end of a line, leads through a dead point to
    another one that is less than `near` (m) away. The other branch of a bend is no such one."""
    work = closing.work
    if not _leads_across(closing) < near:
        return False
    for a in range(closing.ahead.size):
        work.q[a] = closing.other[a]
    if not settle(closing, closing.tight, True):
        return False
    copy(work.q, closing.other)
    return not leads_past(closing)


@inner
def is_guess(closing: Closing, way: float) -> bool:
    """Whether the branch of the q in `work`, at the end of a line, is a guess.

    way: the way to `ahead`, where the motion led, 0 if nothing is known of it: a rest then, in the
    last posture. A line may have begun in an earlier one, behind values out of reach.
    """
    work, n, size = closing.work, closing.ahead.size, closing.tight.size
    if closing.counts[CALLS] == 0:  # a motion begins on the branch of its start
        return False
    off = furthest(work.q, closing.ahead if way > 0.0 else closing.place, n)
    if not STEADY * way < off <= LEAP * size:
        return False
    copy(work.q, closing.line)
    copy(closing.turned, closing.line_turns)
    guess = _meets_another(closing, _REACH * max(off, way))
    copy(closing.line, work.q)
    copy(closing.line_turns, closing.turned)
    closing.counts[FACTORED] = 0
    return guess


@inner
def is_unsure(closing: Closing, way: float) -> bool:
    """Whether noise leaves open on which branch the posture is: the velocity is not known well,
    and a dead point is near. way: to `ahead`, where the estimate of the motion led."""
    work, near = closing.work, _REACH * (way + np.sqrt(closing.known[0]))
    if closing.known[2] <= (_UNSURE * largest(closing.rate, closing.ahead.size)) ** 2:
        return False
    copy(closing.q, closing.line)
    if not _leads_across(closing) < near:
        return False
    zero(closing.stride)
    if go_along(closing, False) < 1.0:
        return True
    copy(work.q, closing.line)
    return _meets_another(closing, near)
