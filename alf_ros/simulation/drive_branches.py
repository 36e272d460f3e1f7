"""Which branches the functions of time of the drives of a model take at their corners."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.data.drive_switches import DriveSwitches
from alf_ros.model.compile import Model


class DriveBranches:
    """The branches over time. `begin` at an instant; the other calls continue from it."""

    def __init__(self, model: Model, switches: Integers) -> None:
        self._system = model.system
        sides = switches.size // 2
        self._switches = DriveSwitches(
            compared=switches,
            here=np.zeros(sides, dtype=np.int64),
            there=np.zeros(sides, dtype=np.int64),
            value=np.zeros(sides),
            rate=np.zeros(sides),
            before=np.zeros(sides),
            rate_before=np.zeros(sides),
            q=np.zeros(model.q.size),
            qd=np.zeros(model.q.size),
            qdd=np.zeros(model.q.size),
        )

    @classmethod
    def of(cls, model: Model) -> DriveBranches | None:
        """Of a model; None if no drive has branches."""
        given = model.system.prescribed
        if not given.slots.size:
            return None
        from alf_ros.model import time_program

        switches = time_program.switches(given.slots, given.params)
        return cls(model, switches) if switches.size else None

    def begin(self, t: float) -> None:
        """The branches at t (s) are the ones from which others differ."""
        self._at(t, self._switches.here)

    def same(self, start: float, first: int, n: int, h: float) -> int:
        """In how many of n steps of h (s) from `start` + first h (s) on the branches stay."""
        from alf_ros.kernel.first_switch import first_switch

        return int(first_switch(self._system, self._switches, start, first, n, h))

    def rates(self, t: float) -> Floats:
        """(blocks D,) the rates of the drives at t (s)."""
        self._at(t, self._switches.there)
        return self._switches.qd.copy()

    def between(self, low: float, high: float) -> Iterator[tuple[float, float]]:
        """The last instant before and the first one behind each switch between two times (s). The
        branches at the end are the new ones."""
        from alf_ros.kernel.first_switch import excursion

        inner = excursion(self._system, self._switches, low, high)
        for end in (high,) if math.isnan(inner) else (inner, high):
            yield from self._between(low, end)
            low = end

    def _between(self, low: float, high: float) -> Iterator[tuple[float, float]]:
        here, there = self._switches.here, self._switches.there
        while True:
            end = high
            self._at(high, there)
            if np.array_equal(here, there):
                return
            while True:
                middle = 0.5 * (low + end)
                if not low < middle < end:
                    break
                self._at(middle, there)
                low, end = (middle, end) if np.array_equal(here, there) else (low, middle)
            yield low, end
            self._at(end, here)
            low = end

    def instants(self, start: float, n: int, h: float) -> list[float]:
        """The switches (s) in n steps of h (s) from `start` (s) on."""
        found, done = list[float](), 0
        self.begin(start)
        while done < n:
            done += self.same(start, done, n - done, h)
            if done < n:
                each = self.between(start + done * h, start + (done + 1) * h)
                found += [end for _, end in each]
                done += 1
        return found

    def _at(self, t: float, out: Integers) -> None:
        from alf_ros.kernel.first_switch import branches_at

        branches_at(self._system, self._switches, t, out)
