"""Forces and accelerations that jump at known instants, between the points of any grid.

A motor follows a table with corners, and a rod hangs from a pivot whose acceleration jumps. Pieces
between two instants have motions in closed form, or of one smooth differential equation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from alf_ros.arrays import Floats
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import load_scene
from alf_ros.studies.exact.motions import ExactMotion
from alf_ros.studies.hard_cases.trial import RunSpec, TableRow

_TIMES = tuple(0.1 * k for k in range(21))  # s
_SEED = 2026
_COUNT = 12  # instants
_MASS, _GAIN, _DAMPING = 2.0, 20.0, 5.0  # kg, N m/rad, N m s/rad; the bar has 1 m
_BEGIN = -0.9  # rad, of the rod


def _instants() -> list[float]:
    """Seconds, at random, and two of them within one step."""
    random = np.random.default_rng(_SEED)
    first = np.sort(random.uniform(0.05, 1.95, _COUNT)).tolist()
    return [*first, first[-1] + 2e-4]


def _bar(name: str, points: dict[str, Any], ends: list[str]) -> dict[str, Any]:
    """A mechanism of one uniform bar."""
    body = {'points': ends, 'mass': _MASS, 'inertia': 'rod'}
    return {'alf': 1, 'name': name, 'points': points, 'bodies': {'bar': body}}


@cache
def _motor() -> ExactMotion:
    """A bar on a motor: its torque jumps where the slope of the table does."""
    times = [0.0, *_instants(), 3.0]
    slopes = [3.0 * (-1) ** k for k in range(len(times) - 1)]  # rad/s
    angles = np.cumsum([0.0, *(slopes * np.diff(times))]).tolist()
    table = [list(row) for row in zip(times, angles, strict=True)]
    points = {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}}
    pin = {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}
    motor = {'joint': 'pin', 'position_gain': _GAIN, 'velocity_gain': _DAMPING}
    source = {
        'mechanism': _bar('motor', points, ['O', 'A']) | {'joints': {'pin': pin}},
        'effects': {'motor': motor | {'position': table}},
    }

    def exact() -> Floats:
        a, b = 3.0 * _GAIN / _MASS, 3.0 * _DAMPING / _MASS
        state, found = np.zeros(2), []
        for (t, angle), (end, then) in pairwise(table):
            rate = (then - angle) / (end - t)
            # angle and rate of the bar, then those of the table
            A = np.array([[0, 1, 0, 0], [-a, -b, a, b], [0, 0, 0, 1], [0, 0, 0, 0]])
            inside = [each for each in _TIMES if t <= each < end]
            moved = [expm((at - t) * A) @ [*state, angle, rate] for at in (*inside, end)]
            found += [each[0] for each in moved[:-1]]
            state = moved[-1][:2]
        return np.column_stack([np.cos(found), np.sin(found)])

    return ExactMotion('motor', 'at rest', partial(load_scene, source), _TIMES, exact, True)


@cache
def _pivot() -> ExactMotion:
    """A rod below a driven pivot, with another constant acceleration from instant to instant."""
    times = [0.0, *_instants(), 3.0]
    jumps = [3.0 * (-1) ** k for k in range(len(times) - 1)]
    terms = [f'{0.5 * by!r}*max(t - {t!r}, 0)**2' for by, t in zip(jumps, times, strict=False)]
    points = {'P': {'at': [0, 0]}, 'A': {'at': [float(np.cos(_BEGIN)), float(np.sin(_BEGIN))]}}
    source = {
        'mechanism': _bar('pivot', points, ['P', 'A']),
        'drives': {'pivot': {'point': 'P', 'at': [' + '.join(terms), '0*t']}},
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
    }

    def motion(acceleration: float) -> Callable[[float, Floats], list[float]]:
        def rates(_: float, y: Floats) -> list[float]:
            pull = acceleration * np.sin(y[0]) - 9.81 * np.cos(y[0])
            return [y[1], 1.5 * float(pull), y[3], acceleration]

        return rates

    def exact() -> Floats:
        state, found = np.array([_BEGIN, 0.0, 0.0, 0.0]), []  # of the rod; of the pivot
        for (t, end), acceleration in zip(pairwise(times), np.cumsum(jumps), strict=True):
            inside = [each for each in _TIMES if t <= each < end]
            solved = solve_ivp(
                motion(float(acceleration)),
                (t, end),
                state,
                method='DOP853',
                t_eval=[*inside, end],
                rtol=1e-13,
                atol=1e-14,
            )
            found += [[x, 0.0, x + np.cos(a), np.sin(a)] for a, _, x, _ in solved.y.T[:-1]]
            state = solved.y[:, -1]
        return np.array(found)

    return ExactMotion('pivot', 'at rest', partial(load_scene, source), _TIMES, exact, True)


def rows(quick: bool) -> Iterator[TableRow]:
    """Bounds of the order of each method, an observed order, and tolerances."""
    numbers = (1.0, 2.13, 5.39) if quick else np.arange(1.0, 25.0) + 0.13 * (np.arange(24) % 6)
    for motion in (_motor(), _pivot()):
        for integrator, factor, coarse in (
            ('rk4', 1e3, 8e-2),
            ('dop853', 1e6, 0.2),
            ('esdirk43', 1e3, 8e-2),
        ):
            order = TABLEAUX[integrator].order
            runs = tuple(
                RunSpec(motion, integrator, h, factor * h**order + 1e-12)
                for h in (1e-2 / float(k) for k in numbers)
            )
            yield TableRow('corners', motion.mechanism, runs)
            steps = np.geomspace(coarse, coarse / 5, 9 if quick else 25).tolist()
            runs = tuple(RunSpec(motion, integrator, h, 0.1) for h in steps)
            yield TableRow('corners', motion.mechanism, runs, order - 0.5)
        for integrator, least in (('dop853_adaptive', 12), ('esdirk43_adaptive', 9)):
            tolerances = 10.0 ** -np.arange(3, least + 1, 3 if quick else 1)
            runs = tuple(
                RunSpec(motion, integrator, 1.0, 100.0 * tolerance + 1e-12, tolerance)
                for tolerance in tolerances
            )
            yield TableRow('corners', motion.mechanism, runs)
