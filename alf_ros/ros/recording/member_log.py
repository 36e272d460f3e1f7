"""A member of an ensemble run again alone, into a log."""

from __future__ import annotations

from pathlib import Path

from alf_ros.errors import StepError
from alf_ros.logs.progress import Report, silent
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.setup import made
from alf_ros.studies.ensemble.study import Study


def log_member(study: Study, k: int, folder: Path, report: Report = silent) -> tuple[Path, str]:
    """Run member k and write its log into a new folder below `folder`.

    Returns the folder of the log, and why the member fails on the way; empty if it does not.
    Raises InputError for a member that there is not, that cannot begin, or a log that cannot be
    made.
    """
    k = check.whole(k, 'log', 0, study.members - 1)
    setup = made(study.scene_of(k), {}, ledger=study.ledger)
    simulation = setup.simulation
    about = {'study': study.digest, 'member': k, 'values': study.samples.values(k)}
    name = f'{study.name}_member_{k}'
    run, reason = LogRun(folder, setup, about={'ensemble': about}, name=name), ''
    try:
        run.send()
        last = check.steps_of(study.duration, simulation.h, 0)
        while simulation.step_index < last:
            simulation.step(min(setup.steps, last - simulation.step_index))
            run.send()
            report(simulation.step_index / last)
    except StepError as error:
        reason = str(error)
    finally:
        run.close()
    return run.recorder.folder, reason
