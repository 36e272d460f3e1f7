"""Where windows begin before the fit; the start of a recording may be known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from alf_ros.studies.identification.posture_track import PostureTrack
from alf_ros.studies.identification.recording import Recording
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import WindowRuns
from alf_ros.studies.identification.window_start import SceneStart

ANYWHERE, AT_REST, AS_SCENE = BEGINS = 'anywhere', 'at_rest', 'scene'


def first_starts(
    runs: WindowRuns, recordings: Sequence[Recording], windows: Sequence[Window], begins: str
) -> list[Window]:
    """The windows, in the order of time in each recording, with their starts. `begins`, one of
    `BEGINS`: the knowledge of the first one of a recording. As the scene it begins at t = 0."""
    tracks = posture_tracks(runs, recordings, windows if begins == AT_REST else ())
    found: list[Window] = []
    for window in windows:
        is_first = not found or found[-1].recording != window.recording
        # a track follows from the first window on
        chart = tracks[window.recording].start(window.first * runs.h)
        if is_first and begins == AS_SCENE:
            inputs = recordings[window.recording].by_step(0, window.last, runs.h)
            found.append(replace(window, first=0, inputs=inputs, chart=SceneStart()))
        else:
            found.append(replace(window, chart=chart))
    return found


def posture_tracks(
    runs: WindowRuns, recordings: Sequence[Recording], at_rest: Sequence[Window]
) -> list[PostureTrack]:
    """One of each recording, which stands still where the first of these windows of it begins."""
    begin = {w.recording: w.first * runs.h for w in reversed(at_rest)}
    return [
        PostureTrack(runs.reference, each.channels, begin.get(n))
        for n, each in enumerate(recordings)
    ]
