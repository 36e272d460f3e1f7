"""Other formulations of the equations of motion, to compare ALF2 with.

`alf1`, `alf2_as_printed`, `canonical` and `penalty` are of the paper, as printed; `baumgarte`,
`lagrange_canonical` and `independent` the classical ones it argues against. They take the fixed
steps of any explicit Runge-Kutta method, and use Φ, Φ_q and the effects of the kernel, the first
four its leading matrix too. All that one carries from step to step is an array, its state y.
"""

from __future__ import annotations

import importlib
from copy import copy
from dataclasses import dataclass
from typing import Any

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.kernel import Forces, Phase, Work
from alf_ros.kernel.status import Status
from alf_ros.model.compile import Model
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import Solver
from alf_ros.simulation.formulations.storage import Settings

OMEGA, MU = 10.0, 1.0  # 1/s and 1, the paper's


@dataclass(frozen=True)
class _Kind:
    """A formulation: its module, its maximum iterations, and the singular matrix of its failure.

    A file holds `prepare`, `start` and the compiled `rates` and `advance`. It is imported when its
    formulation is asked for.
    """

    file: str
    iterations: int = 1000
    singular: str = ''


_MATRIX = 'the classical matrix [M Φ_qᵀ; Φ_q 0] is singular here'
_SPLIT = 'the independent coordinates chosen at the start do not determine the others here'
_KINDS = {
    'alf1': _Kind('alf1'),
    'alf2_as_printed': _Kind('alf2_as_printed'),
    'canonical': _Kind('alf2_as_printed', 1),
    'penalty': _Kind('alf1', 1),
    'baumgarte': _Kind('baumgarte', singular=_MATRIX),
    'lagrange_canonical': _Kind('lagrange_canonical', singular=_MATRIX),
    'independent': _Kind('independent', singular=_SPLIT),
}
NAMES = tuple(_KINDS)


def check_going_on(before: str, after: str) -> None:
    """Raise InputError if the state y of one formulation is not one of another: velocities are no
    momenta, although they are as many numbers."""
    if before != after and (_start_of(before) is None or _start_of(before) != _start_of(after)):
        text = f'cannot go on from a state of {before}, which holds other numbers'
        raise InputError(text, key='solver.formulation', value=after)


def _start_of(name: str) -> Any:
    """The function that makes the first state y; None for alf2, which has none."""
    kind = _KINDS.get(name)
    return None if kind is None else importlib.import_module(f'{__name__}.{kind.file}').start


class Formulation:
    """The formulation that a solver names, prepared for a mechanism.

    q (all blocks D, m) is where the run starts; omega Ω (1/s) and mu μ are natural frequency and
    damping ratio of the constraints, where they are stabilised. Raises InputError for an
    integrator that adapts its step, or is implicit.
    """

    def __init__(
        self, model: Model, solver: Solver, q: Floats, omega: float = OMEGA, mu: float = MU
    ) -> None:
        tableau = TABLEAUX[solver.integrator]
        if tableau.embedded.size or tableau.implicit:
            fixed = [n for n, t in TABLEAUX.items() if not (t.embedded.size or t.implicit)]
            raise InputError(
                f'the formulation {solver.formulation} takes fixed steps only, explicit ones',
                key='integrator',
                value=solver.integrator,
                expected=' or '.join(fixed),
            )
        self._model, self._kind, self._method = model, _KINDS[solver.formulation], solver.method
        self._module = importlib.import_module(f'{__name__}.{self._kind.file}')
        iterations = min(solver.iterations, self._kind.iterations)
        settings = Settings(self._method.b.size, iterations, omega, mu)
        self._storage = self._module.prepare(model, settings, q)

    def apart(self, model: Model) -> Formulation:
        """The same for the same model or one apart from it, in arrays of its own."""
        other = copy(self)
        other._model, other._storage = model, copy(self._storage)
        return other

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != '_module'}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._module = importlib.import_module(f'{__name__}.{self._kind.file}')

    def start(self, q: Floats, qd: Floats) -> Floats:
        """Return the state y (size,) at positions q (m) and velocities q̇ (m/s), all blocks D."""
        y: Floats = self._module.start(self._model, self._storage, q, qd)
        return y

    def advance(
        self,
        forces: Forces,
        work: Work,
        phase: Phase,
        y: Floats,
        t0: float,
        first: int,
        steps: int,
        h: float,
    ) -> tuple[int, int, int]:
        """Take `steps` steps of h (s) from t0 + first h; returns (result, taken, most iterations).

        y is the state, in and out, with `phase`. On failure they belong to the last usable step.
        """
        model, method, storage = self._model, self._method, self._storage
        result, taken, most = self._module.advance(
            model.unit,
            model.system,
            forces,
            method,
            work,
            storage,
            phase,
            y,
            t0,
            first,
            steps,
            h,
        )
        return int(result), int(taken), int(most)

    def rates(self, forces: Forces, work: Work, t: float, y: Floats) -> tuple[int, Floats]:
        """Result and ẏ (size,) at t (s), y (size,), for an integrator outside.

        `work` has q and q̇ of y afterwards; the blocks that are fixed must stand in it before, and
        the angles that effects take a stage to be near to. Only `alf1` and `alf2_as_printed`, and
        their first iterates `penalty` and `canonical`, are written for that.
        """
        model, storage = self._model, self._storage
        storage.y[:] = y
        result = self._module.derivative(model.unit, model.system, forces, work, storage, t)
        return int(result), storage.k[: y.size].copy()

    def failure(self, result: int) -> tuple[str, str]:
        """Reason and remedy, for a StepError."""
        status = Status(result)
        if status == Status.SINGULAR:
            return self._kind.singular, status.remedy
        if status == Status.NOT_FINITE:
            return status.reason, Status.OPENED.remedy
        if status == Status.NOT_POSITIVE:
            return status.reason, 'a direction has neither mass nor constraint there: give it mass'
        return status.reason, status.remedy
