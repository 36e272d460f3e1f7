"""Whether a step is to end before its time: because Python received a signal, or because of a
request.

Compiled code runs without the interpreter's lock, so Python receives no signal during a call. It
counts its stages and rounds of iteration down, and calls the interpreter when the count is used
up: that costs nothing in between, and does not touch any number of the step. Then it looks at one
word.
"""

from __future__ import annotations

from alf_ros.kernel.data import Work
from alf_ros.kernel.numba_ext.calls import ask
from alf_ros.kernel.numba_ext.jit import compiled, inlined, inner

LEFT, GIVEN, STOP = 0, 1, 2  # of `Work.pulse`


@inlined
def told_to_stop(work: Work) -> bool:
    """Whether the step is to be given up; asks Python when it is time to. Once a stage."""
    work.pulse[LEFT] -= 1
    if work.pulse[LEFT] < 0:
        _ask(work)
    return work.pulse[STOP] != 0


@inner
def _ask(work: Work) -> None:
    work.pulse[LEFT] = work.pulse[GIVEN]
    if ask(work.caller) != 0:
        work.pulse[STOP] = 1


@compiled
def stop_is_asked(work: Work) -> bool:
    """Whether somebody has asked, without asking Python."""
    return work.pulse[STOP] != 0
