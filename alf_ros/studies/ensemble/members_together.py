"""Members of a study, made and stepped together where they have a place there.

Members of one geometry, whose outputs need no more than states, are never simulations of their
own (`AlikeMembers`). Others are built one by one, and stepped side by side. The rest runs alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alf_ros.errors import AlfError, StoppedError
from alf_ros.inspection.run import run_of_arrays
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.simulation.alike_members import AlikeMembers
from alf_ros.simulation.member_numbers import MemberNumbers, unlike
from alf_ros.simulation.member_readings import readable
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.side_by_side import SideBySide, no_place
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.member import Member, member_of, run_member, simulation_of
from alf_ros.studies.ensemble.study import Study

_REGISTERS = 8  # of members at a time
_TRIED = 3  # members, of which one is to be like the others


def run_members(study: Study, members: Sequence[int]) -> list[Member]:
    """Run members, in their order: each with the bits of `run_member`."""
    done = _of_one_geometry(study, members)
    left = [k for k in members if k not in done]
    some = _REGISTERS * width()
    for first in range(0, len(left), some):
        done |= _side_by_side(study, left[first : first + some])
    return [done[k] if k in done else run_member(study, k) for k in members]


def _of_one_geometry(study: Study, members: Sequence[int]) -> dict[int, Member]:
    """The members that are like the first ones."""
    done: dict[int, Member] = {}
    if len(members) < 2 * width() or study.quantities is None or study.watch or study.ledger:
        return done
    try:  # another thread may take the last one
        alike = study.idle.pop()
    except IndexError:
        alike = _first_of(study, members)
    if alike is not None:
        for begin in range(0, len(members), alike.most):
            found = _alike(study, alike, members[begin : begin + alike.most])
            if not found:
                alike = None
                break
            done |= found
    study.idle.append(alike)
    return done


def _first_of(study: Study, members: Sequence[int]) -> AlikeMembers | None:
    """For members like the first one that can be built; None if it has to be built by itself, or
    if outputs need more than its states."""
    for k in members[:_TRIED]:
        try:
            first = simulation_of(study, k)
            quantities = readable(first, study.quantities or ())
            if quantities is None or unlike(first) or no_place(first):
                return None
            alike = AlikeMembers(first, quantities)
            return alike if alike.reads_at(study.instants[0].tolist()) else None
        except (AlfError, ArithmeticError, MemoryError):
            continue
    return None


def _alike(study: Study, alike: AlikeMembers, members: Sequence[int]) -> dict[int, Member]:
    """The members that come to the end in the usual way, of some."""
    numbers: dict[int, MemberNumbers] = {}
    others = 0
    for k in members:
        try:
            own = alike.numbers_of(study.scene_of(k))
        except (AlfError, ArithmeticError, MemoryError):
            continue  # alone it fails again, and says why
        if own is not None:
            numbers[k] = own
        else:
            others += 1
        if others == _TRIED and len(numbers) < 2:  # the first one is always like itself
            return {}
    if not numbers:
        return {}
    try:
        t, values, good = alike.run(
            list(numbers.values()), study.duration, study.instants[0].tolist()
        )
    except StoppedError:
        raise
    except AlfError:
        return {}
    found = {}
    for m, k in enumerate(numbers):
        if good[m]:
            own_values = [each[m] for each in values]
            run = run_of_arrays(t, dict(zip(alike.quantities, own_values, strict=True)))
            found[k] = member_of(study, run)
    return found


def _side_by_side(study: Study, members: Sequence[int]) -> dict[int, Member]:
    """The members that can be stepped side by side, of some."""
    together: dict[tuple[float, str], dict[int, Simulation]] = {}
    for k in members:
        try:
            simulation = simulation_of(study, k)
        except (AlfError, ArithmeticError, MemoryError):
            continue  # alone it fails again, and says why
        if not no_place(simulation):
            kind = simulation.h, simulation.solver.integrator
            together.setdefault(kind, {})[k] = simulation
    done: dict[int, Member] = {}
    for group in together.values():
        if len(group) > 1:
            beside = SideBySide(list(group.values()))
            runs = beside.run(study.duration, study.instants[0].tolist())
            for k, (samples, error) in zip(group, runs, strict=True):
                done[k] = member_of(study, _told(samples, error))
    return done


def _told(samples: Sequence[Sample], error: AlfError | None) -> Iterator[Sample]:
    yield from samples
    if error is not None:
        raise error
