"""Statistics of an ensemble while it runs, and which of the varied numbers matter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.ensemble.chunk import Chunk
from alf_ros.studies.ensemble.study import Study

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_FEWEST = 8  # points from which indices are estimated
_HUGE = 1e100


@dataclass(frozen=True)
class NumberSummary:
    """Of the members that have a number: how many, mean, standard deviation, `QUANTILES`, and the
    extremes with the index of the member. A single one has no deviation: NaN."""

    count: int
    mean: float
    deviation: float
    quantiles: tuple[float, ...]
    least: tuple[float, int]
    largest: tuple[float, int]

    def middle(self, digits: int, of_deviation: int) -> str:
        """The mean with its deviation, with so many digits; of a single member the mean alone."""
        mean = f'{self.mean:.{digits}g}'
        return mean if self.count == 1 else f'{mean} ± {self.deviation:.{of_deviation}g}'


@dataclass(frozen=True)
class Influence:
    """How much one varied number matters for one output.

    With the sampling 'saltelli' `first` and `total` are Sobol' indices: the part of the variance
    that the number explains by itself, and with all its interactions, estimated from so many
    `points`. `correlation` is Spearman's.
    """

    name: str
    first: float
    total: float
    points: int
    correlation: float


class Statistics:
    """Single numbers of members, by name; histories are left out. Add chunks in any order."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.numbers: dict[str, Floats] = {}  # (members,), NaN where there is none
        self.units: dict[str, str] = {}
        self._places: dict[str, tuple[str, tuple[int, ...]]] = {}
        for variable in study.variables:
            for name, place in variable.numbers.items():
                self.numbers[name] = np.full(study.members, math.nan)
                self.units[name] = variable.unit
                self._places[name] = variable.name, place
        self.parameters = {
            parameter.name: np.full(study.members, math.nan)
            for parameter in study.parameters
            if not parameter.text
        }

    def add(self, chunk: Chunk) -> None:
        """Count the members of a chunk."""
        members = self.study.indices(chunk.number)
        rows = slice(members.start, members.stop)
        for name, (variable, place) in self._places.items():
            at: Any = (slice(None), *place)
            self.numbers[name][rows] = chunk.arrays[variable][at]
        for name, values in self.parameters.items():
            values[rows] = chunk.arrays[name]

    def summary(self, name: str) -> NumberSummary | None:
        """Of one number; None if no member has it."""
        values = self.numbers[name]
        there = values[np.isfinite(values)]
        if not there.size:
            return None
        members = np.flatnonzero(np.isfinite(values))
        low, high = int(members[there.argmin()]), int(members[there.argmax()])
        unit = _unit(there)
        there = there / unit
        return NumberSummary(
            there.size,
            float(there.mean()) * unit,
            float(there.std(ddof=1)) * unit if there.size > 1 else math.nan,
            tuple((np.quantile(there, QUANTILES) * unit).tolist()),
            (float(values[low]), low),
            (float(values[high]), high),
        )

    def influences(self, name: str) -> list[Influence]:
        """Of all varied numbers on one output; the largest first."""
        from scipy import stats

        values = self.numbers[name]
        values = values / _unit(values[np.isfinite(values)])
        first, total, points = self._indices(values)
        found = []
        for n, parameter in enumerate(self.study.samples.names):
            varied = self.parameters.get(parameter)
            correlation = math.nan
            if varied is not None:
                both = np.isfinite(values) & np.isfinite(varied)
                if both.sum() > 2 and np.ptp(values[both]) > 0.0 < np.ptp(varied[both]):
                    correlation = float(stats.spearmanr(varied[both], values[both]).statistic)
            found.append(Influence(parameter, first[n], total[n], points, correlation))
        return sorted(found, key=_weight, reverse=True)

    def _indices(self, values: Floats) -> tuple[list[float], list[float], int]:
        """First and total Sobol' indices, of the points that all members have reached: as many as
        there are, down to a power of 2. And this number of points."""
        from scipy import stats

        d = len(self.study.samples.names)
        unknown = [math.nan] * d
        if self.study.sampling != 'saltelli':
            return unknown, unknown, 0
        whole: Floats = values.reshape(-1, d + 2)
        points: Floats = whole[np.isfinite(whole).all(axis=1)]
        if len(points) < _FEWEST or np.ptp(points) == 0.0:
            return unknown, unknown, 0
        n = 1 << int(math.log2(len(points)))
        columns = points[:n].T
        # scipy takes no single number: the number beside it changes nothing
        changed = columns[2:] if d > 1 else np.concatenate([columns[2:], columns[:1]])
        told = stats.sobol_indices(
            func={'f_A': columns[:1], 'f_B': columns[1:2], 'f_AB': changed[:, None]}, n=n
        )
        first, total = np.ravel(told.first_order)[:d], np.ravel(told.total_order)[:d]
        return first.tolist(), total.tolist(), n


def _unit(values: Floats) -> float:
    """A power of 2 in which the squares of values are within 64 bits: 1 but for huge ones."""
    largest = float(np.abs(values).max(initial=0.0))
    return 1.0 if largest < _HUGE else math.ldexp(0.5, math.frexp(largest)[1])


def _weight(of: Influence) -> float:
    known = of.total if not math.isnan(of.total) else abs(of.correlation)
    return -1.0 if math.isnan(known) else known
