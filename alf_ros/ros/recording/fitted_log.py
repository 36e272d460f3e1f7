"""The run of a scene with fitted numbers over a recording, as a log."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from alf_ros.errors import StepError
from alf_ros.logs.progress import Report, silent
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation.setup import made
from alf_ros.studies.identification.identified import Identification


def log_fitted(
    found: Identification, folder: Path, name: str = '', report: Report = silent
) -> tuple[Path, str]:
    """Run the fitted scene from the start of the first fitted window to the end of its recording,
    with the recorded inputs, into a new log below `folder`.

    Returns the folder of the log, and why the run fails on the way; empty if it does not. The run
    is one, not one a window, so that it leaves the recording in time. Raises InputError for a log
    that cannot be made.
    """
    window, runs = found.windows[0], found.runs
    solver = dataclasses.asdict(runs.reference.solver)
    setup = made(found.fitted_scene, {**solver, 'accuracy': None})
    simulation = setup.simulation
    state = runs.state(simulation, window, found.starts[0])
    own = [w for w in (*found.windows, *found.kept_away) if w.recording == window.recording]
    last = max(each.last for each in own)
    recording = found.recordings[window.recording]
    inputs = list(recording.by_step(window.first, last, simulation.h))
    values = dict(zip(found.names, found.values.tolist(), strict=True))
    about = {'identification': {'recording': recording.name, 'values': values}}
    run, reason = LogRun(folder, setup, state=state, about=about, name=name), ''
    try:
        run.send()
        while simulation.step_index < last:
            tick = min(simulation.step_index + setup.steps, last)
            while inputs and inputs[0][0] < tick:
                step, held = inputs.pop(0)
                simulation.step(step - simulation.step_index)
                held.apply(simulation)
                run.note(held.entry)
            simulation.step(tick - simulation.step_index)
            run.send()
            report((tick - window.first) / (last - window.first))
    except StepError as error:
        reason = str(error)
    finally:
        run.close()
    return run.recorder.folder, reason
