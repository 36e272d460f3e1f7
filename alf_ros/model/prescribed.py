"""Motions as functions of time, in the form of the kernel."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Prescribed, System
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.mechanism.time_function import Signal, signal


def prescribed(layout: Layout) -> Prescribed:
    """The prescribed blocks of a mechanism; where there are none, nothing is compiled for them."""
    if not layout.mechanism.prescribed:
        return _nothing()
    from alf_ros.model import time_program

    slots, params = time_program.program(_outputs(layout))
    address = np.array([time_program.run.address], dtype=np.uint64)
    return Prescribed(address, slots, params, np.zeros(3 * int(slots[0])))


def program_apart(layout: Layout) -> tuple[Integers, Floats]:
    """The same program, in which every number of the motions has a place of its own: its slots,
    and its numbers."""
    if not layout.mechanism.prescribed:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    from alf_ros.model import time_program

    return time_program.program(_outputs(layout), apart=True)


def _outputs(layout: Layout) -> dict[int, Signal]:
    """Of each coordinate that moves, in the order of q, its function of time."""
    outputs = {}
    for item in layout.mechanism.prescribed:
        unit = layout.length if item.is_direction else 1.0  # directions are blocks as long as that
        for axis, component in enumerate(item.components):
            if component is not None:
                place = layout.of_prescribed[item.name] * layout.dimension + axis
                outputs[place] = signal(unit * component)
    return outputs


@cache
def _nothing() -> Prescribed:
    return Prescribed.empty()


def reached(bare: Prescribed) -> Prescribed:
    """The same with the address of the code in this process, as one that was unpickled needs."""
    if bare.slots.size == 0:
        return bare
    from alf_ros.model import time_program

    return replace(bare, program=np.array([time_program.run.address], dtype=np.uint64))


def prescribe(system: System, t: float, q: Floats, qd: Floats, qdd: Floats) -> None:
    """Put the prescribed blocks of a system, if it has any, where they are at t (s).

    q, q̇, q̈ (blocks D) are written in place.
    """
    if system.prescribed.program.size:
        kernel.prescribed_at(system, t, q, qd, qdd)


def driven_angles(layout: Layout, system: System, t: float) -> Floats:
    """(drives on angles,) rad at t (s), with the turns that prescribed directions do not know."""
    drives = [drive for drive in layout.mechanism.drives if drive.kind == 'angle']
    found = np.zeros((3, len(drives)))
    if drives:
        from alf_ros.model import time_program

        motions = {n: drive.motion[0] or signal(0.0) for n, drive in enumerate(drives)}
        slots, params = time_program.program(motions)
        given = replace(system.prescribed, slots=slots, params=params)
        given = replace(given, registers=np.zeros(3 * int(slots[0])))
        kernel.prescribed_at(replace(system, prescribed=given), t, *found)
    return found[0]


def without_value(layout: Layout, system: System, t: float) -> str:
    """The name of a motion that has no value, rate or acceleration at t (s); '' if all have."""
    if not system.prescribed.program.size:
        return ''
    found = np.zeros((3, max(layout.of_prescribed.values()) + 1, layout.dimension))
    kernel.prescribed_at(system, t, *found.reshape(3, -1))
    for name, place in layout.of_prescribed.items():
        if not np.isfinite(found[:, place]).all():
            return name
    return ''
