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
from alf_ros.kernel import Axes, Cut, CutWork, Effects, HeldForces, Modes, ReadOut
from alf_ros.kernel import readout as passes
from alf_ros.kernel.softest_modes import ALL_SOFT
from alf_ros.model.compile import Model
from alf_ros.model.constraints.packing import indices
from alf_ros.model.softest_modes import KNOWN, MISSING, ROUNDS, begun, found
from alf_ros.scene.scene import Solver
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.instruments import Workspace
from alf_ros.simulation.present import Present
from alf_ros.simulation.stepping import Stepper

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
    """Reads what `into` names, by key of a reading, into its arrays (contiguous, float64).

    It serves one simulation, of formulation alf2 and without drives (`fits`).
    """

    def __init__(
        self,
        model: Model,
        solver: Solver,
        stepper: Stepper,
        dependent_rows: int,
        into: Mapping[str, tuple[Floats, ...]],
    ) -> None:
        self._model, self._solver, self._stepper = model, solver, stepper
        self._redundant = dependent_rows
        self._workspace = Workspace(model)
        self._modes = begun(model, dependent_rows)
        self._energy = into['energy'][0] if 'energy' in into else None
        self._applied: Applied | None = None
        self._curves: list[tuple[int, Curve]] = []
        self.distance = math.inf
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
        redundant = self._modes is not None and dependent_rows > 0
        self._out = ReadOut(
            joints=tools.coordinates,
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

    def _axis_loads(self) -> int:
        """How many effects on free axes have friction under loads."""
        applied, tools = self._stepper.applied, self._stepper.instruments
        if not applied.acts_on_axes:
            return 0
        return len(applied.on_axes(tools.reactions().cut).part.loads)

    @staticmethod
    def fits(model: Model, stepper: Stepper) -> bool:
        """Whether one can serve this simulation."""
        return stepper.formulation is None and not model.mechanism.drives

    def read(self, present: Present, t: float, wanted: int) -> bool:
        """Read `wanted`, a sum of `mask`s, of the present at t (s); True if it did.

        False leaves it to a sample: accelerations are limits, or there are none.
        """
        return self._stepper.beside(present) is False and self.try_read(present, t, wanted)

    def try_read(self, present: Present, t: float, wanted: int) -> bool:
        """`read` after a step that was not interpolated beside a singular position."""
        applied, phase = present.applied, present.phase
        if applied is not self._applied:
            self._hold(applied)
        for n, curve in self._curves:
            self._held.efforts[n] = curve.at(t)[0]
        forces, out = applied.assembled, self._out
        problem = self._workspace.problem(forces, self._solver)
        held, near = self._held, wanted & passes.DISTANCE
        if self._modes is None:
            wanted &= ~passes.DISTANCE
        if not kernel.read_out(problem, phase, held, out, t, wanted, ROUNDS, KNOWN):
            return False
        if wanted & passes.ENERGY and self._energy is not None:
            kinetic = 0.5 * float(out.momenta @ phase.qd[: self._model.n])
            self._energy[0] = kinetic + float(out.told[passes.POTENTIAL])
        self.distance = self._distance() if near else math.inf
        return True

    def _hold(self, applied: Applied) -> None:
        """From now on these forces act."""
        model = self._model
        efforts = np.zeros(len(model.coordinates))
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


def mask(keys: tuple[str, ...], distance: bool = False) -> int:
    """The `wanted` of `SampleReader.read` for these readings.

    `distance`: with the distance to a singular position, if reactions or constraints are read.
    """
    wanted = 0
    for key in keys:
        wanted |= _READINGS[key][0]
    return wanted | (passes.DISTANCE if distance and wanted & _LINEARISED else 0)
