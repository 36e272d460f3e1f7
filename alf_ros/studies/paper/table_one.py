"""Table I of the paper: the error of q̈ after each iteration, and its misprints.

The slider-crank of 6.1 with q = (x1, y1, x2), at θ = 45° and in its singular position, θ = 90°,
with ẋ2 = -2 m/s and α = 1e4. (26) is iterated at one position, without integration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import allocate, compile_model
from alf_ros.scene.scene import load_scene
from alf_ros.studies.exact.one_freedom import GRAVITY

ALPHA, ITERATIONS = 1e4, 4
PRINTED = (6.5792e-4, 4.3705e-8, 2.9206e-12)
PRINTED_SINGULAR = -1.000473825436242729
MASS = np.array([[4.0, 0.0, 1.0], [0.0, 4.0, 0.0], [1.0, 0.0, 2.0]]) / 6.0  # kg
NOTES = (
    'Misprints in 6.1: M is (1/6) [[4, 0, 1], [0, 4, 0], [1, 0, 2]], and the second constraint is',
    '½ ((x2 - x1)² + y1² - 1): with both, the errors at 45° are those printed. The value printed',
    'for 90° is that of M22 = 1/3; with the M of the first half, M22 = 2/3, it is the one beside',
    'it. After three iterations both are -1, to 1e-12.',
    '(26) as printed forms M q̈: rounding is multiplied by α and stays. On residuals it is not.',
)
_GUIDE = 1e16  # α of the row that holds y2, which the paper does not have: as good as gone


@dataclass(frozen=True)
class CrankPosition:
    """The mechanism at a crank angle θ (rad), with ẋ2 = -2 m/s, as dense matrices."""

    theta: float

    @property
    def velocities(self) -> Floats:
        """(3,) ẋ1, ẏ1, ẋ2."""
        return np.array([-1.0, 1.0 / np.tan(self.theta), -2.0])

    @property
    def jacobian(self) -> Floats:
        """(2, 3) Φ_q of ½ (x1² + y1² - 1) and ½ ((x2 - x1)² + y1² - 1)."""
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        return np.array([[cos, sin, 0.0], [-cos, sin, cos]])

    @property
    def convective(self) -> Floats:
        """(2,) Φ̇_q q̇."""
        x1, y1, x2 = self.velocities
        return np.array([x1 * x1 + y1 * y1, (x2 - x1) ** 2 + y1 * y1])

    @property
    def forces(self) -> Floats:
        """(3,) Q, N."""
        return np.array([0.0, -GRAVITY, 0.0])

    def exact(self) -> Floats:
        """(3,) q̈; in the singular position Φ_q q̈ = -Φ̇_q q̇ is one equation twice."""
        J = self.jacobian
        m = J.shape[0]
        whole = np.block([[MASS, J.T], [J, np.zeros((m, m))]])
        right = np.concatenate([self.forces, -self.convective])
        found: Floats = np.linalg.lstsq(whole, right, rcond=1e-12)[0][:3]
        return found

    def as_printed(self, mass: Floats = MASS) -> Floats:
        """(iterations, 3) q̈ by (26) as it stands, which forms M q̈_i."""
        J, found, f = self.jacobian, [], self.forces
        A = mass + ALPHA * J.T @ J
        for _ in range(ITERATIONS):
            found.append(np.linalg.solve(A, f - ALPHA * J.T @ self.convective))
            f = mass @ found[-1]
        return np.array(found)

    def on_residuals(self) -> Floats:
        """(iterations, 3) q̈ by the iteration of the step of this package."""
        model = compile_model(load_scene('slider_crank').mechanism, 1.0)
        distances = model.system.rows.length2.size
        alpha = np.where(np.arange(len(model.row_names)) < distances, ALPHA, _GUIDE)
        system = replace(model.system, rows=replace(model.system.rows, alpha=alpha))
        work = allocate(model, system, 1)
        A, B = (2 * model.layout.of_point[name] for name in 'AB')
        work.q[:] = model.q
        work.q[[A, A + 1, B]] = np.cos(self.theta), np.sin(self.theta), 2.0 * np.cos(self.theta)
        work.qd[[A, A + 1, B]] = self.velocities
        Q, x, found = np.zeros(model.n), np.zeros(model.q.size), []
        Q[A + 1], Q[B + 1] = -GRAVITY, -0.5 * GRAVITY
        kernel.linearise(model.unit, system, work, work.q)
        kernel.convective(model.unit, system.rows, work.g2d, work.qd, work.r2)
        work.r2[:] *= -1.0
        for _ in range(ITERATIONS):
            kernel.augmented(model.unit, system, work, Q, x, kernel.Until(1, 0.0, 1.0))
            found.append(x[[A, A + 1, B]].copy())
        return np.array(found)


def text() -> str:
    """Both halves of the table, beside the values printed."""
    ordinary, singular = CrankPosition(np.pi / 4), CrankPosition(np.pi / 2)
    exact = ordinary.exact()
    errors = [
        np.linalg.norm(found - exact, axis=1)
        for found in (ordinary.as_printed(), ordinary.on_residuals())
    ]
    other = MASS.copy()
    other[1, 1] = 1.0 / 3.0
    of_y = [
        found[:, 1]
        for found in (
            singular.as_printed(other),
            singular.as_printed(),
            singular.on_residuals(),
        )
    ]
    lines = [
        f'Table I of the paper (6.1): slider-crank, ẋ2 = -2 m/s, α = {ALPHA:.0e}',
        '',
        'θ = 45°: |error of q̈|, m/s²',
        'iteration   printed         (26) as it stands   on residuals, as here',
    ]
    for n in range(ITERATIONS):
        printed = f'{PRINTED[n]:.4e}' if n < len(PRINTED) else '-'
        lines.append(f'{n + 1:<12}{printed:<16}{errors[0][n]:<20.4e}{errors[1][n]:.4e}')
    lines += [
        '',
        'θ = 90°, the singular position: ÿ1, m/s²; exact: -1',
        'iteration   printed                  (26), M22 = 1/3        (26), M22 = 2/3'
        '        on residuals, M22 = 2/3',
    ]
    for n in range(ITERATIONS):
        printed = f'{PRINTED_SINGULAR:.16f}' if n == 0 else '-'
        shown = ''.join(f'{values[n]:<23.16f}' for values in of_y)
        lines.append(f'{n + 1:<12}{printed:<25}{shown}'.rstrip())
    return '\n'.join([*lines, '', *NOTES])
