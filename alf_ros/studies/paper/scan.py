"""When ALF1 and ALF2 as printed fail: tolerances and penalties around the values of the paper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alf_ros.studies.paper.formulations import FormulationComparison
from alf_ros.studies.paper.published import PublishedSetting

LITERAL = ('alf1', 'alf2_as_printed')
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7)
PENALTIES = (1e5, 1e6, 1e7, 1e8, 1e9)
NEIGHBOURS = np.geomspace(0.8, 1.25, 11)  # times a tolerance


def table(
    comparison: FormulationComparison,
    formulation: str,
    setting: PublishedSetting,
    tolerances: Sequence[float] = TOLERANCES,
    penalties: Sequence[float] = PENALTIES,
) -> str:
    """When a run fails, a line for each α."""
    title = f'{comparison.example.mechanism}, {formulation}: time of failure, s'
    lines = [title, 'α \\ tolerance' + ''.join(f'{tolerance:>9.0e}' for tolerance in tolerances)]
    for penalty in penalties:
        settings = [replace(setting, tolerance=each, penalty=penalty) for each in tolerances]
        found = [comparison.lost_at(formulation, each) for each in settings]
        lines.append(f'{penalty:<13.0e}' + ''.join(f'{_time(at):>9}' for at in found))
    return '\n'.join(lines)


def neighbours(
    comparison: FormulationComparison,
    formulation: str,
    setting: PublishedSetting,
    factors: Sequence[float] = tuple(NEIGHBOURS),
) -> str:
    """How many runs fail, and when, with nearly equal tolerances."""
    runs = [replace(setting, tolerance=setting.tolerance * factor) for factor in factors]
    found = [comparison.lost_at(formulation, each) for each in runs]
    times = Counter(_time(at) for at in found if at is not None)
    at = ', '.join(f'{number} at {t} s' for t, number in sorted(times.items()))
    ends = f'{min(factors) * setting.tolerance:.3g} .. {max(factors) * setting.tolerance:.3g}'
    lost = sum(times.values())
    return (
        f'{comparison.example.mechanism:16}{formulation:17}failed in {lost} of {len(found)} runs '
        f'with tolerances {ends}{f": {at}" if at else ""}'
    )


def _time(at: float | None) -> str:
    return '-' if at is None else f'{at:.2f}'
