"""The course of a path of equilibria: its points and critical points, up to where it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from alf_ros.errors import InputError
from alf_ros.logs.progress import Report, silent
from alf_ros.studies.statics.arc_length import LostPathError, PathStep, corrected, steps
from alf_ros.studies.statics.path_events import CriticalPoint, critical_points
from alf_ros.studies.statics.path_point import PathDirection, PathPoint

BACK = 'it comes back to its start'
_ASIDE = (0.02, 0.005, 0.001)  # steps that are tried onto another branch
_CLOSES = 1e-6  # distance, without unit, at which a path has come back to its start


@dataclass(frozen=True)
class PathLimits:
    """The values of the number between which a path is followed, and its most points."""

    end: float
    back: float
    most: int

    def passed(self, value: float) -> float | None:
        """The limit that a value is past; None if none."""
        sense = math.copysign(1.0, self.end - self.back)
        if sense * (value - self.end) >= 0.0:
            return self.end
        return self.back if sense * (self.back - value) >= 0.0 else None

    def part(self, first: float, value: float, points: int) -> float:
        """The part of the way from `first` to one of the limits that is done at a value."""
        ways = ((value - first, limit - first) for limit in (self.end, self.back))
        parts = [way / whole for way, whole in ways if way * whole > 0.0]
        return min(max(points / self.most, *parts), 1.0)


@dataclass(eq=False)
class PathCourse:
    """Points in their order; critical points by their place among them; why it ends. `report`
    takes the largest part of the way to a limit that was done, 0 to 1."""

    limits: PathLimits
    points: list[PathPoint] = field(default_factory=list)
    critical: dict[int, CriticalPoint] = field(default_factory=dict)
    ending: str = ''
    report: Report = silent

    def follow(
        self, start: PathPoint, direction: PathDirection, origin: PathPoint | None = None
    ) -> None:
        """From a point of the path along a direction of length 1. `origin`: where the path comes
        from, if it is another point."""
        origin = start if origin is None else origin
        done = 0.0
        self.points.append(start)
        try:
            for step in steps(start, direction, self.limits.passed):
                back = _passed(origin, step) if step.before is not start else None
                if back is not None:
                    self.points.append(back)
                    self.ending = BACK
                    return
                for found in critical_points(step):
                    if len(self.points) - 1 in self.critical:
                        self.points += _middle(step, self.points[-1], found.point)
                    self.critical[len(self.points)] = found
                    self.points.append(found.point)
                self.points.append(step.after)
                part = self.limits.part(start.value, step.after.value, len(self.points))
                done = max(done, part)
                self.report(done)
                if len(self.points) >= self.limits.most:
                    self.ending = f'{self.limits.most} points are reached'
                    return
        except InputError as error:
            last = self.points[-1].value
            self.ending = f'it cannot be followed beyond {last:.9g}: {error}'
            return
        self.ending = f'it reaches {self.points[-1].value:.9g}'


def _middle(step: PathStep, one: PathPoint, other: PathPoint) -> list[PathPoint]:
    """The point of a step between two critical points: it has the stability between them."""
    ways = [
        step.before.scales.product(step.leaving, each.since(step.before)) for each in (one, other)
    ]
    try:
        return [corrected(step.before, step.leaving, 0.5 * sum(ways))]
    except InputError:
        return []


def _passed(origin: PathPoint, step: PathStep) -> PathPoint | None:
    """The point of a step at which the path comes back to another one; None if it does not."""
    before, scales = step.before, origin.scales
    length = scales.product(step.leaving, step.after.since(before))
    back = origin.since(before)
    along = scales.product(step.leaving, back)
    if not 0.0 < along <= length or scales.size(back) > 1.1 * length:
        return None
    try:
        there = corrected(before, step.leaving, along)
    except InputError:
        return None
    return there if scales.size(there.since(origin)) < _CLOSES else None


def branched(critical: CriticalPoint, limits: PathLimits) -> tuple[PathCourse, ...]:
    """The courses of the other path through a branch point, to both sides; one if it comes back.

    The first point on it lies in the plane across the direction without stiffness, beside the
    first path. Raises InputError if there is none.
    """
    here, scales = critical.point, critical.point.scales
    along = scales.product(critical.soft, critical.leaving)
    q = critical.soft.q - along * critical.leaving.q
    aside = PathDirection(q, critical.soft.value - along * critical.leaving.value)
    aside = aside.times(1.0 / scales.size(aside))
    found = []
    for sense in (1.0, -1.0):
        direction = aside.times(sense)
        first = _beside(here, direction)
        course = PathCourse(limits, [here])
        course.follow(first, first.tangent(direction), here)
        found.append(course)
        if course.ending == BACK:
            break
    return tuple(found)


def _beside(here: PathPoint, direction: PathDirection) -> PathPoint:
    reach = 0.1 * here.instant.loads.tangents.length
    farthest = reach / max(float(np.abs(direction.q).max(initial=0.0)), 1e-300)
    for step in _ASIDE:
        try:
            return corrected(here, direction, min(step, farthest), 2.0)
        except LostPathError:
            continue
    raise InputError('no other path is found beside this point', key='branch')
