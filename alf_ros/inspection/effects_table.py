"""Effects in words: a list of all, and the costs in a scene, as text and as CSV."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Any

from alf_ros import effects, paths
from alf_ros.inspection.effect_costs import EffectCosts
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
            said, kind_of = field.metadata, field.metadata['kind']
            unit = f', {said["unit"]}' if 'unit' in said else ''
            lines.append(f'  {field.name:15}{_default(field):12}{said["doc"]} ({kind_of}{unit})')
    return '\n'.join(lines[1:])


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default is dataclasses.MISSING:
        return 'required'
    if field.default is None or isinstance(field.default, tuple):
        return '-'
    if isinstance(field.default, float):
        return format(field.default, 'g')
    return str(field.default)


def table(found: EffectCosts) -> str:
    """The costs as text."""
    width = max([len(effect.label) for effect in found.effects] + [10]) + 2
    head = f'{"effect":{width}}{"added, µs":>11}{"removed, µs":>13}'
    lines = [f'{head}{"change, m":>12}{"work, J":>12}{_HEAD_OF_RATES}']
    for effect in found.effects:
        change = 'no run' if effect.change == math.inf else f'{effect.change:.2e}'
        lines.append(
            f'{effect.label:{width}}{effect.added:11.3f}{effect.removed:13.3f}{change:>12}'
            f'{effect.work:12.4g}{_rates(effect.mode)}'
        )
    lines.append(f'{"(all)":{width}}{"":48}{_rates(found.mode)}')
    lines.append(
        f'a step takes {found.bare:.3f} µs without effects, {found.whole:.3f} µs with all '
        f'effects; smaller differences than {max(found.resolution, 1e-3):.3f} µs are noise'
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


def write(path: Path, found: EffectCosts, about: str) -> None:
    """Write the costs as CSV below the comment line `about`. Raises OSError."""
    with (
        paths.replacing(path) as target,
        open(target, 'w', newline='', encoding='utf-8') as stream,
    ):
        print(about, file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(_COLUMNS)
        writer.writerow(['(none)', f'{found.bare:.4f}', *[''] * 6])
        writer.writerow(['(all)', f'{found.whole:.4f}', '', '', '', *_exact(found.mode)])
        for effect in found.effects:
            numbers = (f'{effect.added:.4f}', f'{effect.removed:.4f}')
            made = (f'{effect.change:.6e}', f'{effect.work:.6e}')
            writer.writerow([effect.label, *numbers, *made, *_exact(effect.mode)])
