"""How many members are one piece of work, where the study does not say it: about two seconds.

The size follows from the study alone, not from what a machine measures, as the files of a store
must not depend on the machine. So the cost of a member is counted: evaluations of its equations,
each with a usual time. Members that are stepped side by side cost less than those alone, and
members that are made together less than those that are built (`members_together`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from alf_ros.errors import AlfError, StepError
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.side_by_side import is_adaptive, no_place
from alf_ros.studies.ensemble.member import simulation_of
from alf_ros.studies.ensemble.structures import read_together
from alf_ros.studies.ensemble.study import MOST_AT_ONCE, Study

# Measured with the scenes of the package, s. Building: of a member, and each of its coordinates.
_BUILT, _COORDINATE, _SAMPLE = 2e-3, 5e-5, 5e-5
_EVALUATION, _OF_COORDINATE = 1e-7, 1.2e-7
# in lanes; alone, members near singular positions go on
_MADE_TOGETHER, _SAMPLE_TOGETHER, _IN_LANES = 3e-5, 5e-7, 0.21
_WORK = 2.0  # s
_LEAST_CHUNKS = 64  # of a study: then no worker waits long for the last one
_LEAST_IN_LANES = 16  # members: fewer are stepped alone, and take about as long
_LARGEST = 2.0**24  # bytes of the arrays of a chunk
_TRIED = 200  # steps of a member, to learn how many evaluations they take
_LOOKED_AT = 8  # members, if their solvers differ


class MemberCost(NamedTuple):
    """About how long a member takes, s, without functions of the user, if it runs beside others;
    and whether it can be stepped side by side with them."""

    seconds: float
    is_in_lanes: bool


def cost_of(study: Study) -> MemberCost:
    """Of the members of a study."""
    several = any(name.partition('.')[0] == 'solver' for name, _ in study.vary)
    costs: list[MemberCost] = []
    for k in _some(study):
        try:
            costs.append(_cost(study, k))
        except (AlfError, ArithmeticError, MemoryError):
            continue  # a member that fails is soon done
        if not several:
            break
    if not costs:
        return MemberCost(_BUILT, False)
    seconds = [cost.seconds for cost in costs]
    return MemberCost(sum(seconds) / len(seconds), all(cost.is_in_lanes for cost in costs))


def size_of(study: Study, cost: MemberCost) -> int:
    """How many members of this cost are a chunk: a power of 2."""
    values = sum(math.prod(variable.shape) for variable in study.variables) + len(study.vary)
    at_once = min(MOST_AT_ONCE, _LARGEST / (8 * values))
    by_work = round(math.log2(max(1.0, _WORK / cost.seconds)))
    size = min(by_work, math.floor(math.log2(max(1.0, at_once))))
    shared = math.ceil(math.log2(max(1.0, study.members / _LEAST_CHUNKS)))
    least = int(math.log2(_LEAST_IN_LANES)) if cost.is_in_lanes else 0
    return 1 << max(min(size, shared), least)


def _some(study: Study) -> Iterator[int]:
    """The first members; if these have an order of their own, some that are spread over it."""
    count = min(study.members, _LOOKED_AT)
    spread = study.sampling in ('grid', 'table')
    return (k * study.members // count if spread else k for k in range(count))


def _cost(study: Study, k: int) -> MemberCost:
    """Of member k. Raises AlfError if it cannot begin."""
    simulation = simulation_of(study, k)
    n, method = simulation.model.n, simulation.solver.method
    steps = check.steps_of(study.duration, simulation.h, 0)
    instants = study.instants[0]
    is_in_lanes = not no_place(simulation)
    is_made_together = (
        is_in_lanes
        and study.quantities is not None
        and read_together(simulation, study.quantities, instants.tolist()) is not None
    )
    tried, before = min(steps, _TRIED), simulation.evaluations
    try:
        simulation.step(tried)
    except StepError:
        tried = max(1, simulation.step_index)
    each = (simulation.evaluations - before) / tried
    if is_in_lanes:
        usual = each if is_adaptive(simulation) else min(each, method.c.size)
        each += (_IN_LANES - 1.0) * usual
    spent = steps * each * (_EVALUATION + _OF_COORDINATE * n)
    if is_made_together:
        return MemberCost(_MADE_TOGETHER + _SAMPLE_TOGETHER * len(instants) + spent, True)
    built = _BUILT + _COORDINATE * n + _SAMPLE * len(instants)
    return MemberCost(built + spent, is_in_lanes)
