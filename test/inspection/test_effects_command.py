"""Command `effects`: its list is complete, and its prices agree with the effects."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from alf_ros import Simulation, effects
from alf_ros.__main__ import main
from alf_ros.inspection.effect_costs import effect_costs
from alf_ros.inspection.effects_table import table
from alf_ros.scene.scene import scene_from_text

SCENE = """
name: priced
mechanism: slider_crank
effects:
  gravity: {acceleration: [0, -9.81]}
  drag:
    crank: {on: crank, quadratic: 0.05}
    nothing: {on: coupler, linear: 0}
  joint_friction: {joint: crank_pin, viscous: 0.1}
  joint_stop: {joint: guide, upper: 3, stiffness: 1000}
initial: {velocities: {B: [-4.0, 0]}}
"""


def test_lists_every_effect_with_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['effects']) == 0
    told = capsys.readouterr().out
    for kind in effects.kinds():
        (head,) = [line for line in told.splitlines() if line.startswith((f'{kind}:', f'{kind},'))]
        below = told.partition(head)[2].partition('\n\n')[0]
        for name, field in effects.load(kind).Parameters.__dataclass_fields__.items():
            (line,) = [x for x in below.splitlines() if x.startswith(f'  {name} ')]
            assert field.metadata['doc'] in line and field.metadata.get('unit', '') in line


def test_prices_of_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'priced.yaml').write_text(SCENE)
    folder = tmp_path / 'out'
    assert main(['effects', str(tmp_path / 'priced.yaml'), '--folder', str(folder)]) == 0
    assert 'drag.nothing' in capsys.readouterr().out
    comment, *lines = (folder / 'priced.csv').read_text().splitlines()
    assert comment.startswith('# ')
    rows = {row['effect']: row for row in csv.DictReader(lines)}
    names = ['gravity', 'drag.crank', 'drag.nothing', 'joint_friction', 'joint_stop']
    assert list(rows) == ['(none)', '(all)', *names]
    changes = {name: float(rows[name]['position_change_m']) for name in names}
    assert changes['drag.nothing'] == changes['joint_stop'] == 0.0  # bit for bit
    assert changes['gravity'] > 0.1 and changes['drag.crank'] > 1e-4
    # differences of times depend on the machine: only the whole ones must be positive
    assert all(math.isfinite(float(row['added_us'])) for row in rows.values())
    assert min(float(rows[name]['added_us']) for name in ('(none)', '(all)')) > 0.0
    assert float(rows['joint_friction']['work_J']) < -0.1
    assert float(rows['drag.nothing']['rate_per_s']) == 0.0
    rate = float(rows['joint_friction']['rate_per_s'])
    assert 0.01 < rate <= float(rows['(all)']['rate_per_s'])
    assert float(rows['joint_friction']['rk4_step_s']) == pytest.approx(2.785 / rate, rel=1e-3)
    assert (folder / 'priced.png').read_bytes()[:4] == b'\x89PNG'


def test_work_of_all_effects_is_the_kinetic_energy_gained() -> None:
    scene = scene_from_text(SCENE)
    found = effect_costs(scene, 0.5)
    sim = Simulation(scene)
    start, end = sim.run(0.5, every=500)
    weight = 1.0 * 9.81  # of each of the two rods
    rise = sum(
        weight * 0.5 * (end.points[name] - start.points[name])[1] for name in ('O', 'A', 'A', 'B')
    )
    work = {effect.label: effect.work for effect in found.effects}
    assert work['gravity'] == pytest.approx(-rise, abs=1e-4)
    taken = sum(work.values()) - work['gravity']
    assert end.energy - start.energy == pytest.approx(taken, abs=1e-4)
    assert work['drag.nothing'] == 0.0


def test_an_effect_without_which_nothing_runs() -> None:
    """Two effects balance each other: the change without either is infinite; drag is priced."""
    scene = scene_from_text(
        'mechanism:\n  alf: 1\n  points: {P: {at: [0, 0]}}\n'
        '  bodies: {mass: {points: [P], mass: 1.0, inertia: point}}\n'
        'effects:\n  drag: {on: P, quadratic: 1}\n  constant_wrench:\n'
        '    left: {on: P, force: [-1e39, 0]}\n    right: {on: P, force: [1e39, 0]}\n'
    )
    found = effect_costs(scene, 0.01)
    changes = {effect.label: effect.change for effect in found.effects}
    assert changes == {
        'drag': 0.0,
        'constant_wrench.left': math.inf,
        'constant_wrench.right': math.inf,
    }
    assert table(found).count('no run') == 2


@pytest.mark.parametrize(
    'argv, message',
    [
        (['nowhere'], 'no scene of this name'),
        (['slider_crank', '--duration', '-1'], 'not a duration'),
        (['slider_crank', '--folder', '/dev/null/x', '--duration', '0.002'], 'Not a directory'),
        (['--what'], 'unrecognized'),
    ],
)
def test_wrong_arguments(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['effects', *argv]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count('\n') == 1


def test_a_scene_without_effects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'bare.yaml').write_text('mechanism: slider_crank\n')
    assert main(['effects', str(tmp_path / 'bare.yaml')]) == 2
    assert 'no effects' in capsys.readouterr().err
