"""Other formulations of the equations of motion, to compare ALF2 with.

`alf1`, `alf2_literal`, `canonical` and `penalty` are the paper's, written as printed; `baumgarte`,
`lagrange_canonical` and `independent` the classical ones it argues against. They take the fixed
steps of any explicit Runge-Kutta method and use the mechanism, Φ_q and (the first four) the leading
matrix of the kernel. All a formulation carries from step to step is its state y, an array.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.formulations.storage import FOLDED, MU, OMEGA, OPENED, SINGULAR
from alf_ros.integrator import TABLEAUX
from alf_ros.kernel import Forces, Work
from alf_ros.model import Model


@dataclass(frozen=True)
class _Kind:
    """The file that says how, the iterations it may take (None: as many as allowed), what breaks.

    A file holds `prepare`, `start` and the compiled `rates` and `advance`; it is imported when its
    formulation is asked for.
    """

    file: str
    iterations: int | None = None
    singular: str = ''


_MATRIX = 'the classical matrix [M Φ_qᵀ; Φ_q 0] is singular here'
_KINDS = {
    'alf1': _Kind('alf1'),
    'alf2_literal': _Kind('alf2'),
    'canonical': _Kind('alf2', 1),
    'penalty': _Kind('alf1', 1),
    'baumgarte': _Kind('baumgarte', 1, _MATRIX),
    'lagrange_canonical': _Kind('lagrange_canonical', 1, _MATRIX),
    'independent': _Kind(
        'independent', 1, 'the independent coordinates chosen at the start do not determine the others here'
    ),
}
NAMES = tuple(_KINDS)


class Formulation:
    """A formulation, prepared for one mechanism and one integrator.

    q (all blocks D, m) is where the run starts; omega Ω (1/s) and mu μ are natural frequency and
    damping ratio of the constraints, in those formulations that stabilise them. Raises InputError
    for an integrator that adapts its step.
    """

    def __init__(
        self,
        name: str,
        model: Model,
        integrator: str,
        q: Floats,
        omega: float = OMEGA,
        mu: float = MU,
    ) -> None:
        self.name, self._kind, self._model = name, _KINDS[name], model
        self._tableau = TABLEAUX[integrator]
        if self._tableau.embedded is not None:
            fixed = [each for each, tableau in TABLEAUX.items() if tableau.embedded is None]
            raise InputError(
                f'the formulation {name} takes fixed steps only',
                key='integrator',
                value=integrator,
                expected=' or '.join(fixed),
            )
        self._module = importlib.import_module(f'{__name__}.{self._kind.file}')
        stages = self._tableau.b.size
        self._storage = self._module.prepare(model, q, stages, omega, mu)

    def start(self, q: Floats, qd: Floats) -> Floats:
        """Return the state y (size,) at positions q (m) and velocities q̇ (m/s), all blocks D."""
        y: Floats = self._module.start(self._model, self._storage, q, qd)
        return y

    def advance(
        self,
        forces: Forces,
        work: Work,
        y: Floats,
        q: Floats,
        qd: Floats,
        turns: Integers,
        t0: float,
        first: int,
        steps: int,
        h: float,
        iterations: int,
    ) -> tuple[int, int, int]:
        """Take `steps` steps of h (s) from t0 + first h; returns (result, taken, most iterations).

        y is the state, in and out; q, q̇ (all blocks D) and turns go with it. On failure they are
        those of the last step that could be gone on from.
        """
        model, tableau = self._model, self._tableau
        result, taken, most = self._module.advance(
            model.unit,
            model.system,
            forces,
            work,
            self._storage,
            tableau.a.ravel(),
            tableau.b,
            tableau.c,
            model.body_basis,
            y,
            q,
            qd,
            turns,
            t0,
            first,
            steps,
            h,
            min(iterations, self._kind.iterations or iterations),
            model.size,
        )
        return int(result), int(taken), int(most)

    def failure(self, result: int) -> tuple[str, str]:
        """Reason and remedy for a StepError."""
        remedy = 'take a smaller step, or the formulation alf2'
        return {
            SINGULAR: (self._kind.singular, 'take the formulation alf2'),
            FOLDED: (
                'no position of the mechanism has these independent coordinates',
                'they were chosen at the start and are no longer fit: take the formulation alf2',
            ),
            OPENED: ('the constraints have opened', remedy),
            kernel.NOT_FINITE: ('the state is no longer finite', remedy),
            kernel.NOT_POSITIVE: (
                'the leading matrix is not positive definite',
                'a direction has neither mass nor constraint there: give it mass',
            ),
        }[result]
