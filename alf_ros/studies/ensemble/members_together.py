"""Members of a study, stepped side by side where they have a place there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alf_ros.errors import AlfError
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.side_by_side import SideBySide, no_place
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.member import Member, member_of, run_member, simulation_of
from alf_ros.studies.ensemble.study import Study

_REGISTERS = 8  # of members at a time


def run_members(study: Study, members: Sequence[int]) -> list[Member]:
    """Run members, in their order: each with the bits of `run_member`."""
    found: list[Member] = []
    some = _REGISTERS * width()
    for first in range(0, len(members), some):
        found += _run(study, members[first : first + some])
    return found


def _run(study: Study, members: Sequence[int]) -> list[Member]:
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
    return [done[k] if k in done else run_member(study, k) for k in members]


def _told(samples: Sequence[Sample], error: AlfError | None) -> Iterator[Sample]:
    yield from samples
    if error is not None:
        raise error
