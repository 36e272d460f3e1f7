"""`identify`: numbers of a scene from recordings of the machine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StoppedError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene, SceneSource, load_scene
from alf_ros.simulation.input_checks import by_name, choice, number, truth
from alf_ros.studies.identification import identifiability, noise_levels, robust_loss
from alf_ros.studies.identification.best_starts import (
    best_starts,
    costs,
    is_lost,
    nearer_starts,
    surest_starts,
)
from alf_ros.studies.identification.dated_forces import check_delay
from alf_ros.studies.identification.first_starts import (
    ANYWHERE,
    AT_REST,
    BEGINS,
    first_starts,
    posture_tracks,
)
from alf_ros.studies.identification.given_recordings import read_all
from alf_ros.studies.identification.handed_over import handed_over
from alf_ros.studies.identification.identified import ChannelFit, Identification
from alf_ros.studies.identification.least_squares_fit import (
    COARSE,
    FINE,
    ROUGH,
    Solution,
    finished,
    solve,
)
from alf_ros.studies.identification.recorded_names import Topics
from alf_ros.studies.identification.recording import MeasuredChannel, Recording
from alf_ros.studies.identification.residual_tests import whiteness
from alf_ros.studies.identification.shared_numbers import (
    DELAY,
    Pair,
    Shared,
    names_to_fit,
    near_margin,
    scene_to_fit,
    shared_numbers,
    widest_margin,
    within_margin,
)
from alf_ros.studies.identification.weighed_windows import WeighedWindows
from alf_ros.studies.identification.window import Window, begin_of, cut, with_margin
from alf_ros.studies.identification.window_residuals import WindowResiduals
from alf_ros.studies.identification.window_runs import WindowRuns, WindowStart

_GROWN = 0.25, 0.5, 1.0  # of a window that is lost
_ROUNDS = 6  # fits, each with the noise that the one before has found
_STEADY = 0.02  # relative change of the noise that needs no other round
_BEGIN = 0.2  # of a window, from which its start is found then
_UNFINISHED = f'{_ROUNDS} rounds were not enough: the noise or the numbers change still'
_AT_BOUND = 1e-6  # of a bound
_PART, _MANY = 5, 15  # of so many windows and more, one of five is fitted before all
_HANDED, _BETTER = 3, 0.9  # times that windows are handed over anew, and ½ Σ φ² that is better
Report = Callable[[str], None]
_Rounds = tuple[WindowResiduals, Solution, Solution]


def identify(
    scene: SceneSource,
    recordings: str | Path | Recording | Sequence[str | Path | Recording],
    fit: Sequence[str],
    *,
    window: float = 2.0,
    hold_out: float = 0.0,
    bounds: Mapping[str, Pair] | None = None,
    priors: Mapping[str, Pair] | None = None,
    noise: Mapping[str, float] | None = None,
    loss: str = 'linear',
    delay: bool = False,
    begins: str = ANYWHERE,
    topics: Topics | None = None,
    report: Report | None = None,
) -> Identification:
    """Fit numbers of a scene to recordings of its machine, by least squares.

    recordings: rosbag2 folders, MCAP files, or `recorded(…)` arrays. fit: names as of `fork --set`
    and of tangents. window (s): length of the parts whose starts are free. hold_out: the part of
    the windows that is kept away from the fit. bounds: (least, largest) by name; priors: (mean,
    standard deviation) by name, of independent normal distributions. noise: standard deviations by
    channel (rad or m; 'knee.velocity' per s), which the fit estimates otherwise. loss: 'linear',
    'huber', 'soft_l1' or 'cauchy'. delay: whether the delay (s) of the measurements behind the
    inputs is fitted too, as the number 'delay'. begins: how each recording begins: in an unknown
    state ('anywhere'), with a machine that stands still ('at_rest'), or in the initial state of
    the scene, at t = 0 ('scene'). report: called with a line of text.

    Raises InputError for names, numbers and recordings that cannot be used, and for numbers
    without a tangent; AlfError where the scene cannot run from the recorded motion.
    """
    say = report or _silent
    names = names_to_fit(fit)
    loaded = load_scene(scene)
    length = number(window, 'window', 0.0)
    part = number(hold_out, 'hold_out', 0.0)
    if not length > 0.0:
        raise InputError('out of range', key='window', value=length, expected='more than 0 s')
    if not part < 1.0:
        raise InputError('out of range', key='hold_out', value=part, expected='0 or more, below 1')
    choice(loss, 'loss', robust_loss.NAMES, 'no such loss')
    late = truth(delay, 'delay')
    choice(begins, 'begins', BEGINS, 'no such start')
    limits = by_name(bounds, 'bounds', '{name: (least, largest)}')
    known = by_name(priors, 'priors', '{name: (mean, standard deviation)}')
    given = dict(by_name(noise, 'noise', '{channel: standard deviation}'))
    loaded = scene_to_fit(loaded, names)
    shared = shared_numbers(loaded, names, limits, known, late)
    read = read_all(recordings, loaded, topics)
    channels = [(n, channel) for n, each in enumerate(read) for channel in each.channels]
    each_channel = [channel for _, channel in channels]
    # by the numbers of motors: targets that are held in a recording act in place of these
    own = [overrides.number_name(loaded, name) for name in names]
    runs = WindowRuns(loaded, own, each_channel, late)
    windows = cut(read, channels, length, runs.h, part, widest_margin(shared, late))
    if late:
        check_delay(loaded, read)
    windows = first_starts(runs, read, windows, begins)
    levels = noise_levels.first_levels(each_channel, given)
    away = sum(w.kept_away for w in windows)
    say(f'{len(windows) - away} windows to fit, {away} kept away, {len(names)} numbers')
    work = _Work(names, runs, channels, windows, levels, loss, given, say, begins)
    return work.identified(loaded, read, shared)


class _Work:
    """The rounds of a fit, and the result of the last one."""

    def __init__(
        self,
        names: Sequence[str],
        runs: WindowRuns,
        channels: Sequence[tuple[int, MeasuredChannel]],
        windows: Sequence[Window],
        levels: Floats,
        loss: str,
        given: Mapping[str, float],
        say: Report,
        begins: str,
    ) -> None:
        self._begins = begins
        self._names, self._runs, self._measured = names, runs, channels
        self._fitted = [w for w in windows if not w.kept_away]
        self._away = [w for w in windows if w.kept_away]
        self._levels, self._loss, self._given, self._say = levels, loss, given, say
        self.evaluations = 0

    def identified(
        self, scene: Scene, recordings: Sequence[Recording], shared: Shared
    ) -> Identification:
        runs = self._runs
        self._fitted = self._hand_over(recordings, shared.begin) or self._fitted
        before, place, solution = self._settled(recordings, shared)
        fit = self._fit(self._fitted)
        after = self._residuals(fit, self._fitted, solution.free, solution.shared)
        held = self._fit(self._away)
        held_free = self._starts(held, solution.shared, [_free(w) for w in self._away], FINE)
        held_after = self._residuals(held, self._away, held_free, solution.shared)
        names = [*self._names, DELAY] if runs.delay else list(self._names)
        return Identification(
            scene=scene,
            names=tuple(names),
            values=solution.shared,
            before=shared.begin,
            knowledge=self._known(fit, shared, place, names),
            place=place.shared,
            channels=self._channels([r.name for r in recordings], before, after, held_after),
            fitted_scene=runs.at(solution.shared[: len(runs.names)]),
            recordings=tuple(recordings),
            windows=tuple(self._fitted),
            kept_away=tuple(self._away),
            starts=solution.free,
            evaluations=self.evaluations,
            settled=solution.settled,
            reason=solution.reason,
            bounds=np.column_stack([shared.lower, shared.upper]),
            at_bounds=_at_bounds(shared, solution.shared, names),
            trouble=after.trouble,
            begins=self._begins,
            runs=runs,
        )

    def _is_white(self, solution: Solution) -> bool:
        """Whether nothing but noise is left of any channel."""
        fit = self._fit(self._fitted)
        residuals = self._residuals(fit, self._fitted, solution.free, solution.shared)
        return all(whiteness(residuals.of(n)).white for n in range(len(self._runs.channels)))

    # ------------------------------------------------------------------------------------- rounds

    def _hand_over(self, recordings: Sequence[Recording], shared: Floats) -> list[Window]:
        """The windows that are fitted, each begun where the one before ends, if joints do not tell
        where it begins; else none."""
        windows = sorted((*self._fitted, *self._away), key=lambda w: (w.recording, w.first))
        if all(w.chart is None or w.chart.is_told for w in windows):
            return []
        self._say('the recorded joints do not tell where windows begin: one after another')
        tracks = posture_tracks(self._runs, recordings, windows if self._begins == AT_REST else ())
        found = handed_over(self._runs, tracks, windows, self._fit, shared)
        self._away = [w for w in found if w.kept_away]
        return [w for w in found if not w.kept_away]

    def _settled(self, recordings: Sequence[Recording], shared: Shared) -> _Rounds:
        """The rounds of a fit. If something is left in the residuals, windows may begin in another
        posture: they were handed over with other numbers. As long as those that are handed over
        with the numbers found fit better, the fit is made again."""
        before, place, solution = self._found(shared)
        for _ in range(_HANDED):
            if not solution.settled or self._is_white(solution):
                break
            others = self._hand_over(recordings, solution.shared)
            own = costs(*_all(self._fit(self._fitted), solution.free), solution.shared)
            new = costs(*_all(self._fit(others), map(_free, others)), solution.shared)
            better = [b < _BETTER * a for a, b in zip(own, new, strict=False)]
            if not any(better):
                break
            each = zip(self._fitted, solution.free, others, better, strict=True)
            pairs = [(o, _free(o)) if is_better else (w, x) for w, x, o, is_better in each]
            self._fitted, free = [w for w, _ in pairs], [x for _, x in pairs]
            place, solution = self._rounds(replace(shared, begin=solution.shared), free)
        return before, place, solution

    def _found(self, shared: Shared) -> _Rounds:
        """The residuals with the given numbers, and what `_rounds` returns."""
        chosen, free = self._chosen(), [_free(w) for w in self._fitted]
        windows = [self._fitted[n] for n in chosen]
        fit = self._fit(windows)
        starts = self._starts(fit, shared.begin, [free[n] for n in chosen], COARSE)
        before = self._residuals(fit, windows, starts, shared.begin)
        self._relevel(before, starts, 0)
        for n, own in zip(chosen, starts, strict=True):
            free[n] = own
        place, solution = self._rounds(*self._begun(chosen, shared, free))
        return before, place, solution

    def _chosen(self) -> list[int]:
        """The numbers of the windows with which the fit begins: a few where there are many."""
        count = len(self._fitted)
        few = count // _PART if count >= _MANY else count
        return [(2 * k + 1) * count // (2 * few) for k in range(few)]

    def _begun(
        self, chosen: Sequence[int], shared: Shared, free: Sequence[Floats]
    ) -> tuple[Shared, Sequence[Floats]]:
        """Where the fit of all windows begins: at the fit of a few, if it is one."""
        others = [n for n in range(len(self._fitted)) if n not in chosen]
        if not others:
            return shared, free
        self._say(f'{len(chosen)} windows first')
        windows, levels, begun = [self._fitted[n] for n in chosen], self._levels, list(free)
        fit = self._fit(windows)
        try:
            found = solve(fit, shared, [free[n] for n in chosen], ROUGH, self._told)
            residuals = self._residuals(fit, windows, found.free, found.shared)
            self._relevel(residuals, found.free, shared.begin.size)
            begins = [begin_of(self._fitted[n], _BEGIN, self._runs.h) for n in others]
            near = nearer_starts(self._fit(begins), found.shared, [free[n] for n in others])
            for n, own in zip((*chosen, *others), (*found.free, *near), strict=True):
                begun[n] = own
            self._fit(self._fitted).differentiate(begun, found.shared)
        except StoppedError:
            raise
        except AlfError:
            self._levels = levels
            return shared, free
        self.evaluations += found.evaluations
        return replace(shared, begin=found.shared), begun

    def _rounds(self, shared: Shared, free: Sequence[Floats]) -> tuple[Solution, Solution]:
        """Where the derivatives are taken at last, and the result of the last step from there."""
        asked, margin = shared, np.inf
        for round_ in range(1, _ROUNDS + 1):
            fit = self._fit(self._fitted)
            tolerance = COARSE if round_ == 1 else FINE
            solution = solve(fit, shared, free, tolerance, self._told)
            self.evaluations += solution.evaluations
            levels = self._levels
            residuals = self._residuals(fit, self._fitted, solution.free, solution.shared)
            shared, free = replace(shared, begin=solution.shared), solution.free
            self._relevel(residuals, free, shared.begin.size)
            if not solution.settled:
                break
            steady = np.allclose(self._levels, levels, rtol=_STEADY, atol=0.0)
            delay = abs(float(shared.begin[-1])) if self._runs.delay else 0.0
            if delay >= (1.0 - _AT_BOUND) * margin:  # the motion is longer out of sight again
                margin = widest_margin(asked, True)
            elif round_ == 1 and self._runs.delay:
                margin = near_margin(asked, delay)
            elif round_ > 1 and steady:
                by_own = fit.is_own
                last = finished(fit, solution, shared)
                if last is not None or by_own:
                    return solution, last or solution
            if self._runs.delay:
                shared = replace(within_margin(asked, margin), begin=shared.begin)
                self._leave_out(margin)
        else:
            solution = replace(solution, reason=_UNFINISHED, settled=False)
        return solution, solution

    def _leave_out(self, margin: float) -> None:
        """Measurements as near (s) to the ends of windows are out of them from now on."""
        for windows in (self._fitted, self._away):
            windows[:] = [with_margin(w, self._measured, self._runs.h, margin) for w in windows]

    def _told(self, evaluations: int, cost: float) -> None:
        self._say(f'{self.evaluations + evaluations} evaluations, cost {cost:.6g}')

    def _fit(self, windows: Sequence[Window], loss: str = '') -> WeighedWindows:
        return WeighedWindows(self._runs, windows, self._levels, loss or self._loss)

    def _starts(
        self, fit: WeighedWindows, shared: Floats, free: Sequence[Floats], tolerance: float
    ) -> tuple[Floats, ...]:
        """The best starts of windows with shared numbers that stay."""
        if self._loss == 'linear':
            found = best_starts(fit, shared, free, tolerance)
        else:
            found = surest_starts(fit, self._fit(fit.windows, 'linear'), shared, free, tolerance)
        each = zip(fit.windows, fit.plain(found, shared), strict=True)
        lost = [n for n, (window, misfit) in enumerate(each) if is_lost(fit, window, misfit)]
        return self._grown(fit, lost, shared, free, found, tolerance) if lost else found

    def _grown(
        self,
        fit: WeighedWindows,
        lost: Sequence[int],
        shared: Floats,
        free: Sequence[Floats],
        found: Sequence[Floats],
        tolerance: float,
    ) -> tuple[Floats, ...]:
        """`found`, but the starts of lost windows by longer and longer parts of them where these
        fit better: a run that is a little slow before a dead point turns back there."""
        grown = [free[n] for n in lost]
        for part in _GROWN:
            parts = [begin_of(fit.windows[n], part, self._runs.h) for n in lost]
            grown = list(best_starts(self._fit(parts), shared, grown, tolerance))
        whole = self._fit([fit.windows[n] for n in lost])
        ways = ([found[n] for n in lost], grown)
        before, after = (costs(whole, whole.begun(starts), shared) for starts in ways)
        better = {n: x for n, x, a, b in zip(lost, grown, before, after, strict=True) if b < a}
        return tuple(better.get(n, x) for n, x in enumerate(found))

    def _relevel(self, residuals: WindowResiduals, free: Sequence[Floats], numbers: int) -> None:
        whole, of = residuals.joined
        count = numbers + sum(each.size for each in free)
        channels = self._runs.channels
        robust = self._loss != 'linear'
        self._levels = noise_levels.levels(channels, self._given, whole, of, count, robust)

    def _residuals(
        self,
        fit: WeighedWindows,
        windows: Sequence[Window],
        free: Sequence[Floats],
        shared: Floats,
    ) -> WindowResiduals:
        return WindowResiduals(fit.plain(free, shared), windows)

    # ------------------------------------------------------------------------------------- results

    def _known(
        self, fit: WeighedWindows, shared: Shared, solution: Solution, names: Sequence[str]
    ) -> identifiability.Knowledge:
        each = fit.information(solution.free, solution.shared)
        parts = [part for part, _ in each]
        prior = np.diag(1.0 / shared.deviation)
        spread = robust_loss.spread(self._loss, np.concatenate([r for _, r in each]))
        size = np.maximum(shared.size, np.abs(solution.shared))
        return identifiability.known(names, parts, size, prior, spread)

    def _channels(
        self,
        names: Sequence[str],
        before: WindowResiduals,
        after: WindowResiduals,
        held: WindowResiduals,
    ) -> tuple[ChannelFit, ...]:
        """`names`: of the recordings."""
        found = []
        strict = self._loss == 'linear'
        for n, channel in enumerate(self._runs.channels):
            own = after.of(n)
            found.append(
                ChannelFit(
                    channel.name,
                    names[self._measured[n][0]],
                    'rad' if self._is_angle(channel.joint) else 'm',
                    channel.kind,
                    float(self._levels[n]),
                    strict and channel.name in self._given,
                    before.rms(n),
                    after.rms(n),
                    held.rms(n),
                    whiteness(own),
                    after.times(n),
                    own,
                )
            )
        return tuple(found)

    def _is_angle(self, joint: str) -> bool:
        model = self._runs.reference.model
        return model.coordinates[model.coordinate_names.index(joint)].is_angle


def _all(
    fit: WeighedWindows, free: Iterable[Floats]
) -> tuple[WeighedWindows, Sequence[WindowStart]]:
    return fit, fit.begun(list(free))


def _free(window: Window) -> Floats:
    assert window.chart is not None
    return window.chart.free


def _at_bounds(shared: Shared, found: Floats, names: Sequence[str]) -> tuple[str, ...]:
    near = _AT_BOUND * np.maximum(np.abs(found), shared.size)  # a bound may be zero
    at = (found - shared.lower <= near) | (shared.upper - found <= near)
    return tuple(name for name, yes in zip(names, at.tolist(), strict=True) if yes)


def _silent(text: str) -> None:
    """Tell nobody."""
