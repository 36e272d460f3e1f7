"""Steps that end in a singular position, and starts there: random speeds, branches, mechanisms.

Every motion reaches the position at a grid point of its run, or up to a millisecond beside it; or
begins there. Some are driven: then the position may be one of the drives (type II).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from alf_ros.arrays import Floats
from alf_ros.scene.scene import load_scene
from alf_ros.studies.exact import one_freedom
from alf_ros.studies.exact.crossed_bars import crossed_four_bars, crossed_mechanism
from alf_ros.studies.exact.motions import ExactMotion
from alf_ros.studies.exact.one_freedom import OneFreedom
from alf_ros.studies.hard_cases.trial import RunSpec, TableRow

GRID = 0.1  # s: a multiple of every step
_TIMES = (0.0, GRID, 2 * GRID, 3 * GRID)
_SEED = 2026
_SPEEDS = (0.05, 10.0)  # rad/s, through the position
_ASIDE = (0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)  # s
_GRAVITY = {'gravity': {'acceleration': [0, -one_freedom.GRAVITY]}}


@dataclass(frozen=True)
class _Passage:
    """A motion through a singular position at `angle` (rad), with `rate` (rad/s) there."""

    name: str
    mechanism: str | dict[str, Any]  # of the library, or as in a file
    parameters: tuple[tuple[str, float], ...]
    alone: OneFreedom
    points: tuple[str, ...]
    angle: float
    rate: float

    @cached_property
    def _course(self) -> tuple[Callable[[float], Floats], Callable[[float], Floats]]:
        """θ and θ̇ at a time (s) before and after the position."""

        def rates(t: float, y: Floats) -> tuple[float, float]:
            return y[1], self.alone.acceleration(y[0], y[1])

        found = [
            solve_ivp(
                rates,
                (0.0, end),
                (self.angle, self.rate),
                method='DOP853',
                rtol=1e-13,
                atol=1e-14,
                max_step=5e-3,
                dense_output=True,
            ).sol
            for end in (-1.2 * GRID, 3.2 * GRID)
        ]
        return found[0], found[1]

    def _at(self, t: float) -> tuple[float, float]:
        theta, rate = self._course[t > 0.0](t)
        return float(theta), float(rate)

    def motion(self, when: float) -> ExactMotion:
        """A motion that reaches the position at the time `when` (s)."""
        theta, rate = self._at(-when)

        def by_point(values: Floats) -> dict[str, list[float]]:
            return dict(zip(self.points, values.reshape(-1, 2).tolist(), strict=True))

        source = {
            'mechanism': self.mechanism,
            'effects': _GRAVITY,
            'initial': {
                'positions': by_point(self.alone.position(theta)),
                'velocities': by_point(self.alone.tangent(theta) * rate),
            },
        }
        return ExactMotion(
            self.name,
            f'{self.angle:.4g} rad at {self.rate:.4g} rad/s in {when:.13g} s',
            partial(load_scene, source, dict(self.parameters)),
            _TIMES,
            lambda: np.array([self.alone.position(self._at(t - when)[0]) for t in _TIMES]),
        )


@dataclass(frozen=True)
class _Driven:
    """A driven motion through a singular position of its drives: its q at time 0 in the position,
    plus t (s), and its scene."""

    mechanism: str
    rate: float
    place: Callable[[float], Floats]
    source: Callable[[float], dict[str, Any]]

    def motion(self, when: float) -> ExactMotion:
        """A motion that reaches the position at the time `when` (s)."""
        return ExactMotion(
            self.mechanism,
            f'driven at {self.rate:.4g} rad/s in {when:.13g} s',
            partial(load_scene, self.source(when)),
            _TIMES,
            lambda: np.array([self.place(t - when) for t in _TIMES]),
            driven=True,
        )


def _piston(rate: float) -> _Driven:
    """A slider-crank whose slider is driven: at its dead centre the crank may turn back or
    continue, and continues."""

    def place(t: float) -> Floats:
        cos, sin = -math.cos(rate * t), -math.sin(rate * t)
        return np.array([cos, sin, 2.0 * cos, 0.0])

    def source(when: float) -> dict[str, Any]:
        q, A = place(-when), place(-when)[:2]
        return {
            'mechanism': 'slider_crank',
            'effects': _GRAVITY,
            'drives': {'piston': {'point': 'B', 'at': [f'-2*cos({rate!r}*(t - {when!r}))', None]}},
            'initial': {
                'positions': {'A': A.tolist(), 'B': q[2:].tolist()},
                'velocities': {'A': [-rate * float(A[1]), rate * float(A[0])]},
            },
        }

    return _Driven('slider_crank', rate, place, source)


def _five_bar(rate: float) -> _Driven:
    """A five-bar with both cranks driven. Its outer bars come to lie in a line (type II), and
    continue: γ is their angle."""
    a, long = 1.0, 1.8  # m: half the base and the cranks; the outer bars

    def place(t: float) -> Floats:
        gamma = rate * t
        crank = math.acos((long * math.cos(gamma) - a) / a)
        x, y = a + a * math.cos(crank), a * math.sin(crank)
        return np.array([-x, y, x, y, 0.0, y + long * math.sin(gamma)])

    def source(when: float) -> dict[str, Any]:
        q = place(-when).tolist()
        e = 1e-4  # s: differences of order 4
        steps = [(8.0, e), (-8.0, -e), (-1.0, 2.0 * e), (1.0, -2.0 * e)]
        velocity = np.sum([w * place(more - when) for w, more in steps], axis=0) / (12.0 * e)
        angle = f'acos({long / a!r}*cos({rate!r}*(t - {when!r})) - 1)'
        bars = {'left': 'O1 A1', 'right': 'O2 A2', 'left_rod': 'A1 P', 'right_rod': 'A2 P'}
        pins = {
            'left_pin': ('ground left', 'O1'),
            'right_pin': ('ground right', 'O2'),
            'left_knee': ('left left_rod', 'A1'),
            'right_knee': ('right right_rod', 'A2'),
            'tip': ('left_rod right_rod', 'P'),
        }
        return {
            'mechanism': {
                'alf': 1,
                'points': {
                    'O1': {'at': [-a, 0], 'fixed': True},
                    'O2': {'at': [a, 0], 'fixed': True},
                    **{name: {'at': q[2 * n : 2 * n + 2]} for n, name in enumerate(_FIVE)},
                },
                'bodies': {
                    name: {'points': ends.split(), 'mass': 1, 'inertia': 'rod'}
                    for name, ends in bars.items()
                },
                'joints': {
                    name: {'type': 'revolute', 'between': bodies.split(), 'at': at}
                    for name, (bodies, at) in pins.items()
                },
            },
            'effects': _GRAVITY,
            'drives': {
                'left_motor': {'joint': 'left_pin', 'angle': f'pi - {angle}'},
                'right_motor': {'joint': 'right_pin', 'angle': angle},
            },
            'initial': {'velocities': {'P': velocity[4:].tolist()}},
        }

    return _Driven('five_bar', rate, place, source)


_FIVE = ('A1', 'A2', 'P')


def _passages(rates: Sequence[float]) -> Iterator[tuple[str, list[_Passage | _Driven]]]:
    """Motions of each mechanism, through both of its singular positions or on both branches."""
    crank, two, seven = (
        one_freedom.slider_crank(),
        one_freedom.four_bars(2),
        one_freedom.four_bars(7),
    )
    change = one_freedom.change_point_alone()
    two_points = tuple(f'B{k}' for k in range(3))
    seven_points = tuple(f'B{k}' for k in range(8))
    for setting, mechanism, parameters, alone, points, angles in (
        ('slider_crank', 'slider_crank', (), crank, ('A', 'B'), (math.pi / 2, 3 * math.pi / 2)),
        ('double_four_bar', 'double_four_bar', (), two, two_points, (0.0, math.pi)),
        ('n_four_bar N=7', 'n_four_bar', (('N', 7),), seven, seven_points, (0.0, math.pi)),
        ('change_point', 'change_point', (), change, ('A', 'B'), (math.pi, 3 * math.pi)),
    ):
        yield (
            setting,
            [
                _Passage(mechanism, mechanism, parameters, alone, points, angle, rate)
                for rate in rates
                for angle in angles
            ],
        )
    yield 'random crossed four-bars', list(_crossed(rates))
    # the rods turn by less than a quarter in a run
    yield 'driven piston', [_piston(rate) for rate in rates]
    yield (
        'driven five-bar',
        [_five_bar(math.copysign(min(abs(rate), 3.0), rate)) for rate in rates],
    )


def _crossed(rates: Sequence[float]) -> Iterator[_Passage]:
    """One to three four-bars of random lengths, each parallel or crossed. The fastest of their
    bars has the rate, or 0.5 rad/s: slower ones turn back so near the position that the rounding
    of their lengths turns them by more than the bounds."""
    random = np.random.default_rng(_SEED)
    for rate in rates:
        for angle in (0.0, math.pi):
            crossed = [bool(one) for one in random.integers(0, 2, random.integers(1, 4))]
            crank = float(random.uniform(0.3, 1.2))
            coupler = crank * float(random.uniform(1.2, 2.5))
            alone = crossed_four_bars(crank, coupler, crossed)
            slopes = np.linalg.norm(alone.tangent(angle).reshape(-1, 2), axis=1) / crank
            name = f'{crank:.4g}, {coupler:.4g} m, crossed {crossed}'
            points = tuple(f'B{k}' for k in range(len(crossed) + 1))
            source = crossed_mechanism(crank, coupler, crossed)
            fastest = math.copysign(max(abs(rate), 0.5), rate)
            yield _Passage(name, source, (), alone, points, angle, fastest / float(slopes.max()))


# integrator, step (s), tolerance, bound (m): of the order of the method, and above rounding
_SETTINGS: tuple[tuple[str, tuple[tuple[float, float | None, float], ...]], ...] = (
    ('rk4', tuple((h, None, 1e5 * h**4 + 1e-9) for h in (1e-2, 5e-3, 1e-3))),
    ('dop853', tuple((h, None, 1e10 * h**8 + 1e-9) for h in (1e-2, 2e-3))),
    ('esdirk43', tuple((h, None, 1e5 * h**4 + 1e-8) for h in (1e-2, 1e-3))),
    ('dop853_adaptive', tuple((GRID, t, 100.0 * t + 1e-9) for t in (1e-3, 1e-6, 1e-9, 1e-12))),
    ('esdirk43_adaptive', tuple((GRID, t, 100.0 * t) for t in (1e-3, 1e-6))),
)


def rows(quick: bool) -> Iterator[TableRow]:
    """Landings and starts, a row for each mechanism and integrator."""
    random = np.random.default_rng(_SEED)
    slowest, fastest = np.log10(_SPEEDS).tolist()
    many = 1 if quick else 8
    rates = random.choice([-1.0, 1.0], many) * 10.0 ** random.uniform(slowest, fastest, many)
    for setting, passages in _passages(rates.tolist()):
        aside = _ASIDE[::3] if quick else _ASIDE
        whens = [GRID + more for more in aside] + [GRID - more for more in aside if more > 0.0]
        starts = [0.0] if setting != 'driven five-bar' else []
        for integrator, settings in _SETTINGS:
            runs = tuple(
                RunSpec(passage.motion(when), integrator, h, bound, tolerance)
                for h, tolerance, bound in settings
                for passage in passages
                for when in (*whens, *starts)
            )
            yield TableRow('landing', setting, runs)
