"""Input and output of the kernel, as structs of arrays.

Conventions. Vectors are flat, block i at [i D, (i + 1) D); D, 2 or 3, is the length of the tuple
`unit` and so a constant when compiled. Movable blocks come first, in elimination order; fixed and
prescribed blocks, for which A has no columns, follow. Rows: distance rows between movable blocks,
distance rows with a fixed end, quadratic rows.

`system`: the mechanism. `forces`: the effects on it. `motion`: state, method and singular modes.
`work`: the workspace. `tangents`, `adjoint`, `force_columns`, `force_trace`: derivatives.
`problem`: these bundled, and numbers that functions of the kernel pass on together. `readings`:
data of samples.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data.adjoint import Adjoint, ForceColumns, StepRecord, Tape
from alf_ros.kernel.data.force_trace import ForceTrace
from alf_ros.kernel.data.forces import Bearings, Effects, ForceDirection, Forces, Kinks, Ledger
from alf_ros.kernel.data.motion import Method, Modes, Phase, Watch
from alf_ros.kernel.data.problem import EVERY_MODE, ModeLimits, Problem, Scales, Span, Until
from alf_ros.kernel.data.readings import (
    Axes,
    BallAngles,
    BlockSums,
    Cut,
    CutWork,
    Forms,
    HeldForces,
    JointCoordinates,
    ReadOut,
    Shares,
)
from alf_ros.kernel.data.system import (
    FREE,
    ORIGIN,
    Arms,
    Departures,
    Integrals,
    Mass,
    Pattern,
    Prescribed,
    Rows,
    Soft,
    System,
)
from alf_ros.kernel.data.tangents import FollowedStage, Tangents
from alf_ros.kernel.data.work import Chart, StepEnd, Trail, Work

SOLVED = 1e-12  # relative change at which a solve is finished
EPS = float(np.finfo(np.float64).eps)
NOTHING = 1e-150  # speeds and accelerations below, SI: a square of it is still a number

__all__ = [
    'EPS',
    'EVERY_MODE',
    'FREE',
    'NOTHING',
    'ORIGIN',
    'SOLVED',
    'Adjoint',
    'Arms',
    'Axes',
    'BallAngles',
    'Bearings',
    'BlockSums',
    'Chart',
    'Cut',
    'CutWork',
    'Departures',
    'Effects',
    'FollowedStage',
    'ForceDirection',
    'ForceColumns',
    'ForceTrace',
    'Forces',
    'Forms',
    'HeldForces',
    'ReadOut',
    'Integrals',
    'JointCoordinates',
    'Kinks',
    'Ledger',
    'Mass',
    'Method',
    'ModeLimits',
    'Modes',
    'Pattern',
    'Phase',
    'Prescribed',
    'Rows',
    'Shares',
    'Problem',
    'Scales',
    'Soft',
    'Span',
    'StepEnd',
    'StepRecord',
    'System',
    'Tape',
    'Tangents',
    'Trail',
    'Until',
    'Watch',
    'Work',
]
