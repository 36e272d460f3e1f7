"""A linear model ẋ = A x + B u, y = C x + D u, with names."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.errors import InputError


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Small motions of a mechanism about an instant.

    x = (η, ν): η (g,) the displacement along `directions`, ν (f,) the change of velocity. g = f
    unless rows bind velocities only. u and y are the changes of inputs and outputs, SI.

    A (g + f, g + f), B (g + f, inputs), C (outputs, g + f), D (outputs, inputs). stiffness (f, f),
    1/s², and damping (f, f), 1/s: η̈ + damping η̇ + stiffness η = B₂ u, for a unit of mass; only if
    g = f. drift (g + f,): ẋ of the instant itself, 0 at rest. directions (g, n): each in the order
    of `Sample.q`, kg^-½. t: s. notes: what a reader should know.

    At an instant of a motion the model describes the neighbouring motions relative to this one, at
    first: its matrices are frozen there.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    stiffness: Floats
    damping: Floats
    drift: Floats
    directions: Floats
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    t: float
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        states, inputs, outputs = len(self.A), len(self.inputs), len(self.outputs)
        return f'<LinearModel of {states} states, {inputs} inputs, {outputs} outputs>'

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x: 'x1', … of displacements, 'v1', … of velocities."""
        places = len(self.directions)
        names = [f'x{k + 1}' for k in range(places)]
        return (*names, *(f'v{k + 1}' for k in range(len(self.A) - places)))

    @property
    def mass(self) -> Floats:
        """(f, f) the unit matrix: `directions` are of unit mass."""
        return np.eye(len(self.A) - len(self.directions))

    @cached_property
    def _decomposed(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Eigenvalues by magnitude, of a pair the positive one first, and vectors."""
        values, vectors = np.linalg.eig(self.A)
        values, vectors = values.astype(complex), vectors.astype(complex)
        scale = float(np.abs(values).max(initial=0.0))
        order = sorted(
            range(values.size),
            key=lambda k: (round(float(abs(values[k])) / (scale or 1.0), 9), -values[k].imag),
        )
        return values[order], vectors[:, order]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """(g + f,) of A, 1/s, by magnitude."""
        return self._decomposed[0]

    @cached_property
    def _shown(self) -> list[int]:
        """One of each pair of eigenvalues, and all real ones."""
        return [k for k, value in enumerate(self._rounded) if value.imag >= -self._nothing]

    @cached_property
    def _nothing(self) -> float:
        """1/s: eigenvalues and imaginary parts of at most this size are rounding."""
        return 1e-12 * float(np.abs(self.eigenvalues).max(initial=0.0))

    @cached_property
    def _rounded(self) -> NDArray[np.complex128]:
        """The eigenvalues, zero where they are rounding: its sign would tell of a growth."""
        values = self.eigenvalues
        return np.where(np.abs(values) > self._nothing, values, 0.0)

    @property
    def frequencies(self) -> Floats:
        """(modes,) natural frequency |λ| / 2π of each mode, Hz: of an oscillation, and of a decay
        or growth without one its rate in the same unit."""
        return np.abs(self._rounded[self._shown]) / (2.0 * math.pi)

    @property
    def damping_ratios(self) -> Floats:
        """(modes,) -Re λ / |λ|: 1 and more does not oscillate, less than 0 grows; NaN of λ = 0."""
        values = self._rounded[self._shown]
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.asarray(-values.real / np.abs(values))

    @property
    def modes(self) -> NDArray[np.complex128]:
        """(modes, n) shape of each mode in the order of `Sample.q`, its largest number 1."""
        places = len(self.directions)
        shapes = self._decomposed[1][:places, self._shown].T @ self.directions
        if not shapes.size:
            return shapes
        largest = np.argmax(np.abs(shapes), axis=1)
        peak = shapes[np.arange(len(shapes)), largest]
        return np.asarray(shapes / np.where(np.abs(peak) > 0.0, peak, 1.0)[:, None])

    @property
    def is_stable(self) -> bool:
        """Whether every motion decays: all eigenvalues have a negative real part."""
        return bool((self.eigenvalues.real < 0.0).all())

    def write(self, path: str | Path) -> Path:
        """Write a file, .npz, .mat or .json as its name ends. Returns its path.

        Raises InputError for another end, OSError if it cannot be written.
        """
        from alf_ros.studies.statics import linear_files

        return linear_files.write(self, path)

    def state_space(self) -> Any:
        """The same as `control.StateSpace`; '_' stands for '.' in names, as it allows no dots.

        Raises InputError without python-control.
        """
        try:
            import control
        except ImportError:
            raise InputError(
                'needs python-control', key='state_space', expected='pip install control'
            ) from None
        return control.StateSpace(
            self.A,
            self.B,
            self.C,
            self.D,
            states=list(self.states),
            inputs=[name.replace('.', '_') for name in self.inputs],
            outputs=[name.replace('.', '_') for name in self.outputs],
        )
