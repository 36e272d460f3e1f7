"""The runs behind the figures: both examples in a setting, as numbers, in words, as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import paths
from alf_ros.studies.paper.formulations import ComparedMotion, FormulationComparison
from alf_ros.studies.paper.published import PublishedSetting
from alf_ros.studies.paper.scan import LITERAL

FORMULATIONS = (*LITERAL, 'alf2')
SAID = 'The paper: in the two four-bars ALF1 fails after 3.3 s, ALF2 gets through.'
_LONGEST = 1.0  # s: the grid of the adaptive steps of alf2; as its tolerance asks in between


@dataclass(frozen=True)
class Figure:
    """The runs of an example beside its exact motion; `name` is the name of its files."""

    name: str
    title: str
    comparison: FormulationComparison
    runs: tuple[ComparedMotion, ...]

    @property
    def heading(self) -> str:
        """The title of the picture."""
        return f'{self.comparison.example.section}; {self.title}'

    @property
    def curves(self) -> tuple[ComparedMotion, ...]:
        """The exact motion, then the runs."""
        return self.comparison.truth, *self.runs

    def lines(self) -> Iterator[str]:
        """Each run in words: whether it gets through, its largest errors, what it cost."""
        for curve in self.runs:
            nearest = '' if curve.nearest is None else f', the nearest at {curve.nearest:.0e} rad'
            yield (
                f'{self.comparison.example.mechanism:16}{curve.name:17}{curve.verdict():16}'
                f'{curve.position_error.max():.1e} m, {curve.energy_error.max():.1e} J, '
                f'gap {curve.gap.max():.1e} m, {curve.evaluations} evaluations{nearest}'
                f'{f"; stopped: {curve.stopped}" if curve.stopped else ""}'
            )

    def write(self, path: Path) -> None:
        """Write a CSV file: a line for each formulation and instant. Raises OSError."""
        example = self.comparison.example
        columns = ['formulation', 't_s']
        columns += [f'{example.coordinate} {unit}' for unit in ('m', 'm/s', 'm/s2')]
        columns += ['energy_J', *(f'lambda {row}' for row in example.rows)]
        columns += ['position_error_m', 'energy_error_J', 'constraint_error_m']
        with (
            paths.replacing(path) as target,
            open(target, 'w', newline='', encoding='utf-8') as stream,
        ):
            writer = csv.writer(stream, lineterminator='\n')
            writer.writerow([column.replace(' ', '_') for column in columns])
            for curve in self.curves:
                for row in np.column_stack(curve.columns()):
                    writer.writerow([curve.name, *(f'{number:.12g}' for number in row)])


def published_title(setting: PublishedSetting) -> str:
    """The setting of the paper in words."""
    return (
        f'{setting.integrator}, tolerance {setting.tolerance:g}, α = {setting.penalty:g} '
        f'(alf2: dop853_adaptive)'
    )


def published(comparison: FormulationComparison, setting: PublishedSetting) -> Figure:
    """An example in the setting of the paper; alf2 with the same tolerance."""
    curves = [comparison.published(name, setting) for name in LITERAL]
    ours = {'integrator': 'dop853_adaptive', 'step': _LONGEST, 'tolerance': setting.tolerance}
    curves.append(comparison.simulated('alf2', ours))
    name = f'{comparison.example.mechanism}_published'
    return Figure(name, published_title(setting), comparison, tuple(curves))


def fixed_title(solver: Mapping[str, float]) -> str:
    """Fixed steps in words."""
    return f'rk4, {1e3 * solver["step"]:g} ms, α = {solver["penalty"]:g}'


def fixed(comparison: FormulationComparison, solver: Mapping[str, Any]) -> Figure:
    """An example with fixed steps; `solver` has `step` (s) and `penalty`."""
    curves = [comparison.simulated(name, solver) for name in FORMULATIONS]
    return Figure(comparison.example.mechanism, fixed_title(solver), comparison, tuple(curves))


def finding(runs: Sequence[ComparedMotion]) -> str:
    """Whether runs of the two four-bars in the setting of the paper reproduce its finding."""
    lost = {curve.name: curve.lost for curve in runs}
    alf1, alf2 = lost['alf1'], lost['alf2_as_printed']
    here = ', '.join(
        f'{name} gets through' if at is None else f'{name} fails at {at:.2f} s'
        for name, at in (('ALF1', alf1), ('ALF2 as printed', alf2))
    )
    agrees = alf1 is not None and alf2 is None
    says = 'reproduces' if agrees else 'does not reproduce'
    return f'Here {here}: the finding {says}. The pass at which a run fails is chance: see --scan.'
