"""Windows of a recording: parts with a free start, which a run follows for a few seconds.

A run over a whole recording depends on its start too strongly to be fitted, a run over a window
does not. The windows share the numbers of the scene (multiple shooting).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.studies.identification.recording import HeldInput, MeasuredChannel, Recording
from alf_ros.studies.identification.window_start import SceneStart, StartChart

_FEWEST = 4  # measurements of a channel in a window
_ON = 1e-9  # of a step: a time that near is on it


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements of a channel in a window: t (N,) s, values (N,); `channel`: its number."""

    channel: int
    t: Floats
    values: Floats


@dataclass(frozen=True, eq=False)
class Window:
    """Steps `first` to `last` of one recording; `inputs`: by step, those held before included.

    `kept_away`: for the hold-out error, not for the fit. `chart`: its start.
    """

    recording: int
    first: int
    last: int
    measured: tuple[Measurements, ...]
    inputs: tuple[tuple[int, HeldInput], ...]
    kept_away: bool = False
    chart: StartChart | SceneStart | None = None


def begin_of(window: Window, part: float, h: float) -> Window:
    """The first part of a window; the whole window if too few measurements are there."""
    last = window.first + max(1, round(part * (window.last - window.first)))
    before = [each.t < last * h for each in window.measured]
    if min(np.count_nonzero(inside) for inside in before) < _FEWEST:
        return window
    measured = tuple(
        Measurements(each.channel, each.t[inside], each.values[inside])
        for each, inside in zip(window.measured, before, strict=True)
    )
    return replace(window, last=last, measured=measured)


def cut(
    recordings: Sequence[Recording],
    channels: Sequence[tuple[int, MeasuredChannel]],
    length: float,
    h: float,
    hold_out: float,
    margin: float,
) -> list[Window]:
    """Windows of about `length` (s) over steps of h (s), of which a part `hold_out` is kept away.

    `margin` (s): measurements as near to the ends of a window are left out, for a delay that is
    fitted. Raises InputError for windows and recordings that are too short.
    """
    if length < h:
        raise InputError(
            'shorter than a step', key='window', value=length, expected=f'{h:g} s or more'
        )
    windows = []
    for number, recording in enumerate(recordings):
        own = [(n, each) for n, (of, each) in enumerate(channels) if of == number]
        windows += _cut(recording, number, own, length, h, margin)
    if hold_out > 0.0:
        away = [round((n + 1) * hold_out) > round(n * hold_out) for n in range(len(windows))]
        windows = [replace(w, kept_away=flag) for w, flag in zip(windows, away, strict=True)]
        if not any(away) or all(away):
            raise InputError(
                'no windows to keep away, or none to fit',
                key='hold_out',
                value=hold_out,
                expected=f'a part of {len(windows)} windows: a shorter window makes more',
            )
    return windows


def _cut(
    recording: Recording,
    number: int,
    channels: Sequence[tuple[int, MeasuredChannel]],
    length: float,
    h: float,
    margin: float,
) -> list[Window]:
    begin, end = math.ceil(recording.begin / h - 1e-6), math.floor(recording.end / h + 1e-6)
    count = max(1, round((end - begin) * h / length))
    found = []
    for k in range(count):  # a stamp that is years away makes many: the first empty one ends it
        first, last = (begin + round(n * (end - begin) / count) for n in (k, k + 1))
        measured = _measured(channels, first * h, last * h, margin, k == count - 1)
        if not measured and _measured(channels, first * h, last * h, 0.0, k == count - 1):
            raise InputError(
                f'delays of up to {margin:g} s leave too few measurements of a window',
                file=recording.name,
                key='window',
                value=f'{(last - first) * h:.6g} s',
                expected=f'more than {2.0 * margin:g} s, or narrower bounds of the delay',
            )
        if not measured:
            raise InputError(
                f'too few measurements in a window, from t = {first * h:.6g} s on',
                file=recording.name,
                key='window',
                value=f'{(last - first) * h:.6g} s',
                expected=f'{_FEWEST} of a joint at least',
            )
        found.append(Window(number, first, last, measured, recording.by_step(first, last, h)))
    return found


def with_margin(
    window: Window, channels: Sequence[tuple[int, MeasuredChannel]], h: float, margin: float
) -> Window:
    """The window with another `margin` (s), above 0; `channels` as for `cut`."""
    own = [(n, each) for n, (of, each) in enumerate(channels) if of == window.recording]
    return replace(window, measured=_measured(own, window.first * h, window.last * h, margin))


def _measured(
    channels: Sequence[tuple[int, MeasuredChannel]],
    begin: float,
    end: float,
    margin: float,
    whole: bool = True,
) -> tuple[Measurements, ...]:
    """The measurements of each channel with enough of them; `whole`: the end belongs to it."""
    found = [
        _part(n, channel, begin + margin, end - margin, whole or margin > 0.0)
        for n, channel in channels
    ]
    return tuple(part for part in found if part is not None)


def _part(
    number: int, channel: MeasuredChannel, start: float, end: float, whole: bool
) -> Measurements | None:
    inside = (channel.t >= start) & ((channel.t <= end) if whole else (channel.t < end))
    if inside.sum() < _FEWEST:
        return None
    return Measurements(number, channel.t[inside], channel.values[inside])


def below(window: Window, part: Measurements, delay: float, h: float) -> Integers:
    """(N,) the step before each measurement of a part, or at it, of a run with steps of h (s)."""
    steps = np.floor((part.t - delay) / h + _ON).astype(np.int64)
    return np.asarray(np.clip(steps, window.first, window.last - 1))


def grid(window: Window, delay: float, h: float) -> Integers:
    """The steps at which a run is read: those on both sides of each measurement."""
    steps = np.concatenate([below(window, part, delay, h) for part in window.measured])
    return np.unique(np.concatenate([[window.first], steps, steps + 1]))
