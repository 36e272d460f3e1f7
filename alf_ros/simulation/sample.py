"""Sample: one instant of a run. Every quantity is computed when it is first read, then kept.

Kinematics and dynamics of the instant, and on top of them energy, efforts and reactions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros import html_table, kernel
from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import AlfError, InputError
from alf_ros.model.compile import Model
from alf_ros.model.constraints import couplings, rotors
from alf_ros.model.constraints.drives import effort
from alf_ros.model.null_spaces import dependent_rows
from alf_ros.scene.scene import Solver
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.dynamics import Dynamics
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.kept import kept
from alf_ros.simulation.named_values import NamedValues, read_only
from alf_ros.simulation.open_efforts import OpenEfforts
from alf_ros.simulation.reactions import ReactionsOf
from alf_ros.simulation.resolution import Known, Resolution
from alf_ros.simulation.sample_diagnostics import Diagnostics
from alf_ros.simulation.sample_limits import Place
from alf_ros.simulation.sample_tangents import MotionTangent
from alf_ros.simulation.state import State
from alf_ros.simulation.tangent_following import Followed

_SPINS = {2: 1, 3: 3}  # numbers of a torque
_NONE = read_only(np.zeros(0))


@dataclass(frozen=True)
class JointState:
    """position (rad, or m along a slider), velocity, effort (N m or N) on the free axis.

    `indeterminate`: the effort is one of many that balance, because drives are redundant.
    """

    position: float
    velocity: float
    effort: float
    indeterminate: bool = False


@dataclass(frozen=True)
class Reaction:
    """Wrench of the parent on the child at the joint, world frame: force (D,) N; torque N m, in
    the plane a number, about +z, in space (3,).

    `indeterminate`: the constraints are redundant here, and the share of this joint is one of many
    that balance (the one of least norm); or the sample is in a singular position where the
    reaction has a pole: components that have no limit are NaN. `open_force` (D,) and `open_torque`
    (1 or 3,): which components that is true of.
    """

    force: Floats
    torque: float | Floats
    indeterminate: bool
    open_force: NDArray[np.bool_]
    open_torque: NDArray[np.bool_]


class Sample(Dynamics):
    """State, forces and health at one instant; arrays are read-only, SI, world frame."""

    def __init__(
        self,
        model: Model,
        applied: Applied,
        solver: Solver,
        t: float,
        state: State,
        dependent_rows: int,
        instruments: Instruments,
        iterations: int,
        step_cost: float,
        beside: bool | None,
        resolution: Callable[[], Resolution],
        followed: Followed | None = None,
    ) -> None:
        """`beside`: whether the step that ended here was interpolated beside a singular position;
        None if no step did."""
        super().__init__(model, applied, solver, t, state, dependent_rows, beside, instruments)
        self._told = iterations, step_cost, resolution
        self._followed = followed

    @property
    def tangents(self) -> Mapping[str, MotionTangent]:
        """Derivatives of this sample by each number of the scene that the simulation was given.

        Raises InputError if it was given none, and for one that has no derivative there.
        """
        if self._followed is None:
            raise InputError(
                'no tangents follow',
                key='tangents',
                expected="Simulation(…, tangents=['coupler.mass', …])",
            )
        followed = self._followed
        names, slopes = followed.following.names, followed.slopes
        return NamedValues(
            names,
            lambda k: MotionTangent(
                self.model,
                self._state,
                k,
                slopes(names[k]),
                partial(followed.quantity, self, k),
                self._instruments,
            ),
        )

    @property
    def diagnostics(self) -> Diagnostics:
        """Its health."""
        return Diagnostics(self, *self._told)

    def __reduce__(self) -> tuple[Any, ...]:
        """State without computed values, which are computed again on demand."""
        iterations, step_cost, resolution = self._told
        parts = self.model, self._applied, self._solver, self.t, self._state, self._dependent_rows
        health = iterations, step_cost, self._beside, Known(resolution())
        return Sample, (*parts, self._instruments, *health, self._followed)

    @property
    def _reactions(self) -> ReactionsOf:
        return self._instruments.reactions

    # -------------------------------------------------------------------------------------- energy

    @property
    def inputs(self) -> Inputs:
        """The wrenches and efforts held."""
        return self._applied.inputs

    @property
    def effects(self) -> tuple[str, ...]:
        """The labels of the effects of the scene."""
        return tuple(dict.fromkeys(effect.label for effect in self._applied.effects))

    @kept
    def energy(self) -> float:
        """Total mechanical energy, J: kinetic, and the potential of the effects that have one."""
        effects = self._applied.assembled.effects
        stored = kernel.potential_energy(effects, self.t, self._state.q, self._near)
        return self._within_numbers(self.kinetic_energy + stored)

    @kept
    def stored(self) -> Mapping[str, float]:
        """Potential energy of each effect of the scene, J; 0 for what stores none."""
        return {
            label: self._within_numbers(
                kernel.potential_energy(part.effects, self.t, self._state.q, self._near)
            )
            for label, part in self._applied.each.items()
        }

    @property
    def works(self) -> Mapping[str, float]:
        """Work of each effect since the start, J, named as in `powers`; 'inputs' for all commands,
        'drives' for drives and belts.

        Together they are the change of kinetic energy. The dissipation of an effect is the fall of
        its stored energy minus its work. Raises InputError without a ledger.
        """
        if not self._state.works:
            raise InputError(
                'no ledger is kept', key='works', expected='Simulation(…, ledger=True)'
            )
        for work in self._state.works.values():
            self._within_numbers(work)
        return self._state.works

    @kept
    def powers(self) -> Mapping[str, float]:
        """Power of each effect of the scene, W; negative if the effect removes energy.

        By kind, or `kind.name` where it has a name of its own.
        """
        qd = self._state.qd
        with np.errstate(over='ignore', invalid='ignore'):
            return {
                label: self._within_numbers(float(Q @ qd)) for label, Q in self.forces_by_effect()
            }

    # -------------------------------------------------------------------------------------- joints

    @kept
    def joint_efforts(self) -> Floats:
        """(joint coordinates,) efforts on the free axis, N m or N: inputs held, motors, springs,
        stops, friction, drives; not the reaction."""
        model, place = self.model, self.model.coordinate_names.index
        efforts = np.zeros(len(model.coordinates))
        for name, held in self._applied.inputs.efforts.items():
            efforts[place(name)] = held.at(self.t)[0] if isinstance(held, Curve) else held
        if self._applied.acts_on_axes:
            unit, state, cut = model.unit, self._state, self._reactions()
            (axes, part), lent = self._applied.on_axes(cut.cut), self._instruments.lend_cut()
            there = lent.workspace
            loads = self._loads[part.loads] if part.loads else np.zeros(0)
            kernel.place_on_cut(unit, cut.arrays, there, state.q, state.qd)
            effects, near = part.effects, self._near
            kernel.add_joint_efforts(unit, axes, effects, there, self.t, near, loads, efforts)
        for drive in self.model.mechanism.drives:
            if drive.kind in ('angle', 'length'):
                n = self.model.coordinate_names.index(drive.of[0])
                efforts[n] += self.drive_efforts[drive.name][0]
        return read_only(efforts)

    @kept
    def geared_efforts(self) -> Floats:
        """(joint coordinates,) efforts on the free axis, N m or N, of couplings and of the inertia
        of rotors: multipliers of rows that bind rates of coordinates; not in `joint_efforts`."""
        model = self.model
        mechanism, place = model.mechanism, model.coordinate_names.index
        efforts = np.zeros(len(model.coordinates))
        for coupling in mechanism.couplings:
            pull = self.multipliers[coupling.name] * couplings.unit_of(coupling, model.layout)
            for name, factor in coupling.of:
                efforts[place(name)] -= factor * pull
        for rotor in mechanism.rotors:
            pull = self.multipliers[rotor.name] * rotors.unit_of(rotor, model.layout)
            for name, factor in rotor.of:
                efforts[place(name)] -= factor * pull
        return read_only(efforts)

    @kept
    def drive_efforts(self) -> Mapping[str, Floats]:
        """Effort of each drive: (1,) N m or N along its coordinate, (D,) N on its point."""
        model, drives = self.model, self.model.mechanism.drives
        if not drives:
            return {}
        layout, of = model.layout, model.layout.of_prescribed

        def read(place: Place) -> Floats:
            work, pull = place.work, np.zeros(place.work.q.size)
            kernel.add_transposed(model.unit, model.system.rows, work.g, work.g2, work.y, pull)
            q, pulls = work.q.reshape(-1, layout.dimension), pull.reshape(-1, layout.dimension)
            efforts = [effort(drive, q[of[drive.name]], pulls[of[drive.name]]) for drive in drives]
            sizes[:] = [each.size for each in efforts]
            return np.concatenate([np.zeros(0), *efforts])

        sizes: list[int] = []
        values = self._read(read)
        ends = np.cumsum(sizes)[:-1]
        return {
            drive.name: read_only(value)
            for drive, value in zip(drives, np.split(values, ends), strict=True)
        }

    @kept
    def drives(self) -> tuple[Floats, Floats, Floats]:
        """(motions,) position (rad or m), velocity and effort (N m or N) of each function of time
        that a drive prescribes, in the order of `driving.motion_names`."""
        layout, state = self.model.layout, self._state
        if not self.model.mechanism.drives:
            return _NONE, _NONE, _NONE
        rows: list[tuple[float, float, float]] = []
        for drive in self.model.mechanism.drives:
            efforts = self.drive_efforts[drive.name]
            if drive.kind == 'angle':
                joint = self.joints[drive.of[0]]
                rows.append((joint.position, joint.velocity, efforts[0]))
                continue
            block = layout.of_prescribed[drive.name]
            s, sd = (x.reshape(-1, layout.dimension)[block] for x in (state.q, state.qd))
            moving = zip(s, sd, efforts, drive.motion, strict=False)
            rows += [(x, v, e) for x, v, e, motion in moving if motion is not None]
        position, velocity, efforts = np.array(rows, dtype=float).reshape(-1, 3).T
        return read_only(position), read_only(velocity), read_only(efforts)

    @property
    def joints(self) -> Mapping[str, JointState]:
        """Position, velocity and effort of each joint coordinate; of a joint that has one, by the
        name of the joint."""
        return NamedValues(
            self.model.coordinate_names,
            lambda n: JointState(
                float(self.joint_positions[n]),
                float(self.joint_velocities[n]),
                float(self.joint_efforts[n]),
                bool(self.open_joint_efforts[n]),
            ),
        )

    @kept
    def open_drive_efforts(self) -> Mapping[str, NDArray[np.bool_]]:
        """Of each number in `drive_efforts` whether it is one of many that balance: another drive
        or a loop holds the same freedom."""
        drives, found = self.model.mechanism.drives, self._open_efforts
        return {
            drive.name: np.isnan(self.drive_efforts[drive.name])
            | (False if found is None else found.of_drive(drive))
            for drive in drives
        }

    @property
    def open_motion_efforts(self) -> NDArray[np.bool_]:
        """(motions,) the same of each effort in `drives`."""
        drives = self.model.mechanism.drives
        each = [
            is_open
            for drive in drives
            for is_open, motion in zip(
                self.open_drive_efforts[drive.name], drive.motion, strict=False
            )
            if motion is not None
        ]
        return np.array(each, dtype=bool)

    @kept
    def open_joint_efforts(self) -> NDArray[np.bool_]:
        """(joint coordinates,) the same of each effort in `joint_efforts`."""
        is_open = np.isnan(self.joint_efforts)
        for drive in self.model.mechanism.drives:
            if drive.kind in ('angle', 'length'):
                n = self.model.coordinate_names.index(drive.of[0])
                is_open[n] |= self.open_drive_efforts[drive.name][0]
        return is_open

    @kept
    def _open_efforts(self) -> OpenEfforts | None:
        """None if all efforts of drives are unique."""
        redundant, work = self._redundant, self._linearised
        if self._limits is not None:  # of rows that depend on others also beside the position
            redundant, work = self._dependent_rows, self._limits.beside
        if not redundant or not self.model.mechanism.drives:
            return None
        shares = self._instruments.shares
        if shares is None:
            return OpenEfforts(self.model, work, dependent_rows(self.model, work)[0])
        with self._on_cut() as there:
            return OpenEfforts(self.model, work, shares.open_rows(work, there))

    # ----------------------------------------------------------------------------------- reactions

    @kept
    def _wrenches(self) -> tuple[Floats, Floats]:
        cut, unit, D = self._reactions(), self.model.unit, self.model.layout.dimension
        joints, effects = len(self.model.joint_names), self._applied.on(cut.cut)
        with self._on_cut() as there:
            applied = there.Q.copy()

            def read(place: Place) -> Floats:
                work, loads = place.work, place.loads
                there.Q[:] = applied
                if loads.size:
                    kernel.place_on_cut(unit, cut.arrays, there, work.q, work.qd)
                    q, qd, Q = there.q, there.qd, there.Q
                    kernel.add_friction(effects, self.t, q, qd, self._near, loads, Q)
                wrenches = np.empty(joints * (D + _SPINS[D]))
                force, torque = wrenches[: joints * D], wrenches[joints * D :]
                kernel.joint_wrenches(unit, cut.arrays, there, work, force, torque)
                return wrenches

            both = self._read(read)
        return both[: joints * D].reshape(-1, D), both[joints * D :].reshape(-1, _SPINS[D])

    @property
    def reaction_forces(self) -> Floats:
        """(joints, D) N: parent on child at the joint, world frame."""
        return read_only(self._wrenches[0])

    @property
    def reaction_torques(self) -> Floats:
        """(joints, 1 or 3) N m: parent on child about the joint, world frame; in the plane +z."""
        return read_only(self._wrenches[1])

    @property
    def reactions(self) -> Mapping[str, Reaction]:
        """Force and torque of parent on child in each joint."""
        D = self.model.layout.dimension

        def reaction(n: int) -> Reaction:
            torque, unknown = self.reaction_torques[n], self._open_components[n]
            return Reaction(
                self.reaction_forces[n],
                float(torque[0]) if D == 2 else torque,
                bool(self._indeterminate[n]),
                unknown[:D],
                unknown[D:],
            )

        return NamedValues(self.model.joint_names, reaction)

    @kept
    def open_loads(self) -> tuple[str, ...]:
        """Effects, as in `powers`, whose friction follows a force that is one of many: so is the
        motion."""
        if not self._applied.loading or not self.diagnostics.redundant:
            return ()
        D, names = self.model.layout.dimension, self.model.joint_names
        open_forces = np.asarray(self._open_components[:, :D].any(axis=1))
        loading = self._applied.loading.items()
        return tuple(label for label, joint in loading if open_forces[names.index(joint)])

    @property
    def _indeterminate(self) -> NDArray[np.bool_]:
        """(joints,) whether the reaction is one of many that balance."""
        return np.asarray(self._open_components.any(axis=1))

    @kept
    def _open_components(self) -> NDArray[np.bool_]:
        """(joints, D + 1 or 3) the same of each component of force and torque."""
        cut, work = self._reactions(), self._linearised
        redundant, shares = self._redundant, self._instruments.shares
        unknown: NDArray[np.bool_] = np.zeros((len(cut.model.joint_names), cut.components), bool)
        if self._limits is not None:  # of rows that depend on others also beside the position
            redundant, work = self._dependent_rows, self._limits.beside
        if self._limits is not None or self._within:
            unknown = np.isnan(np.column_stack(self._wrenches))
        if redundant and shares is not None:
            with self._on_cut() as there:
                unknown |= shares.open_components(work, there)
        elif redundant:
            lent = self._instruments.lend_cut()
            unknown |= cut.indeterminate(lent.workspace, work)
        return unknown

    # ---------------------------------------------------------------------------------- a notebook

    def __repr__(self) -> str:
        joints = len(self.model.coordinate_names)
        return f'<Sample at t = {self.t:.9g} s, {joints} joint coordinates>'

    def _repr_html_(self) -> str:
        """HTML for a notebook: it computes energy, joint coordinates and reactions."""
        try:
            parts = [self._about(), self._joint_table(), self._reaction_table()]
        except AlfError as error:
            parts = [html_table.paragraph(str(error))]
        return html_table.heading(f'Sample at t = {self.t:.9g} s') + ''.join(parts)

    def _about(self) -> str:
        told = self.diagnostics
        at = 'in a singular position' if told.singular else 'no'
        return html_table.pairs(
            [
                ('energy', f'{html_table.number(self.energy)} J'),
                ('constraints open by', f'{told.position_violation:.2g} m'),
                ('singular', at),
            ]
        )

    def _joint_table(self) -> str:
        coordinates = self.model.coordinates
        rows = (
            (
                each.name,
                *(
                    f'{html_table.number(values[n])} {units[0 if each.is_angle else 1]}'
                    for values, units in (
                        (self.joint_positions, ('rad', 'm')),
                        (self.joint_velocities, ('rad/s', 'm/s')),
                        (self.joint_efforts, ('N m', 'N')),
                    )
                ),
                'one of many' if self.open_joint_efforts[n] else '',
            )
            for n, each in enumerate(coordinates)
        )
        head = ('joint coordinate', 'position', 'velocity', 'effort', 'share')
        return html_table.table(head, rows, len(coordinates))

    def _reaction_table(self) -> str:
        names = self.model.joint_names
        rows = (
            (
                name,
                ', '.join(map(html_table.number, self.reaction_forces[n])),
                ', '.join(map(html_table.number, self.reaction_torques[n])),
                'one of many' if self._indeterminate[n] else '',
            )
            for n, name in enumerate(names)
        )
        head = ('joint', 'force of parent on child, N', 'torque, N m', 'share')
        return html_table.table(head, rows, len(names))
