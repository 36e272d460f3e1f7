"""Velocities of branches in words: 'A: [-1, 0] with 1) B: [-2, 0], or 2) B: [0, 0]'."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import NOTHING
from alf_ros.model.compile import Model

BRANCHES = 4  # named in a message
_POINTS = 3


def alike(
    model: Model, velocities: Sequence[Floats], at: Sequence[int], values: Floats
) -> list[Floats]:
    """Directions at the speed of the first component that all of them move: one of those given, or
    1 m/s of a point."""
    n = model.n
    wanted = [(place, value) for place, value in zip(at, values, strict=True) if value]
    D = model.layout.dimension
    points = [block * D + axis for block in model.layout.of_point.values() for axis in range(D)]
    wanted += [(place, 1.0) for place in points if place < n]
    for place, value in wanted:
        if all(abs(v[place]) > 0.1 * np.abs(v[:n]).max() for v in velocities):
            return [v * (value / v[place]) for v in velocities]
    return [v / v[np.argmax(np.abs(v[:n]))] for v in velocities]


def listed(model: Model, velocities: Sequence[Floats], numbers: Sequence[int] = ()) -> str:
    """The common motion, then the differing ones, alternative by alternative, each with the number
    of its branch if numbers are given."""
    shown = [_by_name(model, v) for v in velocities[:BRANCHES]]
    names = list(shown[0])
    common = [n for n in names if len({each[n] for each in shown}) == 1]
    moving = [n for n in common if shown[0][n].strip('[]0, ')]
    apart = [n for n in names if n not in common][:_POINTS]
    first = ', '.join(f'{n}: {shown[0][n]}' for n in moving[: 1 if apart else _POINTS])
    more = [', '.join(f'{n}: {each[n]}' for n in apart) for each in shown] if apart else []
    if more and numbers:
        more = [f'{number}) {each}' for number, each in zip(numbers, more, strict=False)]
    text = ', or '.join(more)
    if len(velocities) > BRANCHES:
        text += f', or {len(velocities) - BRANCHES} others'
    if not more and len(numbers) == 1:
        first = f'{numbers[0]}) {first}'
    return f'{first} with {text}' if first and text else first or text


def _by_name(model: Model, v: Floats) -> dict[str, str]:
    """Velocities of what moves, by name, in words: m/s, of vectors 1/s."""
    layout, D = model.layout, model.layout.dimension
    fastest = np.abs(v).max(initial=NOTHING)
    found = {}
    for items, blocks, unit in (
        (model.mechanism.points, layout.of_point, 1.0),
        (model.mechanism.vectors, layout.of_vector, layout.length),
    ):
        for item in items:
            if not item.fixed:
                rate = v[blocks[item.name] * D : (blocks[item.name] + 1) * D]
                rounded = np.where(np.abs(rate) > 1e-5 * fastest, rate / unit, 0.0)
                found[item.name] = f'[{", ".join(f"{x:.4g}" for x in rounded)}]'
    return found


def moving(model: Model, directions: Floats) -> list[str]:
    """Names of the points and vectors that move in any of the directions."""
    fastest = np.abs(directions).max(axis=0, initial=0.0)
    return [name for name, text in _by_name(model, fastest).items() if text.strip('[]0, ')]


def some_moving(model: Model, directions: Floats) -> str:
    """The first of them."""
    return ', '.join(moving(model, directions)[:6])


def shaky(model: Model, free: Floats) -> str:
    """State that no motion begins in the directions `free` (freedoms, blocks D)."""
    names = some_moving(model, free)
    return f'infinitesimally mobile only (shaky): no motion begins here, though {names} may yield'
