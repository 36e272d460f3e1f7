"""`fork` of a log whose ticks become shorter than one of the steps before."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from alf_ros import Simulation, load_scene
from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.logs.log import Log
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup as settings
from support.log_files import push

CHANGE = 20  # ticks of 2 ms


def log_of(folder: Path, part: int) -> Log:
    """Ticks of one step, of 2 ms and then of a part of it: step and rate are changed at once."""
    setup = settings.made(load_scene('slider_crank'), {'step': 2e-3})
    run = LogRun(folder, setup)
    run.send()
    for tick in range(40):
        if tick == CHANGE:
            push(run, 'coupler', 10.0)
            before = setup.simulation
            solver = dataclasses.asdict(before.solver) | {'step': before.h / part}
            after = Simulation(setup.scene, **solver)
            after.restore(settings.on_grid(before.state, before.h, after.h))
            setup = settings.Setup(setup.scene, after, 1)
            run.use(setup)
            entry = {'kind': 'settings', 'solver': solver, 'steps_per_tick': 1, 'effects': {}}
            run.note(entry)
        setup.simulation.step(setup.steps)
        run.send()
    run.close()
    return load(run.recorder.folder)


@pytest.mark.parametrize('part', [2, 5])
@pytest.mark.parametrize('at', [0.0, 0.01, 2e-3 * CHANGE])
def test_a_fork_is_its_parent(tmp_path: Path, part: int, at: float) -> None:
    log, new = log_of(tmp_path / 'log', part), tmp_path / 'new'
    assert compare(log).equal
    assert main(['fork', str(log.path), '--at', repr(at), '-o', str(new)]) == 0
    child = load(new)
    assert compare(child).equal
    wanted = log.read('~/state').columns['position']
    forked = child.read('~/state').columns['position']
    assert forked.tobytes() == wanted[-len(forked) :].tobytes()
    assert len(forked) == len(wanted) - round(at / 2e-3)
