"""The messages of an instant: one read of the simulation fills those that are due."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from contextlib import suppress

from alf_ros.errors import StepError
from alf_ros.ros.messages.templates import ReadingMessage, StateMessage, Write
from alf_ros.simulation import sample_reader
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sample_reader import SampleReader
from alf_ros.simulation.simulation import Simulation


class InstantMessages:
    """Serialised messages of a simulation, from the `writers` of its topics (by name).

    A `SampleReader` writes the numbers of readings into the bytes. Other topics, and instants
    that it leaves, are written from a sample. `distance`: to a singular position, at the last
    instant; infinite if it was not looked for, or needs accelerations that nobody reads.
    """

    def __init__(self, simulation: Simulation, writers: Mapping[str, Write]) -> None:
        self.simulation = simulation
        self.distance = math.inf
        self._writers = writers
        state = simulation.state
        self._plain: dict[str, ReadingMessage] = {
            name: write.of(state)
            for name, write in writers.items()
            if isinstance(write, (ReadingMessage, StateMessage))
        }
        keys = {name: each.reading.key for name, each in self._plain.items() if each.reading}
        self._keys = {name: key for name, key in keys.items() if key in sample_reader.KEYS}
        into = {key: self._plain[name].blocks for name, key in self._keys.items()}
        fits = sample_reader.fits(simulation)
        self._reader = SampleReader(simulation, into) if fits else None
        self._times: dict[str, float] = {}
        self._masks: dict[tuple[tuple[str, ...], bool], int] = {}

    def write(self, names: tuple[str, ...], ns: int, near: bool = False) -> list[bytes]:
        """The messages of the present state, with the stamp `ns`; `near`: with the `distance`.

        Raises StepError if it cannot be evaluated.
        """
        sample: Sample | None = None
        direct = self._read(names, near)
        made = []
        for name in names:
            plain = self._plain.get(name)
            if plain is not None and (plain.reading is None or (direct and name in self._keys)):
                made.append(plain.stamped(ns))
            else:
                sample = sample or self.simulation.sample()
                made.append(self._writers[name](sample, ns))
        if near and not direct and sample is not None:
            self.distance = sample.diagnostics.distance_if_known
        return made

    def parts(self, names: tuple[str, ...]) -> list[float]:
        """The part of each topic in what a read of these costs, by reads of each alone."""
        for name in names:
            if name not in self._times:
                self._times[name] = self._timed(name)
        whole = sum(self._times[name] for name in names)
        return [self._times[name] / whole for name in names]

    def _timed(self, name: str) -> float:
        """Seconds that the message of one topic takes, the second time."""
        begun = 0.0
        for _ in range(2):
            begun = time.perf_counter()
            with suppress(StepError):
                self.write((name,), 1)
        return time.perf_counter() - begun

    def _read(self, names: tuple[str, ...], near: bool) -> bool:
        """Whether the reader has filled the messages that it can fill."""
        self.distance = math.inf
        wanted = self._masks.get((names, near))
        if wanted is None:
            keys = tuple(self._keys[name] for name in names if name in self._keys)
            wanted = self._masks[names, near] = sample_reader.mask(keys, near)
        reader = self._reader
        if reader is None or not wanted or not reader.read(wanted):
            return False
        self.distance = reader.distance
        return True
