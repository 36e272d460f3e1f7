"""Errors of sensors: white noise and constant biases, functions of seed, sensor and time alone.

A counter-based generator (Philox; Salmon et al., Parallel random numbers: as easy as 1, 2, 3,
SC 2011) gives the numbers of an instant without those before it: a run that is repeated, restored
or sampled at other instants has the same errors at the same times. No two instants of a run share
their numbers, also if the length of its steps changes, and between its steps.
"""

from __future__ import annotations

import zlib

import numpy as np

from alf_ros.arrays import Floats

_BIASES, _INSTANTS = 0, 1  # parts of the counter


class SensorNoise:
    """Errors of the sensor `label` with a `seed`."""

    def __init__(self, seed: int, label: str) -> None:
        self._key = np.array([seed, zlib.crc32(label.encode())], dtype=np.uint64)
        self._biases = self._drawn(_BIASES, 0.0)

    def _drawn(self, part: int, t: float) -> Floats:
        """(6,) standard normal numbers; all bits of t (s) count."""
        counter = np.array([0, 0, part, np.float64(t).view(np.uint64)], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(counter=counter, key=self._key)).normal(size=6)

    def errors(self, t: float, noise: Floats, bias: Floats) -> Floats:
        """(k,) errors at t (s), with standard deviations `noise` and `bias` (k,), k <= 6."""
        found = bias * self._biases[: bias.size]
        if noise.any():
            found = found + noise * self._drawn(_INSTANTS, t)[: noise.size]
        return found
