"""Starts of windows that recorded joints do not tell: where the run of the window before ends.

With the angle of an elbow alone, a shoulder may be anywhere. Where it is follows from the motion:
the start of a window that fits best leads to an end, and there the next window begins, as near as
its recorded joints allow. A recording may begin in another posture than the scene. So where its
first window does not fit, it is tried from others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError
from alf_ros.simulation.state import State
from alf_ros.studies.identification.best_starts import best_starts, costs
from alf_ros.studies.identification.least_squares_fit import COARSE
from alf_ros.studies.identification.posture_track import PostureTrack
from alf_ros.studies.identification.weighed_windows import WeighedWindows
from alf_ros.studies.identification.window import Window, begin_of
from alf_ros.studies.identification.window_runs import WindowRuns, passed
from alf_ros.studies.identification.window_start import SceneStart, StartChart

_MOST = 60  # steps
_GOOD = 1.0  # ½ Σ φ² of a measurement, of which noise leaves a half
# of a search among starts: how many are left, from which part of the window, after so many steps
_ROUNDS = (8, 0.7, 5), (3, 0.7, _MOST), (1, 1.0, _MOST)


def handed_over(
    runs: WindowRuns,
    tracks: Sequence[PostureTrack],
    windows: Sequence[Window],
    weighed: Callable[[Sequence[Window]], WeighedWindows],
    shared: Floats,
) -> list[Window]:
    """The windows, in the order of time in each recording, with the starts that fit best, for
    shared numbers that stay. `tracks`: of the recordings, from their starts on."""
    ends: dict[int, State] = {}
    found = []
    for window in windows:
        track, end = tracks[window.recording], ends.pop(window.recording, None)
        if end is not None and end.step == window.first:
            track.take_up(window.first * runs.h, end)
        chart, is_known = track.start(window.first * runs.h), isinstance(window.chart, SceneStart)
        begun = window if is_known else replace(window, chart=chart)
        try:
            (cost,) = _begin_best([begun], weighed, shared)
            if (
                end is None
                and not is_known
                and cost > _GOOD * sum(part.t.size for part in begun.measured)
            ):
                begun = _best(runs, track, begun, weighed, shared)
            ends[window.recording] = _end(runs, begun, shared)
        except StoppedError:
            raise
        except AlfError:
            pass  # the next window begins where its joints suggest
        found.append(begun)
    return found


def _begin_best(
    windows: Sequence[Window],
    weighed: Callable[[Sequence[Window]], WeighedWindows],
    shared: Floats,
    most: int = _MOST,
) -> list[float]:
    """Let windows begin as fits best, after so many steps at most; returns ½ Σ φ² of each, which
    is infinite where a run fails. All cores share them."""
    fit, charts = weighed(windows), [each.chart for each in windows if each.chart is not None]
    free = best_starts(fit, shared, [chart.free for chart in charts], COARSE, most)
    for chart, own in zip(charts, free, strict=True):
        if isinstance(chart, StartChart):
            chart.free = own
    return costs(fit, fit.begun(free), shared)


def _best(
    runs: WindowRuns,
    track: PostureTrack,
    window: Window,
    weighed: Callable[[Sequence[Window]], WeighedWindows],
    shared: Floats,
) -> Window:
    """The window with that one of several starts with which it fits best. In each round fewer
    are left, of which more is known."""
    t = window.first * runs.h
    left = [window, *(replace(window, chart=chart) for chart in track.elsewhere(t))]
    for count, part, most in _ROUNDS:
        parts = [begin_of(each, part, runs.h) for each in left]
        found = zip(_begin_best(parts, weighed, shared, most), left, strict=True)
        good = [pair for pair in found if pair[0] < np.inf]
        left = [each for _, each in sorted(good, key=lambda pair: pair[0])[:count]]
    return left[0] if left else window


def _end(runs: WindowRuns, window: Window, shared: Floats) -> State:
    """Where the run of a window ends."""
    assert window.chart is not None
    simulation = runs.simulation(shared[: len(runs.names)])
    simulation.restore(runs.state(simulation, window, window.chart.free))
    passed(simulation, window, np.array([window.last]))
    return simulation.state
