"""A chunk that says how much of the processor time of its process its members took.

A module of its own, as workers import what they run.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence

import numpy as np

from alf_ros.studies.ensemble import chunk
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.member import Member
from alf_ros.studies.ensemble.members_together import run_members
from alf_ros.studies.ensemble.study import Study

MEASURED = 'measured'  # no store has an array of this name, so it is not kept
_spent = list[float]()


def _timed(study: Study, members: Sequence[int]) -> list[Member]:
    begin = time.thread_time()
    found = run_members(study, members)
    _spent.append(time.thread_time() - begin)
    return found


vars(chunk)['run_members'] = _timed


def measured_chunk(study: Study, number: int) -> Chunk:
    """A chunk with the number of its process, the processor time of its members, and of all that
    the process has done so far (s)."""
    _spent.clear()
    found = run_chunk(study, number)
    measured = np.array([os.getpid(), sum(_spent), time.process_time()])
    return Chunk(number, {**found.arrays, MEASURED: measured})
