"""From one design to the nearest optimum, by scipy, in parts u = (θ - least) / (most - least).

A path error without limits is a sum of squares: `scipy.optimize.least_squares` (trust region
reflective). Everything else goes to SLSQP, sequential quadratic programs with a line search. Both
have exact gradients.

A step may lead to a design that cannot be: loops that do not close, a run that fails, a goal
without derivative. It is refused. `least_squares` then tries a quarter of the step. SLSQP has no
such rule. It begins again at the last design that it accepted, in a box around it half as large as
the refused step; if it ends at a side of this box, the box grows.

Where limits cannot be met, SLSQP goes back and forth between designs outside of them until it is
stopped. It ends where many designs in a row come no nearer to the limits than one before them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares, minimize

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError
from alf_ros.studies.optimisation.designs import Design, Designs

_TIGHT = 1e-12  # relative change of the objective, and of u, that ends a least-squares search
_FLAT = 1e-11  # relative change of the objective that ends SLSQP, and
_ROUNDED = 1e-8  # between designs that it accepted, from which down no descent is one
_NO_DESCENT = 8  # status of SLSQP: its direction does not lead down
_MOST_BOXES = 60
_SMALLEST = 1e-6  # half side of a box
_AT_SIDE = 1e-9
_NEARER = 1e-3  # part of its distance from the limits by which a design has to come nearer
_MOST_ASIDE = 8  # designs in a row that SLSQP accepts and that do not
OUTSIDE = 1e-6  # part of a limit that a design may be outside
_ENDS = {
    0: 'too many designs',
    1: 'the gradient vanishes',
    2: 'the objective no longer falls',
    3: 'the numbers no longer change',
    4: 'neither the objective nor the numbers change',
}


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """Where a search ended, whether it settled there, and why it ended."""

    design: Design
    settled: bool
    reason: str


class _RefusedError(Exception):
    """A design that cannot be, at u."""

    def __init__(self, u: Floats, error: AlfError) -> None:
        self.u, self.error = u, error


class _TooManyError(Exception):
    """All designs of a search are spent."""


class _OutsideError(Exception):
    """Designs come no nearer to the limits."""


class _LevelError(Exception):
    """The gradient is 0 but for rounding; scipy would divide by it."""


def searched(designs: Designs, start: Floats, most: int) -> LocalOptimum:
    """The optimum near a design (P,), after `most` evaluations at most. Raises AlfError if the
    start itself cannot be."""
    search = _Search(designs, most)
    first = designs.at(search.values(search.parts(start)))
    if first.objective.residuals is not None and not designs.limits:
        return search.by_least_squares(first)
    return search.by_boxes(first)


class _Search:
    def __init__(self, designs: Designs, most: int) -> None:
        self._designs, self._most = designs, most
        self._begun = len(designs.tried)
        self._anchor: Design | None = None
        # outside of the limits: the nearest design, its distance, and those that came no nearer
        self._nearest: Design | None = None
        self._distance, self._aside = np.inf, 0

    def parts(self, values: Floats) -> Floats:
        numbers = self._designs.numbers
        return np.clip((values - numbers.lower) / numbers.width, 0.0, 1.0)

    def values(self, u: Floats) -> Floats:
        numbers = self._designs.numbers
        return np.clip(numbers.lower + u * numbers.width, numbers.lower, numbers.upper)

    def _at(self, u: Floats) -> Design:
        if len(self._designs.tried) - self._begun >= self._most:
            raise _TooManyError
        return self._designs.at(self.values(u))

    # ---------------------------------------------------------------------------- least squares

    def by_least_squares(self, first: Design) -> LocalOptimum:
        size, best = first.objective.residuals.size, [first]  # type: ignore[union-attr]
        failure: list[str] = []

        def residuals(u: Floats) -> Floats:
            try:
                found = self._at(u)
            except StoppedError:  # of the program, not of this design
                raise
            except AlfError as error:
                failure[:] = [str(error)]
                return np.full(size, np.nan)
            if found.objective.value <= best[0].objective.value:
                best[0] = found
            assert found.objective.residuals is not None
            return found.objective.residuals

        def jacobian(u: Floats) -> Floats:
            at = self._designs.at(self.values(u)).objective
            assert at.jacobian is not None
            width = self._designs.numbers.width
            if np.abs(at.gradient * width).max() <= _TIGHT * at.value:
                raise _LevelError
            return at.jacobian * width

        try:
            done = least_squares(
                residuals,
                self.parts(first.values),
                jacobian,
                (0.0, 1.0),
                ftol=_TIGHT,
                xtol=_TIGHT,
                gtol=None,
                max_nfev=self._most,
            )
        except _TooManyError:
            return LocalOptimum(best[0], False, _ENDS[0])
        except _LevelError:
            return LocalOptimum(best[0], True, _ENDS[1])
        except ValueError:  # the first design, which scipy moves off the bounds, cannot be
            if not failure:
                raise
            return LocalOptimum(best[0], False, failure[0])
        return LocalOptimum(best[0], done.status > 0, _ENDS[done.status])

    # -------------------------------------------------------------------------------------- SLSQP

    def by_boxes(self, first: Design) -> LocalOptimum:
        self._anchor, half, refusal = first, 1.0, ''
        scale = abs(self._objective(first)[0]) or 1.0
        for _ in range(_MOST_BOXES):
            u = self.parts(self._anchor.values)
            low, high = np.maximum(u - half, 0.0), np.minimum(u + half, 1.0)
            try:
                done = self._in_box(u, low, high, scale)
            except _RefusedError as refused:
                off = np.abs(refused.u - self.parts(self._anchor.values)).max()
                half, refusal = 0.5 * float(off), str(refused.error)
                if half < _SMALLEST:
                    break
                continue
            except _TooManyError:
                return LocalOptimum(self._anchor, False, _ENDS[0])
            except _OutsideError:
                assert self._nearest is not None
                return LocalOptimum(self._nearest, False, self._missed(self._nearest))
            ended, last = np.clip(done.x, low, high), self._anchor
            self._anchor = self._designs.at(self.values(ended))
            fallen = self._objective(last)[0] - self._objective(self._anchor)[0]
            level = done.status == _NO_DESCENT and abs(fallen) <= _ROUNDED * scale
            settled = done.status == 0 or level
            side = (ended - low <= _AT_SIDE) & (low > 0.0) | (high - ended <= _AT_SIDE) & (
                high < 1.0
            )
            if not settled or not side.any():
                return LocalOptimum(
                    self._anchor, settled, _ENDS[2] if settled else str(done.message)
                )
            half = min(1.0, 2.0 * half)
        return LocalOptimum(self._anchor, False, f'beyond lie designs that cannot be: {refusal}')

    def _in_box(self, u: Floats, low: Floats, high: Floats, scale: float) -> Any:
        def tried(u: Floats) -> Design:
            try:
                return self._at(np.clip(u, low, high))
            except StoppedError:
                raise
            except AlfError as error:
                raise _RefusedError(np.clip(u, low, high), error) from None

        def value(u: Floats) -> float:
            return self._objective(tried(u))[0] / scale

        def slope(u: Floats) -> Floats:
            self._accept(tried(u))  # only where a line search has ended
            assert self._anchor is not None
            return self._objective(self._anchor)[1] / scale

        limits: tuple[dict[str, Any], ...] = ()
        if self._designs.limits:
            rooms: Callable[[Floats], Floats] = lambda u: self._rooms(tried(u))[0]  # noqa: E731
            slopes: Callable[[Floats], Floats] = lambda u: self._rooms(tried(u))[1]  # noqa: E731
            limits = ({'type': 'ineq', 'fun': rooms, 'jac': slopes},)
        return minimize(
            value,
            u,
            jac=slope,
            method='SLSQP',
            bounds=list(zip(low, high, strict=True)),
            constraints=limits,
            options={'ftol': _FLAT, 'maxiter': self._most},
        )

    def _accept(self, design: Design) -> None:
        """Raises _OutsideError where SLSQP comes no nearer to limits that no design has met."""
        before, self._anchor = self._anchor, design
        if design is before or self._distance <= OUTSIDE:
            return
        distance = -self._rooms(design)[0].min(initial=0.0)
        self._aside = 0 if distance < (1.0 - _NEARER) * self._distance else self._aside + 1
        if distance < self._distance:
            self._nearest, self._distance = design, distance
        if self._aside >= _MOST_ASIDE and self._distance > OUTSIDE:
            raise _OutsideError

    def _missed(self, design: Design) -> str:
        """The limits that a design does not meet, in words."""
        limits = zip(self._designs.limits, design.limited, strict=True)
        names = [limit.goal.text for limit, asked in limits if limit.room(asked.value) < -OUTSIDE]
        return f'designs come no nearer to the limits of {", ".join(names)}'

    def _objective(self, design: Design) -> tuple[float, Floats]:
        """The objective, of a path error its square, and its slope by u."""
        asked, width = design.objective, self._designs.numbers.width
        if asked.residuals is None or asked.jacobian is None:
            return asked.value, asked.gradient * width
        return asked.value**2, 2.0 * asked.residuals @ asked.jacobian * width

    def _rooms(self, design: Design) -> tuple[Floats, Floats]:
        """How far the limited numbers are inside, in parts of the limits; and slopes by u."""
        room, slopes, width = [], [], self._designs.numbers.width
        for limit, asked in zip(self._designs.limits, design.limited, strict=True):
            for bound, sign in ((limit.least, 1.0), (limit.most, -1.0)):
                if np.isfinite(bound):
                    room.append(sign * (asked.value - bound) / limit.size)
                    slopes.append(sign * asked.gradient * width / limit.size)
        return np.array(room), np.array(slopes)
