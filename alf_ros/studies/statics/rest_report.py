"""A position of rest in words, and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.statics.positions_of_rest import Equilibrium

_POINTS = 12  # printed at most, of each kind
_AXES = 'xyz'
_ROUNDED = 1e-10  # of the largest number of its kind, from which down one is printed as zero


def report(found: Equilibrium) -> str:
    """Stability and notes, then points, joints and reactions."""
    model = found.sample.model
    D = model.layout.dimension
    lines = [f'{found.stability}, at t = {found.t:g} s; {_freedoms(found)}']
    lines += [f'note: {note}' for note in found.notes]
    lines += ['', _row('point', [f'{axis}, m' for axis in _AXES[:D]])]
    moving = [p.name for p in model.mechanism.points if not p.fixed]
    lines += _some([_row(name, found.points[name]) for name in moving])
    if found.joints:
        lines += ['', _row('joint', ['rad or m', 'effort, N m or N'])]
        states = found.joints.items()
        lines += _some(
            [
                _row(name, [s.position, s.effort]) + ('  one of many' * s.indeterminate)
                for name, s in states
            ]
        )
    if found.reactions and found.stability != 'undecided':
        lines += ['', _row('reaction', [f'{axis}, N' for axis in _AXES[:D]])]
        carried = found.reactions.items()
        most = max(float(np.abs(r.force).max()) for r in found.reactions.values())
        lines += _some(
            [
                _row(name, r.force, _ROUNDED * most) + ('  one of many' * r.indeterminate)
                for name, r in carried
            ]
        )
    for number, motion in enumerate(found.directions):
        if found.stiffness[number] < 0.0:
            lines += ['', f'falls with {found.stiffness[number]:.9g} 1/s^2 along']
            lines += _some(_motion(found, motion))
    return '\n'.join(lines)


def as_data(found: Equilibrium) -> dict[str, Any]:
    """The same as plain data: names, numbers and lists, SI."""
    return {
        't': found.t,
        'stability': found.stability,
        'conservative': found.conservative,
        'notes': list(found.notes),
        'residual': found.residual,
        'stiffness': [None if np.isnan(x) else x for x in found.stiffness.tolist()],
        'directions': found.directions.tolist(),
        'points': {name: at.tolist() for name, at in found.points.items()},
        'joints': {
            n: {'position': s.position, 'effort': s.effort, 'indeterminate': s.indeterminate}
            for n, s in found.joints.items()
        },
        'reactions': {
            name: {
                'force': r.force.tolist(),
                'torque': np.asarray(r.torque).tolist(),
                'indeterminate': r.indeterminate,
            }
            for name, r in found.reactions.items()
        },
    }


def _freedoms(found: Equilibrium) -> str:
    count = found.stiffness.size
    if not count:
        return 'no freedom is told'
    each = zip(found.frequencies[:6], found.stiffness[:6], strict=True)
    low = ', '.join(
        f'{f:.9g}' if not np.isnan(f) else 'flutters' if np.isnan(square) else 'falls'
        for f, square in each
    )
    more = f' and {count - 6} more' if count > 6 else ''
    return f'{count} freedom{"s" * (count > 1)}, without damping {low}{more} Hz'


def _row(name: str, values: Floats | list[Any], nothing: float = 0.0) -> str:
    cells = []
    for each in values:
        rounded = isinstance(each, float) and abs(each) <= nothing
        cells.append(each if isinstance(each, str) else f'{0.0 if rounded else each + 0.0:.9g}')
    return f'{name:16}' + ''.join(f'{cell:>18}' for cell in cells)


def _some(lines: list[str]) -> list[str]:
    more = len(lines) - _POINTS
    return lines if more <= 0 else [*lines[:_POINTS], f'... and {more} more (--json has all)']


def _motion(found: Equilibrium, motion: Floats) -> list[str]:
    model = found.sample.model
    D = model.layout.dimension
    names = [block.name for block in model.mechanism.blocks if not block.fixed]
    blocks = motion.reshape(-1, D)[: len(names)]
    nothing = _ROUNDED * float(np.abs(blocks).max(initial=0.0))
    return [_row(name, at, nothing) for name, at in zip(names, blocks, strict=True)]
