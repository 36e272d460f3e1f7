"""The lowest modes of a row of four-bars: this package beside scipy on the generic saddle point.

    .venv/bin/python benchmark/modes.py [--four-bars 10000] [--modes 20] [--without-generic]

Each four-bar has two cranks and a coupler, slender rods of 1 m and 1 kg, in a horizontal plane. A
spring ties each to the next, and the first to the ground, so that the lowest modes are waves along
the row. In closed form, for N four-bars with m = 2/3 + 1 kg each,

    ω_j² = 4 k / m sin²(π (2 j - 1) / (4 N + 2)),   j = 1, 2, …

The generic solution is the same eigenproblem by scipy.sparse.linalg.eigsh, with SuperLU of the
saddle point [K - σ M, Jᵀ; J, 0]. This exists because no row is redundant here. A dense null space
of N four-bars needs 8 (4 N)² bytes. Errors of ω² are
parts of the highest one that is printed.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # vectors are short: threads only wait

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Scene, Simulation, load_scene  # noqa: E402
from alf_ros.arrays import Floats  # noqa: E402
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve  # noqa: E402
from alf_ros.studies.statics.descent import pushed  # noqa: E402
from alf_ros.studies.statics.instant import Instant, Loads  # noqa: E402
from alf_ros.studies.statics.lowest_modes import lowest  # noqa: E402

STIFFNESS = 1e4  # N/m


def row(four_bars: int) -> Scene:
    """So many four-bars, each tied to the next by a spring between the tips of their cranks."""
    points: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    springs: dict[str, Any] = {}
    for k in range(four_bars):
        x = 2.0 * k
        points[f'A{k}'] = {'at': [x, 0.0], 'fixed': True}
        points[f'D{k}'] = {'at': [x + 1.0, 0.0], 'fixed': True}
        points[f'B{k}'] = {'at': [x, -1.0]}
        points[f'C{k}'] = {'at': [x + 1.0, -1.0]}
        bars = {'left': ('A', 'B'), 'over': ('B', 'C'), 'right': ('D', 'C')}
        for name, (a, b) in bars.items():
            ends = [f'{a}{k}', f'{b}{k}']
            bodies[f'{name}{k}'] = {'points': ends, 'mass': 1.0, 'inertia': 'rod'}
        for name, (parent, child, at) in {
            'p': ('ground', f'left{k}', 'A'),
            'q': (f'left{k}', f'over{k}', 'B'),
            'r': (f'over{k}', f'right{k}', 'C'),
            's': ('ground', f'right{k}', 'D'),
        }.items():
            joint = {'type': 'revolute', 'between': [parent, child], 'at': f'{at}{k}'}
            joints[f'{name}{k}'] = joint
        spring = {'stiffness': STIFFNESS, 'free_length': 1.0}
        if k:
            springs[f's{k}'] = {'between': [f'C{k - 1}', f'B{k}'], **spring}
        else:
            springs['s0'] = {'between': ['ground', 'B0'], 'at': [[-1.0, -1.0], None], **spring}
    mechanism = {'alf': 1, 'space': 'planar', 'points': points, 'bodies': bodies, 'joints': joints}
    return load_scene({'mechanism': mechanism, 'effects': {'spring': springs}})


def exact(four_bars: int, modes: int) -> Floats:
    """ω² in closed form, 1/s²."""
    odd = 2.0 * np.arange(modes) + 1.0
    waves = np.sin(math.pi * odd / (4.0 * four_bars + 2.0)) ** 2
    return np.asarray(4.0 * STIFFNESS * waves / (2.0 / 3.0 + 1.0))


def generic(instant: Instant, lam: Floats, count: int, shift: float) -> Floats:
    """ω² by scipy alone, with the shift (1/s²) that the other found."""
    n = instant.model.n
    H = instant.K + instant.curvature(lam)
    J, M = instant.J[:, :n], instant.M
    saddle = sparse.bmat([[H - shift * M, J.T], [J, None]], format='csc')
    factor = splu(saddle)

    def inverse(b: Floats) -> Floats:
        return np.asarray(factor.solve(np.concatenate([b.ravel(), np.zeros(J.shape[0])]))[:n])

    operator = LinearOperator((n, n), matvec=inverse, dtype=float)
    start = inverse(M @ np.random.default_rng(0).standard_normal(n))
    found = eigsh(H, k=count, M=M, sigma=shift, OPinv=operator, v0=start, tol=1e-12)
    return np.sort(found[0])


def main(argv: Sequence[str] | None = None) -> int:
    """Print times and errors; returns 0 if the modes agree with the closed form."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--four-bars', type=int, default=10_000)
    parser.add_argument('--modes', type=int, default=20)
    parser.add_argument('--without-generic', action='store_true')
    options = parser.parse_args(argv)
    scene = row(options.four_bars)
    lowest_of(row(3), 2)  # compiles
    began = time.perf_counter()
    simulation = Simulation(scene)
    print(f'{options.four_bars} four-bars, {simulation.model.n} coordinates')
    print(f'assembled in                         {time.perf_counter() - began:9.3f} s')
    instant, lam, tangents = prepared(simulation)
    print(f'forces, multipliers, tangents in     {tangents:9.3f} s')
    began = time.perf_counter()
    found, _ = lowest(instant, lam, options.modes)
    spent = time.perf_counter() - began
    known = exact(options.four_bars, options.modes)
    error = float(np.abs(found - known).max() / known[-1])
    print(f'{options.modes} lowest modes in                   {spent:9.3f} s, error {error:.1e}')
    if not options.without_generic:
        began = time.perf_counter()
        shift = -float(known[0])
        other = generic(instant, lam, options.modes, shift)
        spent = time.perf_counter() - began
        away = float(np.abs(other - known).max() / known[-1])
        print(f'scipy on the saddle point, shift given {spent:7.3f} s, error {away:.1e}')
    print(f'a dense null space would need        {8e-9 * simulation.model.n**2:9.3f} GB')
    return 0 if error < 1e-9 else 1


def prepared(simulation: Simulation) -> tuple[Instant, Floats, float]:
    """The start as an instant at rest, its λ, and how long its tangents took, s."""
    began = time.perf_counter()
    state = simulation.state
    instant = Instant(Loads(simulation), 0.0, state.q, np.zeros_like(state.q), state.turns)
    _, lam = pushed(instant, ConstrainedSolve(instant.model, instant.loads.tangents.cliques))
    _ = instant.K
    return instant, lam, time.perf_counter() - began


def lowest_of(scene: Scene, count: int) -> Floats:
    """ω² of a scene that starts at rest, 1/s²."""
    instant, lam, _ = prepared(Simulation(scene))
    return lowest(instant, lam, count)[0]


if __name__ == '__main__':
    sys.exit(main())
