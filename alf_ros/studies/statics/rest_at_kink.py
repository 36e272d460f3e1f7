"""Whether a position of rest is stable where a force has a kink, such as a cord that is just taut.

Each side of the kink has its own stiffness. It is evaluated a little away from the position, along
each free direction, both ways. With one freedom there are two sides, and the worse one decides:
the mechanism falls towards it, or stays where it is put there. With more freedoms the position is
undecided if the sides differ: the motion through several sides decides, which is not computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.errors import AssemblyError
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.descent import moved, pushed
from alf_ros.studies.statics.instant import Instant
from alf_ros.studies.statics.rest_stability import (
    NEUTRAL,
    STABLE,
    UNSTABLE,
    RestStability,
    reduced_stiffness,
    stability_of,
)

UNDECIDED = 'undecided'
ON_ONE_SIDE = 'on one side of it'
_AWAY = 1e-8  # of a typical length: beyond what counts as in the kink
_MOST = 20  # directions
_WORST_FIRST = (UNSTABLE, NEUTRAL, STABLE)


def with_both_sides(instant: Instant, told: RestStability) -> tuple[RestStability, str]:
    """The stability at an instant at rest in a kink, and the sides in words, empty if they agree.

    told: the stability of one side.
    """
    if told.verdict == UNDECIDED:
        return told, ''
    verdicts = {told.verdict}
    solve = ConstrainedSolve(instant.model, instant.loads.tangents.cliques)
    length = _AWAY * instant.loads.tangents.length
    for along in instant.velocity_directions.T[:_MOST]:
        for sense in (1.0, -1.0):
            try:
                side = moved(instant, sense * length / float(np.abs(along).max()) * along)
            except AssemblyError:
                continue
            stiffness = reduced_stiffness(side, pushed(side, solve)[1])
            verdicts.add(stability_of(side, stiffness).verdict)
    found = [verdict for verdict in _WORST_FIRST if verdict in verdicts]
    if len(found) == 1:
        return told, ''
    single = told.stiffness.size == 1
    words = f'{ON_ONE_SIDE} the position is {found[0]}, on another {found[-1]}'
    return replace(told, verdict=found[0] if single else UNDECIDED), words
