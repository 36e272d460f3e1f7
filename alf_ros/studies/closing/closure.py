"""Closure: all joint coordinates of a mechanism with loops from the active ones."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError, StepError
from alf_ros.kernel import integral_values
from alf_ros.kernel.data.closing import CALLS, GUESS, SHARP, SHARP_BEFORE, SHARPEST, Closing
from alf_ros.kernel.loop_closing import close_loops, close_table
from alf_ros.kernel.posture_rates import linearise_posture, rate_matrix, rates_at
from alf_ros.model.compile import allocate
from alf_ros.model.constraints.packing import indices
from alf_ros.model.softest_modes import found
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import is_number, number, text, truth
from alf_ros.simulation.input_values import NO_INPUTS
from alf_ros.simulation.named_values import read_only
from alf_ros.simulation.one_thread import by_one_thread
from alf_ros.simulation.state import State
from alf_ros.studies.closing.actuated import Actuated, actuated, scene_of
from alf_ros.studies.closing.branch_sign import BranchSign
from alf_ros.studies.closing.posture import Posture, Ways
from alf_ros.studies.closing.stops import StoppedTravel, stops_of

_Reached = tuple[Floats, Integers, Floats]  # q, turns, active values

_FURTHEST = 1e4  # rad, or of the size: an active coordinate in one call
_TURNS = 1000  # of an active angle, in which the end of its travel is looked for
_SAME = 1e-6  # of the size: positions that are the same
_LONG = 4.0  # of the size: longest travel of a length that is looked for
_FAR = 100.0  # of the size: how far from its posture a mechanism is followed
_STEPS, _FEWEST = 256, 16  # places at which joints are compared with stops, in a turn and at least
_SHORT = 1e-9  # of the way to a dead point, before which they are compared last
_UNTRIED = (math.inf, -math.inf, 0.0, math.inf, math.inf, math.inf)  # no motion so far
_NOTHING = 1e-30  # of a penalty: the row binds nothing
_MOST_RATIO = 10.0  # of two times between calls, up to which the motion is believed
_FEW = 2.0  # calls that a motion needs to begin anew
_SOFT = 0.05  # of the largest σ so far, beside a position where branches meet


class Closure:
    """The passive joints of a mechanism, from the active ones.

    mechanism: a scene, the name or path of a scene or a mechanism, or a mapping of either; its
    initial positions choose the branch. active: the joint coordinates whose values `close` is
    given, as many as the mechanism has freedoms, and independent. noise: the standard deviation of
    these values (rad or m), one number or one for each name: 0 for commands, the resolution for
    encoders.

    Calls of `close` are a motion: the branch follows from its position, velocity and curvature.
    Drives of the mechanism are left out, effects do not count. Raises InputError for names that
    are no joint coordinates, too many or too few of them, and non-holonomic joints, such as a ball
    that rolls; AssemblyError if it cannot be closed. One thread at a time may use a Closure and
    its postures, else BusyError.
    """

    def __init__(
        self,
        mechanism: SceneSource,
        active: Sequence[str],
        noise: float | Mapping[str, float] = 0.0,
    ) -> None:
        self._lock = threading.Lock()
        scene = scene_of(mechanism)
        self._actuated = actuated(scene, active)
        self.active, self.model = self._actuated.active, self._actuated.model
        self.joint_names = self.model.coordinate_names
        self._stops = stops_of(scene, self.joint_names)
        self._noise = self._numbers(
            noise if isinstance(noise, Mapping) else dict.fromkeys(self.active, noise),
            'noise',
            0.0,
        )
        self._closing = _closing(self._actuated, self._noise)
        self._reader = _closing(self._actuated, self._noise)
        self._branch = BranchSign(self.model, self._actuated.q, self._actuated.dependent_rows)
        self.restart()

    def __repr__(self) -> str:
        return f'<Closure of {self.model.mechanism.name} by {", ".join(self.active)}>'

    def __reduce__(self) -> NoReturn:
        """A copy would continue the same motion: its calls would move this one as well."""
        raise TypeError('a Closure is one motion, and has no copy: make another one of its scene')

    @property
    def start(self) -> dict[str, float]:
        """The active joint coordinates where the mechanism starts, rad or m."""
        values = self._actuated.values[self._closing.active]
        return dict(zip(self.active, values.tolist(), strict=True))

    @property
    def ambiguous(self) -> bool:
        """Whether the branch is a guess, as `Posture.ambiguous` of the last posture."""
        return bool(self._closing.counts[GUESS])

    @by_one_thread
    def restart(self) -> None:
        """Back to where the mechanism starts; the motion so far is forgotten."""
        closing, start = self._closing, self._actuated
        _put(closing, start.q, start.values[closing.active])
        closing.place[:] = start.q[: closing.place.size]
        self._t, self._span, self._calls = math.nan, math.nan, 0

    @by_one_thread
    def close(
        self,
        positions: Mapping[str, float],
        rates: Mapping[str, float] | None = None,
        t: float | None = None,
    ) -> Posture:
        """The posture at these values of all active joint coordinates (rad, turns counted, or m).

        rates: their velocities (rad/s or m/s), for velocities of the posture, which are NaN where
        it cannot move so, as in a dead point. t: the instant (s) of the values; without it calls
        count as equally spaced. Raises InputError, and changes nothing, for a wrong name or
        number, or a time that does not advance.
        """
        closing = self._closing
        wanted = self._numbers(positions, 'positions')
        speeds = None if rates is None else self._numbers(rates, 'rates')
        self._refuse_far(wanted[None])
        ratio, per_call = self._timed(t)
        closing.wanted[:] = wanted
        long_ago = ratio > _MOST_RATIO  # too long to say where the motion leads
        if long_ago:
            closing.counts[CALLS] = min(closing.counts[CALLS], 1)
            closing.counts[GUESS] |= self._is_beside(_FEW)
        close_loops(closing, ratio)
        if long_ago:
            closing.counts[GUESS] |= self._is_beside(0.0)
        self._calls += 1
        missed = float(np.abs(closing.values[closing.active] - wanted).max())
        qd = np.zeros_like(closing.q)
        if speeds is not None:
            if not linearise_posture(closing):
                raise StepError('the leading matrix is not positive definite', 'check masses', 0.0)
            if not rates_at(closing, speeds, per_call, qd):
                qd[: self.model.n] = math.nan
        state = State(
            self._calls, closing.q.copy(), qd, closing.turns.copy(), 0.0, np.zeros(0), NO_INPUTS
        )
        return Posture(
            self.model,
            0.0 if t is None else t,
            state,
            self._actuated.instruments,
            missed,
            self.ambiguous,
            self._ways(state, closing.values[closing.active]),
        )

    @by_one_thread
    def follow(self, table: Sequence[Sequence[float]] | Floats) -> tuple[Floats, Floats]:
        """Joint coordinates along a table of active values (calls, active), in one compiled call.

        The columns are in the order of `active`; calls are equally spaced, and continue the motion
        so far. The next call of `close` is as far in time from the last row as the rows are from
        each other. Returns the joint coordinates (calls, joint coordinates), in the
        order of `joint_names`, and `missed_by` of each call (calls,). Raises InputError for a
        table of another shape, or with values that are no finite real numbers.
        """
        given, joints = self._table(table), len(self.joint_names)
        values, missed = np.zeros(len(given) * joints), np.zeros(len(given))
        self._refuse_far(given)
        if len(given):  # an instant before these calls is none of the last call
            self._timed(None)
        close_table(self._closing, given.ravel(), values, missed)
        self._calls += len(given)
        return values.reshape(len(given), joints), missed

    def _table(self, table: Sequence[Sequence[float]] | Floats) -> Floats:
        """(calls, active) finite numbers. Raises InputError."""
        active = len(self.active)
        try:
            given = np.array(table)
            # among numbers in a list, a truth value would become one of them
            each = np.zeros(0) if isinstance(table, np.ndarray) else np.array(table, dtype=object)
        except ValueError:  # rows of different lengths
            given = each = np.zeros(0)
        real = given.dtype.kind in 'iuf' or all(map(is_number, given.flat))
        real = real and not any(isinstance(x, (bool, np.bool_)) for x in each.flat)
        if not real or np.ma.is_masked(table) or given.shape[1:] != (active,):
            given = np.full((1, active), math.nan)
        given = given.astype(float)
        if not np.isfinite(given).all():
            raise InputError(
                'not a table', key='table', expected=f'rows of {active} finite numbers'
            )
        return given

    def _refuse_far(self, calls: Floats) -> None:
        """Raise InputError if a call (calls, active) is further from the one before than anything
        goes in one call."""
        way = np.abs(np.diff(np.vstack([self._closing.asked, calls]), axis=0))
        far = way / np.where(self._closing.is_angle, 1.0, self.model.size) > _FURTHEST
        if far.any():
            call, n = divmod(int(far.argmax()), len(self.active))  # the first one
            raise InputError('too far away', key=self.active[n], value=float(calls[call, n]))

    def _timed(self, t: float | None) -> tuple[float, float]:
        """The time since the last call over that before, and calls per second if known, else 0."""
        if t is None:
            self._t = self._span = math.nan
            return 1.0, 0.0
        if not is_number(t):
            raise InputError('not a time', key='t', value=t, expected='s')
        if t <= self._t:
            raise InputError(
                'time does not advance', key='t', value=t, expected=f'more than {self._t:g} s'
            )
        span = t - self._t
        ratio = span / self._span
        self._t, self._span = float(t), span
        per_call = 1.0 / span if math.isfinite(span) else 0.0
        return (ratio if math.isfinite(ratio) else 1.0), per_call

    def _is_beside(self, calls: float) -> bool:
        """Whether the posture is in or beside a position where branches meet, or the motion would
        have led there in so many calls."""
        closing = self._closing
        if (closing.held != closing.q).any():
            return True
        largest, *last = (closing.trail[n] for n in (SHARPEST, SHARP, SHARP_BEFORE))
        now, before = (math.exp(min(x, largest) - largest) for x in last)
        return now < max(_SOFT, calls * (before - now))

    def _numbers(self, given: Mapping[str, float], key: str, least: float = -math.inf) -> Floats:
        """(active,) the numbers of a mapping. Raises InputError."""
        if not isinstance(given, Mapping):
            raise InputError(
                'not numbers by name', key=key, value=given, expected=', '.join(self.active)
            )
        if given.keys() != set(self.active):
            for name in given:
                if name not in self.active:
                    raise InputError(
                        'not an active joint', key=key, value=name, choices=self.active
                    )
            missing = ', '.join(name for name in self.active if name not in given)
            raise InputError(f'without {missing}', key=key, expected='a number for each')
        return np.array([number(given[name], f'{key}.{name}', least) for name in self.active])

    def _ways(self, state: State, at: Floats) -> Ways:
        return Ways(
            lambda: self._rates(state, at),
            lambda: self._distance(state, at),
            lambda: self._branch.at(state.q),
            lambda joint, stops: self._travel(state, at, joint, stops),
        )

    @by_one_thread
    def _rates(self, state: State, at: Floats) -> Floats:
        reader = self._read(state, at)
        active, coordinates = reader.active.size, len(self.joint_names)
        matrix = np.zeros(active * coordinates)
        rate_matrix(reader, reader.here, matrix)
        return read_only(matrix.reshape(active, coordinates).T.copy())

    @by_one_thread
    def _distance(self, state: State, at: Floats) -> float:
        modes = found(self.model, self._read(state, at).work, self._actuated.dependent_rows)
        return 1.0 if modes is None else float(modes.sigma[0])

    @by_one_thread
    def _travel(self, state: State, at: Floats, joint: str, stops: bool) -> tuple[float, float]:
        if text(joint, 'joint') not in self.active:
            raise InputError('not an active joint', key='joint', value=joint, choices=self.active)
        n = self.active.index(joint)
        low, high = (self._end(state, at, n, sign) for sign in (-1.0, 1.0))
        if truth(stops, 'stops') and self._stops:
            low, high = (self._stopped(state, at, n, end) for end in (low, high))
        return low, high

    def _stopped(self, state: State, at: Floats, n: int, end: float) -> float:
        """The end of the travel of an active joint within the stops; `end`: of the loops alone."""
        reader, size = self._read(state, at), self.model.size

        def move(posture: _Reached, x: float) -> tuple[_Reached, Floats] | None:
            q, turned, values = posture
            _put(reader, q, values, turned)
            linearise_posture(reader)
            reader.wanted[:] = at
            reader.wanted[n] = x
            if close_loops(reader, 1.0) < 1.0:
                return None
            here = reader.q.copy(), reader.turns.copy(), reader.asked.copy()
            return here, reader.values.copy()

        first = move((state.q.copy(), state.turns.copy(), at), float(at[n]))
        if first is None or end == at[n]:
            return end
        way = 2.0 * np.pi if reader.is_angle[n] else _LONG * size
        still = first[1][self._stops.which]

        def steps() -> Iterator[float]:
            length = min(abs(end - at[n]) * (1.0 - _SHORT), _TURNS * way)
            count = max(_FEWEST, math.ceil(length / way * _STEPS))
            for k in range(1, count + 1):
                yield float(at[n] + math.copysign(length * k / count, end - at[n]))
                turned = k % _STEPS == 0 and math.isinf(end)
                if turned and np.abs(reader.values[self._stops.which] - still).max() <= _SAME:
                    return  # the same again in each turn
                if turned and np.abs(reader.q - state.q).max() > _FAR * size:
                    return

        found = StoppedTravel(self._stops, move).end(float(at[n]), *first, steps())
        return end if found is None else found

    def _end(self, state: State, at: Floats, n: int, sign: float) -> float:
        """The end of the travel of an active joint in one direction, from its values `at`."""
        reader, size = self._read(state, at), self.model.size
        way = 2.0 * np.pi if reader.is_angle[n] else _LONG * size
        # an angle may be in the same position after several turns only, or end in a later one
        for _ in range(_TURNS if reader.is_angle[n] else 1):
            reader.counts[CALLS] = 0  # no motion: it stays on this side of all dead points
            reader.wanted[:] = reader.asked
            reader.wanted[n] += sign * way
            if close_loops(reader, 1.0) < 1.0:
                return float(reader.asked[n])
            moved = np.abs(reader.q - state.q).max()
            if moved <= _SAME * size or moved > _FAR * size:
                break
        return sign * math.inf

    def _read(self, state: State, at: Floats) -> Closing:
        _put(self._reader, state.q, at, state.turns)
        linearise_posture(self._reader)
        return self._reader


def _put(closing: Closing, q: Floats, at: Floats, turns: Integers | int = 0) -> None:
    """Begin at a posture with its active values, without a motion so far."""
    closing.q[:], closing.turns[:], closing.asked[:] = q, turns, at
    closing.held[:], closing.held_turns[:], closing.held_at[:] = q, turns, at
    closing.counts[:], closing.stride[:], closing.trail[:] = 0, 0.0, _UNTRIED


def _closing(of: Actuated, noise: Floats) -> Closing:
    """The data of the kernel, at the start."""
    model, layout = of.model, of.model.layout
    rows, names = model.system.rows, model.row_names
    own = {drive.name for drive in model.mechanism.drives}
    alpha, scale = rows.alpha.copy(), rows.scale.copy()
    active = [place for name, place in zip(names, model.row, strict=True) if name in own]
    alpha[active] *= _NOTHING
    scale[active] = 0.0
    loose = replace(model.system, rows=replace(rows, alpha=alpha, scale=scale))
    coordinate = dict(zip(model.coordinate_names, of.coordinates, strict=True))
    place = {name: n for n, name in enumerate(model.coordinate_names)}
    count, whole, angles = len(of.active), model.q.size, model.system.angles.c.size // 2
    sizes = {
        'known': 3,
        'trail': 6,
        'image': len(rows.alpha),
        **dict.fromkeys(('wanted', 'asked', 'here', 'stride', 'held_at'), count),
        'ends': 2 * count,
        **dict.fromkeys(('q', 'other', 'before', 'line', 'held', 'mode'), whole),
        **dict.fromkeys(('place', 'rate', 'bend', 'ahead', 'way', 'shift'), model.n),
        **dict.fromkeys(('slope', 'bow', 'guess'), model.n),
        'places': 8 * model.n,
        **dict.fromkeys(('angles', 'spins', 'near'), angles),
        **dict.fromkeys(('values', 'rates'), len(place)),
    }
    work, still = allocate(model, model.system, 0), np.zeros(angles, dtype=np.int64)
    integral_values(model.unit, model.system, work, of.q, still, work.sums)
    return Closing(
        unit=model.unit,
        tight=model.system,
        loose=loose,
        work=work,
        joints=of.instruments.coordinates,
        active=indices(place[name] for name in of.active),
        block=indices(layout.of_prescribed[drive.name] for drive in model.mechanism.drives),
        is_angle=indices(coordinate[name].is_angle for name in of.active),
        noise=noise,
        turns=np.zeros(angles, dtype=np.int64),
        turned=np.zeros(angles, dtype=np.int64),
        other_turns=np.zeros(angles, dtype=np.int64),
        line_turns=np.zeros(angles, dtype=np.int64),
        held_turns=np.zeros(angles, dtype=np.int64),
        counts=np.zeros(5, dtype=np.int64),
        **{name: np.zeros(size) for name, size in sizes.items()},
    )
