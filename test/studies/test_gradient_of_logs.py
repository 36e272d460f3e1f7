"""Gradients of recorded runs: their inputs, jumps and settings, and logs that are refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, gradient, load_scene
from alf_ros.__main__ import main as program
from alf_ros.commands.gradient import main
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.ros.recording.fork import fork
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation import setup as settings
from support.arm import arm
from support.log_files import Retold, make, rewritten
from support.thorough import thinned

ARM = arm(1.0)


@pytest.mark.parametrize('integrator', ['rk4', 'esdirk43'])
def test_of_a_log(integrator: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recorded run that is pushed on the way has the derivatives of the tangents."""
    names, file = ['m', 'L'], tmp_path / 'gradient.json'
    scene = overrides.with_changes(load_scene('slider_crank'), {'solver.integrator': integrator})
    (tmp_path / 'scene.yaml').write_text(scene.text, 'utf-8')
    scene = load_scene(tmp_path / 'scene.yaml')
    log, recorded = make(tmp_path / 'log', tmp_path / 'scene.yaml', ticks=30, push_at=10)
    steps = recorded.step_index // 30
    simulation = Simulation(scene, tangents=names)
    simulation.step(9 * steps)
    body = simulation.model.body_names[-1]
    simulation.apply_wrench(body, force=[1.0 / 3.0, 0.0])
    simulation.step(21 * steps)
    assert simulation.state.q.tobytes() == recorded.state.q.tobytes()
    sample = simulation.sample()
    of = ['--of', 'final(points.B.x)', '--by', *names]
    assert main([str(log), *of, '--json', str(file)]) == 0
    printed = capsys.readouterr().out
    told = json.loads(file.read_text('utf-8'))
    for name in names:
        assert told['by'][name] == pytest.approx(sample.tangents[name].points['B'][0], rel=1e-11)
        assert f'{told["by"][name]:.9g}' in printed
    assert told['value'] == sample.points['B'][0]
    assert told['t'] == pytest.approx(simulation.t)
    assert program(['gradient', str(log), *of, '--json', str(tmp_path / 'no' / 'file')]) == 2
    out, err = capsys.readouterr()
    assert out == printed and '--json: No such file' in err and err.count('\n') == 1
    assert program(['gradient', str(log), *of, '--json', '']) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith("alf_ros gradient: --json: no name, got ''")
    of[-len(names) :] = ['gravity.acceleration.x']
    assert program(['gradient', str(log), *of]) == 2
    told = "--by gravity.acceleration.x: no such place in a list, got 'x'; expected 0 for x"
    assert capsys.readouterr().err == f'alf_ros gradient: {told}\n'


def effort_from_tick(folder: Path, scene: Scene, begin: int, ticks: int = 30) -> Path:
    """A log of an arm whose pin gets an effort of 1.5 N m from a tick on."""
    run = LogRun(folder, settings.made(scene, {}))
    simulation, steps = run.setup.simulation, run.setup.steps
    run.send()
    for tick in range(ticks):
        if tick == begin:
            simulation.apply_effort('pin', 1.5)
            run.note({'kind': 'effort', 'cause': 'command', 'name': 'pin', 'effort': 1.5})
        simulation.step(steps)
        run.send()
    run.close()
    return Path(run.recorder.folder)


BEGINS = [0, 2, 10, 29]


@pytest.mark.parametrize(
    ('begin', 'integrator'),
    thinned(product(BEGINS, ['rk4', 'esdirk43']), keep=[(0, 'rk4'), (10, 'esdirk43')]),
)
def test_an_input_that_begins_jumps(begin: int, integrator: str, tmp_path: Path) -> None:
    """No polynomial goes across the jump, and an input from the first step on acts there."""
    scene = load_scene({**ARM, 'solver': {'step': 2e-3, 'integrator': integrator}})
    log = effort_from_tick(tmp_path, scene, begin)
    part = 1.0 - begin / 30
    expected = {
        'max': (1.5, 'N m'),
        'min': (1.5 if begin == 0 else 0.0, 'N m'),
        'mean': (1.5 * part, 'N m'),
        'integral': (1.5 * part * 30 * 2e-3, 'N m s'),
        'rms': (1.5 * np.sqrt(part), 'N m'),
        'final': (1.5, 'N m'),
    }
    for every in (None, 7):
        for fold, (value, unit) in expected.items():
            found = gradient(log, f'{fold}(pin.effort)', ['bar.mass'], every=every)
            assert found.value == pytest.approx(value, abs=1e-14), fold
            assert found.unit == unit


@pytest.mark.parametrize('every', [1, 3, 7])
def test_a_kink_where_an_input_changes(every: int, tmp_path: Path) -> None:
    """The effort turns round at t1: the velocity has its peak there, (m / 3) v = 1.5 t1. A
    polynomial went across it, and its peak was higher."""
    step, turn, ticks = 2e-3, 13, 40
    scene = load_scene({**ARM, 'solver': {'step': step, 'integrator': 'rk4'}})
    run = LogRun(tmp_path, settings.made(scene, {}))
    simulation = run.setup.simulation
    run.send()
    for tick in range(ticks):
        if tick in (0, turn):
            effort = 1.5 if tick == 0 else -3.0
            simulation.apply_effort('pin', effort)
            run.note({'kind': 'effort', 'cause': 'command', 'name': 'pin', 'effort': effort})
        simulation.step(run.setup.steps)
        run.send()
    run.close()
    length = run.setup.steps * step
    t, rest = turn * length, (ticks - turn) * length
    peak = 4.5 * t
    area = 0.5 * peak * t + peak * rest - 4.5 * rest**2
    for of, value in (('max(pin.velocity)', peak), ('integral(pin.velocity)', area)):
        found = gradient(run.recorder.folder, of, ['bar.mass'], every=every)
        assert found.value == pytest.approx(value, rel=1e-9)
        assert found.by['bar.mass'] == pytest.approx(-value, rel=1e-9)
        assert not found.trouble


def test_a_log_of_a_step_and_of_none(tmp_path: Path) -> None:
    """A fork may be shorter than a tick: (m / 3) v' = 1.5 N m with the first v given."""
    scene = load_scene({**ARM, 'solver': {'step': 1e-3, 'integrator': 'rk4'}})
    log = load(effort_from_tick(tmp_path, scene, begin=0, ticks=5))
    step, at = 1e-3, float(log.states.t[2])
    assert log.states.t[1] > 1.5 * step
    short = fork(log, at, {}, tmp_path, 'short', duration=step)
    found = gradient(short, 'final(pin.velocity)', ['bar.mass'])
    assert found.value == pytest.approx(4.5 * (at + step), rel=1e-12)
    assert found.by['bar.mass'] == pytest.approx(-4.5 * step, rel=1e-9)
    none = fork(log, at, {}, tmp_path, 'none', duration=0.0)
    with pytest.raises(InputError, match='none: no gradient: it has not one step'):
        gradient(none, 'final(energy)', ['bar.mass'])


def test_a_log_that_is_not_whole_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The mean of a part differs from the mean of the whole run."""
    log = load(effort_from_tick(tmp_path, load_scene(ARM), 10))
    given = ['--of', 'mean(pin.effort)', '--by', 'bar.mass']
    assert main([str(log.files[0]), *given]) == 0
    assert 'not whole' not in capsys.readouterr().out
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(log.files[0].read_bytes()[:-100])
    assert main([str(cut), *given]) == 0
    out = capsys.readouterr().out
    assert f'the log is not whole: it is the run until t = {load(cut).end:.9g} s (' in out


@pytest.mark.parametrize(
    ('edit', 'said'),
    [
        (lambda k, entry: {**entry, 'effort': 9.0} if k == 1 else entry, 'changed after it'),
        (lambda k, entry: None if k == 1 else entry, 'its inputs give another motion'),
        (lambda k, entry: None if k == 0 else entry, '1 inputs are missing before'),
    ],
    ids=['changed', 'missing', 'the first one is missing'],
)
def test_inputs_that_are_not_the_ones_of_the_run_are_refused(
    edit: Callable[[int, Any], Any],
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = load(effort_from_tick(tmp_path, load_scene(ARM), 10))
    spoilt = rewritten(log.files[0], tmp_path, change=Retold(edit))
    given = ['gradient', str(spoilt), '--of', 'max(pin.effort)', '--by', 'bar.mass']
    assert program(given) == 2
    error = capsys.readouterr().err
    assert said in error and error.count('\n') == 1


@pytest.mark.parametrize('gravity', [None, [0.0, -9.81], [0.0, -1.62]])
def test_settings_that_change_no_motion(gravity: list[float] | None, tmp_path: Path) -> None:
    """As by the parameter `rate` of a node; what changes the motion is named."""
    setup = settings.made(load_scene('slider_crank'), {})
    run, of = LogRun(tmp_path, setup), 'mean(points.B.x)'
    run.send()
    for tick in range(1, 21):
        setup.simulation.step(setup.steps)
        run.send()
        if tick == 10:
            effects = {'effects.gravity.acceleration': gravity} if gravity else {}
            setup = settings.changed(setup, {}, effects, 250.0)
            run.use(setup)
            told = {'solver': asdict(setup.simulation.solver), 'steps_per_tick': setup.steps}
            run.note({'kind': 'settings', **told, 'effects': effects})
    run.close()
    log = run.recorder.folder
    if gravity and gravity[1] != -9.81:
        with pytest.raises(InputError, match=r'acceleration: no gradient: it changes on the way'):
            gradient(log, of, ['m'])
        return
    simulation = Simulation(load_scene('slider_crank'))
    expected = gradient(simulation, of, ['m'], duration=setup.simulation.t, every=2)
    found = gradient(log, of, ['m'])
    assert found.value == pytest.approx(expected.value, rel=1e-13)
    assert found.by['m'] == pytest.approx(expected.by['m'], rel=1e-11)


def test_derivatives_beside_an_input_that_begins(tmp_path: Path) -> None:
    """Against the exact motion of a turning rod: the force in its pin jumps at 0.02 s."""
    scene = {**ARM, 'initial': {'velocities': {'A': [0.0, 1.0]}}}
    scene['solver'] = {'step': 2e-3, 'integrator': 'rk4'}
    log = effort_from_tick(tmp_path, load_scene(scene), 10, ticks=20)
    gain = 3.0 * 1.5  # rad/s², of a rod of 1 m and 1 kg
    t = np.linspace(0.0, 0.02, 2001)
    spin = 1.0 + gain * t
    along, by_mass = 0.5 * spin**2, 0.5 * spin**2 - spin * gain * t  # m l/2 ω²
    force = np.hypot(0.5 * gain, along)  # across: 3/2 of the effort over l, for any mass
    by_mass *= along / force
    before = 0.5 * 0.02  # of m l/2 ω², also its derivative
    cases = {
        'min': (0.5, 0.5),
        'max': (force[-1], by_mass[-1]),
        'integral': (np.trapezoid(force, t) + before, np.trapezoid(by_mass, t) + before),
    }
    for fold, (value, slope) in cases.items():
        found = gradient(log, f'{fold}(norm(reactions.pin.force))', ['bar.mass'])
        assert found.value == pytest.approx(value, rel=1e-8)
        assert found.by['bar.mass'] == pytest.approx(slope, rel=1e-6)
