"""One member of a study: a run of its scene with other numbers, and its outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError, printable
from alf_ros.inspection.run import Run
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.study import Study

LONGEST_REASON = 200  # characters


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
    try:
        return Member(outputs_of(study, simulation_of(study, k)))
    except StoppedError:
        raise
    except AlfError as error:
        reason = str(error)
    except (ArithmeticError, MemoryError) as error:
        reason = f'{type(error).__name__}: {error}'
    except _FunctionError as error:
        reason = str(error)
    return failed(study, reason)


def failed(study: Study, reason: str) -> Member:
    """The row of a member that failed."""
    empty = tuple(np.full(variable.shape, math.nan) for variable in study.variables)
    return Member(empty, printable(reason)[:LONGEST_REASON])


class _FunctionError(Exception):
    """Whatever a function of the user has raised."""


def outputs_of(study: Study, simulation: Simulation) -> tuple[Floats, ...]:
    """The arrays of a member, which is run from its start. Raises StepError, and an exception for
    what a function of the user raises."""
    times, grid = study.instants
    names = [name for output in study.outputs for name in output.quantities]
    everything = any(o.kind == 'function' and not o.reads for o in study.outputs)
    run = Run(simulation.run(study.duration, at=times.tolist()), None if everything else names)
    passes = simulation.passes if study.watch else ()
    return tuple(_arrays(study, run, grid, passes))


def _arrays(study: Study, run: Run, grid: object, passes: object) -> Iterator[Floats]:
    for output in study.outputs:
        try:
            yield from output.read(run, grid, passes)  # type: ignore[arg-type]
        except Exception as error:
            if output.kind != 'function':
                raise
            text = f'function {output.label}: {type(error).__name__}: {error}'
            raise _FunctionError(text) from None
