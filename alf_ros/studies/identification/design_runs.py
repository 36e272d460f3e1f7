"""Runs of candidates of an experiment design, before anything is measured.

Each candidate runs with the numbers as found. Its windows have free starts, and the measured
quantities, rates and noise of the recordings, as in a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StoppedError
from alf_ros.simulation.input_checks import number
from alf_ros.studies.identification.candidate_motion import CandidateMotion
from alf_ros.studies.identification.experiment_design import FurtherMotion
from alf_ros.studies.identification.identifiability import Knowledge
from alf_ros.studies.identification.posture_track import PostureTrack
from alf_ros.studies.identification.recording import MeasuredChannel, Recording
from alf_ros.studies.identification.weighed_windows import WeighedWindows
from alf_ros.studies.identification.window import Window, cut
from alf_ros.studies.identification.window_runs import WindowRuns, passed
from alf_ros.studies.identification.window_start import StartChart


@dataclass(frozen=True, eq=False)
class DesignRuns:
    """Runs candidates beside the recordings of a fit.

    runs, and noise (channels,): of the fit. values (P,): the numbers of the scene, and the delay
    (s) behind them if it is fitted. knowledge: what the recordings tell. length (s): of a window;
    margin (s): at its ends, without measurements, for a delay.
    """

    runs: WindowRuns
    recordings: Sequence[Recording]
    noise: Floats
    values: Floats
    knowledge: Knowledge
    length: float
    margin: float

    def motion(self, candidate: CandidateMotion, duration: float | None) -> FurtherMotion:
        """The information of a candidate; `duration` (s): None for the duration of its plan, or of
        the longest recording. Raises InputError for a scene without the numbers or the joints."""
        channels, noise = self._channels()
        names, delay = self.runs.names, self.runs.delay
        try:
            runs = WindowRuns(candidate.scene, names, channels, delay)
            runs.at(self.values[: len(names)])
        except InputError as error:
            raise error.about(f'design {candidate.name}: {error.key}') from None
        span = self._span(candidate, duration)
        try:
            windows = self._windows(runs, channels, candidate, span)
            fit = WeighedWindows(runs, windows, noise, 'linear')
            own = [_free(w) for w in windows]
            parts = [B for B, _ in fit.information(own, self.values)]
        except StoppedError:
            raise
        except AlfError as error:
            return FurtherMotion(candidate.name, span, None, str(error))
        return FurtherMotion(candidate.name, span, self.knowledge.with_more(parts))

    def _channels(self) -> tuple[list[MeasuredChannel], Floats]:
        """The measured quantities, each once, and their noise: of several recordings the mean
        variance."""
        levels: dict[tuple[str, str], list[float]] = {}
        first: dict[tuple[str, str], MeasuredChannel] = {}
        for channel, level in zip(self.runs.channels, self.noise.tolist(), strict=True):
            key = channel.joint, channel.kind
            first.setdefault(key, channel)
            levels.setdefault(key, []).append(level)
        noise = [float(np.sqrt(np.mean(np.square(each)))) for each in levels.values()]
        return list(first.values()), np.array(noise)

    def _span(self, candidate: CandidateMotion, duration: float | None) -> float:
        """How long it lasts, s."""
        if duration is not None:
            return duration
        plan = candidate.plan
        if plan is not None and candidate.positions:
            return plan.end - plan.begin
        if plan is not None and plan.inputs:
            return max(plan.inputs[-1].t, 0.0) + self.length
        return max(each.end - each.begin for each in self.recordings)

    def _windows(
        self,
        runs: WindowRuns,
        channels: Sequence[MeasuredChannel],
        candidate: CandidateMotion,
        span: float,
    ) -> list[Window]:
        """With the starts that the run has. The values that nobody has measured are zeros: the
        derivatives do not depend on them."""
        plan, simulation = candidate.plan, runs.simulation(self.values[: len(runs.names)])
        begin = plan.begin if plan is not None and candidate.positions else 0.0
        ahead = [_sampled(each, begin, span) for each in channels]
        inputs = plan.inputs if plan is not None else ()
        wished = Recording(candidate.name, tuple(ahead), inputs)
        windows = cut(
            [wished], [(0, each) for each in ahead], self.length, runs.h, 0.0, self.margin
        )
        if plan is not None and candidate.positions:
            chart = PostureTrack(runs.reference, plan.channels).start(windows[0].first * runs.h)
            first = replace(windows[0], chart=chart)
            simulation.restore(runs.state(simulation, first, chart.free))
        found = []
        for window in windows:
            state, model = simulation.state, simulation.model
            chart = StartChart(model, window.first * runs.h, state.q, state.qd, state.turns)
            found.append(replace(window, chart=chart))
            passed(simulation, window, np.array([window.last]))
        return found


def _sampled(channel: MeasuredChannel, begin: float, span: float) -> MeasuredChannel:
    """The channel at its own rate, from `begin` on for `span` (s)."""
    every = float(np.median(np.diff(channel.t))) if channel.t.size > 1 else span
    t = np.linspace(begin, begin + span, max(1, round(span / every)) + 1).astype(np.float64)
    return MeasuredChannel(channel.joint, channel.kind, t, np.zeros_like(t))


def _free(window: Window) -> Floats:
    assert window.chart is not None
    return window.chart.free


def checked_duration(duration: Any) -> float | None:
    """A duration (s) of motions, or None. Raises InputError."""
    if duration is None:
        return None
    found = number(duration, 'design duration', 0.0)
    if not found > 0.0:
        raise InputError('out of range', key='design duration', value=found, expected='above 0 s')
    return found
