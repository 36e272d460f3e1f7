"""Errors of sensors: white noise and constant biases, functions of seed, sensor and step alone.

A counter-based generator (Philox; Salmon et al., Parallel random numbers: as easy as 1, 2, 3,
SC 2011) gives the numbers of a step without those before it: a run that is repeated, restored or
sampled at other instants has the same errors at the same steps.
"""

from __future__ import annotations

import zlib

import numpy as np

from alf_ros.arrays import Floats

_BIAS = 0  # the counter of the biases; steps come after it


class SensorNoise:
    """Errors of the sensor `label` with a `seed`."""

    def __init__(self, seed: int, label: str) -> None:
        self._key = np.array([seed, zlib.crc32(label.encode())], dtype=np.uint64)
        self._biases = self._drawn(_BIAS)

    def _drawn(self, block: int) -> Floats:
        """(6,) standard normal numbers."""
        counter = np.array([0, 0, 0, block], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(counter=counter, key=self._key)).normal(size=6)

    def errors(self, step: int, noise: Floats, bias: Floats) -> Floats:
        """(k,) errors at a step, with standard deviations `noise` and `bias` (k,), k <= 6."""
        found = bias * self._biases[: bias.size]
        if noise.any():
            found = found + noise * self._drawn(1 + step)[: noise.size]
        return found
