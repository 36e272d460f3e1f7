"""Write the tables of the documents, and the peers' picture, from the results.

    .venv/bin/python benchmark/tables.py

What stands between <!-- name --> and <!-- end of name --> is replaced; nothing there is typed.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import statistics
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros.studies.work_precision.measurement import Measurement, Setting  # noqa: E402
from alf_ros.studies.work_precision.report import (  # noqa: E402
    TARGETS,
    Summary,
    cost_to_reach,
    curves,
    sentence,
    table,
)
from alf_ros.studies.work_precision.sweep import measurement_of  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
DOCUMENTS = (
    'README.md',
    'doc/performance.md',
    'doc/reliability.md',
    'doc/new_user.md',
    'doc/closing_loops.md',
    'doc/import.md',
    'doc/identification.md',
)
SURVIVAL = (0.01 / 60, 0.01 / 5)  # s, steps of the sweep
STIFF = 1e-4  # m
LOST = 1e-2  # m: above it, it is another motion
WHY = 100  # characters of a reason
MECHANISMS = {
    'slider_crank': 'slider-crank',
    'double_four_bar': 'two four-bars',
    'n_four_bar': 'ten four-bars',
}
COLOURS = ('#0072b2', '#56b4e9', '#002d47', '#8c8ccf', '#d55e00', '#009e73', '#cc79a7')


def rows(name: str) -> tuple[str, list[dict[str, str]]]:
    """The machine and versions, and the rows of a CSV file."""
    with open(RESULTS / name, encoding='utf-8') as stream:
        about = next(stream).lstrip('# ').strip()
        return about, list(csv.DictReader(stream))


def markdown(about: str, head: str, body: list[list[str]]) -> str:
    """A table below what it is about; `head`: the titles of its columns, a bar between."""
    columns = head.count('|') + 1
    lines = [f'| {head} |', '|---' * columns + '|', *(f'| {" | ".join(row)} |' for row in body)]
    return '\n'.join([f'{about}.\n', *lines]) + '\n'


def work_precision() -> str:
    """A sentence and a table for each scene."""
    about, found = rows('work_precision.csv')
    parts = [f'{about}. ms of processor time per simulated second.\n']
    for scene in dict.fromkeys(row['scene'] for row in found):
        mine = [row for row in found if row['scene'] == scene]
        error, force = (
            float(mine[0][f'reference_{what}']) for what in ('error_m', 'force_error_N')
        )
        duration, kind = float(mine[0]['duration_s']), mine[0]['reference']
        summary = Summary(
            scene, duration, kind, error, force, [measurement_of(row) for row in mine]
        )
        parts += [f'**{sentence(summary)}**\n', f'{table(summary)}\n']
        parts += [f'![{scene}: cost and errors](../benchmark/results/{scene}.png)\n']
    return '\n'.join(parts)


def peer_points() -> tuple[str, dict[str, dict[str, list[Measurement]]]]:
    """By mechanism and engine, the most accurate first."""
    about, found = rows('peers.csv')
    points: dict[str, dict[str, list[Measurement]]] = {}
    for row in found:
        step, tolerance = (float(row[k]) if row[k] else None for k in ('step_s', 'tolerance'))
        error, cpu = (
            float(row[k]) if row[k] else math.nan for k in ('position_error_m', 'cpu_ms_per_s')
        )
        setting = Setting(row['peer'], '', 0, step or 0.1, tolerance)
        nothing = (math.nan,) * 3
        point = Measurement(setting, cpu, 1, 0.0, 0.0, error, *nothing, row['failure'])
        points.setdefault(row['mechanism'], {}).setdefault(row['peer'], []).append(point)
    for engines in points.values():
        for curve in engines.values():
            curve.sort(key=lambda point: point.setting.effort)
    return about, points


def engine_versions() -> list[str]:
    """Names and versions of the engines."""
    _, found = rows('peers.csv')
    return list(dict.fromkeys(row['about'].partition(',')[0] for row in found))


def survived(curve: list[Measurement]) -> list[Measurement]:
    """The runs of the sweep."""
    low, high = (factor * step for factor, step in zip((0.999, 1.001), SURVIVAL, strict=True))
    return [p for p in curve if p.setting.tolerance is None and low < p.setting.step < high]


def lost(point: Measurement) -> bool:
    """Whether a run did not end, or ended on another motion."""
    return bool(point.failure) or not point.position < LOST


def cheapest(curve: list[Measurement], error: float) -> float:
    """Of the runs below an error (m), lucky ones too; infinite if there is none."""
    return min((p.cpu for p in curve if not p.failure and p.position <= error), default=math.inf)


def peers() -> str:
    """Survival and cost of every engine."""
    about, points = peer_points()
    costs = ' | '.join(f'{target:.0e} m' for target in TARGETS)
    parts = [f'{about}; {", ".join(engine_versions())}.\n']
    for mechanism, engines in points.items():
        parts += [
            f'| {MECHANISMS[mechanism]}, 10 s | lost | median error, m | worst, m | {costs} |',
            '|---' * (4 + len(TARGETS)) + '|',
        ]
        for engine, curve in engines.items():
            sweep = survived(curve)
            cells = ['-'] * 3
            if sweep:
                errors = [math.inf if p.failure else p.position for p in sweep]
                cells = [f'{sum(map(lost, sweep))} of {len(sweep)}']
                cells += [f'{x:.0e}' for x in (statistics.median(errors), max(errors))]
            found = [cheapest(curve, target) for target in TARGETS]
            cells += ['-' if math.isinf(cost) else f'{cost:.3g}' for cost in found]
            parts.append(f'| {engine} | {" | ".join(cells)} |')
        parts.append('')
    return '\n'.join(parts)


def engines() -> str:
    """Runs lost and cost of every engine, in a line for each: for the README."""
    about, points = peer_points()
    shown = ('slider_crank', 'double_four_bar')
    columns = [f'{1e0 * target:.0e} m' for target in TARGETS[:2]]
    names = list(dict.fromkeys(engine for name in shown for engine in points[name]))
    body = []
    for engine in names:
        cells = []
        for mechanism in shown:
            curve = points[mechanism].get(engine, [])
            sweep = survived(curve)
            cells.append(f'{sum(map(lost, sweep))} of {len(sweep)}' if sweep else '-')
            costs = [cheapest(curve, target) for target in TARGETS[:2]]
            cells += ['-' if math.isinf(cost) else f'{cost:.3g} ms' for cost in costs]
        body.append([engine, *cells])
    titles = [f'{MECHANISMS[name]}: {each}' for name in shown for each in ('lost', *columns)]
    said = f'{about}; {", ".join(engine_versions())}'
    return markdown(said, ' | '.join(['engine', *titles]), body)


def stiff() -> str:
    """The cost of an error with each integrator, for every rate of the load on its spring."""
    about, found = rows('stiff.csv')
    points: dict[float, list[Measurement]] = {}
    for row in found:
        tolerance = float(row['tolerance']) if row['tolerance'] else None
        setting = Setting('alf2', row['integrator'], 0, float(row['step_s']), tolerance)
        cpu, evaluations, position = (
            float(row[k]) for k in ('cpu_ms_per_s', 'evaluations_per_s', 'position_m')
        )
        unknown = math.nan
        point = Measurement(
            setting, cpu, 0, unknown, evaluations, position, unknown, unknown, unknown
        )
        point = dataclasses.replace(point, failure=row['failure'])
        points.setdefault(float(row['rate_per_s']), []).append(point)
    names = list(dict.fromkeys(row['integrator'] for row in found))
    body = []
    for rate, mine in points.items():
        of = {curve[1]: cost_to_reach(each, STIFF) for curve, each in curves(mine).items()}
        cells = ['-' if of[name] is None else f'{of[name].cpu:.3g}' for name in names]
        body.append([f'{rate:.0f}', *cells])
    said = f'{about}. ms of processor time per simulated second for {1e3 * STIFF:g} mm'
    return markdown(said, ' | '.join(['√(k/m), 1/s', *(f'`{name}`' for name in names)]), body)


def stage_cost() -> str:
    """The cost of a stage, for each number of four-bars."""
    about, found = rows('stage_cost.csv')
    body = []
    for row in found:
        bars, spent = int(row['four_bars']), float(row['us_per_stage'])
        links = 2 * bars + 1
        body.append([f'{bars}', f'{links}', f'{spent:.3g}', f'{1e3 * spent / links:.3g}'])
    head = 'four-bars | links | a stage, µs | a link, ns'
    return markdown(f'{about}; `rk4`, 0.1 ms', head, body)


def order_n() -> str:
    """Cost, fill and preparation of every shape."""
    about, found = rows('order_n.csv')
    head = (
        'shape | bars | stage, µs | per bar, ns | factor, µs | CHOLMOD, µs | solve, µs | fill '
        '| updates | updates, RCM | time to first step, s | MB'
    )
    body = []
    for row in found:
        bars, stage = int(row['bars']), float(row['stage_us'])
        if bars < 90:
            continue
        numbers = [stage, 1e3 * stage / bars]
        numbers += [float(row[k]) for k in ('factor_us', 'cholmod_us', 'solve_us', 'fill')]
        cells = [f'{x:.3g}' if x < 1e3 else f'{x:.0f}' for x in numbers]
        cells += [row['updates'], row['updates_rcm']]
        cells += [f'{float(row["prepare_s"]):.2g}', f'{float(row["memory_mb"]):.0f}']
        body.append([row['shape'], str(bars), *cells])
    return markdown(about, head, body)


def first_step() -> str:
    """From a file to the first step, and what it is made of."""
    about, found = rows('first_step.csv')
    head = (
        'four-bars | links | file | YAML, kB | time to first step, s | parsing YAML, s | scene, s '
        '| simulation, s | step, s | MB | imports (not counted), s'
    )
    body = []
    keys = 'total_s parse_s scene_s model_s step_s memory_mb imports_s'.split()
    for row in found:
        cells = [row['four_bars'], f'{float(row["links"]):.0f}', row['file']]
        numbers = [float(row[key]) for key in ('yaml_kb', *keys)]
        body.append(cells + [f'{x:.2g}' if x < 100.0 else f'{x:.0f}' for x in numbers])
    said = f'{about}. Medians of {found[0]["runs"]} runs, each in a process of its own'
    return markdown(said, head, body)


def large_node() -> str:
    """The ticks of the node of a large mechanism, with readers and a log."""
    about, found = rows('large_node.csv')
    head = (
        'subscribers | log | ticks/s | overruns | lost real time, s | lateness p50, µs | p99, µs '
        '| processor, % of a core | received/s | logged MB/s'
    )
    body = []
    keys = 'ticks_per_s overruns lost_real_time_s lateness_p50_us lateness_p99_us'.split()
    keys += 'processor_percent_of_a_core heard_per_s logged_mb_per_s'.split()
    for row in found:
        cells = [row[key] for key in keys]
        recorded = 'yes' if row['recorded'] == 'True' else 'no'
        body.append([row['subscribers'], recorded, *cells])
    return markdown(about, head, body)


def readings() -> str:
    """The cost of the readings of a sample, before and now, in steps of the same run."""
    about, found = rows('readings.csv')
    keys = list(dict.fromkeys(row['reading'] for row in found))
    cells = {(row['scene'], row['checkout'], row['reading']): row for row in found}
    body = []
    for scene in dict.fromkeys(row['scene'] for row in found):
        for checkout in ('before', 'now'):
            each = [cells.get((scene, checkout, key), {}) for key in keys]
            numbers = [
                row['us'] if row.get('reading') == 'step' else row.get('steps', '-')
                for row in each
            ]
            body.append([scene, checkout, *numbers])
    head = ' | '.join(['scene', 'code', *keys]).replace('| step |', '| step, µs |')
    return markdown(about, head, body)


def message_path() -> str:
    """The node with everything recorded and three readers, beside its goals."""
    about, found = rows('message_path.csv')
    head = (
        'scene | code | goal | processor, % of a core | a tick, µs | ticks/s '
        '| lost real time, s/s | received/s | dropped | step, µs | topics, steps | tick, steps'
    )
    body = [list(row.values()) for row in found]
    return markdown(about, head, body)


def waits() -> str:
    """How long the thread of the node that steps runs, is ready, and sleeps."""
    about, found = rows('waits.csv')
    head = (
        'readers | log | ticks/s | received/s | runs, % | ready, no processor, % | sleeps, % '
        '| node, % of a core | other processes, % | idle, %'
    )
    return markdown(about, head, [list(row.values()) for row in found])


def fuzz() -> str:
    """The outcomes of the cases of each campaign, and of all cases."""
    about, found = rows('fuzz.csv')
    keys = [key for key in found[0] if key not in ('harness', 'cases_per_second')]
    total = {key: str(sum(int(row[key]) for row in found)) for key in keys}
    body = [[row['harness'], *(row[key] for key in keys)] for row in found]
    head = 'harness | cases | ran | refused | tracebacks | hangs | crashes | silent changes'
    return markdown(about, head, [*body, ['all', *total.values()]])


def new_user() -> str:
    """Seconds of each step of a new user."""
    about, found = rows('new_user.csv')
    head = 'step | command | seconds | processor seconds'
    keys = ('seconds', 'processor_seconds')
    body = [[row['step'], f'`{row["command"]}`', *(row[key] for key in keys)] for row in found]
    total = [f'{sum(float(row[key]) for row in found):.1f}' for key in keys]
    return markdown(about, head, [*body, ['all', '', *total]])


def soak() -> str:
    """The last long run of two nodes."""
    about, found = rows('soak.csv')
    body = [[row['quantity'], f'{row["value"]} {row["unit"]}'.strip()] for row in found]
    return markdown(about, 'quantity | value', body)


def closure() -> str:
    """The cost of closing loops."""
    about, found = rows('closure.csv')
    head = (
        'mechanism | active joints | coordinates | µs a call, in a table | µs a call, from Python '
    )
    head += '| loops closed to, m | values missed by, rad or m'
    return markdown(about, head, [list(row.values()) for row in found])


def closure_passes() -> str:
    """How often a branch was lost."""
    about, found = rows('closure_passes.csv')
    head = 'motion | noise, m | motions | calls | other branch | largest error at the end, rad '
    head += '| values missed by, m | µs a call'
    return markdown(about, head, [list(row.values()) for row in found])


def robots() -> str:
    """Robot files of others, imported and simulated: as they are, and with balls."""
    about, plain = rows('robots.csv')
    _, joined = rows('robots_balls.csv')
    head = 'file | result | with `--balls` | freedoms | loops | evaluations a second | closure, m '
    head += '| s per simulated s'
    body = []
    for one, other in zip(plain, joined, strict=True):
        cells = [_told(one), other['result'] if one['result'] == other['result'] else _told(other)]
        cells += [other[key] for key in ('freedoms', 'loops')]
        cells += [_short(other[key]) for key in ('evaluations', 'closure', 'seconds')]
        body.append([one['file'].removesuffix('/robot.urdf'), *cells])
    counts = [sum(row['result'] == 'ok' for row in found) for found in (plain, joined)]
    ran = [f'{count} of {len(plain)} ok' for count in counts]
    return markdown(about, head, [*body, ['all', *ran, *[''] * 5]])


def identification() -> str:
    """Bias and coverage of refits of known machines."""
    about, found = rows('identification.csv')
    head = 'recording | refits | number | bias, deviations | coverage of 95 % '
    head += '| expected in 19 of 20 campaigns | processor time of a fit, s'
    body = []
    for row in found:
        bias = f'{row["bias"]} ± {row["bias_deviation"]}' if row['bias'] else 'not determined'
        coverage = row['coverage'] or f'named in {row["named"]}'
        cells = [row[key] for key in ('case', 'refits', 'number')]
        body.append([*cells, bias, coverage, row['coverage_expected'], row['cpu_s']])
    return markdown(about, head, body)


def _told(row: dict[str, str]) -> str:
    """A result, and the beginning of its reason."""
    why = row['why'].replace('|', '/')
    if len(why) > WHY:
        why = why[:WHY].rsplit(' ', 1)[0] + ' …'
    return f'{row["result"]}: {why}' if why else row['result']


def _short(number: str) -> str:
    return f'{float(number):.2g}' if number else ''


def draw(path: Path) -> None:
    """Above the error of every step of the sweep, below what an error costs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    about, points = peer_points()
    figure = Figure(figsize=(4.5 * len(points), 9.0), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(f'10 s through singular positions, {about}', fontsize=10)
    axes: Any = figure.subplots(2, len(points), sharey='row', squeeze=False)
    # of all mechanisms: one may lack an engine
    names = dict.fromkeys(engine for engines in points.values() for engine in engines)
    colours = dict(zip(names, COLOURS, strict=False))
    handles = {}
    for column, (mechanism, engines) in enumerate(points.items()):
        steps, costs = axes[:, column]
        steps.set(title=MECHANISMS[mechanism], xlabel='step, ms')
        costs.set(xlabel='processor time, ms per simulated second')
        for engine, curve in engines.items():
            colour = colours[engine]
            style: Any = {'color': colour, 'marker': 'o', 'markersize': 3.0, 'linewidth': 1.0}
            sweep = survived(curve)
            errors = [math.nan if p.failure else p.position for p in sweep]
            steps.plot([1e3 * p.setting.step for p in sweep], errors, linestyle='', **style)
            bad = [1e3 * p.setting.step for p in sweep if p.failure]
            steps.plot(bad, [40.0] * len(bad), 'x', color=colour)
            ended = [p for p in curve if not p.failure]
            (handles[engine],) = costs.plot(
                [p.cpu for p in ended], [p.position for p in ended], **style
            )
        for panel in (steps, costs):
            panel.set(xscale='log', yscale='log')
            panel.grid(True, color='0.9')
            panel.set_axisbelow(True)
        steps.set_ylim(1e-13, 1e3)
        steps.set_xticks([0.2, 0.5, 1.0, 2.0], labels=['0.2', '0.5', '1', '2'])
        steps.axhline(10.0, color='0.6', linewidth=0.8)
        text = steps.text(0.01, 0.985, 'did not end', va='top', color='0.4')
        text.set_transform(steps.transAxes)
    for panel in axes[:, 0]:
        panel.set(ylabel='largest position error, m')
    figure.legend(handles.values(), handles.keys(), loc='outside lower center', ncols=6)
    figure.savefig(path, dpi=110)


TABLES = (
    ('work_precision', work_precision),
    ('stiff', stiff),
    ('stage_cost', stage_cost),
    ('order_n', order_n),
    ('first_step', first_step),
    ('large_node', large_node),
    ('readings', readings),
    ('message_path', message_path),
    ('waits', waits),
    ('peers', peers),
    ('engines', engines),
    ('fuzz', fuzz),
    ('new_user', new_user),
    ('soak', soak),
    ('closure', closure),
    ('closure_passes', closure_passes),
    ('robots', robots),
    ('identification', identification),
)


def filled(text: str) -> str:
    """A document with its tables as the results are."""
    for name, made in TABLES:
        marks = f'<!-- {name} -->', f'<!-- end of {name} -->'
        if marks[0] in text:
            before, _, rest = text.partition(marks[0])
            text = f'{before}{marks[0]}\n{made()}\n{marks[1]}{rest.partition(marks[1])[2]}'
    return text


def main() -> None:
    """Write them."""
    for name in DOCUMENTS:
        path = ROOT / name
        path.write_text(filled(path.read_text(encoding='utf-8')), encoding='utf-8')
    draw(RESULTS / 'peers.png')
    print(f'tables in {", ".join(DOCUMENTS)}, picture in benchmark/results/peers.png')


if __name__ == '__main__':
    main()
