"""`alf_ros.fastest`: the fastest run of a given path under limits of the efforts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.simulation.input_checks import by_name, is_number, number, texts, whole
from alf_ros.simulation.packed_effects import kinds_of
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.loads.driven_motion import Carrier, moving, undriven
from alf_ros.studies.loads.effort_limits import EffortLimits
from alf_ros.studies.loads.inverse_dynamics import InverseDynamics, Motion
from alf_ros.studies.loads.load_history import POSSIBLE, LoadHistory
from alf_ros.studies.loads.prescribed_loads import history_of
from alf_ros.studies.loads.singular_instants import filled

_PIECES, _MOST = 1000, 100_000
_AGREED = 1e-9  # of the largest speed: forces of the speed no longer change it
_ROUNDS = 60
_ROUNDED = 1e-12  # of the limits: forces of the speed that count as none
_STANDING = 1e-12  # of the largest speed along the path: it stands still
_LATER = (0.1234, 1.618)  # s, after which a force that depends on time has another value
_BESIDE = 1e-3  # of a speed: others, for the slope of forces of the speed
_TIMED = 'forces that depend on time have no fastest run'
_AT = 1e-6  # of the range of an effort within which it is at its limit


@dataclass(frozen=True, eq=False)
class FastestRun:
    """The fastest run of a path from rest to rest.

    s (N + 1,): the parameter of the path at the ends of N pieces, with t (N + 1,), s, and rate
    (N + 1,), ṡ, there. loads: efforts and reactions in the middle of the pieces, where the efforts
    keep their limits. at_limit (N, a): whether an effort is at its limit there.
    """

    s: Floats
    t: Floats
    rate: Floats
    loads: LoadHistory
    at_limit: NDArray[np.bool_]

    @property
    def duration(self) -> float:
        """The time for the whole path, s."""
        return float(self.t[-1])

    @cached_property
    def limited_by(self) -> Mapping[str, float]:
        """For each actuator, the part of the time that it spends at a limit."""
        part = (np.diff(self.t)[:, None] * self.at_limit).sum(axis=0) / self.duration
        return dict(zip(self.loads.names, part.tolist(), strict=True))

    def __repr__(self) -> str:
        return f'<FastestRun of {self.duration:.6g} s, {len(self.s) - 1} pieces>'


def fastest(
    path: SceneSource,
    limits: Mapping[str, float | Sequence[float]],
    *,
    length: float,
    pieces: int = _PIECES,
    without: Sequence[str] = (),
) -> FastestRun:
    """The fastest run of a path from rest to rest, under limits of the efforts.

    path: a scene whose drives prescribe the path: their t is the parameter s of the path, from 0
    to `length`, and says nothing about time. limits: for each actuator (as in `loads`) the largest
    effort (N or N m), or the least and the largest. pieces: of constant s̈; the error of
    the duration falls with the power 1.5 of their length. It falls with the power 1 if forces are
    proportional to the speed (these are roots of ṡ², whose slope is infinite at rest), or if the
    path itself begins or ends at rest, as a table does: ṡ then begins with a jump.

    Raises InputError for what cannot be used, with friction that depends on reactions, if the
    actuators cannot follow the path, or limits are too small to hold the mechanism on it.
    """
    path = load_scene(path)
    names, low, high = _limits(limits)
    length = number(length, 'length', 0.0)
    if length == 0.0:
        raise InputError('not usable', key='length', value=length, expected='> 0')
    count = whole(pieces, 'pieces', 2, _MOST)
    simulation = moving(path)
    bare = undriven(path, texts(without, 'without'))
    if bare.state.loads.size:
        raise InputError(
            'friction that depends on reactions',
            key='without',
            expected='the names of its effects',
        )
    _check_without_time(bare)
    solver, carrier = InverseDynamics(bare, names, 'limits'), Carrier(simulation, bare)
    way = length / count
    middle = [(k + 0.5) * way for k in range(count)]
    along = carrier.motion(list(simulation.run(middle[-1], at=middle)))
    x, inertia, rest = _speeds(solver, along, way, (low, high))
    motion, t = _run(along, way, x)
    found = solver.needed(motion)
    lost = ~found.is_known
    found.efforts[lost] = (inertia * (np.diff(x) / (2.0 * way))[:, None] + rest)[lost]
    near = _AT * (high - low)
    return FastestRun(
        s=np.array([way * k for k in range(count + 1)]),
        t=t,
        rate=np.sqrt(x),
        loads=history_of(carrier, bare, solver, motion, found),
        at_limit=(found.efforts > high - near) | (found.efforts < low + near),
    )


def _limits(given: Mapping[str, float | Sequence[float]]) -> tuple[list[str], Floats, Floats]:
    names, low, high = list[str](), list[float](), list[float]()
    for name, value in by_name(given, 'limits', 'a number for each actuator').items():
        try:
            ends = [-value, value] if is_number(value) else list(value)
            a, b = ends
        except (TypeError, ValueError):
            raise InputError(
                'not a limit', key=f'limits.{name}', value=value, expected='most, or [least, most]'
            ) from None
        a, b = (number(end, f'limits.{name}') for end in (a, b))
        if not a < b:
            raise InputError('an empty range', key=f'limits.{name}', value=value)
        names.append(name)
        low.append(a)
        high.append(b)
    if not names:
        raise InputError('no limits', key='limits', expected='a number for each actuator')
    return names, np.array(low), np.array(high)


def _check_without_time(bare: Simulation) -> None:
    """Raises InputError for forces and joints that say themselves how they depend on time."""
    model = bare.model
    names = [joint.name for joint in model.mechanism.joints if joint.motion]
    names += [
        effect.label
        for effect in bare.applied.effects
        if any(kind.packed.instants.size for kind in kinds_of((effect,), model.layout))
    ]
    if names:
        raise InputError(_TIMED, key='path', value=', '.join(names))


def _check_that_it_moves(along: Motion) -> None:
    """Raises InputError for a path that stands still: nothing limits the speed there."""
    speeds = np.abs(along.qd).max(axis=1)
    still = speeds <= _STANDING * float(speeds.max())
    if still.any():
        where = f's = {along.t[still][0]:.6g}'
        raise InputError(f'it stands still at {where}, where nothing limits the speed', key='path')


def _timed(along: Motion, rate: Floats, bend: Floats) -> Motion:
    """The path with ṡ and s̈ (N,)."""
    qd = along.qd * rate[:, None]
    qdd = along.qd * bend[:, None] + along.qdd * (rate**2)[:, None]
    return replace(along, qd=qd, qdd=qdd)


def _efforts(solver: InverseDynamics, along: Motion, rate: Floats, bend: Floats) -> Floats:
    """(N, a) with ṡ and s̈ (N,); NaN in singular positions. Raises InputError if the actuators
    cannot follow the path."""
    found = solver.needed(_timed(along, rate, bend))
    short = np.nan_to_num(found.short)
    if short.max() > POSSIBLE:
        raise InputError(
            f'these actuators cannot follow the path at s = {along.t[int(short.argmax())]:.6g}',
            key='limits',
            value=', '.join(solver.names),
        )
    return found.efforts


def _everywhere(s: Floats, efforts: Floats, sizes: Floats) -> Floats:
    """(N, a) with limits in singular positions, to a part of `sizes` (a,). Raises InputError if
    there is none."""
    found = filled(s, efforts, sizes)
    lost = np.isnan(found).any(axis=1)
    if lost.any():
        raise InputError(f'the efforts are not determined at s = {s[lost][0]:.6g}', key='path')
    return found


def _speeds(
    solver: InverseDynamics, along: Motion, way: float, limits: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """x = ṡ² (N + 1,) at the ends of the pieces; efforts (N, a) for a unit of s̈, and the rest of
    the efforts, in their middle. Forces that depend on the speed come from the last round."""
    _check_that_it_moves(along)
    s, still, one = along.t, np.zeros(along.t.size), np.ones(along.t.size)
    at_rest = _efforts(solver, along, still, still)
    for more in _LATER:
        later = _efforts(solver, replace(along, t=s + more), still, still)
        if not np.array_equal(later, at_rest, equal_nan=True):
            raise InputError(_TIMED, key='path')
    sizes = np.abs(limits).max(axis=0)
    inertial = replace(along, qd=np.zeros_like(along.qd))
    by_square = _efforts(solver, inertial, one, still) - at_rest  # q̈ = q'' ṡ² alone
    m = _everywhere(s, _efforts(solver, along, still, one) - at_rest, sizes)
    g, c = _everywhere(s, at_rest, sizes), _everywhere(s, by_square, sizes)

    def drag_at(rate: Floats) -> Floats:
        moving_at = _efforts(solver, along, rate, still)
        return _everywhere(s, moving_at - at_rest - by_square * (rate**2)[:, None], sizes)

    # drag + slope (x - rate²): linear in x, which is exact for a quadratic drag
    rate: Floats = still
    held: Floats = still  # the last speeds whose drag the limits could hold
    drag, part, change = np.zeros_like(g), 1.0, np.inf
    slope: Floats = np.zeros_like(g)
    for _ in range(_ROUNDS):
        rest = g + drag - slope * (rate**2)[:, None]
        x, where = EffortLimits(way, m, c + slope, rest, *limits).fastest(0.0, 0.0)
        if where >= 0 and not rate.any():
            raise InputError(
                f'the limits cannot hold the path at s = {s[where]:.6g}', key='limits'
            )
        if where >= 0:
            rate = 0.5 * (held + rate)  # so fast that the drag exceeds the limits
        else:
            if not np.isfinite(x).all():
                where = int(np.argmin(np.isfinite(x[1:])))
                raise InputError(f'nothing limits the speed at s = {s[where]:.6g}', key='path')
            found = np.sqrt(0.5 * (x[1:] + x[:-1]))
            before, change = change, float(np.abs(found - rate).max())
            if change <= _AGREED * float(found.max()):
                return x, m, rest + (c + slope) * (found**2)[:, None]
            if change > 0.7 * before:
                part = max(0.1, 0.7 * part)
            held = rate
            rate = found if not rate.any() else rate + part * (found - rate)
        drag = drag_at(rate)
        if np.abs(drag).max() <= _ROUNDED * float(sizes.max()):
            return x, m, g + c * (rate**2)[:, None]
        ways = 4.0 * _BESIDE * rate**2
        rise = drag_at((1.0 + _BESIDE) * rate) - drag_at((1.0 - _BESIDE) * rate)
        slope = np.divide(rise, ways[:, None], out=np.zeros_like(g), where=ways[:, None] > 0.0)
    raise InputError('forces that depend on the speed do not settle', key='path')


def _run(along: Motion, way: float, x: Floats) -> tuple[Motion, Floats]:
    """The motion in the middle of the pieces, over time; and t (N + 1,) at their ends."""
    middle = 0.5 * (x[1:] + x[:-1])
    rate, ends, bend = np.sqrt(middle), np.sqrt(x), np.diff(x) / (2.0 * way)
    t = np.concatenate([[0.0], np.cumsum(2.0 * way / (ends[1:] + ends[:-1]))])
    return replace(_timed(along, rate, bend), t=t[:-1] + way / (ends[:-1] + rate)), t
