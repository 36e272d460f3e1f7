"""The fit: numbers that all windows share, and the start of each window, by least squares.

The residuals r of a window depend on the shared numbers and on its own start alone. [r A B] = Q R
has as many rows as columns: R in place of the window keeps ½ |r|², Jᵀ r and Jᵀ J. The first column
of R is (|r|, 0, …), which needs no derivatives. So scipy.optimize.least_squares (trust region,
bounds) gets a few rows for each window, whatever the number of measurements.

Numbers that the measurements do not see would drift by rounding. So each number is held at its
value in the scene, and each start at its first estimate, by a deviation of `UNSEEN` times its
size. A number that is known to its own size, 100 %, moves by 1e-6 of its deviation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError
from alf_ros.studies.identification.identifiability import beside
from alf_ros.studies.identification.robust_loss import rooted
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import Misfit, WindowRuns, WindowStart

# relative change of ½ Σ φ² at which a fit ends: the last one, one before others, one of a part
FINE, COARSE, ROUGH = 1e-6, 1e-3, 1e-2
UNSEEN = 1e3  # times the size: the deviation that holds what nothing sees
_MOST = 60  # evaluations of a fit
_SHORTENED = 8  # times that a step to a better start is made shorter
# a jacobian serves again where it has told the change of the residuals since but for this part,
_BENT = 0.1
_NEAR = 2.0  # or where the square of the change is as much as that of so many residuals
_SOLVED = 1e-3  # deviations: shared numbers that would move by less are not worth a step,
_NEARLY = 0.5  # and those that move by less are not worth more than one
_STALLED = 1e-2  # part of ½ Σ φ² that a step would gain where there is none: the runs jump
_ROUNDING = 1e-6  # of a number: as far from a bound, or as much as a change
_JUMPS = (
    'no step makes the sum of squares smaller, although it has a slope: the runs of a window jump '
    'there, as beside a position that they pass or turn back from; a shorter window may help'
)
_ENDS = {  # by the status of scipy
    0: f'{_MOST} evaluations were not enough',
    1: 'the sum of squares has no slope',
    2: 'the sum of squares changes no more',
    3: 'the numbers change no more',
    4: 'the sum of squares and the numbers change no more',
}

Told = Callable[[int, float], None]  # evaluations so far, and ½ Σ φ²


@dataclass(frozen=True)
class Shared:
    """The shared numbers, of the scene and then the delay (s): where each begins, its
    bounds, its prior: mean and standard deviation, which is infinite without one, and its size."""

    begin: Floats
    lower: Floats
    upper: Floats
    mean: Floats
    deviation: Floats
    size: Floats

    @property
    def weight(self) -> Floats:
        """Of the difference to the mean, in the fit."""
        return 1.0 / np.minimum(self.deviation, UNSEEN * self.size)


@dataclass(frozen=True, eq=False)
class Solution:
    """`shared` numbers and `free` numbers of each window; `reason`: why the fit has ended;
    `settled`: whether it did by itself."""

    shared: Floats
    free: tuple[Floats, ...]
    reason: str
    settled: bool


class LeastSquaresFit:
    """Fits windows with the noise (channels,) of each channel, and a loss."""

    def __init__(
        self, runs: WindowRuns, windows: Sequence[Window], noise: Floats, loss: str
    ) -> None:
        self._runs, self._windows, self._noise, self._loss = runs, windows, noise, loss
        model = runs.reference.model
        self._size = float(np.sqrt(model.mass_scale)) * model.size  # of a start, kg^½ m, kg^½ m/s
        self.evaluations = 0

    def solve(
        self,
        shared: Shared,
        free: Sequence[Floats],
        told: Told | None = None,
        tolerance: float = FINE,
    ) -> Solution:
        """The best shared numbers and starts, from those given on.

        Raises AlfError if the runs cannot begin with the given numbers.
        """
        sizes = [each.size for each in free]
        problem = _Problem(self, self._windows, shared, sizes, tolerance)
        tried = _Tried(problem.values, problem.rows, told)
        P, x = self.numbers, np.concatenate([shared.begin, *free])
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
            self.evaluations += tried.count
            free = tuple(problem.starts(found.x))
            return Solution(found.x[:P], free, found.reason, found.settled)
        self.evaluations += tried.count
        reason, settled = _ENDS[done.status], done.status > 0
        if settled and is_stalled(done.fun, done.jac, done.x, lower, upper, P):
            reason, settled = _JUMPS, False
        if tried.failure is not None and done.status <= 0:
            reason += f'; the last failure of a run: {tried.failure}'
        return Solution(done.x[:P], tuple(problem.starts(done.x)), reason, settled)

    def starts(
        self, shared: Floats, free: Sequence[Floats], tolerance: float = FINE
    ) -> tuple[Floats, ...]:
        """The best start of each window with shared numbers that stay, by Gauss-Newton steps that
        are shortened where they gain nothing.

        Raises AlfError if a run cannot begin.
        """
        found = list(free)
        going = [n for n, own in enumerate(found) if own.size]
        for _ in range(_MOST):
            steps = self._steps(found, going, shared, tolerance)
            going = []
            for _ in range(_SHORTENED):
                tried = {n: found[n] + step for n, (step, _) in steps.items()}
                costs = self._costs([(self._windows[n], x) for n, x in tried.items()], shared)
                for (n, x), cost in zip(tried.items(), costs, strict=True):
                    step, before = steps.pop(n)
                    if cost < before:
                        found[n] = x
                        going.append(n)
                    else:
                        steps[n] = 0.25 * step, before
                if not steps:
                    break
            if not going:
                break
        return tuple(found)

    def _steps(
        self, free: Sequence[Floats], going: Sequence[int], shared: Floats, tolerance: float
    ) -> dict[int, tuple[Floats, float]]:
        """Of the windows that are not at their best starts: a step there, and ½ Σ φ² here."""
        starts, found = [(self._windows[n], free[n]) for n in going], {}
        for n, start, misfit in zip(going, starts, self._by_starts(starts, shared), strict=True):
            value, J = self.rooted(*start, misfit)
            cost = 0.5 * float(value @ value)
            if best_gain(value, J) > tolerance * cost:
                found[n] = best_step(value, J), cost
        return found

    def _costs(self, starts: Sequence[WindowStart], shared: Floats) -> list[float]:
        """½ Σ φ² of windows; infinite where a run fails."""
        try:
            misfits = self._misfits(starts, shared, False)
        except StoppedError:
            raise
        except AlfError:
            if len(starts) == 1:
                return [np.inf]
            return [cost for start in starts for cost in self._costs([start], shared)]
        each = [
            self.rooted(*start, misfit)[0] for start, misfit in zip(starts, misfits, strict=True)
        ]
        return [0.5 * float(value @ value) for value in each]

    def nearer_starts(self, shared: Floats, free: Sequence[Floats]) -> list[Floats]:
        """The starts of the windows a Gauss-Newton step nearer to the best ones."""
        starts = self._starts(free)
        found = []
        for (window, own), misfit in zip(starts, self._by_starts(starts, shared), strict=True):
            found.append(own + best_step(*self.rooted(window, own, misfit)))
        return found

    def finished(self, solution: Solution, shared: Shared) -> Solution | None:
        """The solution after a last step, by the jacobians of the place where it is, which are
        kept; None if it is not near the minimum. Raises AlfError."""
        self.differentiate(solution.free, solution.shared)
        sizes, P = [each.size for each in solution.free], self.numbers
        problem = _Problem(self, self._windows, shared, sizes, FINE)
        x = np.concatenate([solution.shared, *solution.free])
        value, J = problem.linearised(x)
        used = np.ones(x.size, dtype=bool)
        used[:P] = _is_inside(solution.shared, shared.lower, shared.upper)
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

    # ------------------------------------------------------------------------------------- windows

    @property
    def numbers(self) -> int:
        """How many numbers all windows share."""
        return self._runs.numbers

    def plain(self, free: Sequence[Floats], shared: Floats) -> list[Misfit]:
        """Of all windows, without jacobians."""
        return self._misfits(self._starts(free), shared, False)

    def differentiate(self, free: Sequence[Floats], shared: Floats) -> None:
        """Keep misfits with jacobians, for what asks next. Raises AlfError."""
        self._misfits(self._starts(free), shared, True)

    def _starts(self, free: Sequence[Floats]) -> list[WindowStart]:
        return list(zip(self._windows, free, strict=True))

    def _misfits(
        self, starts: Sequence[WindowStart], shared: Floats, differentiated: bool
    ) -> list[Misfit]:
        delay, values = self._split(shared)
        most = max((w.chart.free.size for w in self._windows if w.chart is not None), default=0)
        return self._runs.misfits_at(values, starts, delay, most if differentiated else 0)

    def linearised(self, free: Sequence[Floats], shared: Floats) -> list[Misfit]:
        """Of all windows, with jacobians: the last ones, with the secants since, if these hold.
        Raises AlfError."""
        now, found, told, bent = self.plain(free, shared), [], 0.0, 0.0
        for window, own, here in zip(self._windows, free, now, strict=True):
            last = self._runs.last(window)
            if last is None:
                break
            x, before = last
            noise = self._noise[here.channel]
            moved = np.concatenate([shared, own]) - x
            change = before.jacobian @ moved
            off = here.residuals - before.residuals - change
            told += float(np.sum((change / noise) ** 2))
            bent += float(np.sum((off / noise) ** 2))
            found.append(replace(here, jacobian=_secant(before.jacobian, moved, off)))
        r = np.concatenate([each.residuals / self._noise[each.channel] for each in now])
        holds = told <= _NEAR * float(np.mean(r**2)) or bent <= _BENT**2 * told
        if len(found) == len(now) and holds:
            delay, values = self._split(shared)
            for (window, own), each in zip(self._starts(free), found, strict=True):
                self._runs.keep_secant(values, window, own, delay, each)
            return found
        return self._misfits(self._starts(free), shared, True)

    def _by_starts(self, starts: Sequence[WindowStart], shared: Floats) -> list[Misfit]:
        """With jacobians by the starts alone."""
        delay, values = self._split(shared)
        return self._runs.by_starts(values, starts, delay)

    def _split(self, shared: Floats) -> tuple[float, Floats]:
        """The delay, and the numbers of the scene."""
        delay = float(shared[-1]) if self._runs.delay else 0.0
        return delay, shared[: len(self._runs.names)]

    def information(self, free: Sequence[Floats], shared: Floats) -> list[tuple[Floats, Floats]]:
        """B⊥ (N, P) of each window, and its residuals (N,) in units of the noise: with jacobians
        of this very place, in which undetermined combinations vanish. Raises AlfError."""
        found = []
        misfits = self._misfits(self._starts(free), shared, True)
        for window, misfit in zip(self._windows, misfits, strict=True):
            r, J = self.scaled(misfit)
            assert window.chart is not None
            of_start = np.vstack([J[:, self.numbers :], window.chart.known])
            of_numbers = np.zeros((len(of_start), self.numbers))
            of_numbers[: len(J)] = J[:, : self.numbers]
            found.append((beside(of_start, of_numbers), r))
        return found

    def scaled(self, misfit: Misfit) -> tuple[Floats, Floats]:
        """Residuals and jacobian in units of the noise."""
        noise = self._noise[misfit.channel]
        return misfit.residuals / noise, misfit.jacobian / noise[:, None]

    def rooted(self, window: Window, free: Floats, misfit: Misfit) -> tuple[Floats, Floats]:
        """φ and its derivatives, and behind them what holds the start."""
        r, J = self.scaled(misfit)
        value, slope = rooted(self._loss, r)
        assert window.chart is not None
        weak, known = 1.0 / (UNSEEN * self._size), window.chart.known
        held = np.zeros((free.size + len(known), J.shape[1]))
        if J.size:
            held[:, J.shape[1] - free.size :] = np.vstack([weak * np.eye(free.size), known])
        return (
            np.concatenate([value, weak * (free - window.chart.free), known @ free]),
            np.vstack([J * slope[:, None], held]),
        )


def _secant(J: Floats, moved: Floats, off: Floats) -> Floats:
    """The jacobian nearest to J that tells the change of residuals over `moved`, which J tells
    but for `off` (Broyden); numbers count by what they change."""
    weight = np.sum(J**2, axis=0) * moved
    length = float(moved @ weight)
    return J + np.outer(off, weight / length) if length > 0.0 else J


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
        fit: LeastSquaresFit,
        windows: Sequence[Window],
        shared: Shared,
        sizes: Sequence[int],
        tolerance: float,
    ) -> None:
        self._fit, self._windows, self._shared = fit, windows, shared
        self._tolerance = tolerance
        self._last: Floats | None = None  # x of the last slopes
        self._P = fit.numbers
        self._edges = self._P + np.cumsum([0, *sizes])
        self._first = np.cumsum([0, *(1 + self._P + size for size in sizes)])  # row of a window
        self.rows = int(self._first[-1]) + self._P

    def starts(self, x: Floats) -> list[Floats]:
        """Of the windows."""
        return [x[a:b] for a, b in zip(self._edges, self._edges[1:], strict=False)]

    def values(self, x: Floats) -> Floats:
        """(|r|, 0, …) of each window, then the priors."""
        found, shared, starts = np.zeros(self.rows), x[: self._P], self.starts(x)
        misfits = self._fit.plain(starts, shared)
        each = zip(self._first, self._windows, starts, misfits, strict=False)
        for at, window, own, misfit in each:
            value, _ = self._fit.rooted(window, own, misfit)
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
        if best_gain(value, found) <= self._tolerance * 0.5 * float(value @ value):
            raise _Ended(x, _ENDS[2], True)
        self._last = x.copy()
        return found

    def linearised(self, x: Floats) -> tuple[Floats, Floats]:
        """The values and their slopes, but for a rotation of the rows of each window."""
        P, found, value = self._P, np.zeros((self.rows, x.size)), np.zeros(self.rows)
        starts = self.starts(x)
        misfits = self._fit.linearised(starts, x[:P])
        each = zip(self._first, self._edges, self._windows, starts, misfits, strict=False)
        for at, column, window, own, misfit in each:
            R = compressed(*self._fit.rooted(window, own, misfit))
            found[at : at + len(R), :P] = R[:, 1 : 1 + P]
            found[at : at + len(R), column : column + own.size] = R[:, 1 + P :]
            value[at] = R[0, 0]
        found[self._first[-1] :, :P] = np.diag(self._shared.weight)
        value[self._first[-1] :] = (x[:P] - self._shared.mean) * self._shared.weight
        return value, found


def is_stalled(value: Floats, J: Floats, x: Floats, lower: Floats, upper: Floats, P: int) -> bool:
    """Whether a step inside the bounds, that changes one of the P first numbers by more than
    rounding, would make ½ |value|² much smaller."""
    inside = _is_inside(x, lower, upper)
    if best_gain(value, J[:, inside]) <= _STALLED * 0.5 * float(value @ value):
        return False
    step = np.zeros(x.size)
    step[inside] = best_step(value, J[:, inside])
    return bool((np.abs(step[:P]) > _ROUNDING * np.abs(x[:P])).any())


def _is_inside(x: Floats, lower: Floats, upper: Floats) -> NDArray[np.bool_]:
    return np.asarray(np.minimum(x - lower, upper - x) > _ROUNDING * np.abs(x))


def best_step(value: Floats, J: Floats) -> Floats:
    """The step without limits that makes ½ |value + J step|² least."""
    norm = np.linalg.norm(J, axis=0)
    norm[norm == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(J / norm, -value, rcond=None)[0] / norm)


def best_gain(value: Floats, J: Floats) -> float:
    """By how much a step without limits makes ½ |value + J step|² smaller."""
    return 0.5 * float(np.sum((J @ best_step(value, J)) ** 2))


def compressed(value: Floats, J: Floats) -> Floats:
    """R (columns, columns) of [r A B], its first entry not negative."""
    columns = 1 + J.shape[1]
    whole = np.zeros((max(columns, value.size), columns))
    whole[: value.size, 0], whole[: value.size, 1:] = value, J
    R: Floats = np.linalg.qr(whole)[1]
    return -R if R[0, 0] < 0.0 else R


class _Tried:
    """Values that scipy tries: after the first ones a failure of a run is NaN, and scipy takes a
    shorter step."""

    def __init__(
        self, values: Callable[[Floats], Floats], size: int, told: Told | None = None
    ) -> None:
        self._values, self._size, self._told = values, size, told
        self.count = 0
        self.failure: AlfError | None = None

    def __call__(self, x: Floats) -> Floats:
        self.count += 1
        try:
            found = self._values(x)
        except StoppedError:
            raise
        except AlfError as error:
            if self.count == 1:
                raise
            self.failure = error
            return np.full(self._size, np.nan)
        if self._told is not None:
            self._told(self.count, 0.5 * float(found @ found))
        return found
