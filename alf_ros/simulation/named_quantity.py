"""One quantity of samples by its name, and its derivative along a change of scene and state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.simulation.differences import OFFSETS, slope
from alf_ros.simulation.displaced_scenes import Displaced, Pushed
from alf_ros.simulation.full_names import full_name
from alf_ros.simulation.quantities import Group, groups, open_components
from alf_ros.simulation.sample import Sample

_WITHOUT = ('works.', 'diagnostics.')  # kinds of quantities without a derivative


@dataclass(frozen=True, eq=False)
class NamedQuantity:
    """`name` as a path in `Sample`; row and component (None: all) where its group has it."""

    name: str
    group: Group
    row: int
    component: int | None

    @property
    def is_vector(self) -> bool:
        """Whether it has several components."""
        return bool(self.group.components) and self.component is None

    @property
    def units(self) -> tuple[str, ...]:
        """The units that its components have, each once."""
        units = self.group.units
        return tuple(dict.fromkeys(units)) if self.component is None else (units[self.component],)

    def read(self, sample: Sample) -> Floats:
        """(components,) in a sample."""
        return self._of(np.asarray(self.group.read(sample), dtype=float))

    def read_beside(self, sample: Sample) -> tuple[Floats, float]:
        """As `read`, with the largest finite size in its group with the same units: a
        much smaller value may be rounding."""
        every = np.asarray(self.group.read(sample), dtype=float)
        alike = [unit in self.units for unit in self.group.units]
        sizes = np.abs(every[:, alike] if self.group.components else every)
        return self._of(every), float(sizes.max(initial=0.0, where=np.isfinite(sizes)))

    def _of(self, every: Floats) -> Floats:
        found = every[self.row]
        return np.atleast_1d(found if self.component is None else found[self.component])

    @property
    def turns(self) -> bool:
        """Whether it is an angle, which counts turns."""
        return self.units == ('rad',)

    def check_unique(self, sample: Sample) -> None:
        """Raises InputError if it is one of many that balance, as a share of redundant joints."""
        found = open_components(sample, self.group.names[self.row])
        if found.any() and (self.component is None or found[self.component]):
            told = f'is one of many that balance at t = {sample.t:.6g} s'
            raise InputError(
                f'no derivative: with redundant constraints it {told}', value=self.name
            )

    def checked(self, key: str) -> NamedQuantity:
        """Itself. Raises InputError, which says `key`, if it has no derivative."""
        if self.name.startswith(_WITHOUT):
            raise InputError('this quantity has no derivative', key=key, value=self.name)
        return self


def named_quantity(name: str, key: str, sample: Sample) -> NamedQuantity:
    """The quantity of a name, or of an end of it, as `record` takes them; `sample`: of the same
    scene. Raises InputError, which says `key`."""
    known: dict[str, tuple[Group, int, int | None]] = {}
    for group in groups(sample):
        for row, each in enumerate(group.names):
            known[each] = group, row, None
            for c, axis in enumerate(group.components):
                known[f'{each}.{axis}'] = group, row, c
    full = full_name(name, tuple(known), key)
    return NamedQuantity(full, *known[full])


def slope_along(
    read: Callable[[Sample], Floats],
    turns: bool,
    sample: Sample,
    around: Displaced,
    dq: Floats,
    dqd: Floats,
    what: str,
    size: float = 0.0,
) -> Floats:
    """(components,) the derivative of a reading where a number changes, and per unit of it the
    state by dq and dqd (blocks D, m and m/s).

    turns: it reads angles. what: the reading in words; size: of other terms that it sums. Raises
    InputError where the reading is not smooth.
    """
    change, size = changes_along(read, turns, sample, around, dq, dqd, size)
    return slope(change, around.step, around.name, f'{what} at t = {sample.t:.6g} s', size)


def changes_along(
    read: Callable[[Sample], Floats],
    turns: bool,
    sample: Sample,
    around: Displaced,
    dq: Floats,
    dqd: Floats,
    size: float,
) -> tuple[Floats, float]:
    """(8, components) how a reading differs in the scenes `around`, which `slope_along`
    differentiates, and the size of the values that it reads or sums."""
    here = read(sample)
    displaced = [
        read(
            scene.sample(
                sample.t, sample.state, offset * around.step * dq, offset * around.step * dqd
            )
        )
        for offset, scene in zip(OFFSETS, around.scenes, strict=True)
    ]
    change = np.array(displaced) - here
    if turns:
        change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
    return change, float(np.abs(here).max(initial=size))


def slope_by_push(read: Callable[[Sample], Floats], sample: Sample, pushed: Pushed) -> Floats:
    """(components,) the derivative of a reading by an effort or a wrench from outside, where the
    state stays.

    Accelerations, multipliers and reactions solve linear equations, in which such a force is on
    the right side. So they are affine in it, and one reading with it tells the derivative.
    """
    still = np.zeros_like(sample.state.q)
    here, there = (
        read(each.sample(sample.t, sample.state, still, still))
        for each in (pushed.still, pushed.by_one)
    )
    return np.asarray(there - here)
