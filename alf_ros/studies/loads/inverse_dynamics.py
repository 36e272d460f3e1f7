"""Efforts of chosen actuators for given motions, all instants in one compiled call.

kernel/needed_efforts.py has the equations. Here the normal equations of an instant are solved:
u = W^-½ (W^-½ G W^-½)⁺ W^-½ c, the efforts of least Σ w u² among those that leave the least of f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.kernel.data.actuation import Actuation
from alf_ros.kernel.needed_efforts import effort_equations, effort_residuals, needed_efforts
from alf_ros.model.rank import distance
from alf_ros.simulation.held_inputs import one_by_one
from alf_ros.simulation.input_values import NO_INPUTS, Inputs
from alf_ros.simulation.instruments import Workspace
from alf_ros.simulation.named_inputs import named_inputs
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.instant import Loads

# of the largest eigenvalue of the normal equations, or of what it would be without rows, from
# which down one counts as zero; these are squares of singular values
_DEPENDENT = 1e-13
# distance to a singular position, below which q̈ of a prescribed motion is felt to be rounded: as
# rounding over x⁴
_DOUBTFUL = 3e-2
_LABOUR = 4_000_000  # numbers times solves in one compiled call: about 0.1 s
_SOLVES = 8  # what an instant costs besides a solve for each actuator
_ROUNDS = 2  # that take back rounding of the normal equations


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion in T instants: t (T,), s; q, qd, qdd (T, blocks D), m and per second; turns (T,
    angles); loads (T, loads), N, on which friction depends."""

    t: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    turns: Integers
    loads: Floats

    def at(self, which: Any) -> Motion:
        """The same at some instants (a mask or indices)."""
        return Motion(*(getattr(self, field.name)[which] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class NeededEfforts:
    """Efforts (T, a), N or N m. short (T,): what they leave, as a part of the largest forces, in
    the metric of M. missing (T, joint coordinates): accelerations that they leave, rad/s² or m/s².
    moved (T,): how many freedoms the actuators move."""

    efforts: Floats
    short: Floats
    missing: Floats
    moved: Integers

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """(T,) whether the efforts are determined."""
        return np.asarray(~np.isnan(self.efforts).any(axis=1))

    @property
    def is_regular(self) -> NDArray[np.bool_]:
        """(T,) whether the efforts are a solution there, not a limit of neighbours."""
        return np.asarray(~np.isnan(self.short))


class InverseDynamics:
    """Of the mechanism, the effects and the held inputs of a simulation, which has no drives.

    actuators: names of joint coordinates, or of inputs of `linearise` ('wrenches.C.force.z'); key:
    where they are given. Raises InputError for unknown names.
    """

    def __init__(
        self, simulation: Simulation, actuators: Sequence[str], key: str = 'actuators'
    ) -> None:
        model = simulation.model
        names = [f'joints.{n}.effort' if n in model.coordinate_names else n for n in actuators]
        loads = Loads(simulation)
        self.inputs = named_inputs(loads.model, loads.effects, names, key)
        for each in self.inputs:
            if each.name.startswith('targets.'):
                raise InputError(
                    'not a force', key=key, value=each.name, expected='an effort, a wrench'
                )
        self.names = tuple(_short(each.name) for each in self.inputs)
        self.units = tuple(each.unit for each in self.inputs)
        self._model, self._before = model, simulation.state.inputs
        self._independent = len(model.row_names) - simulation.dependent_rows
        self._weights: Floats = np.ones(len(self.inputs))
        self._packed = one_by_one(model, [each.added(NO_INPUTS, 1.0) for each in self.inputs])
        applied = simulation.applied
        self._problem = Workspace(model).problem(applied.assembled, simulation.solver)
        self._joints = simulation._run.stepper.instruments.coordinates

    def weigh(self, weights: Floats) -> None:
        """Take (a,) weights of the efforts in the sum Σ w u² that is least if there are too many
        actuators, in place of 1."""
        self._weights = weights

    def held(self, efforts: Floats) -> Inputs:
        """The inputs held, and these efforts (a,)."""
        inputs = self._before
        for each, value in zip(self.inputs, efforts, strict=True):
            inputs = each.added(inputs, float(value))
        return inputs

    def needed(self, motion: Motion) -> NeededEfforts:
        """The efforts for a motion that fulfils the constraints; NaN where they are not
        determined: in a singular position, also one of the actuators."""
        # an interruption is heard between two calls
        most = max(1, _LABOUR // (self._model.q.size * (_SOLVES + len(self.names))))
        spans = (slice(k, k + most) for k in range(0, motion.t.size, most))
        parts = [self._part(motion.at(span)) for span in spans]
        efforts, left, whole, missing, moved, rank = map(np.concatenate, zip(*parts, strict=True))
        clear = self._is_clear(rank)
        clear &= moved >= moved[clear].max(initial=0)
        efforts[~clear] = np.nan
        size = float(whole[clear].max(initial=0.0))
        short = left / size if size > 0.0 else np.zeros(left.size)
        short[~clear] = np.nan
        return NeededEfforts(efforts, short, missing, moved)

    def _part(self, motion: Motion) -> tuple[Any, ...]:
        """Efforts, `left` and `whole` as in `Actuation`, missing, moved, and the rank of Φ_q."""
        count, a = motion.t.size, len(self.names)
        of = self._actuation(motion, a)
        needed_efforts(of)
        efforts, missing = of.efforts.reshape(count, a), of.missing.reshape(count, -1)
        moved = np.full(count, a)
        hard = np.isnan(efforts).any(axis=1) & ~np.isnan(of.rank)
        if hard.any():
            found, its = self._by_eigenvalues(motion.at(hard))
            efforts[hard] = found.efforts.reshape(-1, a)
            missing[hard] = found.missing.reshape(missing[hard].shape)
            of.left[hard], of.whole[hard], moved[hard] = found.left, found.whole, its
        return efforts, of.left, of.whole, missing, moved, of.rank

    def _is_clear(self, rank: Floats) -> NDArray[np.bool_]:
        """(T,) whether an instant is no singular position, nor too near to one."""
        apart = distance(self._independent - rank, self._model.penalty)
        return np.asarray(apart > _DOUBTFUL * self._model.system.ordinary)  # False for NaN

    def _by_eigenvalues(self, motion: Motion) -> tuple[Actuation, Integers]:
        """The same where actuators are dependent, or nearly; and how many freedoms they move."""
        count, a = motion.t.size, len(self.names)
        of = self._actuation(motion, a)
        effort_equations(of)
        scale = 1.0 / np.sqrt(self._weights)
        values, vectors = np.linalg.eigh(scale[:, None] * of.gram.reshape(count, a, a) * scale)
        whole = np.maximum(values[:, -1], (scale**2 * of.alone.reshape(count, a)).max(axis=1))
        counts = values > _DEPENDENT * whole[:, None]
        inverse = np.where(counts, 1.0 / np.where(counts, values, 1.0), 0.0)
        efforts = of.efforts.reshape(count, a)
        for _ in range(_ROUNDS):
            pull = scale * of.pull.reshape(count, a)
            along = inverse * (vectors * pull[:, :, None]).sum(axis=1)
            efforts += scale * (vectors * along[:, None, :]).sum(axis=2)
            effort_residuals(of)
        return of, counts.sum(axis=1)

    def _actuation(self, motion: Motion, a: int) -> Actuation:
        model, count = self._model, motion.t.size
        size, joints = model.q.size, len(model.coordinates)
        angles = motion.turns.shape[1]
        empty = {
            'efforts': count * a,
            'gram': count * a * a,
            **dict.fromkeys(('pull', 'alone'), count * a),
            **dict.fromkeys(('rank', 'left', 'whole'), count),
            'missing': count * joints,
            **dict.fromkeys(('B', 'X'), a * size),
            **dict.fromkeys(('f', 'x'), size),
            'G': a * a,
            'Z': self._problem.work.diagonal.size,
            'Zo': self._problem.work.off.size,
            **dict.fromkeys(('c', 'u'), a),
            **dict.fromkeys(('angles', 'spins'), angles),
            **dict.fromkeys(('values', 'speeds'), joints),
        }
        return Actuation(
            unit=model.unit,
            problem=self._problem,
            actuators=self._packed,
            joints=self._joints,
            t=motion.t,
            q=motion.q.ravel(),
            qd=motion.qd.ravel(),
            qdd=motion.qdd.ravel(),
            turns=motion.turns.ravel(),
            loads=motion.loads.ravel(),
            turned=np.zeros(angles, dtype=np.int64),
            **{name: np.zeros(number) for name, number in empty.items()},
        )


def _short(name: str) -> str:
    """'leg0' of 'joints.leg0.effort'; other names stay."""
    parts = name.split('.')
    return '.'.join(parts[1:-1]) if parts[0] == 'joints' else name
