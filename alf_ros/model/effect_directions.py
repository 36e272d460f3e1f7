"""The directions in which the effects of a scene yield, for an implicit method.

They join the pattern of A: blocks that only a spring connects are neighbours there too.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alf_ros.kernel import Pattern, Soft, System
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.packing import indices
from alf_ros.model.symbolic_factor import pattern_of


class Direction(NamedTuple):
    """Number of the effect, which of its directions, and the blocks that it moves."""

    effect: int
    number: int
    blocks: tuple[int, ...]


def softened(system: System, layout: Layout, directions: Sequence[Direction]) -> System:
    """The system with M̂ in the place of M: the directions, and a pattern with space for them."""
    D, movable = layout.dimension, layout.movable
    cliques = [sorted(b for b in each.blocks if b < movable) for each in directions]
    fixed = [sorted(b for b in each.blocks if b >= movable) for each in directions]
    pattern = pattern_of(layout, system.mass, system.rows, cliques)
    blocks: list[int] = []
    first, ends, first_pair = [0], [], [0]
    pairs: list[tuple[int, int, int]] = []
    for clique, rest in zip(cliques, fixed, strict=True):
        at = len(blocks)
        for e, i in enumerate(clique):
            pairs += [(at + e, at + f, _place(pattern, i, k)) for f, k in enumerate(clique[:e])]
        ends.append(at + len(clique))
        blocks += [*clique, *rest]
        first.append(len(blocks))
        first_pair.append(len(pairs))
    soft = Soft(
        effect=indices(each.effect for each in directions),
        number=np.array([each.number for each in directions], dtype=np.int64),
        first=indices(first),
        movable=indices(ends),
        block=indices(blocks),
        first_pair=indices(first_pair),
        pair=np.array(pairs, dtype=np.uint32).reshape(-1, 3),
        g=np.zeros(len(blocks) * D),
        weight=np.zeros(len(directions)),
        stiff=np.zeros(2),
        gradient=np.zeros(layout.blocks * D),
        k=np.zeros(movable * D),
    )
    return replace(system, pattern=pattern, soft=soft)


def _place(pattern: Pattern, i: int, k: int) -> int:
    """Where block (i, k) stands below the diagonal, i > k."""
    start, end = int(pattern.first[k]), int(pattern.first[k + 1])
    return start + bisect_left(pattern.row[start:end].tolist(), i)
