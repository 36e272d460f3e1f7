"""A state as one list of named numbers with rates, as a log keeps it, and back, bit for bit.

In the order of the scene's file: the natural coordinates of movable points, vectors and auxiliary
blocks (m; vectors in the length of the drawing, as the kernel has them) with their velocities;
then, with zero rates, the turns of each counted angle, the pace (s), the variables of other
formulations, the works of a ledger (J), the reactions on which friction depends (N) and the sense
of their balance, the sums that gears and the like keep constant (m), and the step index.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.state import State


def names(model: Model, state: State) -> tuple[str, ...]:
    """Of all numbers of a state."""
    axes = 'xyz'[: model.layout.dimension]
    blocks = [block.name for block in model.mechanism.blocks if not block.fixed]
    blocks += model.layout.of_auxiliary
    return (
        *(f'{name}.{axis}' for name in blocks for axis in axes),
        *(f'turns[{k}]' for k in range(model.system.angles.c.size // 2)),
        'pace',
        *(f'carried[{k}]' for k in range(state.carried.size)),
        *(f'works[{name}]' for name in state.works),
        *(f'loads[{k}]' for k in range(state.loads.size)),
        *(f'sums[{k}]' for k in range(state.sums.size)),
        'step',
    )


def values(model: Model, state: State) -> tuple[Floats, Floats]:
    """Numbers and rates, each as long as `names`."""
    D, n = model.layout.dimension, model.n
    works = list(state.works.values())
    rest = state.turns, [state.pace], state.carried, works, state.loads, state.sums, [state.step]
    parts = [np.asarray(part, dtype=float) for part in rest]
    numbers, rates = np.zeros((2, n + sum(part.size for part in parts)))
    for blocks, to in ((state.q, numbers), (state.qd, rates)):
        np.take(blocks.reshape(-1, D), model.coordinate_block, axis=0, out=to[:n].reshape(-1, D))
    for part in parts:
        numbers[n : n + part.size] = part
        n += part.size
    return numbers, rates


def state(model: Model, like: State, numbers: Floats, rates: Floats, inputs: Inputs) -> State:
    """The state of these numbers and rates; `like` is one of the same simulation.

    A log of an earlier version has no loads, which begin at zero, or loads without a sense, or no
    sums. Raises ValueError if there are not as many numbers as that simulation has.
    """
    n, turns, D = model.n, like.turns.size, model.layout.dimension
    carried, works = n + turns + 1, n + turns + 1 + like.carried.size
    loads = works + len(like.works)
    sums, end = loads + like.loads.size, numbers.size - 1
    if end != sums + like.sums.size and end != loads and like.loads.size:
        sums -= 1  # of a version without the sense
    if end not in (loads, sums, sums + like.sums.size):
        raise ValueError(f'{numbers.size} numbers are no state of this mechanism')
    found = np.zeros_like(like.loads)
    if end != loads:
        found[: sums - loads] = numbers[loads:sums]
    q, qd = like.q.copy(), like.qd.copy()
    q.reshape(-1, D)[model.coordinate_block] = numbers[:n].reshape(-1, D)
    qd.reshape(-1, D)[model.coordinate_block] = rates[:n].reshape(-1, D)
    return replace(
        like,
        step=int(numbers[-1]),
        q=q,
        qd=qd,
        turns=numbers[n : n + turns].astype(np.int64),
        pace=float(numbers[n + turns]),
        carried=np.array(numbers[carried:works]),
        inputs=inputs,
        loads=found,
        sums=np.array(numbers[sums:-1]),
        works=dict(zip(like.works, numbers[works:loads].tolist(), strict=True)),
    )
