"""Ctrl-C at any instant, also while workers are begun: none outlives its crew."""

from __future__ import annotations

import operator
import os
import signal
import sys
import threading
from types import FrameType
from typing import Any

from alf_ros.studies.ensemble import crews
from support.ensemble_kills import children, is_gone

# Python runs handlers of signals where functions begin, among others
EVENTS = {crews.__file__: ('call', 'line'), threading.__file__: ('call',)}
MOST = 500  # of them


def test_no_worker_outlives_a_crew_that_is_interrupted_while_it_begins() -> None:
    """At every instant of the main thread, until a result is awaited."""
    for count in range(1, MOST):
        before = set(children(os.getpid()))
        interrupted = _interrupted_at(count)
        left = set(children(os.getpid())) - before
        assert all(map(is_gone, left)), count
        if not interrupted:
            return
    raise AssertionError(f'more than {MOST} instants')


def _interrupted_at(count: int) -> bool:
    """Begin two workers; returns whether the instant came before the first result."""
    instants = iter(range(count))

    def interrupt(frame: FrameType, event: str, given: Any) -> Any:
        events = EVENTS.get(frame.f_code.co_filename)
        if events is None:
            return None
        if event in events and next(instants, None) == count - 1:
            signal.raise_signal(signal.SIGINT)
        return interrupt

    chunks = crews.Processes(2, run=operator.mul).chunks(2, [3, 4])
    sys.settrace(interrupt)
    try:
        first = next(chunks)
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    del chunks  # which ends the workers
    assert first in (6, 8)
    return False
