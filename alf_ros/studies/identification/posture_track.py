"""The motion of a mechanism that recorded joints suggest: where windows begin, before the fit.

The joints are smoothed by parabolas through neighbouring measurements. The mechanism follows them
in small steps: its free directions are turned so that its joints come nearest to the recorded
ones, and its loops are closed again. So it stays on its branch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import null_space

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.simulation.state_trail import StateArrays
from alf_ros.studies.identification.joint_readings import JointMotion, JointReadings
from alf_ros.studies.identification.recording import MeasuredChannel
from alf_ros.studies.identification.window_start import DenseRows, StartChart, least_change
from alf_ros.studies.statics.instant import counted

_NEAR = 11  # measurements of a parabola
_TURN = 0.2  # rad or m, by which a joint moves in one step
_ROUNDS = 12
_NEAR_ENOUGH = 1e-6  # of the size: the fit goes on from there
_KEEP = 1e-6  # weight of the directions that no joint tells
_CLOSED, _DEPENDENT = 1e-9, 1e-7
_APART = 3  # measurements, between the two that give a speed
_FAST = 3.0  # times the fastest that a joint is recorded: the deviation of its speed at a start
_STEP, _STEPS, _PLACES = 0.1, 2, 12  # of the size; of a place; on a way
_WAYS = 4  # at most
_UNTOLD = 1e-6  # of the largest singular value of the joints
_MISSING = 5.0  # usual times between measurements: a longer one is a gap
_ROUNDED = 1e-4  # rad, of angles that wrap
_FAR = 0.5  # rad, or of the size: a joint that is off by more is another one


class PostureTrack:
    """Follows the positions and velocities of channels (of one recording), from the start of a
    scene on. at_rest (s): when the machine stands still, if that is known."""

    def __init__(
        self,
        simulation: Simulation,
        channels: Sequence[MeasuredChannel],
        at_rest: float | None = None,
    ) -> None:
        state, model = simulation.state, simulation.model
        self._model, self._at_rest = model, at_rest
        names = list(model.coordinate_names)
        self._of = [(names.index(c.joint), c) for c in channels if c.kind == 'position']
        self._rates = {names.index(c.joint): c for c in channels if c.kind == 'velocity'}
        self._joints = np.array([n for n, _ in self._of], dtype=np.int64)
        self._readings = JointReadings(model, (), self._joints.tolist())
        self._angles = self._readings.is_angle
        self._wraps = [
            bool(angle) and _wraps(c) for (_, c), angle in zip(self._of, self._angles, strict=True)
        ]
        each = zip(self._of, self._wraps, strict=True)
        self._usual = np.array([_usual(c, wraps) for (_, c), wraps in each]).T
        self._times = np.unique(np.concatenate([c.t for _, c in self._of]))
        apart = np.diff(self._times)
        self._gap = _MISSING * float(np.median(apart)) if apart.size else math.inf
        self._t: float | None = None
        self._q, self._turns = state.q, state.turns
        self._going = np.zeros_like(state.q)  # q̇, as far as no joint tells it
        self._x = self._read(self._q).x[0]  # the joints there

    def start(self, t: float) -> StartChart:
        """The free start of a window at t (s), which must not be before the last one. Raises
        InputError if the mechanism cannot follow the recorded joints."""
        self._follow(t)
        return self._chart(DenseRows(self._model, t))

    def _chart(self, rows: DenseRows) -> StartChart:
        """Around the posture, with the recorded rates."""
        t, n = rows.t, self._model.n
        _, rate = self._smooth(t)
        for joint, channel in self._rates.items():
            for k in np.flatnonzero(self._joints == joint):
                rate[k] = _parabola(channel, t, False)[0]
        motion = self._read(self._q)
        every = np.ones_like(rows.binds)
        Z = rows.null_space(self._q, every)
        whole, moved = rows.placed(self._q)
        J = rows.jacobian(whole)
        moved[:n] = self._going[:n]
        moved[:n] -= np.linalg.lstsq(J[:, :n], J @ moved, rcond=1e-9)[0]
        own = self._rate_of(moved)
        moved[:n] += Z @ _least(motion.dx[0] @ Z, rate - own)
        moves, speeds = (motion.dx[0] / each[:, None] for each in self._usual)
        turns, at_rest = self._turns.copy(), t == self._at_rest
        return StartChart(self._model, t, whole, moved, turns, moves, speeds, at_rest)

    def take_up(self, t: float, state: State) -> None:
        """Continue from a state of the mechanism at t (s), where joints leave it open."""
        self._t, self._going = t, state.qd
        self._take(state.q, state.turns)

    def elsewhere(self, t: float) -> Iterator[StartChart]:
        """Other starts with the same joints, where `start` was asked for last: on ways forth and
        back in directions that no joint tells."""
        rows, begun, random = (
            DenseRows(self._model, t),
            (self._q, self._turns),
            np.random.default_rng(0),
        )
        first = self._untold(rows)
        ways = 1 if first.shape[1] == 1 else min(_WAYS, first.shape[1])
        for _ in range(ways):
            along = first @ random.standard_normal(first.shape[1])
            for sign in (1.0, -1.0):
                self._take(*begun)
                yield from self._way(rows, sign * along)
        self._take(*begun)

    def _way(self, rows: DenseRows, along: Floats) -> Iterator[StartChart]:
        n, size = self._model.n, self._model.size
        for k in range(1, _STEPS * _PLACES + 1):
            untold = self._untold(rows)
            along = untold @ np.linalg.lstsq(untold, along, rcond=None)[0]
            length = float(np.abs(along).max(initial=0.0))
            if not length > 0.0:
                return
            moved = self._q.copy()
            moved[:n] += _STEP * size / length * along
            try:
                moved = self._closed(rows, moved)
                self._take(moved, counted(self._model, self._q, self._turns, moved))
                self._go(self._smooth(rows.t)[0], rows.t, 0.0)
            except InputError:
                return
            if k % _STEPS == 0:
                yield self._chart(rows)

    def _untold(self, rows: DenseRows) -> Floats:
        """(n, directions) of the free motion that move no recorded joint."""
        told = self._read(self._q).dx[0]
        Y, _ = rows.in_mesh(self._q, rows.motions(self._q)[0], told)
        return np.asarray(Y @ null_space(told @ Y, rcond=_UNTOLD))

    def _take(self, q: Floats, turns: Integers) -> None:
        self._q, self._turns = q, turns
        self._x = self._read(q).x[0]

    def _rate_of(self, qd: Floats) -> Floats:
        return self._read(self._q, qd).v[0]

    def _follow(self, t: float) -> None:
        """In steps in which no joint moves far."""
        if self._t is None:
            self._t = t
            self._count_turns(self._smooth(t)[0])
        between = self._times[(self._times > self._t) & (self._times < t)]
        instants = np.array([self._t, *between, t])
        before, *raw = self._between(instants)
        missing = np.diff(instants) > self._gap
        each = zip([*between.tolist(), t], raw, missing.tolist(), strict=True)
        for at, measured, is_gap in each:
            if is_gap:
                self._over_gap(before, measured, at)
            if np.abs(self._off(measured)).max(initial=0.0) > _TURN:
                self._go(self._smooth(at)[0], at, 0.5 * _TURN)
            before = measured
        self._go(self._smooth(t)[0], t, 0.0)
        self._t = t
        if not self._is_missing(t):
            self._check(self._off(self._smooth(t)[0]))

    def _is_missing(self, t: float) -> bool:
        """Whether t (s) lies in a gap: the straight way over it need not be one of the mechanism,
        and is where the fit begins only."""
        n = int(np.searchsorted(self._times, t))
        inside = 0 < n < self._times.size and self._times[n] > t
        return bool(inside and self._times[n] - self._times[n - 1] > self._gap)

    def _between(self, times: Floats) -> Floats:
        """(times, joints) between the measurements, angles without jumps of whole turns."""
        each = zip(self._of, self._wraps, strict=True)
        values = [(c.t, np.unwrap(c.values) if wraps else c.values) for (_, c), wraps in each]
        return np.array([np.interp(times, *each) for each in values]).T

    def _over_gap(self, before: Floats, measured: Floats, t: float) -> None:
        """Go straight from one measurement to the next over a gap between them: in one step joints
        would go the shorter way round, and the mechanism could change its branch."""
        parts = math.ceil(np.abs(measured - before).max(initial=0.0) / _TURN)
        for part in np.linspace(0.0, 1.0, parts + 1)[1:-1]:
            self._go(before + part * (measured - before), t, 0.5 * _TURN)

    def _check(self, off: Floats) -> None:
        """Raises InputError if a joint is far from where it was recorded."""
        assert self._t is not None
        parts = np.abs(off) / np.where(self._angles, 1.0, self._model.size)
        k = int(parts.argmax())
        if not parts[k] <= _FAR:
            unit = 'rad' if self._angles[k] else 'm'
            raise InputError(
                'the mechanism cannot be where this joint was recorded, at '
                f't = {self._t:.6g} s: it is off by {off[k]:.3g} {unit}',
                key=self._of[k][1].joint,
                expected='the joint of the scene, in its sense, unit and zero',
            )

    def _go(self, want: Floats, t: float, near: float) -> None:
        """Until no joint is off by more than `near`, or they come no nearer."""
        rows, n = DenseRows(self._model, t), self._model.n
        for _ in range(_ROUNDS):
            off = self._off(want)
            told = self._read(self._q).dx[0]
            Y, unmeshing = rows.in_mesh(self._q, rows.motions(self._q)[0], told)
            if not unmeshing.size:
                Y = rows.null_space(self._q, rows.binds)
            A = told @ Y
            far = np.abs(off).max(initial=0.0)
            y = _least(A, off * min(1.0, 2.0 * _TURN / max(far, 1e-300)))
            moved = self._q.copy()
            moved[:n] += Y @ y
            moved = self._closed(rows, moved, unmeshing.size > 0)
            before = self._q
            self._turns = counted(self._model, before, self._turns, moved)
            self._q = moved
            self._x = self._read(moved).x[0]
            if np.abs(moved - before).max(initial=0.0) < _NEAR_ENOUGH * self._model.size:
                return
            if np.abs(self._off(want)).max(initial=0.0) <= near:
                return

    def _closed(self, rows: DenseRows, q: Floats, in_mesh: bool = False) -> Floats:
        """The nearest posture; in_mesh: with gears and others as they are in the present one."""
        n = self._model.n
        q, _ = rows.placed(q)
        for _ in range(_ROUNDS):
            gap, J = rows.gaps(q)[rows.binds], rows.jacobian(q)[rows.binds, :n]
            if in_mesh:
                slip, turning = rows.unmeshed(self._q, q)
                gap, J = np.concatenate([gap, slip]), np.vstack([J, turning])
            if np.abs(gap).max(initial=0.0) <= _CLOSED * self._model.size:
                return q
            q[:n] -= least_change(J, gap, _DEPENDENT)
        raise InputError(
            f'the mechanism cannot follow the recorded joints at t = {rows.t:.6g} s',
            key='recording',
            expected='joints of this mechanism, in its sense and from its zero',
        )

    def _off(self, want: Floats) -> Floats:
        """By how much the joints are off, angles to half a turn."""
        off = want - self._x
        return np.where(self._angles, wrapped(off), off)

    def _count_turns(self, want: Floats) -> None:
        """Begin with the turns of the recorded angles."""
        found = self._turns.copy()
        for joint, is_, wanted in zip(self._joints.tolist(), self._x, want, strict=True):
            of = self._model.coordinates[joint]
            if of.is_angle and of.less < 0:
                found[of.place] += round((wanted - is_) / (2.0 * np.pi))
        self._turns = found
        self._x = self._read(self._q).x[0]

    def _smooth(self, t: float) -> tuple[Floats, Floats]:
        each = [
            _parabola(channel, t, wraps)
            for (_, channel), wraps in zip(self._of, self._wraps, strict=True)
        ]
        return np.array([x for x, _ in each]), np.array([v for _, v in each])

    def _read(self, q: Floats, qd: Floats | None = None) -> JointMotion:
        """At q, with the derivatives by its movable coordinates."""
        n = self._model.n
        eye = np.zeros((1, n, q.size))
        eye[0, :, :n] = np.eye(n)
        rates = np.zeros_like(q) if qd is None else qd
        turns: Integers = self._turns[None]
        return self._readings.read(
            StateArrays(q[None], rates[None], turns, eye, np.zeros_like(eye))
        )


def wrapped(angle: Floats) -> Floats:
    """An angle (rad) to half a turn."""
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))


def _wraps(angle: MeasuredChannel) -> bool:
    """Whether jumps of recorded angles by more than half a turn are whole turns, and not counted.

    Angles that count turns span more than one, or jump in gaps alone. There angles within -π to π,
    or 0 to 2π, may do either, and are taken to jump.
    """
    values, passed = angle.values, np.diff(angle.t)
    jumps = np.abs(np.diff(values)) > np.pi
    low, high = float(values.min()), float(values.max())
    if not jumps.any() or high - low > 3.0 * np.pi:  # a turn, and noise
        return False
    if (jumps & (passed <= _MISSING * float(np.median(passed)))).any():
        return True
    return any(
        first - _ROUNDED <= low and high <= first + 2.0 * np.pi + _ROUNDED for first in (-np.pi, 0)
    )


def _parabola(channel: MeasuredChannel, t: float, turns: bool) -> tuple[float, float]:
    """Value and rate at t (s) of a parabola through the nearest measurements; `turns`: angles."""
    k = int(np.searchsorted(channel.t, t))
    first = min(max(0, k - _NEAR // 2), max(0, channel.t.size - _NEAR))
    part = slice(first, first + _NEAR)
    span = channel.t[part] - t
    values = np.unwrap(channel.values[part]) if turns else channel.values[part]
    degree = min(2, span.size - 1)
    scale = float(np.abs(span).max(initial=0.0)) or 1.0
    c = np.linalg.lstsq(np.vander(span / scale, degree + 1, increasing=True), values, rcond=None)[
        0
    ]
    return float(c[0]), float(c[1]) / scale if degree else 0.0


def _usual(channel: MeasuredChannel, turns: bool) -> tuple[float, float]:
    """By how much (rad or m) and how fast (per s) a start may be off and move: deviations from the
    motion of the whole channel, infinite if it is not seen to move."""
    values = np.unwrap(channel.values) if turns else channel.values
    apart = min(_APART, values.size - 1)
    moved = np.abs(values[apart:] - values[: values.size - apart])
    passed = channel.t[apart:] - channel.t[: values.size - apart]
    fastest = float((moved / passed).max(initial=0.0, where=passed > 0.0))
    return float(np.ptp(values)) or np.inf, _FAST * fastest or np.inf


def _least(A: Floats, off: Floats) -> Floats:
    """The smallest change with the joints nearest to the recorded ones."""
    if A.shape[1] == 0:
        return np.zeros(0)
    scale = float(np.linalg.norm(A, 2)) or 1.0
    wide = np.vstack([A, _KEEP * scale * np.eye(A.shape[1])])
    return np.asarray(
        np.linalg.lstsq(wide, np.concatenate([off, np.zeros(A.shape[1])]), rcond=None)[0]
    )
