"""The result of `optimise`: the best design, what it gains, and how each start ended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from alf_ros import html_table, paths
from alf_ros.arrays import Floats
from alf_ros.scene.scene import Scene
from alf_ros.studies import result_folder
from alf_ros.studies.optimisation.design_goal import DesignGoal, DesignLimit
from alf_ros.studies.optimisation.design_numbers import DesignNumbers
from alf_ros.studies.optimisation.designs import DesignCurve
from alf_ros.studies.result_folder import REPORT


@dataclass(frozen=True, eq=False)
class StartedSearch:
    """One start: where it began, and where it ended.

    begin, end (P,): numbers of the designs; `end` is None for a start that cannot be. objective:
    at the end, NaN then. outside: the largest part of a limit by which the end is outside of it.
    settled: whether the search ended by itself; reason: why it ended. tried: the objective of each
    design that was evaluated, NaN for designs that cannot be.
    """

    begin: Floats
    end: Floats | None
    objective: float
    outside: float
    settled: bool
    reason: str
    tried: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best design of an optimisation.

    values, before (P,): found, and in the scene. objective_before, objective_after: of the scene
    and of the new one; `before` is NaN if the scene itself has no objective. limits_before,
    limits_after: the limited numbers. active: the numbers at their bounds, and the limits that
    hold with equality. is_feasible: whether all limits hold, to a millionth of their sizes. notes:
    conditions of the result, one sentence each. starts: all; `best`: the index of the best one.
    curves_before, curves_after: of the objective and of each limited number, over time.
    """

    scene: Scene
    optimised_scene: Scene
    numbers: DesignNumbers
    objective: DesignGoal
    limits: tuple[DesignLimit, ...]
    values: Floats
    objective_before: float
    objective_after: float
    limits_before: tuple[float, ...]
    limits_after: tuple[float, ...]
    active: tuple[str, ...]
    is_feasible: bool
    notes: tuple[str, ...]
    starts: tuple[StartedSearch, ...]
    best: int
    curves_before: tuple[DesignCurve, ...] = field(repr=False)
    curves_after: tuple[DesignCurve, ...] = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the numbers that were varied."""
        return self.numbers.names

    @property
    def before(self) -> Floats:
        """(P,) in the scene."""
        return self.numbers.before

    @property
    def settled(self) -> bool:
        """Whether the best search ended by itself."""
        return self.starts[self.best].settled

    def __getitem__(self, name: str) -> float:
        """The value of a number."""
        return float(self.values[self.names.index(name)])

    def lines(self) -> Iterator[str]:
        """The result as a terminal shows it."""
        width = max(map(len, self.names))
        for k, name in enumerate(self.names):
            bound = ', at its bound' if name in self.active else ''
            yield f'{name:{width}}  {self.before[k]:.6g} -> {self.values[k]:.6g}{bound}'
        before, after = self.objective_before, self.objective_after
        shown = f'{before:.6g}' if np.isfinite(before) else 'none'
        yield f'{self.objective.text}: {shown} -> {after:.6g} {self.objective.unit}'.rstrip()
        for limit, old, new in zip(
            self.limits, self.limits_before, self.limits_after, strict=True
        ):
            goal, active = limit.goal, ', at its limit' if limit.goal.text in self.active else ''
            shown = f'{old:.6g}' if np.isfinite(old) else 'none'
            yield f'{goal.text}: {shown} -> {new:.6g} {goal.unit}'.rstrip() + active
        failed = sum(each.end is None for each in self.starts)
        yield f'{len(self.starts)} starts, {failed} failed; the best is start {self.best}'
        yield from self.notes

    def __str__(self) -> str:
        return '\n'.join(self.lines())

    def __repr__(self) -> str:
        each = zip(self.names, self.values, strict=True)
        told = ', '.join(f'{name} {value:.6g}' for name, value in each)
        return f'<Optimum of {self.scene.name}: {told}>'

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        rows = zip(self.names, map(str, self.before), map(str, self.values), strict=True)
        return html_table.heading('Optimum') + html_table.table(
            ('number', 'before', 'after'), rows, len(self.names)
        )

    def save(self, folder: str | Path) -> Path:
        """Write `<scene>.yaml`, the scene with the new numbers, and `report.html` into a folder,
        which is made; returns it. Raises OSError."""
        from alf_ros.studies.optimisation.optimum_page import page

        scene = f'{self.scene.name}.yaml'
        # The report comes first: beside it the other files are those of this study.
        return paths.written(folder, {REPORT: page(self), scene: self.optimised_scene.text})


def check_folder(folder: Path, scene: Scene, key: str) -> None:
    """Raise InputError, which says `key`, if the optimum of a scene cannot be saved there, or only
    in place of other files."""
    from alf_ros.studies.optimisation.optimum_page import title_of

    result_folder.check(folder, [f'{scene.name}.yaml', REPORT], title_of(scene), key)
