"""How near the states of a log are to singular positions, and where it passes through them."""

from __future__ import annotations

import numpy as np

from alf_ros import assembly, kernel
from alf_ros.analysis.reports import CLOSEST, Reports
from alf_ros.arrays import Floats
from alf_ros.logs import progress
from alf_ros.model import allocate
from alf_ros.passes import zero
from alf_ros.prescribed import prescribe
from alf_ros.rank import distance, effective_rank
from alf_ros.simulation import Simulation

# What comes as near as this and turns back is marked too; farther than _FAR nothing is looked at.
NEAR, _FAR = 1e-2, 0.5


def distances(
    simulation: Simulation, t: Floats, q: Floats, report: progress.Report = progress.silent
) -> Floats:
    """(k,) at times t (k,) s and coordinates q (k, n) in the order of a log, m; NaN where A cannot
    be factored. As `Sample.diagnostics.distance`, in one workspace."""
    model, blocks = simulation.model, simulation.state.q
    work, D = allocate(model, model.system, 0), model.layout.dimension
    independent = len(model.row_names) - assembly.ordinary(model, blocks)[0]
    work.q[:] = blocks
    missing = np.empty(len(t))
    for k, instant in enumerate(t.tolist()):
        work.q.reshape(-1, D)[model.coordinate_block] = q[k].reshape(-1, D)
        prescribe(model.system, instant, work.q, work.qd, work.qdd)
        whole = kernel.linearise(model.unit, model.system, work, work.q)
        missing[k] = independent - effective_rank(model, work) if whole else np.nan
        report(k / len(t))
    return distance(missing, model.penalty)


def passes(t: Floats, sigma: Floats) -> list[tuple[float, float, bool]]:
    """(t, σ at the nearest instant, whether it is a pass): minima of the distance that are passes
    through a singular position, or come nearer to one than NEAR and turn back.

    σ must be that of every tick: from instants far apart, passes would be read that are none.
    """
    found = []
    for k in np.flatnonzero((sigma[1:-1] < sigma[:-2]) & (sigma[1:-1] <= sigma[2:])) + 1:
        if sigma[k] >= _FAR:
            continue
        at = zero(t[k - 1 : k + 2], sigma[k - 1 : k + 2])
        if at is not None or sigma[k] < NEAR:
            found.append((float(t[k]) if at is None else at, float(sigma[k]), at is not None))
    return found


def reported(reports: Reports) -> list[tuple[float, float]]:
    """(from, to) s: between two reports of the diagnostics it came nearer than NEAR."""
    trace = reports.numbers.get(CLOSEST)
    if trace is None:
        return []
    near = np.flatnonzero(trace.low[:, 0] < NEAR)
    ends = np.append(trace.t[1:], trace.t[-1:]) if trace.group > 1 else trace.t
    return [(float(trace.t[max(0, k - 1)]), float(ends[k])) for k in near]
