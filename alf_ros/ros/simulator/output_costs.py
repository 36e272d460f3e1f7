"""Costs of topics in a run, and the rate of the log that readers and disk could follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

_FULL = 0.9  # part of a core that a thread may use, for the rest comes late


@dataclass(frozen=True)
class TopicCost:
    """Cost of a topic: `made` and `sent`, s of the thread of the ticks, and `logged`, bytes.

    `published`: whether it has readers, so that the log is not its only reason.
    """

    made: float = 0.0
    sent: float = 0.0
    logged: int = 0
    published: bool = False


@dataclass(frozen=True)
class Spent:
    """Costs of a run while `ticks` ticks were made, of `period` real s each (0: as fast as
    possible): per tick, `step` s in the solver; `topics` by name; `written` bytes by the thread
    that writes the log, in `writing` s of processor time."""

    ticks: int
    period: float
    step: float
    topics: Mapping[str, TopicCost]
    writing: float = 0.0
    written: int = 0

    @property
    def logged(self) -> int:
        """Bytes for the log."""
        return sum(topic.logged for topic in self.topics.values())

    @property
    def outputs(self) -> float:
        """Seconds of a tick that the topics take."""
        each = (topic.made + topic.sent for topic in self.topics.values())
        return sum(each) / max(1, self.ticks)

    @property
    def writer_load(self) -> float:
        """Part of a core that the writing thread needs for what the log is given."""
        if not self.written or not self.ticks or not self.period:
            return 0.0
        return self.writing / self.written * self.logged / (self.ticks * self.period)

    @property
    def slowest(self) -> str:
        """The topic with most of the time of a tick; '' without any."""
        return max(self.topics, key=self._time, default='')

    @property
    def largest(self) -> str:
        """The topic with most bytes for the log; '' without any."""
        return max(self.topics, key=lambda name: self.topics[name].logged, default='')

    def _time(self, name: str) -> float:
        topic = self.topics[name]
        return topic.made + topic.sent

    @property
    def lasting_part(self) -> float:
        """The part of the logged messages that ticks and writing thread could follow: 1 if all,
        0 if even a run without a log is too slow."""
        if not self.ticks or not self.period:
            return 1.0
        fixed, thinned = self.step, 0.0
        for name, topic in self.topics.items():
            if topic.published:
                fixed += self._time(name) / self.ticks
            else:
                thinned += self._time(name) / self.ticks
        part, left = 1.0, _FULL * self.period - fixed
        if left <= 0.0:
            part = 0.0
        elif left < thinned:
            part = left / thinned
        return min(part, _FULL / self.writer_load) if self.writer_load > _FULL else part

    def lasting_rate(self, rate: float) -> float:
        """Messages (Hz) of each topic in the log that could be followed, at `rate` ticks per
        simulated second."""
        part = self.lasting_part
        return rate if part >= 1.0 else rounded(part * rate)

    def advice(self, rate: float) -> str:
        """How a run of `rate` ticks per simulated second could keep up; '' if it does."""
        lasting = self.lasting_rate(rate)
        if lasting >= rate:
            return ''
        if lasting >= 1.0:
            return f'record.rate.all:={lasting:g} would hold'
        if self.step > _FULL * self.period:
            return f'a step takes {1e3 * self.step:.3g} ms of a tick of {1e3 * self.period:.3g} ms'
        return f'{self.slowest} costs most: turn it off, or lower `rate`'


NOTHING = Spent(0, 0.0, 0.0, {})


def rounded(rate: float) -> float:
    """The rate (Hz) to two digits, not above it; 0 below 1e-3."""
    if rate < 1e-3:
        return 0.0
    scale = 10.0 ** (math.floor(math.log10(rate)) - 1)
    return math.floor(rate / scale * (1.0 + 1e-12)) * scale
