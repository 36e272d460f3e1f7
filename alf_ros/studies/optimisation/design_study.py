"""A study: all that the searches of an optimisation depend on, and that a worker needs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StoppedError
from alf_ros.simulation.input_checks import by_name
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.optimisation.design_goal import DesignLimit, design_goal, design_limit
from alf_ros.studies.optimisation.design_numbers import design_numbers
from alf_ros.studies.optimisation.designs import Design, Designs, Told
from alf_ros.studies.optimisation.local_search import searched
from alf_ros.studies.optimisation.optimum import StartedSearch
from alf_ros.studies.sent_scene import SentScene


@dataclass(frozen=True, eq=False)
class SearchEnd:
    """How one start ended: its row, and its design; or why it failed."""

    row: StartedSearch
    design: Design | None = None
    error: AlfError | None = None


@dataclass(frozen=True, eq=False)
class DesignStudy(SentScene):
    """The searches of an optimisation.

    vary, minimise, subject_to: as `optimise` has them. duration, period (s): of the motion, and
    between its samples; driven: whether drives decide on the motion; begins: the numbers (P,)
    with which each search begins; most: evaluations of one search; usual: sizes of the limited
    numbers, as `sized` finds them.
    """

    vary: Mapping[str, Any]
    minimise: Any
    subject_to: Mapping[str, Any]
    duration: float
    period: float
    driven: bool
    begins: tuple[Floats, ...]
    most: int
    usual: tuple[float, ...] = ()

    @cached_property
    def _sample(self) -> Sample:
        return Simulation(self.scene).sample()

    def designs(self) -> Designs:
        """An evaluation of designs that knows none yet, so that no search depends on another.

        Raises InputError for numbers and goals that cannot be used.
        """
        limits = limits_of(self.subject_to, self._sample, self.duration)
        if self.usual:
            each = zip(limits, self.usual, strict=True)
            limits = [replace(limit, usual=usual) for limit, usual in each]
        return Designs(
            design_numbers(self.scene, self.vary),
            design_goal(self.minimise, 'minimise', self._sample, self.duration),
            limits,
            self.duration,
            self.period,
            self.driven,
        )

    def sized(self) -> DesignStudy:
        """The same with the sizes that limited numbers have in the first start that can be: a
        limit of 0 tells none. Raises InputError as `designs` does."""
        designs = self.designs()
        if any(limit.is_zero for limit in designs.limits):
            for begin in self.begins:
                try:
                    usual = tuple(size or 1.0 for size in designs.sizes_of(begin))
                except StoppedError:
                    raise
                except AlfError:
                    continue
                return replace(self, usual=usual)
        return self

    def indices(self, k: int) -> range:
        """The starts that belong to number k: that one."""
        return range(k, k + 1)


def started_search(study: DesignStudy, k: int, told: Told | None = None) -> SearchEnd:
    """Search from start k; told: called after each design."""
    designs, begin = study.designs(), study.begins[k]
    designs.told = told
    row = StartedSearch(begin, None, math.nan, math.nan, False, '', ())
    try:
        found = searched(designs, begin, study.most)
    except StoppedError:
        raise
    except AlfError as error:
        return SearchEnd(replace(row, reason=str(error), tried=tuple(designs.tried)), error=error)
    design = found.design
    rooms = [
        limit.room(asked.value)
        for limit, asked in zip(designs.limits, design.limited, strict=True)
    ]
    row = StartedSearch(
        begin,
        design.values,
        design.objective.value,
        max(0.0, -min(rooms, default=0.0)),
        found.settled,
        found.reason,
        tuple(designs.tried),
    )
    return SearchEnd(row, design)


def limits_of(given: Any, sample: Sample, duration: float) -> list[DesignLimit]:
    """The limits of `subject_to`, for the scene of a sample. Raises InputError."""
    expected = '{max(norm(knee.force)): [~, 50]}'
    found = []
    for name, data in by_name(given, 'subject_to', expected).items():
        key = f'subject_to.{name}'
        if not isinstance(data, Mapping):
            found.append(design_limit(name, data, key, sample, duration))
            continue
        for word in data:
            if word not in ('of', 'between'):
                raise InputError('unknown key', key=key, value=word, choices=('of', 'between'))
        limit = design_limit(data.get('of'), data.get('between'), key, sample, duration)
        # two limits may be of numbers of one text, such as of two paths of one point
        goal = replace(limit.goal, text=f'{limit.goal.text} ({name})')
        found.append(replace(limit, goal=goal))
    return found
