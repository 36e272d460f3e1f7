"""Experiment design: which further motion tells most about the numbers of an identification.

The information of a motion, B⊥ᵀ B⊥, adds to the information of the recordings. Motions are ordered
by their least certain combination (E-optimal); the volume of the confidence ellipsoid (D-optimal)
is the second answer. Both are relative: each number counts in parts of its size.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros import html_table
from alf_ros.errors import InputError
from alf_ros.studies.identification.identifiability import Combination, Knowledge


@dataclass(frozen=True, eq=False)
class FurtherMotion:
    """A candidate of `duration` (s). knowledge: from the recordings and this motion; None, with
    the reason in `failure`, for a motion that cannot be run or differentiated."""

    name: str
    duration: float
    knowledge: Knowledge | None
    failure: str = ''

    @property
    def known(self) -> Knowledge:
        """The knowledge. Raises InputError if there is none."""
        if self.knowledge is None:
            raise InputError(self.failure, key='design', value=self.name)
        return self.knowledge

    @property
    def undetermined(self) -> tuple[Combination, ...]:
        """The combinations that remain with a deviation of 100 % or more."""
        return tuple(each for each in self.known.combinations if not each.determined)


@dataclass(frozen=True, eq=False)
class ExperimentDesign:
    """Further motions, the one with the best known least certain combination first.

    names: of the numbers; before: what the recordings alone tell. Motions that cannot be run are
    the last ones.
    """

    names: tuple[str, ...]
    before: Knowledge
    motions: tuple[FurtherMotion, ...]

    @cached_property
    def able(self) -> tuple[FurtherMotion, ...]:
        """The motions that can be run, in order."""
        return tuple(each for each in self.motions if each.knowledge is not None)

    @cached_property
    def by_volume(self) -> tuple[FurtherMotion, ...]:
        """The same, the one with the smallest confidence ellipsoid first."""
        return tuple(sorted(self.able, key=lambda each: _volume(each.known)))

    def __getitem__(self, name: str) -> FurtherMotion:
        """A motion by its name."""
        found = {each.name: each for each in self.motions}
        if name not in found:
            raise InputError('no such motion', key='design', value=name, choices=found)
        return found[name]

    def lines(self) -> Iterator[str]:
        """The result as a terminal shows it."""
        head = ('further motion', 's', 'least certain', 'volume', 'by volume')
        yield from _aligned([head, *self.rows()])
        yield ''
        yield from _aligned([('deviation of', *self.columns), *self.deviations()])
        for each in self.able:
            for one in each.undetermined:
                yield f'{each.name}: {untold(one)}'
        for each in self.motions:
            if each.failure:
                yield f'{each.name}: cannot be used: {each.failure}'

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Name, duration, deviation of the least certain combination, volume and its rank."""
        yield 'recordings alone', '', *_words(self.before), ''
        for each in self.able:
            rank = str(self.by_volume.index(each) + 1)
            yield each.name, f'{each.duration:.4g}', *_words(each.known), rank

    @property
    def columns(self) -> tuple[str, ...]:
        """Of the deviations."""
        return ('recordings alone', *(each.name for each in self.able))

    def deviations(self) -> Iterator[tuple[str, ...]]:
        """The deviation that each number would have, after each motion."""
        each = [self.before, *(motion.known for motion in self.able)]
        for k, name in enumerate(self.names):
            found = (float(of.deviations[k]) for of in each)
            yield name, *(f'{x:.2g}' if np.isfinite(x) else 'not at all' for x in found)

    def __str__(self) -> str:
        return '\n'.join(self.lines())

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        head = ('further motion', 's', 'least certain', 'volume', 'rank by volume')
        rows = [*self.rows()]
        return html_table.heading('Further motions') + html_table.table(head, rows, len(rows))

    def as_data(self) -> dict[str, Any]:
        """For JSON: null stands for a combination or number that is not seen at all."""
        return {
            'numbers': list(self.names),
            'recordings alone': _data(self.before),
            'motions': [
                {'name': each.name, 'duration': each.duration, 'failure': each.failure}
                | ({} if each.knowledge is None else _data(each.knowledge))
                for each in self.motions
            ],
        }


def ordered(
    names: Sequence[str], before: Knowledge, motions: Sequence[FurtherMotion]
) -> ExperimentDesign:
    """The design of motions, which it orders."""
    able = sorted((m for m in motions if m.knowledge is not None), key=lambda m: _least(m.known))
    unable = [each for each in motions if each.knowledge is None]
    return ExperimentDesign(tuple(names), before, (*able, *unable))


def untold(one: Combination) -> str:
    """A combination that is not determined, in words."""
    how = 'at all' if np.isinf(one.deviation) else f'to better than {one.deviation:.0%}'
    return f'not determined {how}: {one.text}'


def _least(of: Knowledge) -> tuple[float, ...]:
    """For E-optimality: the deviation of the least certain combination; if two motions agree in
    it, or do not see it at all, the next one decides."""
    return tuple(of.relative.tolist())


def _volume(of: Knowledge) -> tuple[int, float]:
    return of.untold, of.volume


def _words(of: Knowledge) -> tuple[str, str]:
    least = of.relative[0]
    if np.isinf(least):
        return 'not at all', ''
    return f'{100.0 * least:.3g} %', f'{100.0 * of.volume:.3g} %'


def _data(of: Knowledge) -> dict[str, Any]:
    deviations = [float(x) if np.isfinite(x) else None for x in of.deviations]
    combinations = [
        {
            'parts': each.parts,
            'deviation': each.deviation if np.isfinite(each.deviation) else None,
        }
        for each in of.combinations
    ]
    seen = np.isfinite(of.volume)
    return {
        'deviations': deviations,
        'combinations': combinations,
        'volume': of.volume if seen and not of.untold else None,
    }


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Columns of one width; the first one to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *rest in rows:
        cells = [first.ljust(widths[0])]
        cells += [each.rjust(width) for each, width in zip(rest, widths[1:], strict=True)]
        yield '  '.join(cells).rstrip()
