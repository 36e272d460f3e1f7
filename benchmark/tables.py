"""Write the tables of the documents, and the peers' picture, from the results.

    .venv/bin/python benchmark/tables.py

What stands between <!-- name --> and <!-- end of name --> is replaced; nothing there is typed.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from statistics import median

from peer_tables import draw, engines, peers
from results_file import RESULTS, ROOT, markdown, rows

# isort: split
from alf_ros.studies.work_precision.measurement import Measurement, Setting
from alf_ros.studies.work_precision.report import (
    Summary,
    cost_to_reach,
    curves,
    sentence,
    table,
)
from alf_ros.studies.work_precision.sweep import measurement_of

DOCUMENTS = (
    'README.md',
    'doc/performance.md',
    'doc/reliability.md',
    'doc/new_user.md',
    'doc/closing_loops.md',
    'doc/import.md',
    'doc/identification.md',
    'doc/derivatives.md',
    'doc/method.md',
)
STIFF = 1e-4  # m
WHY = 100  # characters of a reason


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


def day() -> str:
    """A day of motion at 1 kHz."""
    about, found = rows('day.csv')
    body = [[row['quantity'], f'{row["value"]} {row["unit"]}'.strip()] for row in found]
    return markdown(about, 'quantity | value', body)


def lanes() -> str:
    """A step of a member in lanes beside its single run."""
    about, found = rows('lanes.csv')
    widths = sorted({int(row['lanes']) for row in found})
    head = 'mechanism | integrator | step, ms | '
    head += ' | '.join(f'{lanes} lanes, µs' for lanes in widths)
    head += ' | alone, µs | ' + ' | '.join(f'ratio, {lanes}' for lanes in widths[1:])
    head += ' | steps taken alone'
    cases: dict[tuple[str, str, str], dict[int, dict[str, str]]] = {}
    for row in found:
        case = row['mechanism'], row['integrator'], f'{1e3 * float(row["step_s"]):g}'
        cases.setdefault(case, {})[int(row['lanes'])] = row
    body = []
    for case, by_width in cases.items():
        each = [by_width[lanes] for lanes in widths]
        alone = min(float(row['alone_us']) for row in each)
        times = [f'{float(row["lanes_us"]):.3g}' for row in each]
        ratios = [f'{float(row["ratio"]):.2f}' for row in each[1:]]
        apart = f'{100.0 * float(each[0]["apart"]):.1f} %'
        body.append([*case, *times, f'{alone:.3g}', *ratios, apart])
    return markdown(about, head, body)


def scheduler() -> str:
    """The chunks that a scheduler and the client keep up with."""
    about, found = rows('scheduler.csv')
    head = (
        'workers | threads, all | processes | scheduler without chunks, % of a processor | store '
    )
    head += '| a chunk, s | chunks | chunks/s | possible | ratio '
    head += '| client, ms of processor a chunk | scheduler, ms | workers, ms '
    head += '| scheduler full, chunks of 1 s | of 5 s | client full, 1 s | 5 s'
    return markdown(about, head, [list(row.values()) for row in found])


def ensemble_overhead() -> str:
    """The parts of the processor time of an ensemble, with one worker and with two."""
    about, found = rows('ensemble_overhead.csv')
    head = 'crew | workers | a member, ms of processor | members, % | workers besides, % '
    head += '| store, % | client and scheduler, % | idle cluster, % | members/s '
    head += '| of twice, by the clock | by processor time | members alone'
    return markdown(about, head, [list(row.values()) for row in found])


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
    head = 'motion | noise, m | motions | calls | other branch | of these without a word '
    head += '| called a guess | largest error at the end, rad | values missed by, m | µs a call'
    return markdown(about, head, [list(row.values()) for row in found])


def robots() -> str:
    """Robot files of others, imported and simulated."""
    about, found = rows('robots.csv')
    head = 'file | result | freedoms | loops | evaluations a second | closure, m '
    head += '| s per simulated s'
    body = []
    for row in found:
        cells = [_told(row), *(row[key] for key in ('freedoms', 'loops'))]
        cells += [_short(row[key]) for key in ('evaluations', 'closure', 'seconds')]
        body.append([row['file'].removesuffix('/robot.urdf'), *cells])
    ran = sum(row['result'] == 'ok' for row in found)
    return markdown(about, head, [*body, ['all', f'{ran} of {len(found)} ok', *[''] * 5]])


def identification() -> str:
    """Bias and coverage of refits of known machines."""
    about, found = rows('identification.csv')
    head = 'recording | refits | number | bias, deviations | coverage of 95 % '
    head += '| expected in 19 of 20 campaigns | a fit, s of processor | s by the clock'
    body = []
    for row in found:
        bias = f'{row["bias"]} ± {row["bias_deviation"]}' if row['bias'] else 'not determined'
        coverage = row['coverage'] or f'named in {row["named"]}'
        cells = [row[key] for key in ('case', 'refits', 'number')]
        times = row['cpu_s'], row['clock_s']
        body.append([*cells, bias, coverage, row['coverage_expected'], *times])
    return markdown(about, head, body)


def derivatives(file: str) -> str:
    """The cost of tangents and gradients."""
    about, found = rows(file)
    head = 'scene | numbers | a step, µs | run with one tangent, runs | with all, runs '
    head += '| run and pass back, runs | reading, ms a number'
    return markdown(about, head, [list(row.values()) for row in found])


def derivative_errors() -> str:
    """Errors of tangents beside the error of the position in the same run."""
    about, found = rows('derivative_errors.csv')
    head = 'scene | settings | position | worst tangent | of which number | ratio'
    return markdown(about, head, [list(row.values()) for row in found])


def gradient_rounding() -> str:
    """Gradients beside tangents, and tangents beside themselves after rounding."""
    about, found = rows('gradient_rounding.csv')
    head = 'scene | settings | gradient and tangents apart | tangents, after a last digit'
    return markdown(about, head, [list(row.values()) for row in found])


def coarse_steps() -> str:
    """Fixed steps that are too long, and whether that is reported."""
    about, found = rows('coarse_steps.csv')
    return markdown(about, ' | '.join(found[0]), [list(row.values()) for row in found])


def _told(row: dict[str, str]) -> str:
    """A result, and the beginning of its reason."""
    why = row['why'].replace('|', '/')
    if len(why) > WHY:
        why = why[:WHY].rsplit(' ', 1)[0] + ' …'
    return f'{row["result"]}: {why}' if why else row['result']


def _short(number: str) -> str:
    return f'{float(number):.2g}' if number else ''


def trees() -> str:
    """Robots without loops beside MuJoCo."""
    about, found = rows('trees.csv')
    head = (
        'robot | base | joints | alf_ros, ms/s | MuJoCo, ms/s | ratio | evaluations/s | '
        'in joint angles | of MuJoCo | µs an evaluation | of these at least | of MuJoCo | '
        'limits apart, rad'
    )
    return markdown(about, head, [list(row.values()) for row in found])


def random_robots() -> str:
    """Evaluations of random robots over those in joint angles."""
    about, found = rows('random_robots.csv')
    body = []
    for kind in dict.fromkeys(row['kind'] for row in found):
        ratios = [float(row['ratio']) for row in found if row['kind'] == kind]
        known = sorted(ratio for ratio in ratios if math.isfinite(ratio))
        counts = str(len(known)), str(len(ratios) - len(known))
        body.append([f'{kind}s', *counts, f'{median(known):.2f}', f'{known[-1]:.2f}'])
    head = 'robots | measured | chaotic, not measured | median ratio | worst'
    return markdown(about, head, body)


def identification_peers() -> str:
    """Fits of the same recordings here and by MuJoCo's toolbox."""
    about, found = rows('identification_peers.csv')
    return markdown(about, ' | '.join(found[0]), [list(row.values()) for row in found])


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
    ('day', day),
    ('lanes', lanes),
    ('scheduler', scheduler),
    ('ensemble_overhead', ensemble_overhead),
    ('closure', closure),
    ('closure_passes', closure_passes),
    ('robots', robots),
    ('identification', identification),
    ('derivatives', partial(derivatives, 'derivatives.csv')),
    ('derivatives_avx2', partial(derivatives, 'derivatives_avx2.csv')),
    ('derivative_errors', derivative_errors),
    ('gradient_rounding', gradient_rounding),
    ('coarse_steps', coarse_steps),
    ('trees', trees),
    ('random_robots', random_robots),
    ('identification_peers', identification_peers),
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
