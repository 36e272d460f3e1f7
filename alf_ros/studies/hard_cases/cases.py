"""The cases: mechanisms through their singular positions, and what their runs have to keep to."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from alf_ros.model.tableaux import TABLEAUX
from alf_ros.studies.exact import motions as reference_motion
from alf_ros.studies.exact.motions import ExactMotion
from alf_ros.studies.hard_cases import campaign, corners, landing
from alf_ros.studies.hard_cases.trial import RunResult, RunSpec, TableRow, observed_order


def _runs(
    motions: Iterable[ExactMotion], integrator: str, steps: Iterable[float]
) -> tuple[RunSpec, ...]:
    """Runs with the bound of the method: 1e-6 m of order 4 (to 2 ms), 1e-9 m of order 8 to 4 ms.

    Above 4 ms order 8 has only to stay on its branch (1e-3 m).
    """

    def bound(h: float) -> float:
        return 1e-6 if integrator == 'rk4' else 1e-9 if h <= 4e-3 else 1e-3

    return tuple(RunSpec(motion, integrator, h, bound(h)) for motion in motions for h in steps)


def _survival(quick: bool) -> Iterator[TableRow]:
    """All steps h = 0.01/k through the examples of the paper."""
    for name in ('slider_crank', 'double_four_bar'):
        for integrator, numbers in (
            ('rk4', (5, 8, 13, 31) if quick else range(5, 61)),
            ('dop853', (1, 3, 5, 10) if quick else range(1, 61)),
        ):
            steps = [0.01 / k for k in numbers]
            yield TableRow(
                'survival', name, _runs([reference_motion.paper(name)], integrator, steps)
            )


def _change_points(quick: bool) -> Iterator[TableRow]:
    """A four-bar without symmetry; odd steps, some of which land on the position."""
    odd = (0.0, 0.13, 0.26, 0.39, 0.52, 0.65)
    steps = [5e-3 / (k + more) for k in ((1, 2) if quick else (1, 2, 5, 10)) for more in odd]
    motion = reference_motion.change_point()
    for integrator, factor, order in (('rk4', 1e6, 4), ('dop853', 1e10, 8)):
        runs = tuple(RunSpec(motion, integrator, h, factor * h**order + 1e-10) for h in steps)
        yield TableRow('change_point', 'change_point', runs)


def _many_bars(quick: bool) -> Iterator[TableRow]:
    """N freedoms more for an instant, against the pendulum that N four-bars are."""
    for integrator, steps in (('rk4', (2e-3, 1e-3, 5e-4)), ('dop853', (4e-3, 2e-3, 1e-3))):
        for n in (2, 10) if quick else (2, 10, 100, 1000):
            yield TableRow(
                'many_bars',
                f'n_four_bar N={n}',
                _runs([reference_motion.four_bars(n)], integrator, steps),
            )


def _starts(quick: bool) -> Iterator[TableRow]:
    """Let go in the singular position, so near it that rounding decides, at rest beside it."""
    rates = (0.5, -2.0) if quick else (0.5, -0.5, 2.0, -2.0, 6.0, -6.0)
    beside = (1e-3, -1e-7) if quick else (1e-3, -1e-3, 1e-5, -1e-5, 1e-7, -1e-7, 1e-9)
    beyond = (1e-9, -1e-6) if quick else (1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3, -1e-3)
    for name in ('slider_crank', 'double_four_bar'):
        for where, offsets in (('in', (0.0,)), ('near', beyond)):
            motions = [
                reference_motion.start(name, offset, rate) for offset in offsets for rate in rates
            ]
            for integrator, h in (('rk4', 1e-3), ('dop853', 2e-3)):
                yield TableRow('starts', f'{name} {where} it', _runs(motions, integrator, (h,)))
        at_rest = [reference_motion.start(name, offset, 0.0) for offset in beside]
        for integrator, h in (('rk4', 1e-3), ('dop853', 2e-3)):
            runs = tuple(RunSpec(motion, integrator, h, 1e-6) for motion in at_rest)
            yield TableRow('starts', f'{name} at rest beside it', runs)


def _orders(quick: bool) -> Iterator[TableRow]:
    """The order of the method, seen through singular passes; no run may leave its branch."""
    for motion, largest in (
        (reference_motion.paper('slider_crank'), 4e-2),
        (reference_motion.paper('double_four_bar'), 0.12),
        (reference_motion.change_point(), 2.5e-2),
    ):
        for integrator, coarse in (('rk4', 1.6e-2), ('dop853', largest)):
            steps = np.geomspace(coarse, coarse / 5, 9 if quick else 25)
            runs = tuple(RunSpec(motion, integrator, float(h), 0.1) for h in steps)
            yield TableRow('order', motion.mechanism, runs, TABLEAUX[integrator].order - 0.5)


def _adaptive(quick: bool) -> Iterator[TableRow]:
    """The error follows the tolerance, and is not above a hundred of it after the motion."""
    tolerances = 10.0 ** -np.arange(3, 13, 3 if quick else 1)
    for motion in (
        reference_motion.paper('slider_crank'),
        reference_motion.paper('double_four_bar'),
        reference_motion.change_point(),
    ):
        runs = tuple(
            RunSpec(motion, 'dop853_adaptive', 1.0, 100.0 * tolerance, tolerance)
            for tolerance in tolerances
        )
        yield TableRow('adaptive', motion.mechanism, runs)


def _implicit(quick: bool) -> Iterator[TableRow]:
    """The method for stiff scenes in the same places: its steps, its order, its tolerances."""
    paper = [reference_motion.paper(name) for name in ('slider_crank', 'double_four_bar')]
    steps = [0.01 / k for k in ((1, 3, 8) if quick else range(1, 41))]
    odd = [
        0.01 / (k + more) for k in (1, 2, 5) for more in ((0.13,) if quick else (0.0, 0.13, 0.39))
    ]
    change = reference_motion.change_point()
    for motion, lengths, factor, floor, coarse in (
        (paper[0], steps, 1e4, 2e-9, 1.6e-2),
        (paper[1], steps, 1e4, 2e-9, 4e-2),
        (change, odd, 1e6, 1e-8, 1.6e-2),
    ):
        runs = tuple(RunSpec(motion, 'esdirk43', h, factor * h**4 + floor) for h in lengths)
        yield TableRow('implicit', motion.mechanism, runs)
        tolerances = 10.0 ** -np.arange(3, 11, 3 if quick else 1)
        runs = tuple(
            RunSpec(motion, 'esdirk43_adaptive', 1.0, 100.0 * tolerance, tolerance)
            for tolerance in tolerances
        )
        yield TableRow('implicit', motion.mechanism, runs)
        lengths = np.geomspace(coarse, coarse / 5, 9 if quick else 25).tolist()
        runs = tuple(RunSpec(motion, 'esdirk43', h, 0.1) for h in lengths)
        yield TableRow('implicit', motion.mechanism, runs, TABLEAUX['esdirk43'].order - 0.5)


CASES = {
    'survival': _survival,
    'adaptive': _adaptive,
    'change_point': _change_points,
    'implicit': _implicit,
    'many_bars': _many_bars,
    'starts': _starts,
    'landing': landing.rows,
    'corners': corners.rows,
    'order': _orders,
    'campaign': campaign.rows,
}


def judge(row: TableRow, results: Sequence[RunResult]) -> str:
    """'passed', or the fault in the runs of a row."""
    bad = [result for result in results if result.verdict != 'passed']
    if bad:
        efforts = list(dict.fromkeys(result.run.effort for result in bad))
        at = ', '.join(efforts[:3]) + (' ...' if efforts[3:] else '')
        lost = sum(bool(result.failure) for result in bad)
        stopped = f', {lost} did not end' if lost else ''
        return f'FAILED: {len(bad)} of {len(results)}{stopped} ({at})'
    if row.order is not None and not observed_order(results) >= row.order:
        return f'FAILED: order below {row.order}'
    if row.ratio is not None and not ratios(results)[0] <= row.ratio:
        return f'FAILED: more than {row.ratio} times the evaluations'
    return 'passed'


def ratios(results: Sequence[RunResult]) -> tuple[float, float]:
    """Median and worst ratio of the evaluations to the evaluations of the one freedom alone."""
    ratios = [math.inf if result.failure else result.ratio for result in results]
    return statistics.median(ratios), max(ratios)
