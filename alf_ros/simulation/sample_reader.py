"""Readings of a run's present, step by step: one compiled call writes them where they are wanted.

A `Sample` computes each quantity when it is read, and keeps it. Here the quantities are known
beforehand, such as the topics of a node, and their numbers go straight into arrays of the caller,
such as the bytes of a message. They are the numbers of a sample, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.kernel import Axes, Cut, CutWork, Effects, HeldForces, Modes, ReadOut
from alf_ros.kernel import readout as passes
from alf_ros.kernel.softest_modes import ALL_SOFT
from alf_ros.model.constraints.packing import indices
from alf_ros.model.softest_modes import KNOWN, MISSING, ROUNDS, begun, found
from alf_ros.simulation import state_vector
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.bearing_shares import has_bearings
from alf_ros.simulation.instruments import Workspace
from alf_ros.simulation.observables import joint_state_names
from alf_ros.simulation.one_thread import by_one_thread
from alf_ros.simulation.simulation import Simulation

# the fields of a reading (`observables`), in its order, and what the kernel calls it
_READINGS = {
    'state': (passes.STATE, ('number', 'number_rate')),
    'joint_states': (passes.JOINTS, ('position', 'velocity', 'effort')),
    'reactions': (passes.REACTIONS, ('wrench',)),
    'constraints': (passes.CONSTRAINTS, ('violation', 'violation_rate', 'multiplier')),
    'energy': (passes.ENERGY, ()),
    'work': (passes.WORKS, ('work',)),
}
KEYS = tuple(_READINGS)
_LINEARISED = passes.REACTIONS | passes.CONSTRAINTS


class SampleReader:
    """Reads the present of a simulation that `fits`: what `into` names, by key of a reading, into
    its arrays (contiguous, float64, as large as the reading).

    The first read, which may compile, is made here. Raises InputError for arrays that do not fit.
    """

    def __init__(self, simulation: Simulation, into: Mapping[str, tuple[Floats, ...]]) -> None:
        model, stepper = simulation.model, simulation._run.stepper
        self._simulation, self._lock = simulation, simulation._lock
        self._model, self._stepper = model, stepper
        self._redundant = redundant_rows = simulation._start.dependent_rows
        self._workspace = Workspace(model)
        self._modes = begun(model, redundant_rows)
        self._energy = into['energy'][0] if 'energy' in into else None
        self._applied: Applied | None = None
        self._curves: list[tuple[int, Curve]] = []
        self.distance = math.inf
        _check(simulation, into)
        tools = stepper.instruments
        self._on_cut = 'reactions' in into or stepper.applied.acts_on_axes
        arrays: dict[str, Floats] = {
            name: np.zeros(0) for _, names in _READINGS.values() for name in names
        }
        for key, given in into.items():
            for array in given:
                array[:] = 0.0  # what no pass writes
            arrays |= dict(zip(_READINGS[key][1], given, strict=False))
        joints, D = len(model.joint_names), model.layout.dimension
        rows, angles = len(model.row_names), model.system.angles.c.size // 2
        work = self._workspace.work
        redundant = self._modes is not None and redundant_rows > 0
        self._out = ReadOut(
            joints=tools.coordinates,
            balls=tools.balls,
            cut=tools.reactions().arrays if self._on_cut else Cut.empty(),
            there=tools.reactions().workspace() if self._on_cut else CutWork.empty(),
            modes=self._modes or Modes.empty(),
            mode_start=self._modes.z.copy() if self._modes else np.zeros(0),
            inverse=np.empty_like(work.diagonal) if redundant else np.zeros(0),
            inverse_off=np.empty_like(work.off) if redundant else np.zeros(0),
            row=indices(model.row),
            coordinate=indices(model.coordinate_block),
            angles=np.zeros(angles),
            spins=np.zeros(angles),
            near=np.zeros(angles),
            phi=np.zeros(rows),
            rate=np.zeros(rows),
            axis_load=np.zeros(self._axis_loads()),
            force=np.zeros(joints * D),
            torque=np.zeros(joints * (1 if D == 2 else 3)),
            momenta=np.zeros(model.n),
            told=np.zeros(3),
            **arrays,
        )
        self._known = mask(tuple(into), distance=True)
        self._try(self._known)

    def _axis_loads(self) -> int:
        """How many effects on free axes have friction under loads."""
        applied, tools = self._stepper.applied, self._stepper.instruments
        if not applied.acts_on_axes:
            return 0
        return len(applied.on_axes(tools.reactions().cut).part.loads)

    @by_one_thread
    def read(self, wanted: int) -> bool:
        """Read `wanted`, a `mask`; True if it did.

        False leaves it to a sample: accelerations are limits, or there are none, or an energy is
        not finite. Raises InputError for readings without arrays.
        """
        if wanted & ~self._known:
            raise InputError('no arrays for these readings', key='wanted', value=wanted)
        return self._stepper.beside(self._simulation._run.present) is False and self._try(wanted)

    def _try(self, wanted: int) -> bool:
        """`read` after a step that was not interpolated beside a singular position."""
        present, t = self._simulation._run.present, self._simulation.t
        applied, phase = present.applied, present.phase
        if applied is not self._applied:
            self._hold(applied)
        for n, curve in self._curves:
            self._held.efforts[n] = curve.at(t)[0]
        forces, out = applied.assembled, self._out
        problem = self._workspace.problem(forces, self._simulation.solver)
        held, near = self._held, wanted & passes.DISTANCE
        if self._modes is None:
            wanted &= ~passes.DISTANCE
        if not kernel.read_out(problem, phase, held, out, t, wanted, ROUNDS, KNOWN):
            return False
        if wanted & passes.WORKS and not np.isfinite(phase.works).all():
            return False
        if wanted & passes.ENERGY and self._energy is not None:
            with np.errstate(over='ignore', invalid='ignore'):
                kinetic = 0.5 * float(out.momenta @ phase.qd[: self._model.n])
            self._energy[0] = kinetic + float(out.told[passes.POTENTIAL])
            if not math.isfinite(self._energy[0]):
                return False
        self.distance = self._distance() if near else math.inf
        return True

    def _hold(self, applied: Applied) -> None:
        """From now on these forces act."""
        model = self._model
        efforts = np.zeros(len(joint_state_names(model)))
        self._curves.clear()
        for name, held in applied.inputs.efforts.items():
            n = model.coordinate_names.index(name)
            if isinstance(held, Curve):
                self._curves.append((n, held))
            else:
                efforts[n] = held
        on_cut, axes, on_axes = Effects.empty(), Axes.empty(), Effects.empty()
        loads: list[int] = []
        if self._on_cut:
            cut = self._stepper.instruments.reactions().cut
            on_cut = applied.on(cut)
            if applied.acts_on_axes:
                axes, (on_axes, loads) = applied.on_axes(cut)
        self._held = HeldForces(on_cut, axes, on_axes, indices(loads), efforts)
        self._applied = applied

    def _distance(self) -> float:
        """Distance to a singular position, as `Diagnostics.distance`."""
        if self._modes is None:
            return 1.0
        told, modes, model = self._out.told, self._modes, self._model
        soft = modes.s2[-1] < ALL_SOFT and modes.root.size - self._redundant > modes.s2.size
        if self._redundant and not soft:
            lost = len(model.row_names) - self._redundant - told[passes.RANK]
            soft = lost > MISSING
        if soft:
            found_there = found(model, self._workspace.work, self._redundant, modes)
            return float(found_there.sigma[0]) if found_there else 1.0
        return float(told[passes.SIGMA])


def fits(simulation: Simulation) -> bool:
    """Whether a `SampleReader` can serve it: of formulation alf2, without drives, and without
    bearings that share redundant reactions."""
    model = simulation.model
    plain = not model.mechanism.drives and not has_bearings(model)
    return simulation._run.stepper.formulation is None and plain


def _check(simulation: Simulation, into: Mapping[str, tuple[Floats, ...]]) -> None:
    model, state = simulation.model, simulation.state
    sizes = {
        'state': (len(state_vector.names(model, state)),) * 2,
        'joint_states': (len(joint_state_names(model)),) * 3,
        'reactions': (6 * len(model.joint_names),),
        'constraints': (len(model.row_names),) * 3,
        'energy': (1,),
        'work': (len(simulation.accounts),),
    }
    for key, arrays in into.items():
        if key not in sizes:
            raise InputError('no such reading', value=key, choices=KEYS)
        whole = all(x.flags.c_contiguous and x.dtype == np.float64 for x in arrays)
        if not whole or tuple(x.size for x in arrays) != sizes[key]:
            expected = f'contiguous arrays of float64, sizes {sizes[key]}'
            raise InputError('arrays that do not fit the reading', key=key, expected=expected)


def mask(keys: tuple[str, ...], distance: bool = False) -> int:
    """The `wanted` of `SampleReader.read` for these readings.

    `distance`: with the distance to a singular position, if reactions or constraints are read.
    """
    wanted = 0
    for key in keys:
        wanted |= _READINGS[key][0]
    return wanted | (passes.DISTANCE if distance and wanted & _LINEARISED else 0)
