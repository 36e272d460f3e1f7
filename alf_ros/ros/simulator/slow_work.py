"""Lines of the terminal about slow work: compiling, and searches for an accuracy."""

from __future__ import annotations

from collections.abc import Callable

from alf_ros.ros.terminal import StatusLine
from alf_ros.simulation.setup import Setup


class Compiling:
    """The current long task: compiling, after the first cache miss; else ''."""

    def __init__(self) -> None:
        from alf_ros.kernel.numba_ext import cache  # the solver is loaded by now

        self._count, self._before = cache.misses, cache.misses()

    def __call__(self) -> str:
        return 'compiling, the first time only ...' if self._count() > self._before else ''


def searched(status: StatusLine, accuracy: float, make: Callable[[], Setup]) -> Setup:
    """The setup that `make` returns, with lines about the search for its accuracy (m) if one is
    asked for."""
    if not accuracy:
        return make()
    status.say(f'searching settings for an accuracy of {accuracy:g} m ...')
    setup = make()
    found = setup.simulation.accuracy
    if found is not None:
        how, estimate = found.solver.integrator, f'estimated error {found.estimate:.2g} m'
        if how.endswith('_adaptive'):
            how += f' with tolerance {found.solver.tolerance:.2g}'
        no = '' if found.met else 'not met; best are '
        status.say(f'settings for {found.asked:g} m: {no}{how}, {estimate}')
    return setup
