"""Members of a study that are made together, structure by structure.

Usually all members have one structure. Where a number is zero for some members, or rounding
decides whether a coefficient is, they have a few: each has memory for members (`AlikeMembers`).
Members of a rare structure, and those that nobody is like, are left to be built one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from alf_ros.columns import Divided
from alf_ros.errors import AlfError, StoppedError
from alf_ros.inspection.run import RunsTogether
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.scene.scene import Scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.alike_members import AlikeMembers
from alf_ros.simulation.member_numbers import MemberNumbers, is_same, unlike
from alf_ros.simulation.member_readings import readable
from alf_ros.simulation.quantities import Quantity
from alf_ros.simulation.side_by_side import no_place
from alf_ros.simulation.simulation import Simulation

Runs = tuple[list[int], RunsTogether]  # of these members

_MOST = 8  # structures of a study
_TRIED = 3  # members from which one structure is to be learnt
_COMPARED = 8  # members that are read in both ways, before others are read together
_TRIES = 16  # groups of members that are read together: they are divided by structure


@dataclass
class _Structure:
    """Memory for members of one structure; those that wait for their run; how many had this
    structure, and how many came to the end."""

    alike: AlikeMembers
    waiting: dict[int, MemberNumbers] = field(default_factory=dict)
    count: int = 0
    done: int = 0

    @property
    def is_of_use(self) -> bool:
        """Whether members come to the end, as far as is known."""
        return self.done > 0 or self.count < 2 * width()

    def takes(self, k: int, scene: Scene) -> bool:
        """Whether member k is of this structure; then it waits."""
        own = self.alike.numbers_of(scene)
        if own is not None:
            self.waits(k, own)
        return own is not None

    def waits(self, k: int, own: MemberNumbers) -> None:
        """Member k, which has these numbers, waits."""
        self.waiting[k] = own
        self.count += 1

    def run(self, duration: float, at: Sequence[float]) -> Iterator[Runs]:
        """Run the members that wait; those that come to the end in the usual way."""
        numbers, self.waiting = self.waiting, {}
        if not numbers:
            return
        try:
            t, values, good = self.alike.run(list(numbers.values()), duration, at)
        except StoppedError:
            raise
        except AlfError:
            return
        self.done += int(good.sum())
        if good.any():
            arrays = [each[good] for each in values]
            quantities = dict(zip(self.alike.quantities, arrays, strict=True))
            members = [k for k, came in zip(numbers, good.tolist(), strict=True) if came]
            yield members, RunsTogether(t, quantities)


def _are_same(
    of: _Structure, members: Sequence[tuple[int, MemberNumbers]], read_one: Callable[[int], Scene]
) -> bool:
    """Whether the numbers of members that were read together have the bits of those read one by
    one. They have where numpy's library multiplies matrices in a stack as it does single ones."""
    try:
        return all(is_same(own, of.alike.numbers_of(read_one(k))) for k, own in members)
    except AlfError:
        return False


def _neighbourhood(member: tuple[int, MemberNumbers]) -> list[float]:
    """Members whose lists are close in order are alike in the first number in which any differ."""
    geometry, masses, _, params, given = member[1]
    rows = (each for part in geometry.rows for each in part)
    return [geometry.size, *given, *geometry.drawn, *rows, *masses, *params]


class Structures:
    """The structures that members of a study are known to have, as they come. One thread at a time
    uses it.

    names: the quantities to be read; duration (s); `at`: the instants (s) at which they are read;
    `likely`: how many members come at a time.
    """

    def __init__(
        self, names: Sequence[str], duration: float, at: Sequence[float], likely: int
    ) -> None:
        self._names, self._duration, self._at, self._likely = names, duration, at, likely
        self._known: list[_Structure] = []
        self._learning = True
        self._trusted: bool | None = None

    @property
    def known(self) -> int:
        """How many structures are known."""
        return len(self._known)

    @property
    def most(self) -> int:
        """How many members of a structure are run at a time, of those that are known."""
        return max((each.alike.most for each in self._known), default=0)

    def run(self, scenes: Iterable[tuple[int, Scene]]) -> Iterator[Runs]:
        """Members with their scenes, in: those that are run together with others, with their
        runs."""
        others: dict[int, Scene] = {}
        for k, scene in scenes:
            if not any(each.takes(k, scene) for each in self._known) and self._learning:
                others[k] = scene
                if len(others) >= (2 * width() if self._known else _TRIED):
                    self._learn(others)
            for each in self._known:
                if len(each.waiting) == each.alike.most:
                    yield from each.run(self._duration, self._at)
            if not (self._known or self._learning):
                return
        if not self._known and self._learning:
            self._learn(others)
        yield from self._ended()

    def run_read_together(
        self,
        members: Sequence[int],
        read: Callable[[Sequence[int]], Scene | None],
        read_one: Callable[[int], Scene],
    ) -> Iterator[Runs]:
        """`run` of members that are read together, of structures that are known. `read` gives the
        scene of some of them, whose numbers are columns (`overrides.of_members`); `read_one` the
        scene of one."""
        for each, numbers in self._read(members, read):
            if self._trusted is None:
                self._trusted = _are_same(each, numbers[:_COMPARED], read_one)
            if not self._trusted:
                break
            # neighbours pass singular positions at about the same time, where steps cost more
            for k, own in sorted(numbers, key=_neighbourhood):
                each.waits(k, own)
                if len(each.waiting) == each.alike.most:
                    yield from each.run(self._duration, self._at)
        yield from self._ended()

    def _read(
        self, members: Sequence[int], read: Callable[[Sequence[int]], Scene | None]
    ) -> Iterator[tuple[_Structure, list[tuple[int, MemberNumbers]]]]:
        """The members that can be read together, structure by structure, with their numbers."""
        groups, tries = [np.array(members)], 0
        while groups and tries < _TRIES:
            group, tries = groups.pop(0), tries + 1
            try:
                scene = read(group.tolist())
                if scene is None:
                    continue
                for each in self._known:
                    found = each.alike.numbers_of_columns(scene, group.size)
                    if found is not None:
                        yield each, list(zip(group.tolist(), found, strict=True))
                        break
            except Divided as divided:
                parts = group[divided.agreeing], group[~divided.agreeing]
                groups += [part for part in parts if width() <= part.size < group.size]
            except (AlfError, ArithmeticError, MemoryError, TypeError, ValueError):
                continue  # one by one they say why

    def _ended(self) -> Iterator[Runs]:
        """Run all members that wait; forget structures of no use."""
        for each in self._known:
            yield from each.run(self._duration, self._at)
        if not all(each.is_of_use for each in self._known):
            self._learning = False
            self._known = [each for each in self._known if each.is_of_use]

    def _learn(self, others: dict[int, Scene]) -> None:
        """Learn the structure of one of the first members among the `others`; the members that
        have it wait."""
        alike = None
        for scene in list(others.values())[:_TRIED]:
            try:
                alike = self._like(scene)
            except (AlfError, ArithmeticError, MemoryError):
                continue
            break
        if alike is not None:
            found = _Structure(alike)
            self._known.append(found)
            for k in [k for k, scene in others.items() if found.takes(k, scene)]:
                del others[k]
        if alike is None or len(self._known) == _MOST or (found.count < 2 and self.known > 1):
            self._learning = False
            self._known = [each for each in self._known if each.count > 1]

    def _like(self, scene: Scene) -> AlikeMembers | None:
        """Memory for members like this one; None if it has to be built by itself, or if more than
        its states is read. Raises what its simulation does."""
        first = Simulation(scene)
        quantities = read_together(first, self._names, self._at)
        return AlikeMembers(first, quantities, self._likely) if quantities is not None else None


def read_together(
    simulation: Simulation, names: Sequence[str], at: Sequence[float]
) -> list[Quantity] | None:
    """The quantities of these names, if members like a simulation are made together and read at
    these instants (s); None if each has to be built by itself, or if more than its states is
    read. Raises InputError for an unknown name."""
    quantities = readable(simulation, names)
    if quantities is None or unlike(simulation) or no_place(simulation):
        return None
    h = simulation.h
    steps = [math.floor(t / h + check.CLOSE) for t in at]
    is_on_grid = all(t - n * h <= check.CLOSE * h for t, n in zip(at, steps, strict=True))
    return quantities if is_on_grid else None  # others are reached aside
