"""Instants at which the rate of a drive jumps, which would take infinite forces.

abs, min and max, roots that touch zero, and the like give motions with corners. Where the
acceleration alone jumps there, the run continues, with steps that end at the corner. Where the
rate jumps and something moves freely, the velocities of all bodies would jump with it. No step
computes this: the run ends before, and says so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.drive_branches import DriveBranches

_JUMP = 1e-6  # of the rates of the step
_ASIDE = 1e-4  # of a step: so far from a corner roundings of its rates have faded
_WIDE = 50.0
_SAME = 1e-9  # rank, of a whole number
_NEAR = 1e-11  # of a step, and …
_ROUNDED = 1e-14  # … of t: steps know a corner that far behind their end, as they may have met it


class DriveJump(NamedTuple):
    """The rate of a drive, `name`, jumps by so much (rad/s or m/s) at t (s)."""

    name: str
    t: float
    by: float

    def __str__(self) -> str:
        return f'the rate of {self.name} jumps by {self.by:.4g} at t = {self.t:.9g} s'


class Ahead(NamedTuple):
    """How many steps are free of jumps, the corners (s) in these or right behind, and the jump
    that follows."""

    free: int
    corners: list[float]
    jump: DriveJump | None = None


class DriveJumps:
    """Where drives of a model jump."""

    def __init__(self, model: Model, branches: DriveBranches) -> None:
        self._model, self._branches = model, branches

    @classmethod
    def of(cls, model: Model, ledger: bool) -> DriveJumps | None:
        """Of a model whose drives may jump; None if no drive may, or where nothing moves freely
        and no works are counted: the motion is then known whatever the forces are."""
        branches = DriveBranches.of(model)
        free = model.n - model.system.rank > _SAME or bool(model.system.rows.velocity)
        return cls(model, branches) if branches is not None and (free or ledger) else None

    def ahead(self, start: float, first: int, n: int, h: float) -> Ahead:
        """In n steps of h (s), from start + first h on."""
        done, branches, corners = 0, self._branches, list[float]()
        branches.begin(start + first * h)
        while done < n:
            done += branches.same(start, first + done, n - done, h)
            if done == n:
                break
            found, jump = self._between(start + (first + done) * h, start + (first + done + 1) * h)
            corners += found
            if jump is not None:
                return Ahead(done, corners, jump)
            done += 1
        # whatever the steps of one call, each knows the same corners
        end = start + (first + n) * h
        near = _NEAR * h + _ROUNDED * abs(end)
        if not branches.same(end, 0, 1, near):
            corners += [corner for _, corner in branches.between(end, end + near)]
        return Ahead(n, corners)

    def _between(self, low: float, high: float) -> tuple[list[float], DriveJump | None]:
        """The corners before the first jump between two times, and the jump."""
        rates, aside, corners = self._branches.rates, _ASIDE * (high - low), list[float]()
        least = _JUMP * np.maximum(np.abs(rates(low)), np.abs(rates(high)))

        def difference(last: float, end: float, away: float) -> Floats:
            """Of the rates on both sides, from where roundings have faded."""
            before = 2.0 * rates(max(last - away, low)) - rates(max(last - 2.0 * away, low))
            return np.abs(2.0 * rates(end + away) - rates(end + 2.0 * away) - before)

        for last, end in self._branches.between(low, high):
            corners.append(end)
            near = np.abs(rates(end) - rates(last))
            if (near <= least).all():
                continue
            by = difference(last, end, aside)
            # a rate as √t differs less and less towards the corner; there roots have none
            fades = by < 0.5 * difference(last, end, _WIDE * aside)
            fades = np.where(np.isfinite(near), near < 0.1 * by, fades)
            if ((by > least) & ~fades).any():
                return corners, self._named(end, by)
        return corners, None

    def _named(self, t: float, by: Floats) -> DriveJump:
        layout = self._model.layout
        block, axis = divmod(int(np.argmax(by)), layout.dimension)
        name = next(n for n, at in layout.of_prescribed.items() if at == block)
        most = float(by[block * layout.dimension + axis])
        drives = {drive.name: drive for drive in self._model.mechanism.drives}
        is_angle = name in drives and drives[name].kind == 'angle'
        return DriveJump(name, t, most / layout.length if is_angle else most)
