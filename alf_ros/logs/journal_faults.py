"""Faults of a journal: entries that are missing, changed, out of order, or not as they were
written."""

from __future__ import annotations

from typing import Any

from alf_ros.logs import journal
from alf_ros.logs.series import Series
from alf_ros.logs.stamps import stamp_ns


class JournalFaults:
    """Takes the messages of a journal one by one, in their order."""

    def __init__(self, info: dict[str, Any]) -> None:
        """`info`: what the log says of itself."""
        self._info = info
        self._number, self._seal = 0, ''

    def of(self, series: Series, row: int, entry: dict[str, Any]) -> list[str]:
        """The faults of the next message, and of the ones that are missing before it."""
        told, found = journal.told(entry), list[str]()
        stamp, number = int(series.stamp[row]), int(series.sequence[row])
        expected = self._number + 1
        self._number = max(number, self._number)
        if number < expected:
            found.append(f'{series.topic}: message {number} comes after message {expected - 1}')
        if series.form:
            found.append(f'input at {told}: it, or one beside it, is not written as a text is')
        if number > expected:
            found.append(f'{number - expected} inputs are missing before {told}')
        if stamp != stamp_ns(entry['t'], int(self._info['stamps_ahead_ns'])):
            found.append(f'input at {told}: stamp {stamp} ns is not that of its t')
        fault = journal.fault(entry, self._seal)
        if fault:
            found.append(f'input at {told}: {fault}')
        if entry['kind'] == 'start' and not _is_start(entry, self._info):
            found.append('its two descriptions of the start differ')
        self._seal = entry.get(journal.SEAL, '')
        return found


def _is_start(entry: dict[str, Any], info: dict[str, Any]) -> bool:
    """Whether an entry describes the start as the log itself does."""
    return all(entry.get(key) == value for key, value in info.items())
