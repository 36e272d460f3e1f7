"""The noise of channels: from the recording before a fit, from the residuals after one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.simulation.input_checks import is_number
from alf_ros.studies.identification.recording import MeasuredChannel

_LEAST = 1e-12  # of the range of a channel
_NORMAL = 1.4826  # standard deviation of a normal distribution, over its median magnitude


def first_levels(channels: Sequence[MeasuredChannel], given: Mapping[str, float]) -> Floats:
    """(channels,) standard deviations: those `given` by name, or from fourth differences, in which
    a smooth motion nearly vanishes. Raises InputError."""
    names = [each.name for each in channels]
    for name, value in given.items():
        if name not in names:
            raise InputError('not measured', key='noise', value=name, choices=names)
        if not is_number(value) or not value > 0.0:
            raise InputError(
                'no standard deviation', key=f'noise.{name}', value=value, expected='above 0'
            )
    return np.array([given.get(each.name, _from_differences(each)) for each in channels])


def _from_differences(channel: MeasuredChannel) -> float:
    differences = np.diff(channel.values, 4)
    found = float(np.sqrt(np.mean(differences**2) / 70.0)) if differences.size else 0.0
    return max(found, _least(channel))


def _least(channel: MeasuredChannel) -> float:
    """Below what any noise is, so that a channel that never changes has one."""
    return _LEAST * (float(np.ptp(channel.values)) or 1.0)


def levels(
    channels: Sequence[MeasuredChannel],
    given: Mapping[str, float],
    residuals: Floats,
    of: Integers,
    fitted: int,
    robust: bool,
) -> Floats:
    """(channels,) standard deviations of residuals (N,), each of channel `of`, after a fit of so
    many numbers; those `given` stay. `robust`: by their median."""
    share = np.sqrt(max(1.0, of.size - fitted) / of.size)
    found = []
    for n, channel in enumerate(channels):
        own = residuals[of == n]
        if channel.name in given or not own.size:
            found.append(given.get(channel.name, _from_differences(channel)))
            continue
        size = _NORMAL * np.median(np.abs(own)) if robust else np.sqrt(np.mean(own**2))
        found.append(max(float(size) / share, _least(channel)))
    return np.array(found)
