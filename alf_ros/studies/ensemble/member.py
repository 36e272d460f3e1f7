"""One member of a study: a run of its scene with other numbers, and its outputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError, printable
from alf_ros.inspection.run import Run, RunsTogether
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.singular_passes import Pass
from alf_ros.studies.ensemble.study import Study

LONGEST_REASON = 200  # characters
_CUT = ' …'  # behind the words of a longer one


@dataclass(frozen=True, eq=False)
class Member:
    """`arrays`: of each variable of the study, NaN if the member failed; `reason`: why it did."""

    arrays: tuple[Floats, ...]
    reason: str = ''


def simulation_of(study: Study, k: int) -> Simulation:
    """Member k at its start. Raises InputError, AssemblyError if it cannot begin."""
    return Simulation(study.scene_of(k), watch=study.watch, ledger=study.ledger)


def run_member(study: Study, k: int) -> Member:
    """Run member k. What fails in it is its reason; only a stop from outside is raised."""

    simulations: list[Simulation] = []

    def alone() -> Iterator[Sample]:
        simulations.append(simulation_of(study, k))
        yield from simulations[0].run(study.duration, at=study.instants[0].tolist())

    return member_of(study, alone(), lambda: simulations[0].passes)


def member_of(
    study: Study, samples: Iterable[Sample] | Run, passes: Callable[[], Sequence[Pass]] = tuple
) -> Member:
    """The outputs of a run, from its samples at the instants of the study, or as it was read
    there; `passes`: through singular positions, known when the samples are. What fails in the run
    is its reason."""
    try:
        return Member(outputs_of(study, samples, passes))
    except StoppedError:
        raise
    except (AlfError, ArithmeticError, MemoryError, _FunctionError) as error:
        return failed(study, reason_of(error))


def reason_of(error: Exception) -> str:
    """The reason of a member that ends with this error."""
    if isinstance(error, ArithmeticError | MemoryError):
        return f'{type(error).__name__}: {error}'
    return str(error)


def members_of(study: Study, runs: RunsTogether, count: int) -> list[Member]:
    """`member_of` of so many members that were read together."""
    known = [output.read_together(runs, study.instants[1]) for output in study.outputs]
    if any(each is None for each in known):
        return [member_of(study, runs.run(m)) for m in range(count)]
    arrays = [array for each in known if each is not None for array in each]
    return [Member(own) for own in zip(*arrays, strict=True)]


def trouble_of(study: Study, k: int) -> str:
    """`Diagnostics.trouble` of member k at its end, with an integrator of fixed steps or with
    drives; empty if it is sound, or fails."""
    try:
        simulation = simulation_of(study, k)
        if simulation.solver.method.embedded.size and not simulation.scene.mechanism.drives:
            return ''  # its errors are within the tolerance
        for sample in simulation.run(study.duration, at=[study.duration]):
            said = sample.diagnostics.trouble
        return said
    except StoppedError:
        raise
    except (AlfError, ArithmeticError, MemoryError):
        return ''


def failed(study: Study, reason: str) -> Member:
    """The row of a member that failed."""
    empty = tuple(np.full(variable.shape, math.nan) for variable in study.variables)
    return Member(empty, _fitting(printable(reason)))


def _fitting(reason: str) -> str:
    """At most `LONGEST_REASON` characters, cut between words: half a number is another number."""
    if len(reason) <= LONGEST_REASON:
        return reason
    kept = reason[: LONGEST_REASON - len(_CUT)]
    return (kept.rpartition(' ')[0] or kept) + _CUT


class _FunctionError(Exception):
    """Whatever a function of the user has raised."""


def outputs_of(
    study: Study, samples: Iterable[Sample] | Run, passes: Callable[[], Sequence[Pass]]
) -> tuple[Floats, ...]:
    """The arrays of a member. Raises what its run raises, and an exception for what a function of
    the user raises."""
    run = samples if isinstance(samples, Run) else Run(samples, study.quantities)
    return tuple(_arrays(study, run, study.instants[1], passes() if study.watch else ()))


def _arrays(study: Study, run: Run, grid: object, passes: object) -> Iterator[Floats]:
    for output in study.outputs:
        try:
            yield from output.read(run, grid, passes)  # type: ignore[arg-type]
        except (Exception, SystemExit) as error:  # whatever somebody's function raises
            if output.kind != 'function':
                raise
            text = f'function {output.label}: {type(error).__name__}: {error}'
            raise _FunctionError(text) from None
