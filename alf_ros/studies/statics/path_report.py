"""A path of equilibria in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alf_ros.studies.statics.equilibrium_path import EquilibriumPath, PathEvent

_NAMED = 3  # points that move
_ROUNDED = 1e-12  # of the largest value, from which down one is printed as zero


def report(path: EquilibriumPath, others: Mapping[str, Sequence[EquilibriumPath]]) -> str:
    """Where the path begins and ends, and its turning and branch points; then the `others` that
    leave at branch points, by the name of the point."""
    lines = _lines(path)
    for name, sides in others.items():
        for side in sides:
            lines += ['', f'from {name}:', *_lines(side)]
    return '\n'.join(lines)


def _lines(path: EquilibriumPath) -> list[str]:
    over = f'{path.over}, {path.unit}'.rstrip(', ')
    lines = [f'{len(path)} points; {path.ending}', '']
    lines.append(f'{"":12}{over:>26}   stability')
    nothing = _ROUNDED * float(np.abs(path.values).max())
    values = np.where(np.abs(path.values) > nothing, path.values, 0.0)
    lines.append(_row('begins', values[0], path.stability[0]))
    for event in path.events:
        stability = f'{event.before} -> {event.after}, moves {_moving(path, event)}'
        lines.append(_row(event.name, values[event.index], stability))
    lines.append(_row('ends', values[-1], path.stability[-1]))
    return lines


def _row(name: str, value: float, text: str) -> str:
    return f'{name:12}{value:>26.12g}   {text}'


def _moving(path: EquilibriumPath, event: PathEvent) -> str:
    """The blocks that move most without stiffness, with their directions."""
    mechanism = path.rest(0).sample.model.mechanism
    names = [block.name for block in mechanism.blocks if not block.fixed]
    D = mechanism.dimension
    blocks = event.direction.reshape(-1, D)[: len(names)]
    order = np.argsort(-np.abs(blocks).max(axis=1), kind='stable')[:_NAMED]
    named = [k for k in sorted(order) if np.abs(blocks[k]).max() > 1e-6]
    words = (f'{x:.4g}' if abs(x) > 1e-9 else '0' for k in named for x in blocks[k])
    return ', '.join(f'{names[k]} ({", ".join(next(words) for _ in range(D))})' for k in named)
