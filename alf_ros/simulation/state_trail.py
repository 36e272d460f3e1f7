"""States on the way of a run, as arrays, from one compiled call."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Phase, Trail


@dataclass(frozen=True, eq=False)
class StateArrays:
    """q, qd (N, blocks D), turns (N, angles), dq and dqd (N, K, blocks D): what a run passed."""

    q: Floats
    qd: Floats
    turns: Integers
    dq: Floats
    dqd: Floats


class StateTrail:
    """The states of a run at given steps (N,), ascending: from the present one, `phase`, on."""

    def __init__(self, steps: Integers, phase: Phase) -> None:
        N = steps.size
        self._whole = phase.q.size
        self.trail = Trail(
            steps=np.array(steps, dtype=np.int64),
            count=np.zeros(1, dtype=np.int64),
            q=np.zeros(N * phase.q.size),
            qd=np.zeros(N * phase.q.size),
            turns=np.zeros(N * phase.turns.size, dtype=np.int64),
            tangents=np.zeros(N * phase.tangents.size),
        )
        if N and steps[0] == phase.step[0]:
            for name in ('q', 'qd', 'turns', 'tangents'):
                now = getattr(phase, name)
                getattr(self.trail, name)[: now.size] = now
            self.trail.count[0] = 1

    @property
    def arrays(self) -> StateArrays:
        """Of the steps passed so far."""
        of, N, whole = self.trail, int(self.trail.count[0]), self._whole
        total = of.steps.size
        carried = of.tangents.reshape(total, of.tangents.size // (2 * total * whole), 2, whole)[:N]
        return StateArrays(
            of.q.reshape(total, whole)[:N],
            of.qd.reshape(total, whole)[:N],
            of.turns.reshape(total, -1)[:N],
            carried[:, :, 0],
            carried[:, :, 1],
        )
