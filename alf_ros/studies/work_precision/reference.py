"""References for runs of a scene: its exact motion, or a run so fine that it converged."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.scene.scene import Scene
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.exact import motions

EXACT_ERROR = 1e-12  # m, what the exact motions are good to (exact.py)
SPACING = 0.1  # s between the instants looked at
GRID = 0.025  # s; differs from the step of the runs, so that no run is compared with itself
PAIRS = ((1e-12, 1e-11), (1e-11, 1e-10), (1e-10, 1e-9), (1e-8, 1e-7))  # fine run, and its check


@dataclass(frozen=True)
class Course:
    """Results of a run at given instants.

    q (instants, n), m; energy (instants,), J; force (instants, n): Φ_qᵀ λ, N; gap: the largest by
    which a constraint was open, m.
    """

    q: Floats
    energy: Floats
    force: Floats
    gap: float


@dataclass(frozen=True)
class Reference:
    """times (s), the course there, what it is in words, its own errors: q (m) and Φ_qᵀ λ (N)."""

    times: tuple[float, ...]
    course: Course
    kind: str
    error: float
    force_error: float


def course(simulation: Simulation, times: tuple[float, ...]) -> Course:
    """Run from the start through `times` (s). Raises StepError."""
    simulation.reset()
    samples = list(simulation.run(times[-1], at=times))
    return Course(
        np.array([sample.q for sample in samples]),
        np.array([sample.energy for sample in samples]),
        np.array([sample.constraint_forces for sample in samples]),
        max(sample.diagnostics.position_violation for sample in samples),
    )


def reference(scene: Scene, duration: float | None = None) -> Reference:
    """The reference for `duration` (s; as long as the exact motion is known, or 10 s).

    Positions come from the exact motion if it is known. Everything else comes from a run with
    `dop853_adaptive` at tolerance 1e-12, or the finest that runs. Its own error is the distance to
    the same run at a ten times larger tolerance. Raises InputError if no run converges.
    """
    motion = _exact(scene)
    whole = duration or (motion.times[-1] if motion else 10.0)
    if motion is not None and whole > motion.times[-1] + 1e-9:
        motion = None  # not known for so long
    times = tuple(SPACING * k for k in range(1 + max(1, round(whole / SPACING))))
    for fine, check in PAIRS:
        try:
            found, other = (_fine(scene, times, tolerance) for tolerance in (fine, check))
        except AlfError:
            continue
        error, kind = _distance(found.q, other.q), f'self-converged at tolerance {fine:.0e}'
        if not error < 1e-2 * max(np.ptp(found.q), 1e-300):
            continue
        if motion is not None:
            energy = np.full(len(times), found.energy[0])  # nothing in these takes or gives any
            found = Course(motion.exact()[: len(times)], energy, found.force, found.gap)
            error, kind = EXACT_ERROR, 'exact motion'
        return Reference(times, found, kind, error, _distance(found.force, other.force))
    raise InputError(
        'no run of this scene converges, so a reference is missing',
        key='scene',
        value=scene.name,
        expected='a shorter --duration, or smoother forces',
    )


def _fine(scene: Scene, times: tuple[float, ...], tolerance: float) -> Course:
    settings = {'formulation': 'alf2', 'integrator': 'dop853_adaptive', 'step': GRID}
    return course(Simulation(scene, tolerance=tolerance, **settings), times)  # type: ignore[arg-type]


def _distance(a: Floats, b: Floats) -> float:
    found = float(np.abs(a - b).max())
    return found if math.isfinite(found) else math.inf


def _exact(scene: Scene) -> motions.ExactMotion | None:
    """The exact motion of what moves as one that is known, whatever its solver section says."""
    bodies = len(scene.mechanism.bodies)
    known = (
        motions.paper('slider_crank'),
        motions.paper('double_four_bar'),
        motions.change_point(),
        motions.four_bars(max(1, bodies // 2)),
    )

    def moves(other: Scene) -> tuple[object, ...]:
        return other.mechanism, other.effects, other.positions, other.velocities

    for motion in known:
        if motion.mechanism == scene.mechanism.name and moves(motion.scene()) == moves(scene):
            return motion
    return None
