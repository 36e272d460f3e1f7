"""The fit: numbers that all windows share, and the start of each window, by least squares.

The residuals r of a window depend on the shared numbers and on its own start alone. [r A B] = Q R
has as many rows as columns: R in place of the window keeps ½ |r|², Jᵀ r and Jᵀ J. The first column
of R is (|r|, 0, …), which needs no derivatives. So scipy.optimize.least_squares (trust region,
bounds) gets a few rows for each window, whatever the number of measurements.

A shared number that the measurements do not see is held at its value in the scene, as starts are
(`weighed_windows`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError
from alf_ros.studies.identification.gauss_newton import (
    ROUNDING,
    best_gain,
    best_step,
    compressed,
    is_inside,
)
from alf_ros.studies.identification.identifiability import beside
from alf_ros.studies.identification.shared_numbers import Shared
from alf_ros.studies.identification.weighed_windows import WeighedWindows

# relative change of ½ Σ φ² at which a fit ends: the last one, one before others, one of a part
FINE, COARSE, ROUGH = 1e-6, 1e-3, 1e-2
_MOST = 60  # evaluations of a fit
_SOLVED = 1e-3  # deviations: shared numbers that would move by less are not worth a step,
_NEARLY = 0.5  # and those that move by less are not worth more than one
_IDLE = 2  # evaluations without a gain
_STALLED = 1e-2  # part of ½ Σ φ² that a step would gain where there is none: the runs jump
_JUMPS = (
    'no step makes the sum of squares smaller, although it has a slope: the runs of a window jump '
    'there, as beside a position that they pass or turn back from, or where no recorded joint '
    'tells a start; other windows, or one more recorded joint, may help'
)
_ENDS = {  # by the status of scipy
    0: f'{_MOST} evaluations were not enough',
    1: 'the sum of squares has no slope',
    2: 'the sum of squares changes no more',
    3: 'the numbers change no more',
    4: 'the sum of squares and the numbers change no more',
}

Told = Callable[[int, float], None]  # evaluations so far, and ½ Σ φ²


@dataclass(frozen=True, eq=False)
class Solution:
    """`shared` numbers and `free` numbers of each window; `reason`: why the fit has ended;
    `settled`: whether it did by itself; `evaluations`: of all windows."""

    shared: Floats
    free: tuple[Floats, ...]
    reason: str
    settled: bool
    evaluations: int


def solve(
    windows: WeighedWindows,
    shared: Shared,
    free: Sequence[Floats],
    tolerance: float,
    told: Told | None = None,
) -> Solution:
    """The best shared numbers and starts, from those given on.

    Raises AlfError if the runs cannot begin with the given numbers.
    """
    sizes = [each.size for each in free]
    problem = _Problem(windows, shared, sizes, tolerance)
    tried = _Tried(problem, told)
    P, x = windows.numbers, np.concatenate([shared.begin, *free])
    lower, upper = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    lower[:P], upper[:P] = shared.lower, shared.upper
    try:
        done = least_squares(
            tried,
            x,
            problem.slopes,
            (lower, upper),
            x_scale='jac',
            ftol=tolerance,
            xtol=FINE,
            gtol=None,
            max_nfev=_MOST,
        )
    except _Ended as found:
        free = tuple(problem.starts(found.x))
        return Solution(found.x[:P], free, found.reason, found.settled, tried.count)
    reason, settled = _ENDS[done.status], done.status > 0
    if settled and is_stalled(done.fun, done.jac, done.x, shared):
        reason, settled = _JUMPS, False
    if tried.failure is not None and done.status <= 0:
        reason += f'; the last failure of a run: {tried.failure}'
    return Solution(done.x[:P], tuple(problem.starts(done.x)), reason, settled, tried.count)


def finished(windows: WeighedWindows, solution: Solution, shared: Shared) -> Solution | None:
    """The solution after a last step, by the jacobians of the place where it is, which are
    kept; None if it is not near the minimum. Raises AlfError."""
    windows.differentiate(solution.free, solution.shared)
    sizes, P = [each.size for each in solution.free], windows.numbers
    problem = _Problem(windows, shared, sizes, FINE)
    x = np.concatenate([solution.shared, *solution.free])
    value, J = problem.linearised(x)
    used = np.ones(x.size, dtype=bool)
    used[:P] = is_inside(solution.shared, shared.lower, shared.upper, shared.size)
    moved = np.sqrt(2.0 * best_gain(value, beside(J[:, P:], J[:, :P][:, used[:P]])))
    if moved <= _SOLVED:
        return solution
    x[used] += best_step(value, J[:, used])
    within = (shared.lower <= x[:P]).all() and (x[:P] <= shared.upper).all()
    if moved > _NEARLY or not within:
        return None
    try:
        after = problem.values(x)
    except StoppedError:
        raise
    except AlfError:
        return None
    if not after @ after < value @ value:
        return None
    return replace(solution, shared=x[:P], free=tuple(problem.starts(x)))


class _Ended(Exception):
    """Ends a fit at x, for this reason."""

    def __init__(self, x: Floats, reason: str, settled: bool) -> None:
        super().__init__()
        self.x, self.reason, self.settled = x, reason, settled


class _Problem:
    """All windows, for scipy: x are the shared numbers and the starts, one after another.

    scipy ends with a step that has changed nothing, so with a run of all windows and a jacobian
    too many. The jacobian before tells how much its best step would change.
    """

    def __init__(
        self,
        windows: WeighedWindows,
        shared: Shared,
        sizes: Sequence[int],
        tolerance: float,
    ) -> None:
        self.windows, self._shared = windows, shared
        self.tolerance = tolerance
        self._last: Floats | None = None  # x of the last slopes
        self._P = windows.numbers
        self._edges = self._P + np.cumsum([0, *sizes])
        self._first = np.cumsum([0, *(1 + self._P + size for size in sizes)])  # row of a window
        self.rows = int(self._first[-1]) + self._P

    def starts(self, x: Floats) -> list[Floats]:
        """Of the windows."""
        return [x[a:b] for a, b in zip(self._edges, self._edges[1:], strict=False)]

    def values(self, x: Floats) -> Floats:
        """(|r|, 0, …) of each window, then the priors."""
        found, shared, starts = np.zeros(self.rows), x[: self._P], self.starts(x)
        misfits = self.windows.plain(starts, shared)
        each = zip(self._first, self.windows.windows, starts, misfits, strict=False)
        for at, window, own, misfit in each:
            value, _ = self.windows.rooted(window, own, misfit)
            found[at] = np.linalg.norm(value)
        found[self._first[-1] :] = (shared - self._shared.mean) * self._shared.weight
        return found

    def slopes(self, x: Floats) -> Floats:
        """Of the values. Raises _Ended if no step would change the sum of squares, or if there
        are no slopes but where the last ones were."""
        try:
            value, found = self.linearised(x)
        except StoppedError:
            raise
        except AlfError as error:
            if self._last is None:
                raise
            raise _Ended(self._last, f'no derivatives on the way: {error}', False) from None
        if best_gain(value, found) <= self.tolerance * 0.5 * float(value @ value):
            raise _Ended(x, _ENDS[2], True)
        self._last = x.copy()
        return found

    def linearised(self, x: Floats) -> tuple[Floats, Floats]:
        """The values and their slopes, but for a rotation of the rows of each window."""
        P, found, value = self._P, np.zeros((self.rows, x.size)), np.zeros(self.rows)
        starts = self.starts(x)
        misfits = self.windows.linearised(starts, x[:P])
        each = zip(self._first, self._edges, self.windows.windows, starts, misfits, strict=False)
        for at, column, window, own, misfit in each:
            R = compressed(*self.windows.rooted(window, own, misfit))
            found[at : at + len(R), :P] = R[:, 1 : 1 + P]
            found[at : at + len(R), column : column + own.size] = R[:, 1 + P :]
            value[at] = R[0, 0]
        found[self._first[-1] :, :P] = np.diag(self._shared.weight)
        value[self._first[-1] :] = (x[:P] - self._shared.mean) * self._shared.weight
        return value, found


def is_stalled(value: Floats, J: Floats, x: Floats, shared: Shared) -> bool:
    """Whether a step inside the bounds, that changes one of the shared numbers, the first of x, by
    more than rounding, would make ½ |value|² much smaller."""
    P, inside = shared.size.size, np.ones(x.size, dtype=bool)
    inside[:P] = is_inside(x[:P], shared.lower, shared.upper, shared.size)
    step = np.zeros(x.size)
    step[inside] = best_step(value, J[:, inside])
    moved, ends = step[:P], np.where(step[:P] > 0.0, shared.upper, shared.lower)
    moves = moved != 0.0
    # along what no residual sees a step is as long as rounding makes it
    part = ((ends - x[:P])[moves] / moved[moves]).min(initial=1.0)
    gain = part * (2.0 - part) * best_gain(value, J[:, inside])
    if gain <= _STALLED * 0.5 * float(value @ value):
        return False
    return bool((np.abs(part * moved) > ROUNDING * np.abs(x[:P])).any())


class _Tried:
    """Values that scipy tries: after the first ones a failure of a run is NaN, and scipy takes a
    shorter step. Where jacobians of other places find nothing better any more, the fit ends."""

    def __init__(self, problem: _Problem, told: Told | None) -> None:
        self._problem, self._told = problem, told
        self._best: Floats = np.zeros(0)
        self._least, self._idle = np.inf, 0
        self.count = 0
        self.failure: AlfError | None = None

    def __call__(self, x: Floats) -> Floats:
        self.count += 1
        try:
            found = self._problem.values(x)
        except StoppedError:
            raise
        except AlfError as error:
            if self.count == 1:
                raise
            self.failure = error
            found = np.full(self._problem.rows, np.nan)
        cost = 0.5 * float(found @ found)
        if self._told is not None and np.isfinite(cost):
            self._told(self.count, cost)
        self._idle = 0 if cost < (1.0 - self._problem.tolerance) * self._least else self._idle + 1
        if cost < self._least:
            self._best, self._least = x.copy(), cost
        if self._idle >= _IDLE and not self._problem.windows.is_own:
            raise _Ended(self._best, _ENDS[2], True)
        return found
