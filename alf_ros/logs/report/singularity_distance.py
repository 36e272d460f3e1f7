"""How near the states of a log are to singular positions, and where it passes through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Phase
from alf_ros.logs import progress
from alf_ros.logs.report.diagnostic_levels import Reports
from alf_ros.model import ordinary_positions
from alf_ros.model.compile import Model, allocate
from alf_ros.model.prescribed import prescribe
from alf_ros.model.softest_modes import KNOWN, NIL, ROUNDS, begun, near
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.singular_passes import FOLLOWED, ModeComparison, place

_AGAIN = 2.0  # times as far as where it turns back: it comes from there and goes there again
_WARN = 1


@dataclass(frozen=True, eq=False)
class Distances:
    """Of k instants: t (k,) s, σ (k,) as `Sample.diagnostics.distance`, NaN where A cannot be
    factored, its error (k,); when modes vanished between two of them, s; σ that is called near.
    """

    t: Floats
    sigma: Floats
    error: Floats
    passes: list[float]
    near: float


def distances(
    simulation: Simulation, t: Floats, q: Floats, report: progress.Report = progress.silent
) -> Distances:
    """At times t (k,) s and coordinates q (k, n) in the order of a log, m.

    A pass is one where σ changes its sign from one instant to the next, as far as the modes of
    both are the same: instants far apart tell none.
    """
    model, blocks = simulation.model, simulation.state.q
    unit, system = model.unit, model.system
    work, D = allocate(model, system, 0), model.layout.dimension
    redundant = ordinary_positions.ordinary(model, blocks)[0]
    modes = begun(model, redundant, FOLLOWED)
    sigma, error, passes = np.ones(len(t)), np.zeros(len(t)), list[float]()
    work.q[:] = blocks
    last: tuple[float, Floats] | None = None  # the last instant whose σ has a sign
    steady = False
    for k, instant in enumerate(t.tolist()):
        report(k / len(t))
        work.q.reshape(-1, D)[model.coordinate_block] = q[k].reshape(-1, D)
        prescribe(system, instant, work.q, work.qd, work.qdd)
        if modes is None:
            continue
        if not kernel.linearise(unit, system, work, work.q):
            sigma[k], steady, last = np.nan, False, None
            continue
        before, steady = steady, kernel.follow(unit, system, work, modes, ROUNDS, KNOWN)
        sigma[k], error[k] = modes.sigma[0], modes.error[0]
        if sigma[k] < NIL:
            continue
        here = instant, work.q.copy()
        if last is not None and not (steady and before):
            passes += _pass(model, redundant, last, here)
        last = here
    return Distances(t, sigma, error, passes, near(model))


def _pass(
    model: Model, redundant: int, before: tuple[float, Floats], after: tuple[float, Floats]
) -> list[float]:
    """When a mode vanished between two instants (s, q), s, if one did."""
    work, nothing = allocate(model, model.system, 0), np.zeros(0, dtype=np.int64)
    places = []
    for t, q in (before, after):
        phase = Phase(q, np.zeros_like(q), nothing, np.zeros(1), np.zeros(0))
        places.append(place(model, work, redundant, t, phase))
    a, b = places
    if a is None or b is None:
        return []
    told = ModeComparison(model, work, a, b, moving=False)
    return [told.t] if told.passes else []


def passes(found: Distances) -> list[tuple[float, float, bool]]:
    """(t, σ at the nearest instant, whether it is a pass): passes through singular positions, and
    where it came near to one, for all the error of σ, and turned back."""
    t, sigma = found.t, found.sigma
    events = []
    for at in found.passes:
        k = int(np.searchsorted(t, at))
        events.append((at, float(np.nanmin(sigma[max(0, k - 1) : k + 1])), True))
    for k in _turned(sigma, found.error):
        around = t[max(0, k - 1)], t[min(len(t) - 1, k + 1)]
        through = any(around[0] <= at <= around[1] for at in found.passes)
        if sigma[k] + found.error[k] < found.near and not through:
            events.append((float(t[k]), float(sigma[k]), False))
    return sorted(events)


def _turned(sigma: Floats, error: Floats) -> list[int]:
    """Instants of the minima that rise to _AGAIN times as much, and above the error, on both
    sides; the first and the last instant count as such a side."""
    found, falling, top, least = [], True, np.inf, 0
    for k in np.flatnonzero(~np.isnan(sigma)).tolist():
        bound = _AGAIN * (sigma[least] + error[least])
        if falling and sigma[k] < sigma[least]:
            least = k
        elif falling and sigma[k] > bound:
            found.append(least)
            falling, top = False, sigma[k]
        elif not falling:
            top = max(top, sigma[k])
            if sigma[k] + error[k] < top / _AGAIN:
                falling, least = True, k
    return found


def reported(reports: Reports) -> list[tuple[float, float]]:
    """(from, to) s: between two reports of the diagnostics it came near, as they said."""
    trace = reports.levels.get('constraints')
    if trace is None:
        return []
    warned = np.flatnonzero(trace.high[:, 0] == _WARN)
    ends = np.append(trace.t[1:], trace.t[-1:]) if trace.group > 1 else trace.t
    return [(float(trace.t[max(0, k - 1)]), float(ends[k])) for k in warned]
