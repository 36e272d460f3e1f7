"""Whether a position of rest is stable where a force has a kink, such as a cord that is just taut.

Each side of the kink has its own stiffness. It is evaluated a little away from the position, along
each free direction, both ways. The worst side decides: the mechanism falls towards it, or stays
where it is put there. With more than one freedom the position is undecided if some sides are
unstable and others are not: the motion through several sides decides, which is not computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
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
_GROWS = 1.9  # factor over twice the distance, from which up a stiffness is zero in the kink
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
            step = sense * length / float(np.abs(along).max()) * along
            try:
                verdicts.add(_limit(*(_beside(instant, k * step, solve) for k in (1.0, 2.0))))
            except AssemblyError:
                continue
    found = [verdict for verdict in _WORST_FIRST if verdict in verdicts]
    if len(found) == 1:
        return told, ''
    mixed = found[0] == UNSTABLE and told.stiffness.size > 1
    words = f'{ON_ONE_SIDE} the position is {found[0]}, on another {found[-1]}'
    return replace(told, verdict=UNDECIDED if mixed else found[0]), words


def _beside(instant: Instant, step: Floats, solve: ConstrainedSolve) -> RestStability:
    """The stability as it would be after a displacement (n,), m. Raises AssemblyError."""
    side = moved(instant, step)
    return stability_of(side, reduced_stiffness(side, pushed(side, solve)[1]))


def _limit(near: RestStability, far: RestStability) -> str:
    """The verdict of a side in the limit of the kink, from two places of which one is twice as
    far: a stiffness that grows with the distance, as loads do there, is zero in the kink."""
    if near.growth is not None or np.isnan(near.stiffness).any():
        return near.verdict
    grows = np.abs(far.stiffness) > _GROWS * np.abs(near.stiffness)
    least = float(np.where(grows, 0.0, near.stiffness).min(initial=np.inf))
    return STABLE if least > 0.0 else NEUTRAL if least == 0.0 else UNSTABLE
