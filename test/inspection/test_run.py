"""A run as a table: names, values as the samples have them, and files that others read back."""

from __future__ import annotations

import csv
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pyarrow.parquet
import pytest
import xarray
from matplotlib.image import imread

import alf_ros
from alf_ros import InputError, Run, Simulation, load_scene, record
from alf_ros.scene.scene import scene_from_text
from support.forked import ended
from support.parallel_cranks import THREE_CRANKS
from support.paths import ROOT
from support.reader import START_LIMIT

SCENES = ('slider_crank', 'wiper', 'stewart_platform', 'screw_jack')


@pytest.fixture(scope='module')
def crank() -> Run:
    return record(Simulation(load_scene('slider_crank'), ledger=True), 0.5, every=10)


@pytest.mark.parametrize('name', SCENES)
def test_every_quantity_is_that_of_the_samples(name: str) -> None:
    """A name is a path in Sample: the run has the value at its end, for every sample."""
    simulation = Simulation(load_scene(name), ledger=True)
    other = Simulation(load_scene(name), ledger=True)
    run = record(simulation, 0.1, every=20)
    samples = list(other.run(0.1, every=20))
    assert run.t.tolist() == [sample.t for sample in samples]
    for full in run.names:
        section, _, rest = full.partition('.')
        for values, sample in zip(run[full], samples, strict=True):
            assert np.array_equal(values, read(sample, section, rest), equal_nan=True), full


def read(sample: Any, section: str, rest: str) -> Any:
    """The value that a user of Sample reads."""
    found = getattr(sample, section)
    if section == 'diagnostics':
        return getattr(found, rest)
    if section == 'body_poses':
        return found[sample.model.body_names.index(rest)]
    if section == 'drives':
        name, what = rest.rsplit('.', 1)
        if what == 'effort' and name in sample.drive_efforts:
            (effort,) = sample.drive_efforts[name]
            return effort
        kinds = {'position': 0, 'velocity': 1, 'effort': 2}
        return found[kinds[what]][motions(sample).index(name)]
    if section in ('joints', 'reactions'):
        name, what = rest.rsplit('.', 1)
        return getattr(found[name], what)
    return found[rest] if rest else found


def motions(sample: Any) -> tuple[str, ...]:
    from alf_ros.model.constraints.drives import motion_names

    return motion_names(sample.model.mechanism)


def test_the_end_of_a_name_and_a_component(crank: Run) -> None:
    force = crank['reactions.crank_pin.force']
    assert force.shape == (len(crank), 2) and np.ptp(force) > 1.0
    assert np.array_equal(crank['crank_pin.force'], force)
    assert np.array_equal(crank['crank_pin.force.y'], force[:, 1])
    assert list(crank.columns('crank_pin.force.y')) == ['reactions.crank_pin.force.y']
    units = {'crank_pin.force': 'N', 'guide.position': 'm', 'knee.position': 'rad'}
    assert {name: crank.unit(name) for name in units} == units
    assert crank.unit('body_poses.crank') == 'm, rad'
    assert crank.unit('body_poses.crank.angle') == 'rad'


def test_the_works_are_the_change_of_kinetic_energy(crank: Run) -> None:
    works = sum(crank[name] for name in crank.names if name.startswith('works.'))
    kinetic = crank['kinetic_energy']
    assert works == pytest.approx(kinetic - kinetic[0], abs=1e-6)


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('crank_pn.force', "did you mean 'crank_pin.force'?"),
        ('kinetic_enrgy', "did you mean 'kinetic_energy'?"),
        ('A', "more than one quantity ends so, got 'A'; expected points.A or velocities.A"),
        ('crank_pin.force.z', "name: no such quantity, got 'crank_pin.force.z'; did you mean"),
        ('pin.efort', "name: no such quantity, got 'pin.efort'; did you mean 'crank_pin.effort'"),
        ('B.z', "name: no such quantity, got 'B.z'; expected points.B.y or velocities.B.y"),
        (3, 'name: no such quantity, got 3'),
        ('', 'name: no such quantity'),
    ],
)
def test_a_name_that_is_none(crank: Run, name: Any, message: str) -> None:
    for call in (crank.__getitem__, crank.unit, crank.columns, crank.plot):
        with pytest.raises(InputError) as caught:
            call(name)
        assert message in str(caught.value) and '\n' not in str(caught.value)


def test_only_what_is_asked_for_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(sample: Any) -> None:
        raise AssertionError('reactions are computed')

    simulation = Simulation(load_scene('slider_crank'))
    monkeypatch.setattr(alf_ros.Sample, 'reaction_forces', property(refuse))
    run = record(simulation, 0.1, only=['knee.position', 'energy'])
    assert run.names == ('joints.knee.position', 'energy') and len(run) == 101
    with pytest.raises(AssertionError, match='computed'):
        record(simulation, 0.1)


def test_a_period_between_the_steps() -> None:
    """`period=` gives the instants that `run(at=…)` gives, and the same motion."""
    one, other = (Simulation(load_scene('slider_crank'), step=0.002) for _ in range(2))
    one.step(3)
    other.step(3)
    run = record(one, 0.1, period=0.003, only=['points.B'])
    times = 0.006 + 0.003 * np.arange(34)
    assert run.t == pytest.approx(times, abs=1e-15)
    places = [sample.points['B'] for sample in other.run(0.1, at=run.t.tolist())]
    assert np.array_equal(run['points.B'], places)
    assert (one.t, one.step_index) == (other.t, 53)


@pytest.mark.parametrize(
    ('keywords', 'message'),
    [
        ({'every': 0.01}, 'every: not usable, got 0.01; expected a whole number'),
        ({'period': 0.0}, 'period: not usable, got 0.0; expected s, more than 0'),
        ({'period': float('nan')}, 'period: not usable, got nan'),
        ({'period': 1e-300}, 'period: too many samples'),
        ({'period': 1e-15}, 'period: too many samples'),
        ({'every': 2, 'period': 0.1}, 'period: `every` states it already'),
        ({'only': 'energy'}, "only: not a list of names, got 'energy'"),
        ({'only': ['enrgy']}, "only: no such quantity, got 'enrgy'; did you mean 'energy'?"),
        ({'duration': -1.0}, 'duration: not usable, got -1.0'),
    ],
)
def test_a_refused_call_has_taken_no_step(keywords: dict[str, Any], message: str) -> None:
    simulation = Simulation(load_scene('pendulum'))
    with pytest.raises(InputError) as caught:
        record(simulation, **{'duration': 1.0, **keywords})
    assert str(caught.value).startswith(message)
    assert simulation.step_index == 0


def test_what_is_no_simulation_and_no_sample() -> None:
    with pytest.raises(InputError, match='simulation: not a simulation, got 3'):
        record(3, 1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="samples: not a sample, got 'a'"):
        Run('a')  # type: ignore[arg-type]
    with pytest.raises(InputError, match='samples: no samples'):
        Run([])


def test_nothing_in_it_can_be_changed(crank: Run) -> None:
    for values in (crank.t, crank['energy'], crank['crank_pin.force']):
        with pytest.raises(ValueError, match='read-only'):
            values[0] = 0.0


def test_csv_reads_back_exactly(crank: Run, tmp_path: Path) -> None:
    with open(crank.csv(tmp_path / 'run.csv'), newline='', encoding='utf-8') as stream:
        head, *rows = csv.reader(stream)
    expected = {'t': crank.t, **crank.columns()}
    assert head == list(expected)
    assert np.array_equal(np.array(rows, dtype=float).T, [*expected.values()], equal_nan=True)


def test_parquet_and_frame_read_back_exactly(crank: Run, tmp_path: Path) -> None:
    table = pyarrow.parquet.read_table(crank.parquet(tmp_path / 'run.parquet'))
    assert table.schema.field('reactions.knee.force.x').metadata == {b'unit': b'N'}
    assert table.schema.field('t').metadata == {b'unit': b's'}
    pandas.testing.assert_frame_equal(table.to_pandas().set_index('t'), crank.frame())
    assert np.array_equal(crank.frame()['energy'], crank['energy'])


def test_xarray_reads_back_from_a_dataset(crank: Run) -> None:
    found = crank.xarray()
    assert isinstance(found, xarray.Dataset) and list(found.data_vars) == list(crank.names)
    pin = found['reactions.crank_pin.force']
    assert pin.dims == ('t', 'axis') and pin.attrs == {'units': 'N'}
    assert np.array_equal(pin.sel(axis='y'), crank['crank_pin.force.y'])
    angle = found['body_poses.crank'].sel(pose='angle')
    assert np.array_equal(angle, crank['body_poses.crank.angle'])
    assert found['t'].attrs == {'units': 's'} and np.array_equal(found['t'], crank.t)


def test_plot_has_a_panel_for_each_unit(crank: Run, tmp_path: Path) -> None:
    file = tmp_path / 'picture.png'
    panels = crank.plot('crank_pin.force', 'energy', 'knee.force.x', file=file)
    assert [axes.get_ylabel() for axes in panels] == ['N', 'J']
    lines = {str(line.get_label()): line for axes in panels for line in axes.get_lines()}
    assert list(lines) == [*crank.columns('crank_pin.force', 'knee.force.x'), 'energy']
    for name, line in lines.items():
        assert np.array_equal(line.get_xydata(), np.column_stack([crank.t, crank[name]]))
    shades = imread(file)[..., :3]
    assert shades.shape[1] == 960 and np.unique(shades.reshape(-1, 3), axis=0).shape[0] > 100


def test_a_share_of_a_load_is_marked(tmp_path: Path) -> None:
    """Three parallel cranks carry a platform. Along them their forces are one of many; the weight
    and what accelerates it are not. The cranks begin upright, so that their force along x is known
    at first, and the last sample is looked at too."""
    run = pickle.loads(pickle.dumps(record(Simulation(scene_from_text(THREE_CRANKS)), 0.3)))
    forces = tuple(f'reactions.{side}{k}.force' for side in ('foot', 'head') for k in range(3))
    assert run.indeterminate == forces
    assert run.is_indeterminate('head1.force.x') and not run.is_indeterminate('energy')
    assert not run.is_indeterminate('foot0.torque')
    said = 'one of many that balance: constraints are redundant'
    found = run.xarray()
    assert {name for name in found if 'indeterminate' in found[name].attrs} == set(forces)
    assert found['reactions.head1.force'].attrs == {'units': 'N', 'indeterminate': said}
    found.to_netcdf(tmp_path / 'run.nc', engine='scipy')
    table = pyarrow.parquet.read_schema(run.parquet(tmp_path / 'run.parquet'))
    told = {b'unit': b'N', b'indeterminate': said.encode()}
    assert table.field('reactions.head1.force.x').metadata == told
    (forces_panel, _) = run.plot('head1.force.x', 'energy', file=tmp_path / 'run.png')
    (line,) = forces_panel.get_lines()
    assert line.get_label() == 'reactions.head1.force.x, one of many'


def test_what_is_determined_is_not_marked(crank: Run) -> None:
    assert crank.indeterminate == () and not crank.is_indeterminate('crank_pin.force')
    with pytest.raises(InputError, match='no such quantity'):
        crank.is_indeterminate('crank_pin.forces')


@pytest.mark.parametrize(
    'write', [Run.csv, Run.parquet, lambda run, path: run.plot('energy', file=path)]
)
def test_a_file_that_cannot_be_written(
    crank: Run, tmp_path: Path, write: Callable[[Run, Path], object]
) -> None:
    missing = tmp_path / 'no folder' / 'run.png'
    with pytest.raises(InputError, match='run.png: cannot be written'):
        write(crank, missing)


def test_pictures_that_cannot_be(crank: Run, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'no format of a picture, got .*; expected \.png'):
        crank.plot('energy', file=tmp_path / 'run.xyz')
    with pytest.raises(InputError, match='plot: nothing to draw'):
        crank.plot()


@pytest.mark.parametrize(
    ('module', 'call', 'message'),
    [
        ('matplotlib', "plot('energy')", "plot needs matplotlib: pip install 'alf_ros[plot]'"),
        ('pyarrow', "parquet('x')", "Parquet needs pyarrow: pip install 'alf_ros[table]'"),
        ('pandas', 'frame()', "a DataFrame needs pandas: pip install 'alf_ros[table]'"),
        ('xarray', 'xarray()', "a Dataset needs xarray: pip install 'alf_ros[table]'"),
    ],
)
def test_without_what_only_one_way_out_needs(
    module: str, call: str, message: str, tmp_path: Path
) -> None:
    """Blocked from the start: the others work, and this one says in one line what to install."""
    (tmp_path / 'blocked.py').write_text(f"""
import sys
sys.modules['{module}'] = None
from alf_ros import InputError, Simulation, load_scene, record
run = record(Simulation(load_scene('pendulum')), 0.01, only=['energy'])
run.csv('/dev/null')
try:
    run.{call}
except InputError as error:
    print(error)
""")
    done = ended(['blocked.py'], tmp_path, {**os.environ, 'PYTHONPATH': str(ROOT)}, START_LIMIT)
    assert (done.stdout.strip(), done.stderr) == (message, '')


def test_the_extras_are_those_of_the_package() -> None:
    text = (ROOT / 'setup.py').read_text('utf-8')
    assert "'table': ['pandas', 'pyarrow', 'xarray']" in text and "'plot': ['matplotlib']" in text
