"""The numbers in which members of one structure differ: lengths, masses, numbers of effects,
velocities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.columns import Divided, spread
from alf_ros.effects import Effect
from alf_ros.errors import AlfError
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.packing import RowNumbers
from alf_ros.model.mass import BodyMasses, masses_of
from alf_ros.model.member_rows import Geometry, MemberRows, are_rows_of
from alf_ros.scene.scene import Scene
from alf_ros.simulation.packed_effects import AskedFunctions, PackedKind, kinds_of
from alf_ros.simulation.simulation import Simulation


class MemberNumbers(NamedTuple):
    """The numbers of one member: of its rows; masses of all bodies, one after another, as
    `BodyMasses` has them; of `Effects.params`; and the velocities given (m/s) in the order in
    which rows hold them."""

    geometry: Geometry
    masses: Sequence[float] | Floats
    bound: Sequence[tuple[float, float]] | Floats
    params: Floats
    given: Floats


def is_same(one: MemberNumbers, other: MemberNumbers | None) -> bool:
    """Whether the numbers of two members are the same, in all bits."""
    return other is not None and _bits(one) == _bits(other)


def _bits(numbers: MemberNumbers) -> list[bytes]:
    geometry, *others = numbers
    parts = (geometry.size, geometry.drawn, *geometry.rows, *others)
    return [np.asarray(part, dtype=float).tobytes() for part in parts]


class Likeness:
    """Whether scenes are like the scene of a simulation in all but such numbers, and theirs."""

    def __init__(self, simulation: Simulation) -> None:
        """`simulation`: one for which `unlike` finds nothing."""
        stepper, self._scene = simulation._run.stepper, simulation.scene
        self.layout, mechanism = simulation.model.layout, self._scene.mechanism
        self.rows = MemberRows(simulation.model)
        self._geometry = self.rows.of(self.layout)
        embedded = stepper.method.embedded.size > 0
        self._asked = AskedFunctions(sides=embedded, intervals=True)
        kinds = kinds_of(self._scene.effects, self.layout, self._asked)
        self._kinds = [_structure(kind) for kind in kinds]
        self.bodies = [(body, masses_of(body, self.layout)) for body in mechanism.bodies]
        self._velocities = _places(self._scene)
        self._given = _given(self._scene, self.layout)

    def numbers_of(self, scene: Scene) -> MemberNumbers | None:
        """The numbers of a scene; None if it is another one in more than numbers."""
        own, mechanism = self._scene, scene.mechanism
        if mechanism.structure != own.mechanism.structure or mechanism.rotors:
            return None
        if scene.solver != own.solver or scene.positions or scene.branch is not None:
            return None
        if _places(scene) != self._velocities:
            return None
        layout, geometry = self.layout.like(mechanism), self._geometry
        if mechanism.geometry != own.mechanism.geometry:
            geometry = self.rows.of(layout)
        if geometry is None:
            return None
        masses: list[float] = []
        bound: list[tuple[float, float]] = []
        for body, (first, known) in zip(mechanism.bodies, self.bodies, strict=True):
            same = body is first and geometry is self._geometry
            found = known if same else masses_of(body, layout, known=False)
            if found is not known and _bound(found) != _bound(known):
                return None
            masses += found.masses
            bound += found.bound
        params = self._params(scene.effects, layout)
        if params is None:
            return None
        return MemberNumbers(geometry, masses, bound, params, _given(scene, layout))

    def numbers_of_columns(self, scene: Scene, members: int) -> list[MemberNumbers] | None:
        """The numbers of each member of a scene whose numbers are columns; None if it is another
        one in more than numbers. Raises what `overrides.of_members` does."""
        found = self.numbers_of(scene)
        if found is None:
            return None
        geometry, masses = found.geometry, columns.array(found.masses)
        bound, size = columns.array(found.bound).reshape(-1, 2), columns.array([geometry.size])
        parts = (size, geometry.drawn, *geometry.rows, masses, bound, found.params, found.given)
        every = []
        for (size,), drawn, *numbers in zip(
            *(spread(each, members) for each in parts), strict=True
        ):
            shape = Geometry(float(size), drawn, RowNumbers(*numbers[:4]))
            every.append(MemberNumbers(shape, *numbers[4:]))
        return every

    def _params(self, effects: Sequence[Effect], layout: Layout) -> Floats | None:
        """The numbers of effects on a layout; None if they are others in more than numbers."""
        try:
            kinds = kinds_of(effects, layout, self._asked)
        except Divided:
            raise
        except (AlfError, ArithmeticError):
            return None  # alone it fails again, and says why
        if [_structure(kind) for kind in kinds] != self._kinds:
            return None
        return np.asarray(columns.concatenated([kind.packed.params for kind in kinds]))


def unlike(simulation: Simulation) -> str:
    """Why no other member can be made from the numbers in which it differs from this one; empty
    if others can."""
    start, scene, system = simulation._start, simulation.scene, simulation.model.system
    if scene.mechanism.geometry is None or scene.mechanism.prescribed:
        return 'motions as functions of time differ by more than numbers'
    if scene.mechanism.auxiliary or system.rows.velocity or system.integrals.row.size:
        return 'rows of velocities and blocks of no body are made for each member'
    if not are_rows_of(simulation.model):
        return 'rows that are made otherwise are made for each member'
    if start.dependent_rows or start.near or start.singular or start.adjustment:
        return 'redundant rows and singular positions are examined for each member'
    if scene.positions or scene.branch is not None:
        return 'positions given are closed for each member'
    if simulation.accuracy is not None or simulation.solver != scene.solver:
        return 'settings that are picked belong to one member'
    return ''


def _bound(masses: BodyMasses) -> tuple[object, ...]:
    """The blocks that masses bind, and which of their numbers are zero."""
    zero = [(k == 0.0, w == 0.0) for k, w in masses.bound]
    return masses.blocks, masses.pairs, zero


def _structure(kind: PackedKind) -> tuple[object, ...]:
    """All of a packed kind but its numbers."""
    packed = kind.packed
    addresses = kind.force, kind.potential, kind.friction, kind.tangent, kind.side, kind.interval
    sizes = packed.params.size, packed.intervals, len(kind.rubbing)
    return kind.name, addresses, packed.slots.tobytes(), packed.instants.tobytes(), sizes


def _places(scene: Scene) -> tuple[tuple[str, tuple[bool, ...]], ...]:
    """Which velocities are given."""
    return tuple(
        (name, tuple(each is None for each in values)) for name, values in scene.velocities.items()
    )


def _given(scene: Scene, layout: Layout) -> Floats:
    """The velocities given, m/s; components of vectors are in their own length."""
    found: list[float] = []
    for name, values in scene.velocities.items():
        unit = 1.0 if name in layout.of_point else layout.length
        # as from the constant of a row, where zero has the other sign
        found += [-(0.0 - unit * value) for value in values if value is not None]
    return np.asarray(columns.array(found))
