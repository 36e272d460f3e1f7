"""The numbers of a mode in words, for its table and its page."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.statics.vibration_modes import VibrationModes

_NAMED = 3  # shares of a mode
_LEAST = 0.005  # share that is worth a name


def frequency_text(found: VibrationModes, k: int) -> str:
    """The frequency of mode k in Hz, or 'falls', or 'flutters'."""
    frequency = found.frequencies[k]
    if not np.isnan(frequency):
        return f'{frequency:.9g}'
    return 'flutters' if np.isnan(found.squares[k]) else 'falls'


def damping_text(found: VibrationModes, k: int) -> str:
    """The damping ratio of mode k, or '-'."""
    ratio = found.damping_ratios[k]
    return '-' if np.isnan(ratio) else f'{ratio + 0.0:.9g}'


def largest_shares(shares: Mapping[str, Floats], k: int) -> str:
    """The largest shares of mode k."""
    order = sorted(shares, key=lambda name: -abs(float(np.nan_to_num(shares[name][k]))))
    named = [name for name in order if abs(shares[name][k]) >= _LEAST][:_NAMED]
    return ', '.join(f'{name} {shares[name][k]:.0%}' for name in named) or 'none'
