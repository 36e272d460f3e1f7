"""Results of a work-precision sweep: the cost to reach an error, as a table and as a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from alf_ros.studies.work_precision.measurement import Measurement

TARGETS = (1e-3, 1e-6, 1e-9)  # m
Curve = tuple[str, str, int]


@dataclass(frozen=True)
class Summary:
    """The points of one scene, what they were compared with, and its own errors (m, N)."""

    scene: str
    duration: float
    reference: str
    error: float
    force_error: float
    points: Sequence[Measurement]


def curves(points: Iterable[Measurement]) -> dict[Curve, list[Measurement]]:
    """Points that differ in accuracy alone, the most accurate first."""
    found: dict[Curve, list[Measurement]] = {}
    for point in points:
        found.setdefault(point.setting.curve, []).append(point)
    return {k: sorted(v, key=lambda p: p.setting.effort) for k, v in found.items()}


@dataclass(frozen=True)
class CostToReach:
    """The cost of an error: ms per simulated second, with the setting next below that error."""

    cpu: float
    point: Measurement


def cost_to_reach(curve: Sequence[Measurement], error: float) -> CostToReach | None:
    """The cost of `error` (m) along a curve, or None if it is not reached.

    A point counts with the worst error of itself and all finer points, so that luck does not
    count; at the fine end rounding may be above it. Between points logarithms are linear.
    """
    last: tuple[float, Measurement] | None = None
    for point in curve:
        worst = point.position if last is None else max(last[0], point.position)
        if not point.failure and worst <= error:
            last = worst, point
        elif last is not None:
            below, found = last
            cpu = found.cpu
            if not point.failure and 0.0 < below < error and 0.0 < point.cpu < cpu:
                part = math.log(error / below) / math.log(worst / below)
                cpu *= (point.cpu / cpu) ** part
            return CostToReach(cpu, found)
    return None if last is None else CostToReach(last[1].cpu, last[1])


def best(points: Iterable[Measurement], error: float) -> CostToReach | None:
    """The lowest of all curves."""
    found = [cost_to_reach(curve, error) for curve in curves(points).values()]
    return min((p for p in found if p is not None), key=lambda p: p.cpu, default=None)


def sentence(summary: Summary, error: float = 1e-6) -> str:
    """The cost of `error` (m), and of an error ten times smaller."""
    found = best(summary.points, error)
    if found is None:
        return f'{summary.scene}: no setting reaches {error:.0e} m.'
    text = (
        f'{summary.scene}: {error:.0e} m costs {found.cpu:.2g} ms per second '
        f'({_rounded(1e3 / found.cpu)}x real time) with '
        f'{found.point.setting.formulation}, {found.point.setting}; '
    )
    tighter = best(summary.points, error / 10.0)
    if tighter is None:
        return f'{text}ten times tighter is not reached.'
    return f'{text}ten times tighter costs {100.0 * (tighter.cpu / found.cpu - 1.0):+.0f} %.'


def table(summary: Summary) -> str:
    """Markdown: a line per curve, the cheapest for the middle target first."""
    heads = [f'{target:.0e} m' for target in TARGETS]
    lines = [
        f'| {summary.scene} | iterations | {" | ".join(heads)} | best error, m | energy, J | '
        'gap, m | Φ_qᵀλ, N | did not end |',
        '|---' * (len(TARGETS) + 7) + '|',
    ]
    rows = []
    for (formulation, integrator, iterations), curve in curves(summary.points).items():
        reached = [cost_to_reach(curve, target) for target in TARGETS]
        costs = [found.cpu if found else math.inf for found in reached]
        ended = [point for point in curve if not point.failure]
        finest = min(ended, key=lambda p: p.position, default=None)
        errors = ['-'] * 4
        if finest is not None:
            values = finest.position, finest.energy, finest.gap, finest.force
            errors = [f'{value:.0e}' for value in values]
        failed = f'{len(curve) - len(ended)} of {len(curve)}'
        cells = [f'{formulation}, {integrator}', str(iterations)]
        cells += [f'{cost:.3g}' if cost < math.inf else '-' for cost in costs]
        rows.append(((costs[1], costs[0], costs[2]), [*cells, *errors, failed]))
    lines += [f'| {" | ".join(cells)} |' for _, cells in sorted(rows)]
    return '\n'.join(lines)


def markdown(summaries: Sequence[Summary], about: str) -> str:
    """The whole report."""
    parts = [
        '# Work and precision\n',
        f'{about.lstrip("# ")}.\n',
        'ms of processor time per simulated second to reach a position error, median of '
        'repetitions, compilation apart; logarithms are linear between settings, and all finer '
        'ones of the line reach it too. The other columns are of the setting with the least '
        'position error.\n',
    ]
    for summary in summaries:
        parts += [
            f'## {summary.scene}, {summary.duration:g} s\n',
            f'Reference: {summary.reference}, itself good to {summary.error:.0e} m.\n',
            f'{sentence(summary)}\n',
            f'{table(summary)}\n',
        ]
    return '\n'.join(parts)


def _rounded(number: float) -> str:
    """Two digits, as people say it."""
    digits = 1 - math.floor(math.log10(number))
    return f'{round(number, digits):,.{max(digits, 0)}f}'
