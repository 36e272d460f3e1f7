"""List all effects there are, or what those of a scene cost and what difference they make."""

from __future__ import annotations

import csv
import dataclasses
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from alf_ros import effects
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.errors import InputError
from alf_ros.inspection import effect_costs_plot
from alf_ros.inspection.effect_costs import PriceList, price_list
from alf_ros.logs.provenance import about
from alf_ros.scene.scene import load_scene
from alf_ros.simulation.stiffness import Mode

_COLUMNS = (
    'effect',
    'added_us',
    'removed_us',
    'position_change_m',
    'work_J',
    'rate_per_s',
    'rk4_step_s',
    'dop853_step_s',
)
_METHODS = ('rk4', 'dop853')
_HEAD_OF_RATES = f'{"rate, 1/s":>12}{"rk4, s":>12}{"dop853, s":>12}'


def listing() -> str:
    """Every effect with its parameters: name, kind, unit, default, what it is."""
    lines = []
    for kind in effects.kinds():
        module = effects.load(kind)
        summary = ' '.join((module.__doc__ or '').partition('\n\n')[0].split())
        several = ', several' if module.MULTIPLE else ''
        lines += ['', f'{kind}{several}: {summary}']
        for field in dataclasses.fields(module.Parameters):
            about, kind_of = field.metadata, field.metadata['kind']
            unit = f', {about["unit"]}' if 'unit' in about else ''
            lines.append(f'  {field.name:15}{_default(field):12}{about["doc"]} ({kind_of}{unit})')
    return '\n'.join(lines[1:])


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default is dataclasses.MISSING:
        return 'required'
    if field.default is None or isinstance(field.default, tuple):
        return '-'
    if isinstance(field.default, float):
        return format(field.default, 'g')
    return str(field.default)


def table(found: PriceList) -> str:
    """A price list as text."""
    width = max([len(price.effect) for price in found.prices] + [10]) + 2
    head = f'{"effect":{width}}{"added, µs":>11}{"removed, µs":>13}'
    lines = [f'{head}{"change, m":>12}{"work, J":>12}{_HEAD_OF_RATES}']
    for price in found.prices:
        change = 'no run' if price.change == math.inf else f'{price.change:.2e}'
        lines.append(
            f'{price.effect:{width}}{price.added:11.3f}{price.removed:13.3f}{change:>12}'
            f'{price.work:12.4g}{_rates(price.mode)}'
        )
    lines.append(f'{"(all)":{width}}{"":48}{_rates(found.mode)}')
    lines.append(
        f'a step takes {found.bare:.3f} µs without effects, {found.whole:.3f} µs with all of '
        f'them; a difference below {max(found.resolution, 1e-3):.3f} µs says nothing'
    )
    lines.append(
        'rk4, dop853: the longest step with which an effect alone leaves the method stable; '
        'esdirk43 is with any'
    )
    return '\n'.join(lines)


def _rates(mode: Mode) -> str:
    steps = (mode.step(method) for method in _METHODS)
    return f'{mode.rate:12.3g}' + ''.join(f'{_short(step):>12}' for step in steps)


def _short(step: float) -> str:
    return 'any' if step == math.inf else f'{step:.2e}'


def _exact(mode: Mode) -> list[str]:
    return [f'{x:.6e}' for x in (mode.rate, *(mode.step(method) for method in _METHODS))]


def _write(path: Path, found: PriceList) -> None:
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(_COLUMNS)
        writer.writerow(['(none)', f'{found.bare:.4f}', *[''] * 6])
        writer.writerow(['(all)', f'{found.whole:.4f}', '', '', '', *_exact(found.mode)])
        for price in found.prices:
            numbers = (f'{price.added:.4f}', f'{price.removed:.4f}')
            made = (f'{price.change:.6e}', f'{price.work:.6e}')
            writer.writerow([price.effect, *numbers, *made, *_exact(price.mode)])


def main(argv: Sequence[str] | None = None) -> int:
    """List the effects, or price those of a scene. Returns 0; raises InputError, StepError."""
    parser = Parser(
        prog='effects',
        description='Without SCENE: all effects with their parameters, defaults and units. With '
        'SCENE: what each of its effects costs on this machine and what difference it makes, also '
        'as CSV and picture.',
    )
    parser.add_argument('scene', nargs='?', metavar='SCENE', help='a name or a path')
    parser.add_argument(
        '--duration', type=float, default=1.0, metavar='S', help='simulated seconds (default: 1)'
    )
    add_folder(parser, 'effects', 'for results')
    options = parser.parse_args(argv)
    if options.scene is None:
        print(listing())
        return 0
    if not 0.0 < options.duration < math.inf:
        raise InputError(
            'not a duration', key='--duration', value=options.duration, expected='above 0 s'
        )
    scene = load_scene(options.scene)
    if not scene.effects:
        raise InputError('this scene has no effects', key='SCENE', value=options.scene)
    found = price_list(scene, options.duration)
    print(table(found))
    written = [f'{scene.name}.csv']
    with writing_into(options.folder) as folder:
        _write(folder / written[0], found)
        try:
            effect_costs_plot.draw(folder / f'{scene.name}.png', scene.name, found)
            written.append(f'{scene.name}.png')
        except ImportError as error:
            print(f'alf_ros effects: no picture: {error}', file=sys.stderr)
    print(f'{" and ".join(written)} in {folder}')
    return 0
