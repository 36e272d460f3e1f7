"""`analyze`: what it gathers against the whole log, and its page in a browser, without network."""

import base64
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from alf_ros import Simulation, load_scene
from alf_ros.commands.analyze import main
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.logs.report.commands import MOST_HELD, MOST_TEXTS, Orders, held_before
from alf_ros.logs.report.decimation import Instants, Trace
from alf_ros.logs.report.drawn_motion import mechanism, motion
from alf_ros.logs.report.gather import Label, gather
from alf_ros.logs.report.html import packed, page
from alf_ros.logs.report.singularity_distance import distances
from alf_ros.logs.report.summary import account
from alf_ros.logs.tables import to_csv, to_parquet
from alf_ros.ros.recording.fork import fork
from support.browser import CHROMIUM, Browser
from support.forked import ended
from support.full_disk import small_files
from support.log_files import Retold, make, rewritten
from support.parallel_cranks import THREE_CRANKS
from support.paths import ROOT
from support.ros_node import START_LIMIT, SimulatorProcess
from support.thorough import LONG

needs_chromium = pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')


@pytest.fixture(scope='module')
def planar(tmp_path_factory):
    return make(tmp_path_factory.mktemp('planar'), 'slider_crank', ticks=1000)[0].parent


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Of the node, with diagnostics: through the first singular position of the slider-crank."""
    folder = tmp_path_factory.mktemp('recorded')
    with SimulatorProcess(folder, '--duration', '2') as process:
        assert process.process.wait(60.0) == 0, process.output
    (log,) = (path for path in folder.iterdir() if path.is_dir())
    return log


# ------------------------------------------------------------------------------- bounded memory


@pytest.mark.parametrize('pieces', [[5000], [1] * 700, [3, 1000, 17, 4096, 1, 2000]])
def test_a_trace_keeps_every_peak_in_order(pieces):
    rng = np.random.default_rng(sum(pieces))
    n = sum(pieces)
    t, values = np.arange(n) * 0.5, rng.standard_normal((n, 3))
    values[rng.integers(n, size=n // 7), 1] = np.nan
    trace = Trace(3, 64)
    for part in np.split(np.arange(n), np.cumsum(pieces)[:-1]):
        trace.add(t[part], values[part])
    group = trace.group
    assert 32 < len(trace.t) <= 64 and group & (group - 1) == 0
    assert np.array_equal(trace.t, t[::group])
    for k in range(len(trace.t)):
        some = values[k * group : (k + 1) * group]
        assert np.array_equal(trace.low[k], np.nanmin(some, axis=0), equal_nan=True)
        assert np.array_equal(trace.high[k], np.nanmax(some, axis=0), equal_nan=True)


def test_frames_are_evenly_spaced():
    frames, t = Instants(100), np.arange(12_345.0)
    for part in np.array_split(t, 77):
        frames.add(part, part[:, None])
    assert frames.stride == 128 and np.array_equal(frames.t, t[::128])
    assert np.array_equal(frames.values[:, 0], frames.t)


def test_a_flood_of_commands_takes_bounded_memory():
    orders, n, names = Orders(), 100_000 if LONG else 40_000, ['crank', 'coupler', 'A']
    entries = [
        {'step': k, 'kind': 'wrench', 'name': names[k % 3], 'force': [float(k), 0.0]}
        for k in range(n)
    ]
    t = np.arange(n, dtype=np.float64) * 1e-3
    for part in np.array_split(np.arange(n), 10):
        orders.add(t[part], [entries[k] for k in part])
    assert orders.count == n
    assert len(orders.held) <= MOST_HELD and len(orders.texts) <= MOST_TEXTS
    for name in names:  # what is held is the last command, or one just before it
        trace = orders.traces['wrench', name]
        assert trace.high.max() >= n - 3
        held = [each for each in orders.held if each.name == name]
        assert held[-1].force[0] >= n - 3
        times = np.array([each.t for each in held])
        assert np.diff(times).max() < 0.1


def on_the_page(values):
    """The numbers as the page unpacks them."""
    found = packed(np.array(values))
    if isinstance(found, float):
        return np.full(len(values), found)
    numbers = np.frombuffer(base64.b64decode(found['f32']), '<f4')
    return numbers.astype(float) + found.get('base', 0.0)


def test_the_drift_of_an_energy_survives_float32():
    energy = 13.603384190106665 + 1e-9 * np.sin(np.arange(500.0))
    assert np.ptp(energy.astype(np.float32)) == 0.0
    assert np.abs(on_the_page(energy) - energy).max() < 1e-14
    energy[7] = np.nan
    assert np.abs(np.delete(on_the_page(energy) - energy, 7)).max() < 1e-14


@pytest.mark.parametrize(
    'values', [[0.0, 0.0], [0.1, 0.1], [1e300, 1e300], [np.nan] * 2, [np.inf, 1.0], [0.0, 1e-20]]
)
def test_other_numbers_come_through(values):
    assert on_the_page(values) == pytest.approx(values, rel=1e-6, abs=0.0, nan_ok=True)


# ----------------------------------------------------------------------------------- what it finds


def test_it_gathers_what_the_log_has(planar):
    log = load(planar)
    found = gather(log)
    assert found.counts == log.survey.counts and (found.first, found.last) == (0.0, log.end)
    signals = {
        label: (s.trace, n) for s in found.signals.values() for n, label in enumerate(s.labels)
    }

    def column(*label):
        trace, n = signals[Label(*label)]
        assert trace.group == 1 and np.array_equal(trace.low[:, n], trace.high[:, n])
        return trace.high[:, n]

    joints, wrenches = log.read('joint_states'), log.read('reactions').columns['wrench']
    knee = joints.names.index('knee')
    for key in ('position', 'velocity', 'effort'):
        assert np.array_equal(column(key, 'knee'), joints.columns[key][:, knee])
    assert np.array_equal(column('force', 'knee', 'y'), wrenches[:, knee, 1])
    assert np.allclose(column('force', 'knee', 'size'), np.hypot(*wrenches[:, knee, :2].T))
    assert np.array_equal(column('energy', 'energy'), log.read('energy').columns['data'][:, 0])
    phi = np.abs(log.read('constraints').columns['position'])
    assert np.array_equal(column('violation', 'largest |Φ|'), phi.max(axis=1))
    assert found.worst[0] == phi.max()
    (entry,) = log.inputs[1:]
    assert found.orders.count == 1
    assert found.orders.traces['wrench', 'coupler'].t[0] == entry['t']
    said = dict(account(log).about)['solver']
    assert 'step 0.001' in said and 'None' not in said


def test_the_motion_is_that_of_the_run(planar):
    log = load(planar)
    found = motion(gather(log), mechanism(log))
    again = Simulation(load_scene('slider_crank'))
    for k in range(0, 200, 40):
        assert again.step_index == 2 * k
        points, model = again.sample().points, again.model
        expected = np.array([points[name] for name in model.point_names])
        # a push begins at tick 99
        if k < 99:
            assert np.array_equal(found.places[k, : len(expected), :2], expected)
        again.step(80)
    assert found.angles == {'crank_pin', 'knee'} and not found.spatial
    assert np.isnan(found.applied[98]).all()
    # held at the middle of the coupler
    assert found.applied[101, 0, 3:].tolist() == [1.0 / 3.0, 0.0, 0.0]
    ends = [found.places[101, again.model.point_names.index(name)] for name in 'AB']
    assert np.allclose(found.applied[101, 0, :3], np.mean(ends, axis=0), atol=1e-12)


def test_a_fork_begins_with_the_commands_held(planar, tmp_path):
    """They stand in its state, not in an entry of their own."""
    found = account(load(fork(load(planar), 0.5, {}, tmp_path, duration=0.1)))
    trace = found.found.orders.traces['wrench', 'coupler']
    assert trace.t.tolist() == [0.5] and trace.high[0, 0] == 1.0 / 3.0
    assert np.all(found.motion.applied[:, 0, 3:] == [1.0 / 3.0, 0.0, 0.0])
    (text,) = (text for _, _, text in found.texts if 'coupler' in text)
    assert text == (
        'step 500, wrench coupler: cause: held before, force: [0.333333, 0.0], torque: 0.0, '
        'frame: world'
    )


@pytest.mark.parametrize('inputs', [None, 3, {'wrenches': [1]}, {'efforts': {'A': 'x'}}])
def test_what_is_held_in_a_damaged_state_is_passed_over(inputs):
    start = {'step': 0, 't': 0.0, 'kind': 'start', 'state': {'inputs': inputs}}
    assert held_before(start) == []


def test_passes_are_found_where_a_watched_run_finds_them(recorded):
    simulation = Simulation(load_scene('slider_crank'), watch=True)
    simulation.step(2000)
    log = load(recorded)
    found = account(log)
    expected = [each.t for each in simulation.passes]
    assert len(expected) == 2
    marked = [t for t, _, through in found.motion.passes if through]
    assert np.allclose(marked, expected, atol=1e-5)
    assert sum('pass through' in text for _, _, text in found.texts) == 2


def test_distances_are_those_of_samples(planar):
    log = load(planar)
    again = Simulation(load_scene('slider_crank'))
    expected = []
    for _ in range(5):
        expected.append(again.sample().diagnostics.distance)
        again.step(30)
    states = log.states
    found = distances(mechanism(log), states.t[:75:15], states.q[:75:15])
    assert np.allclose(found.sigma, expected, rtol=1e-6)
    assert np.all(found.error < 1e-6)


def test_of_too_many_states_only_the_diagnostics_tell_passes(recorded, monkeypatch):
    monkeypatch.setattr('alf_ros.logs.report.gather.MOST_STATES', 500)
    found = account(load(recorded))
    simulation = Simulation(load_scene('slider_crank'), watch=True)
    simulation.step(2000)
    assert found.motion.stride == 4 and found.motion.passes is None
    for each in simulation.passes:
        assert any(begin < each.t <= end for begin, end in found.passes)
    assert all(end - begin < 1.5 for begin, end in found.passes)
    assert any('diagnostics' in note for note in found.notes)
    assert 'diagnostics: least' in page([found])


def test_diagnostics_become_levels_and_curves(recorded):
    log = load(recorded)
    reports = gather(log).reports
    messages = log.read('/diagnostics').messages
    tasks = [status['name'].rpartition(': ')[2] for status in messages[-1]['status']]
    assert list(reports.levels) == tasks
    for n, task in enumerate(tasks):
        levels = [message['status'][n]['level'] for message in messages]
        assert reports.levels[task].high[:, 0].tolist() == levels
    assert any(level == 1 and text.startswith('constraints') for _, level, text in reports.texts)
    costs = reports.numbers['cost', 'step'].high[:, 0]
    assert len(costs) == len(messages) and np.nanmax(costs) > 0.0


def test_shares_of_loads_are_told(tmp_path, recorded):
    (tmp_path / 'cranks.yaml').write_text(THREE_CRANKS)
    arguments = '--scene', str(tmp_path / 'cranks.yaml'), '--duration', '0.2'
    with SimulatorProcess(tmp_path / 'logs', *arguments) as process:
        assert process.process.wait(60.0) == 0, process.output
    (log,) = (path for path in (tmp_path / 'logs').iterdir() if path.is_dir())
    names = ', '.join(f'{side}{k}' for side in ('foot', 'head') for k in range(3))
    told = f'reactions of {names}: one of many that balance: constraints are redundant'
    assert ('indeterminate', told) in account(load(log)).about
    assert not any(what == 'indeterminate' for what, _ in account(load(recorded)).about)


def test_the_work_of_effects_is_read_where_a_log_has_it(planar, tmp_path):
    """A ledger in the place of the constraints."""

    def as_ledger(topic, data):
        if topic == '/simulator/constraints':
            before = deserialize_message(data, JointState)
            works = {'name': ['gravity', 'motor'], 'position': [1.0, 2.0]}
            return serialize_message(JointState(header=before.header, **works))
        return data

    (file,) = planar.glob('*.mcap')
    log = load(rewritten(file, tmp_path, change=as_ledger))
    log.info['topics']['~/work'] = log.info['topics'].pop('~/constraints')
    found = gather(log)
    labels = {label for key in found.signals for label in key}
    assert {Label('work', 'gravity'), Label('work', 'motor')} <= labels


def test_a_log_that_was_cut_off_is_shown_as_far_as_it_goes(planar, tmp_path):
    (file,) = planar.glob('*.mcap')
    chunked = rewritten(file, tmp_path).read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(chunked[: len(chunked) // 2])
    found = account(load(cut))
    assert found.faults and 'cut off' in found.faults[0]
    assert 0.0 < found.last < load(planar).end and found.motion is not None
    assert 'cut off' in page([found])


def test_missing_messages_are_counted(planar, tmp_path):
    (file,) = planar.glob('*.mcap')
    seen = []

    def thinned(topic, data):
        seen.append(topic)
        dropped = topic == '/joint_states' and seen.count(topic) in (5, 6, 7)
        return None if dropped else data

    found = account(load(rewritten(file, tmp_path, change=thinned)))
    assert found.faults == ['3 messages of /joint_states are missing']


def test_a_log_without_states_has_plots_and_says_why_nothing_moves(planar, tmp_path):
    (file,) = planar.glob('*.mcap')
    found = account(
        load(rewritten(file, tmp_path, change=lambda t, d: None if t == '/simulator/state' else d))
    )
    assert found.motion is None and found.found.signals
    assert any('no animation' in note for note in found.notes)


def test_no_code_of_a_log_is_run(planar, tmp_path):
    """An effect from a file that is gone keeps nobody from looking at the motion."""
    scene, effect = tmp_path / 'scene.yaml', tmp_path / 'lift.py'
    shutil.copy(ROOT / 'alf_ros/effects/gravity.py', effect)
    scene.write_text(
        f'mechanism: slider_crank\neffects:\n  {effect}: {{acceleration: [0, -9.81]}}\n'
    )
    log = make(tmp_path / 'logs', str(scene), ticks=20, push_at=10)[0]
    effect.unlink()
    # another process: in this one the effect has run
    code = f"""
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.logs.report.summary import account
try:
    load({str(log)!r}).scene()
except InputError:
    print(account(load({str(log)!r})).motion is not None)
"""
    run = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert run.stdout == 'True\n', run.stderr


# ------------------------------------------------------------------------------------ the command


@pytest.mark.parametrize('kind', ['csv', 'parquet'])
def test_tables_that_find_the_disk_full_are_one_line(planar, tmp_path, kind):
    """A file that is closed writes the rest, and fails once more."""
    if kind == 'parquet':
        pytest.importorskip('pyarrow')
    log, write = load(planar), {'csv': to_csv, 'parquet': to_parquet}[kind]
    inputs, *tables = [path.stat().st_size for path in write(log, tmp_path / 'whole')]
    most = max(tables) - 1  # the end of the largest table has no room
    assert most > inputs
    with (
        small_files(most),
        pytest.raises(InputError, match=r'full: cannot be written: .*File too large'),
    ):
        write(log, tmp_path / 'full')


def test_the_command_writes_page_and_tables(planar, tmp_path, capsys):
    target = tmp_path / 'page.html'
    tables = ['--csv', str(tmp_path / 'csv')]
    assert main([str(planar), '-o', str(target), *tables]) == 0
    assert str(target) in capsys.readouterr().out
    assert (tmp_path / 'csv/joint_states.csv').is_file()
    assert main([str(planar), str(planar), '-o', str(target), *tables]) == 0
    for name in (planar.name, f'{planar.name}_1'):
        assert (tmp_path / 'csv' / name / 'joint_states.csv').is_file()


def test_parquet_where_it_can_be_written(planar, tmp_path):
    parquet = tmp_path / 'parquet'
    argv = [str(planar), '-o', str(tmp_path / 'page.html'), '--parquet', str(parquet)]
    if importlib.util.find_spec('pyarrow') is None:  # optional: who has it not is told
        with pytest.raises(InputError, match='pip install pyarrow'):
            main(argv)
    else:
        assert main(argv) == 0
        assert (parquet / 'simulator_reactions.parquet').is_file()


def test_it_stands_beside_the_log(planar, tmp_path):
    log = Path(shutil.copytree(planar, tmp_path / 'run'))
    assert main([str(log)]) == 0
    assert main([str(log), str(log)]) == 0
    assert {path.name for path in tmp_path.glob('*.html')} == {'run.html', 'run_compared.html'}


def test_what_cannot_be_done_is_one_line(planar, tmp_path):
    for arguments in ([], [tmp_path / 'none'], [planar, '-o', tmp_path / 'no' / 'page.html']):
        command = ['-m', 'alf_ros', 'analyze', *map(str, arguments)]
        done = ended(command, ROOT, dict(os.environ), START_LIMIT)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1


def test_a_page_never_replaces_a_file_of_its_log(planar, tmp_path):
    log = shutil.copytree(planar, tmp_path / 'log')
    (link := tmp_path / 'page.html').symlink_to(next(log.glob('*.mcap')))
    before = {file: file.read_bytes() for file in log.iterdir()}
    for target in (*before, link):
        with pytest.raises(InputError, match='--output: a file of the log, and left as it is'):
            main([str(log), '-o', str(target)])
    assert {file: file.read_bytes() for file in log.iterdir()} == before


def test_a_name_cannot_end_the_data(planar, tmp_path):
    found = account(load(planar))
    found.name = '</script><script>alert(1)</script>'
    text = page([found])
    assert text.count('</script>') == 2
    data = re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.S)[1]
    assert json.loads(data)['logs'][0]['name'] == found.name


def test_nothing_is_fetched(planar):
    text = page([account(load(planar))])
    assert 'http:' not in text and 'https:' not in text
    assert "default-src 'none'" in text


# ------------------------------------------------------------------------------------ the browser

INK = """((canvas) => {
    const dots = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let found = 0;
    for (let n = 0; n < dots.length; n += 4) {
        const [r, g, b, alpha] = dots.subarray(n, n + 4);
        if (alpha > 128 && Math.max(r, g, b) - Math.min(r, g, b) > 45) found++;
    }
    return found;
})"""  # dots with a colour: curves and arrows; lines and grid are grey
STAGE = "document.getElementById('stage')"


def area(panel):
    return f'document.querySelector(\'[data-panel="{panel}"] canvas\')'


def opened(paths, tmp_path):
    target = tmp_path / 'page.html'
    assert main([*map(str, paths), '-o', str(target)]) == 0
    return Browser(target.as_uri(), tmp_path / 'profile', (1400, 900))


def check(browser, panels):
    """Every panel and the stage are drawn, nothing went wrong, nothing was asked for."""
    browser.run('goTo(0.4 * view.first + 0.6 * view.last)')
    browser.until(f'{INK}({STAGE}) > 50')
    for panel in panels:
        browser.until(f'{INK}({area(panel)}) > 50')
    assert browser.complaints == []


@needs_chromium
def test_the_page_of_a_recorded_log(recorded, tmp_path):
    with opened([recorded], tmp_path) as browser:
        panels = ['timeline', 'position.angle', 'position.length', 'velocity.angle', 'force']
        check(browser, [*panels, 'energy', 'violation', 'distance', 'iterations', 'cost'])
        # a click sets the time everywhere
        image = browser.run(f'{STAGE}.toDataURL()')
        browser.click('[data-panel=energy] .area', along=0.75)
        at = browser.run('view.t')
        assert 1.2 < at < 1.7
        assert browser.run("document.getElementById('time').textContent") == f'{at:.3f} s'
        browser.until(f"{STAGE}.toDataURL() !== '{image}'")
        moved = "new Set([...document.querySelectorAll('.cursor')].map((c) => c.style.transform))"
        assert browser.run(f'{moved}.size') == 1
        # the curve's value there is that of the log
        log = load(recorded)
        joints = log.read('joint_states')
        k = np.searchsorted(log.time(joints.stamp), at) - 1
        value = browser.run(
            'document.querySelector(\'[data-panel="position.angle"] .chip b\').textContent'
        )
        assert abs(float(value) - joints.columns['position'][k, 0]) < 0.01
        # zoom, play, curves off
        browser.click('#in')
        assert browser.run('view.to - view.from') == pytest.approx(1.0, rel=0.01)
        before = browser.run(f'{area("force")}.toDataURL()')
        browser.click('[data-panel=force] .chip')
        browser.until(f"{area('force')}.toDataURL() !== '{before}'")
        browser.click('#all')
        browser.click('#play')
        browser.until(f'view.t > {at} + 0.1 || view.t < {at}')
        browser.click('#play')
        assert browser.complaints == []


@needs_chromium
def test_two_logs_lie_over_each_other(planar, tmp_path):
    other = fork(load(planar), 0.5, {'coupler.mass': '2.0'}, tmp_path)
    with opened([planar, other], tmp_path) as browser:
        check(browser, ['position.angle', 'force', 'energy', 'wrench', 'timeline'])
        browser.run('goTo(1.0)')
        text = browser.run("document.querySelector('[data-panel=energy] .chip b').textContent")
        energies = [float(value) for value in text.split('|')]
        assert energies[1] > energies[0] + 1.0
        assert browser.run('motions.length') == 2
        # a command early in view is seen over the long name of its row
        row = "plots[0].rows.findIndex((row) => row.label === 'A wrench coupler')"
        number, t, width = browser.run(
            f'[{row}, plots[0].rows[{row}].t[0], {area("timeline")}.clientWidth]'
        )
        browser.run(f'zoomTo({t} - 0.03, {t} + 0.97)')
        place = f'xOf({t}, {width}), MARGIN.top + 15 * {number} + 7'
        dot = f'[{place}].map((x) => Math.round(x * devicePixelRatio))'
        dot = f"{area('timeline')}.getContext('2d').getImageData(...{dot}, 1, 1).data"
        browser.until(f'{dot}[2] - {dot}[0] > 100')
        assert 'coupler.mass = 2.0' in browser.run("document.getElementById('about').textContent")


@needs_chromium
def test_a_mechanism_in_space_turns_under_the_hand(tmp_path):
    log = make(tmp_path, 'spatial_slider_crank', ticks=200)[0]
    with opened([log], tmp_path) as browser:
        check(browser, ['position.angle', 'force', 'energy'])
        # an energy that hardly changes: the axis has no mark beyond its ends, such as its base
        marks = browser.run('ticks(13.2943666666665, 13.2943666666669, 4).found')
        assert 3 <= len(marks) <= 6 and marks[-1] <= 13.2943666666669
        assert browser.run('stage.spatial')
        before = browser.run(f'{STAGE}.toDataURL()')
        browser.run('stage.camera.yaw += 1; draw()')
        browser.until(f"{STAGE}.toDataURL() !== '{before}'")


@needs_chromium
def test_a_long_log_shows_its_peak(planar, tmp_path):
    """One energy of many is far off: it is seen, whatever was left out."""
    count = 0

    def spike(topic, data):
        nonlocal count
        count += topic == '/simulator/energy'
        if topic == '/simulator/energy' and count == 777:
            return serialize_message(Float64(data=1e3))
        return data

    (file,) = planar.glob('*.mcap')
    log = rewritten(file, tmp_path, change=spike)
    with opened([log], tmp_path) as browser:
        check(browser, ['energy'])
        plot = "plots.find((plot) => plot.panel?.key === 'energy')"
        curve = f'columns({plot}.curves[0], 100)'
        assert browser.run(f'{curve}.x.length') <= 100
        assert browser.run(f'Math.max(...{curve}.high)') == 1e3


@needs_chromium
def test_a_log_without_anything_is_a_page_too(planar, tmp_path):
    (file,) = planar.glob('*.mcap')
    log = rewritten(file, tmp_path, change=lambda topic, data: None)
    with opened([log], tmp_path) as browser:
        text = browser.run("document.getElementById('about').textContent")
        assert 'empty' in text and 'no animation' in text
        assert browser.complaints == []


HOSTILE = '</script><img src=x onerror="window.owned=1"><script>window.owned=1</script>'


@needs_chromium
def test_names_of_strangers_stay_text(planar, tmp_path):
    """Of scene, versions, joints, commands and parents of a log: written, never read as HTML."""

    def record(name, texts):
        if name == 'alf_ros':
            texts['scene'] = HOSTILE
            texts['versions'] = json.dumps({'alf_ros': HOSTILE, 'cpu': HOSTILE})
            texts['parent'] = json.dumps(
                {'log': HOSTILE, 't': HOSTILE, 'changes': {HOSTILE: HOSTILE}}
            )
        return texts

    def change(topic, data):
        if topic != '/joint_states':
            return retold(topic, data)
        message = deserialize_message(data, JointState)
        message.name[0] = HOSTILE
        return serialize_message(message)

    def edited(k, entry):
        return {**entry, 'name': HOSTILE, 'frame': HOSTILE} if 'name' in entry else entry

    retold = Retold(edited)
    path = rewritten(next(planar.glob('*.mcap')), tmp_path, change=change, record=record)
    path = path.rename(tmp_path / "<img src=x onerror='window.owned=1'>_0.mcap")
    with opened([path, path], tmp_path) as browser:
        browser.until("document.body.textContent.includes('window.owned=1')")
        browser.run('goTo(0.4 * view.first + 0.6 * view.last)')
        assert browser.run('window.owned') is None
        assert browser.run("document.querySelectorAll('img, iframe, object').length") == 0
        assert browser.run("document.querySelectorAll('script').length") <= 2
        assert browser.complaints == []
