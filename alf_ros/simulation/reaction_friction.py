"""Data for the reactions on which friction depends, if a scene has such friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from alf_ros.errors import InputError
from alf_ros.kernel import Bearings, Effects
from alf_ros.mechanism import Joint
from alf_ros.model.constraints.packing import indices
from alf_ros.simulation.bearing_shares import has_bearings
from alf_ros.simulation.reactions import Reactions


@cache
def _none() -> Bearings:
    return Bearings.empty()


def bearings(
    reactions: Callable[[], Reactions],
    joints: Sequence[Joint | None],
) -> Bearings:
    """Bearings of these joints, one for each load; None for a load that is always zero.

    Forces on the cut mechanism are not set. Without a loaded joint no code is compiled.
    """
    if not any(joint is not None for joint in joints):
        return _none()
    from alf_ros.kernel import reaction_friction as compiled

    cut = reactions()
    if has_bearings(cut.model):
        raise InputError(
            'friction that depends on a reaction does not support the stiffness of bearings',
            key='effects',
            expected='a given load, or joints without stiffness',
        )
    first, block, sign = [0], [], []
    first_entry, entry, entry_row = [0], [], []
    for joint in joints:
        if joint is not None:
            for n, weight in cut.shared(joint):
                block.append(n)
                sign.append(weight)
            for n, row in cut.own_entries(joint):
                entry.append(n)
                entry_row.append(row)
        first.append(len(block))
        first_entry.append(len(entry))
    D, loads, rows = cut.cut.dimension, len(joints), cut.rows
    whole, memory = cut.cut.blocks * D, min(loads, compiled.MEMORY)
    sizes = {
        'g': rows.i.size * D,
        'g2': rows.b.size,
        'q': whole,
        'qd': whole,
        'qdd': whole,
        'Q': whole,
        'needed': whole,
        'y': rows.alpha.size,
        'given': cut.model.q.size,
        'qdd_of': cut.model.q.size,
        'across': cut.model.q.size,
        'softest': cut.model.system.rows.alpha.size,
        'kept_y': cut.model.system.rows.alpha.size,
        'kept_r2': cut.model.system.rows.alpha.size,
        'loads': loads,
        'force': loads * D + 1,
        'good': loads * D + 1,
        'trial': loads,
        'answer': loads,
        'reaction': loads * D,
        'response': loads * loads * D,
        'branch': 2,
        'ended': 1,
        'point': loads,
        'next': loads,
        'heading': loads * D,
        'best': loads,
        'slope': loads * loads,
        'change': loads,
        'past_trial': memory * loads,
        'past_gap': memory * loads,
        'gram': memory * memory,
        'mix': memory,
    }
    return Bearings(
        settle=np.array([compiled.settle(D).address], dtype=np.uint64),
        mass=cut.mass,
        rows=rows,
        effects=Effects.empty(),
        source=indices(cut.source),
        source_row=indices(cut.source_row),
        first=indices(first),
        block=indices(block),
        sign=np.array(sign, dtype=float),
        first_entry=indices(first_entry),
        entry=indices(entry),
        entry_row=indices(entry_row),
        begins=np.zeros(1, dtype=np.int64),
        passes=np.zeros(2, dtype=np.int64),
        **{name: np.zeros(size) for name, size in sizes.items()},
    )
