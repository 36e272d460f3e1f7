"""Quantities of all members at an instant, read in compiled calls: those whose values need no
more than the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.lanes.observing import JOINT, JOINT_RATE, Observing, observe
from alf_ros.model.member_energies import MemberEnergies, observe_energies
from alf_ros.model.member_rows import LENGTHS, Geometry, MemberRows
from alf_ros.model.member_structs import MemberStructs
from alf_ros.simulation.full_names import full_name
from alf_ros.simulation.quantities import Group, Quantity, groups
from alf_ros.simulation.simulation import Simulation

_ENERGIES = 'energy', 'kinetic_energy'


def readable(simulation: Simulation, names: Sequence[str]) -> list[Quantity] | None:
    """The quantities of these names, or ends of names, of a simulation; None if one needs more
    than states. Raises InputError for an unknown name."""
    known = groups(simulation.sample())
    owner: dict[str, tuple[Group, str]] = {}
    for group in known:
        for name in group.names:
            owner |= dict.fromkeys((f'{name}.{axis}' for axis in group.components), (group, name))
            owner[name] = group, name
    found: dict[str, Quantity] = {}
    for asked in names:
        group, name = owner[full_name(asked, tuple(owner), 'only')]
        head, _, tail = name.rpartition('.')
        of_joint = head.startswith('joints.') and tail in ('position', 'velocity')
        if not (of_joint or head in ('points', 'velocities') or name in _ENERGIES):
            return None
        found[name] = Quantity(name, group.units, group.components)
    return list(found.values())


class MemberReadings:
    """Reads quantities of members like a simulation, whose data stand in `problems`, `phases`."""

    def __init__(
        self,
        simulation: Simulation,
        quantities: Sequence[Quantity],
        rows: MemberRows,
        problems: MemberStructs,
        phases: MemberStructs,
    ) -> None:
        self._rows, self._problems, self._phases = rows, problems, phases
        self._model, self._members = simulation.model, problems.members
        coordinates = simulation._run.stepper.instruments.coordinates
        self._joints = MemberStructs(coordinates, problems.members, LENGTHS)
        self._read = [self._reader(each.name) for each in quantities]
        names = [each.name for each in quantities]
        self._of_joints = (
            self._observing() if any(n.startswith('joints.') for n in names) else None
        )
        self._energies = self._summing() if any(n in _ENERGIES for n in names) else None
        self._kinetic = np.zeros(problems.members)

    def _reader(self, name: str) -> Callable[[], Floats]:
        """The values of a quantity, (members,) or (members, D), at the instant that was read."""
        model, phases = self._model, self._phases
        head, _, tail = name.rpartition('.')
        if name == 'energy':
            return lambda: self._kinetic + self._told_energies().stored
        if name == 'kinetic_energy':
            return lambda: self._kinetic
        if head in ('points', 'velocities'):
            D = model.layout.dimension
            block = int(model.point_block[model.point_names.index(tail)])
            of = phases.q if head == 'points' else phases.qd
            return lambda: np.asarray(of[:, block * D : (block + 1) * D])
        joint = model.coordinate_names.index(head.partition('.')[2])
        at = joint if tail == 'position' else len(model.coordinate_names) + joint
        return lambda: self._told_joints().numbers.reshape(self._members, -1)[:, at]

    def _observing(self) -> Observing:
        joints, angles = len(self._model.coordinate_names), self._angles
        kinds = np.repeat([JOINT, JOINT_RATE], joints).astype(np.uint32)
        return Observing(
            problem=self._problems.addresses,
            phase=self._phases.addresses,
            joints=self._joints.addresses,
            kind=kinds,
            which=np.tile(np.arange(joints, dtype=np.uint32), 2),
            **{name: np.zeros(angles) for name in ('angles', 'spins', 'near')},
            **{name: np.zeros(joints) for name in ('values', 'rates')},
            numbers=np.zeros(self._members * kinds.size),
        )

    def _summing(self) -> MemberEnergies:
        return MemberEnergies(
            problem=self._problems.addresses,
            phase=self._phases.addresses,
            momenta=np.zeros(self._members * self._model.n),
            stored=np.zeros(self._members),
            one=np.zeros(self._model.n),
            **{name: np.zeros(self._angles) for name in ('angles', 'spins', 'near')},
        )

    def take(self, geometry: Sequence[Geometry]) -> None:
        """Read members of this geometry from now on."""
        self._rows.put_lengths(geometry, self._joints)

    @property
    def _angles(self) -> int:
        return self._model.system.angles.c.size // 2

    def _told_joints(self) -> Observing:
        assert self._of_joints is not None
        return self._of_joints

    def _told_energies(self) -> MemberEnergies:
        assert self._energies is not None
        return self._energies

    def at(self, t: float) -> list[Floats]:
        """The quantities of all members now, at t (s): (members,) or (members, D) of each."""
        problem, phase = self._problems.member(0), self._phases.member(0)
        if self._of_joints is not None:
            observe(problem, phase, self._joints.member(0), self._of_joints)
        if self._energies is not None:
            observe_energies(problem, phase, t, self._energies)
            n, qd = self._model.n, self._phases.qd
            momenta = self._energies.momenta.reshape(self._members, n)
            # a product of two vectors for each, as a sample makes it: other sums are rounded
            # otherwise
            products = np.matmul(momenta[:, None, :], qd[:, :n, None])
            self._kinetic = 0.5 * products[:, 0, 0]
        return [np.array(read()) for read in self._read]
