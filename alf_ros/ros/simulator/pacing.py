"""How many ticks are due: simulated time against the steady clock, with a bounded backlog."""

from __future__ import annotations

# Real time (s) that may be caught up after a delay; more is counted as lost and never made up.
BACKLOG = 0.1
# Shortest time (s) between two calls of the timer: faster ticks come several at a call.
SHORTEST_BEAT = 1e-3
_WINDOW = 1.0
_MANY = 1 << 30


class Pacer:
    """Paces ticks of `tick` simulated seconds at `factor` simulated seconds per second.

    A factor of 0 does not pace: a tick is always due. `beat` (s) is the period for the timer. All
    times are in seconds of one steady clock.
    """

    def __init__(self, tick: float, factor: float) -> None:
        self.tick = tick
        self.ticks = 0
        self.overruns = 0  # calls that came more than a beat late
        self.lost = 0.0  # s of real time that could not be caught up
        self.achieved = 0.0  # simulated seconds per second over the last window of 1 s
        # s after the earliest call of that window: median and 99th percentile
        self.lateness: tuple[float, float] = (0.0, 0.0)
        self.set_factor(factor)

    def set_tick(self, tick: float) -> None:
        """Change the simulated seconds of a tick from the next call of `due` on."""
        self.tick = tick
        self.set_factor(self.factor)

    def set_factor(self, factor: float) -> None:
        """Change the real-time factor from the next call of `due` on."""
        self.factor = factor
        self._period = self.tick / factor if factor > 0.0 else 0.0
        self.beat = max(self._period, SHORTEST_BEAT)
        self.start()

    def start(self) -> None:
        """Start, or continue after a pause, at the next call of `due`: the time until then is not
        made up."""
        self._started = False
        self.achieved = 0.0

    def due(self, now: float) -> int:
        """Number of ticks due at `now`; each is to be reported by `done`."""
        if not self._started:
            self._started, self._next = True, now
            self._open_window(now)
        elif now - self._window_start >= _WINDOW:
            self._close_window(now)
        if self._period == 0.0:
            return _MANY
        late = now - self._next
        # The call that started the schedule was late itself, so others come before their time:
        # half a period decides, or that would turn one tick each call into none and then two.
        if late < -0.5 * self._period:
            return 0
        # Ticks shorter than the beat wait for it: that is not late.
        delay = late - (self.beat - self._period)
        self._late.append(delay)
        if delay > self.beat:
            self.overruns += 1
        if late > BACKLOG:
            self.lost += late - BACKLOG
            self._next += late - BACKLOG
            late = BACKLOG
        return 1 + max(0, int(late / self._period))

    def done(self) -> None:
        """One tick was made."""
        self.ticks += 1
        self._window_ticks += 1
        self._next += self._period

    def _close_window(self, now: float) -> None:
        self.achieved = self._window_ticks * self.tick / (now - self._window_start)
        if self._late:
            late = sorted(self._late)
            p50, p99 = late[len(late) // 2], late[len(late) * 99 // 100]
            self.lateness = p50 - late[0], p99 - late[0]
        self._open_window(now)

    def _open_window(self, now: float) -> None:
        self._window_start, self._window_ticks = now, 0
        self._late: list[float] = []
