"""Members of a study, made and stepped together where they have a place there.

Members of one structure, whose outputs need no more than states, are never simulations of their
own (`Structures`). Others are built one by one, and stepped side by side. The rest runs alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alf_ros.errors import AlfError, StoppedError
from alf_ros.inspection.run import RunReader
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.side_by_side import SideBySide, no_place
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.member import (
    Member,
    failed,
    member_of,
    members_of,
    reason_of,
    run_member,
    simulation_of,
)
from alf_ros.studies.ensemble.structures import Runs, Structures
from alf_ros.studies.ensemble.study import Study

_REGISTERS = 8  # of members at a time


def run_members(study: Study, members: Sequence[int]) -> list[Member]:
    """Run members, in their order: each with the bits of `run_member`."""
    done = _of_known_structure(study, members)
    left = [k for k in members if k not in done]
    some = _REGISTERS * width()
    for first in range(0, len(left), some):
        done |= _side_by_side(study, left[first : first + some])
    return [done[k] if k in done else run_member(study, k) for k in members]


def _of_known_structure(study: Study, members: Sequence[int]) -> dict[int, Member]:
    """The members that are made together with others of their structure."""
    if len(members) < 2 * width() or study.quantities is None or study.watch or study.ledger:
        return {}
    try:  # another thread may take the last one
        structures = study.idle.pop()
    except IndexError:
        at = study.instants[0].tolist()
        structures = Structures(study.quantities, study.duration, at, len(members))
    done: dict[int, Member] = {}

    def take(found: Iterator[Runs]) -> None:
        for own, runs in found:
            done.update(zip(own, members_of(study, runs, len(own)), strict=True))

    left = list(members)
    if not structures.known:
        take(structures.run(_scenes(study, left[: 2 * width()])))
        left = left[2 * width() :]
    if left and structures.known:
        take(structures.run_read_together(left, study.scene_of_members, study.scene_of))
        left = [k for k in left if k not in done]
    if left:
        take(structures.run(_scenes(study, left)))
    study.idle.append(structures)
    return done


def _scenes(study: Study, members: Sequence[int]) -> Iterator[tuple[int, Scene]]:
    """The members that have a scene, with it."""
    for k in members:
        try:
            scene = study.scene_of(k)
        except (AlfError, ArithmeticError, MemoryError):
            continue  # alone it fails again, and says why
        yield k, scene


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
            readers = [RunReader(study.quantities) for _ in group]
            failures = _read(list(group.values()), study, readers)
            for n, (k, reader) in enumerate(zip(group, readers, strict=True)):
                if n in failures:
                    done[k] = failed(study, reason_of(failures[n]))
                else:
                    done[k] = member_of(study, reader.run())
    return done


def _read(
    simulations: Sequence[Simulation], study: Study, readers: Sequence[RunReader]
) -> dict[int, Exception]:
    """Run simulations and read each sample at once, as one that runs alone is read: samples of
    all members would need much memory. Returns what fails first, by number."""
    failures: dict[int, Exception] = {}

    def look(n: int, sample: Sample) -> None:
        if n in failures:
            return
        try:
            readers[n].read(sample)
        except StoppedError:
            raise
        except (AlfError, ArithmeticError, MemoryError) as error:
            failures[n] = error

    beside = SideBySide(simulations)
    ended = beside.run(study.duration, study.instants[0].tolist(), look)
    return {**ended, **failures}
