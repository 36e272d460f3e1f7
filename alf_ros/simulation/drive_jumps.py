"""Instants at which the rate of a drive jumps, which would take infinite forces.

abs, min and max give motions with corners. Where the acceleration alone jumps there, the run
continues. Where the rate jumps and something moves freely, the velocities of all bodies would jump
with it. No step computes this: the run ends before, and says so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.data.drive_switches import DriveSwitches
from alf_ros.model.compile import Model

_JUMP = 1e-6  # of the rates on both sides
_SAME = 1e-9  # rank, of a whole number


class DriveJump(NamedTuple):
    """The rate of a drive, `name`, jumps by so much (rad/s or m/s) at t (s)."""

    name: str
    t: float
    by: float

    def __str__(self) -> str:
        return f'the rate of {self.name} jumps by {self.by:.4g} at t = {self.t:.9g} s'


class DriveJumps:
    """Where drives of a model jump."""

    def __init__(self, model: Model, switches: Integers) -> None:
        self._model, self._system = model, model.system
        sides = switches.size // 2
        self._switches = DriveSwitches(
            compared=switches,
            here=np.zeros(sides, dtype=np.int64),
            there=np.zeros(sides, dtype=np.int64),
            q=np.zeros(model.q.size),
            qd=np.zeros(model.q.size),
            qdd=np.zeros(model.q.size),
        )

    @classmethod
    def of(cls, model: Model, ledger: bool) -> DriveJumps | None:
        """Of a model whose drives may jump; None if no drive may, or where nothing moves freely
        and no works are counted: the motion is then known whatever the forces are."""
        slots = model.system.prescribed.slots
        if not slots.size:
            return None
        from alf_ros.model import time_program

        switches = time_program.switches(slots)
        free = model.n - model.system.rank > _SAME or bool(model.system.rows.velocity)
        return cls(model, switches) if switches.size and (free or ledger) else None

    def before(self, start: float, first: int, n: int, h: float) -> tuple[int, DriveJump | None]:
        """How many of n steps of h (s), from start + first h on, are free of jumps, and the jump
        that follows."""
        from alf_ros.kernel.first_switch import first_switch

        done, switches = 0, self._switches
        self._branches(start + first * h, switches.here)
        while done < n:
            t = start + (first + done) * h
            done += int(first_switch(self._system, switches, t, h, n - done))
            if done == n:
                break
            t = start + (first + done) * h
            jump = self._between(t, start + (first + done + 1) * h)
            if jump is not None:
                return done, jump
            done += 1
        return n, None

    def _branches(self, t: float, out: Integers) -> Floats:
        """The branches at t (s) into `out`, and the rates (blocks D,) of the drives there."""
        from alf_ros.kernel.first_switch import branches_at

        branches_at(self._system, self._switches, t, out)
        return self._switches.qd.copy()

    def _between(self, low: float, high: float) -> DriveJump | None:
        """The first jump between two times; without one, `here` are the branches at the end."""
        here, there = self._switches.here, self._switches.there
        while True:
            end = high
            self._branches(high, there)
            if np.array_equal(here, there):
                return None
            while True:
                middle = 0.5 * (low + end)
                if not low < middle < end:
                    break
                self._branches(middle, there)
                low, end = (middle, end) if np.array_equal(here, there) else (low, middle)
            before = self._branches(low, there)
            after = self._branches(end, here)
            by, most = np.abs(after - before), np.maximum(np.abs(after), np.abs(before))
            if (by > _JUMP * most).any():
                return self._named(end, by)
            low = end

    def _named(self, t: float, by: Floats) -> DriveJump:
        layout = self._model.layout
        block, axis = divmod(int(np.argmax(by)), layout.dimension)
        name = next(n for n, at in layout.of_prescribed.items() if at == block)
        most = float(by[block * layout.dimension + axis])
        drives = {drive.name: drive for drive in self._model.mechanism.drives}
        is_angle = name in drives and drives[name].kind == 'angle'
        return DriveJump(name, t, most / layout.length if is_angle else most)
