"""A body put elsewhere, or given another speed, with the mechanism assembled around it.

The body goes there along a screw, as a nut goes along a bolt: turned less than half a turn, and
about a pin that holds it, if one does. The other bodies follow in small steps. So the mechanism
stays on its branch, and angles are counted as in a motion. Velocities follow from an impulse on
the body: parts that it does not reach keep their velocities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import AssemblyError, InputError
from alf_ros.mechanism import Body
from alf_ros.mechanism.natural_coordinates import TURN, Layout
from alf_ros.mechanism.orientation import orientation, quaternion
from alf_ros.model import assembly
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.singular_location import located
from alf_ros.model.singular_start import distance
from alf_ros.simulation.branch_velocities import on_branch as velocities_on
from alf_ros.simulation.branch_velocities import on_nearest_branch
from alf_ros.simulation.input_checks import numbers, text
from alf_ros.simulation.state import State

# How far, of the size, a pose may be from one that the constraints allow, and of the largest
# speed, a twist: typed or computed values have a few digits less.
TOLERANCE = 1e-6
# Most that a body goes at once: rad, and of the size.
_TURN, _MOVE = 0.02, 0.01
_MOST = 1000.0  # times
_MOST_ON_THREADS = 2000.0  # times, by a radian of the thread
_FIRST = 1e-2  # of such a step, before all others: tells which way the mechanism goes
_SAME = 1e-6  # of the size: where two ways of other steps end at one place
_HALVED = 5  # times that the steps of a way may be
_IN, _BESIDE = 1e-6, 1e-4  # σ of the position itself, and of what is better extrapolated
_POINTS, _APART = 8, 0.25  # before a singular position, and how far apart, in such steps
_STILL = 1e-9  # part of the speeds before, from which down a body held still holds all
_LARGEST = 1e40  # number that is one, as in files
_UNIT = 1e-2  # by which the length of a quaternion may differ from 1


def placed(
    model: Model,
    state: State,
    t: float,
    body: str,
    pose: Sequence[float] | Floats | None = None,
    twist: Sequence[float] | Floats | None = None,
    branch: int | None = None,
    dependent: int = 0,
) -> tuple[Floats, Floats, Integers]:
    """q (m), q̇ (m/s), turns with the frame of `body` at `pose`, moving with `twist`, at t (s).

    pose: in the plane x, y (m), angle (rad, of any turn); in space x, y, z, quaternion x, y, z, w.
    twist: velocity of the origin of the frame (m/s), angular velocity (rad/s), in the world frame:
    3 or 6 numbers. Without a pose the mechanism stays where it is; without a twist the body keeps
    its own, as far as the constraints permit. branch: the number of the branch that the velocities
    fit, in a singular position; `dependent`: rows that depend on others in ordinary positions.
    Raises InputError for an invalid pose or twist, AssemblyError with the gap of the constraints
    for an impossible one, or with the branches.
    """
    layout = model.layout
    if text(body, 'body') not in layout.body:
        raise InputError('unknown body', key='body', value=body, choices=model.body_names)
    one, wanted = layout.body[body], None if pose is None else _frame(layout, body, pose)
    speeds, D = None, layout.dimension
    if twist is not None:
        speeds = np.array(numbers(twist, 'twist', (3, 6)[D - 2], _LARGEST))

    def given(q: Floats) -> assembly.Given | None:
        return None if speeds is None else _moving(model, q, one, speeds[:D], speeds[D:])

    def on_branch(q: Floats) -> Floats:
        return velocities_on(model, q, t, dependent, branch or 1, given(q), state.qd)

    def going(q: Floats) -> Floats:
        beside, qd = distance(model, q, dependent) > _IN, None
        try:
            if not beside:  # what the rows leave free there need not begin a motion
                qd = on_nearest_branch(model, q, t, dependent, given(q), state.qd, TOLERANCE)
            if qd is None:
                of = model, state, t, q, one
                qd = _going_on(*of, beside) if speeds is None else _set_going(*of, speeds, beside)
        except AssemblyError as error:
            raise AssemblyError(f'{body} cannot move like that: {error.message}') from None
        held = speeds is not None and not speeds.any()
        if held and np.abs(qd).max() <= _STILL * np.abs(state.qd).max():
            return np.zeros_like(qd)  # what rounding leaves would be no rest
        return qd

    if wanted is None:
        return state.q, on_branch(state.q) if branch else going(state.q), state.turns
    way = _Way(model, state.q, one, *wanted)
    q, turns = _assembled(model, state, way, dependent)
    if branch:
        q = located(model, q)
        return q, on_branch(q), turns
    if distance(model, q, dependent) >= _BESIDE:
        return q, going(q), turns
    led = _led_to(model, state, way, going)
    if led is None or np.abs(led[0] - q).max() > _SAME * model.size:
        led = q, going(q)
    q, qd = led
    if not qd.any() and distance(model, q, dependent) <= _IN:
        q = located(model, q)  # at rest nothing tells the branch but the place
    return q, qd, turns


def spin(d: Floats, rates: Floats) -> Floats:
    """(3,) ω of rates = ω × d for directions d (k, 3): zero about what nothing turns about."""
    cross = np.vstack([-np.cross(each, np.eye(3)).T for each in d]) if len(d) else np.zeros((0, 3))
    return np.asarray(np.linalg.lstsq(cross, rates.ravel(), rcond=None)[0])


def unit_quaternion(given: Floats) -> Floats:
    """The quaternion (4,), of length 1. Raises InputError if it is too far from that."""
    length = float(np.linalg.norm(given))
    if not abs(length - 1.0) <= _UNIT:
        raise InputError(
            'not a rotation',
            key='quaternion',
            value=given.tolist(),
            expected='4 numbers, the sum of their squares 1',
        )
    return np.asarray(given / length)


# ----------------------------------------------------------------------------------------- places


def _frame(layout: Layout, body: str, pose: Sequence[float] | Floats) -> tuple[Floats, Floats]:
    """Origin (D,) and axes (D, D) of a pose."""
    if layout.dimension == 2:
        x, y, angle = numbers(pose, 'pose', 3, _LARGEST)
        return np.array([x, y]), math.cos(angle) * np.eye(2) + math.sin(angle) * TURN
    given = np.array(numbers(pose, 'pose', 7, _LARGEST))
    return given[:3], _axes(unit_quaternion(given[3:]))


def _axes(turn: Floats) -> Floats:
    """(3, 3) rotation matrix of a unit quaternion x, y, z, w."""
    u, w = turn[:3], turn[3]
    return np.asarray((w * w - u @ u) * np.eye(3) + 2.0 * np.outer(u, u) + 2.0 * w * _cross(u))


def _cross(u: Floats) -> Floats:
    """(3, 3) matrix of u ×."""
    return np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])


def _assembled(model: Model, state: State, way: _Way, dependent: int) -> tuple[Floats, Integers]:
    """q and turns with the body at the end of its way, the rest of the mechanism after it."""
    found = _followed(model, state, way, dependent)
    q = assembly.close(model, {}, found[-1])  # of the constraints nothing stays open
    turns, before = state.turns, _angles(model, state.q) + 2.0 * np.pi * state.turns
    for place in [*found[:-1], q]:
        angles = _angles(model, place)
        turns = np.rint((before - angles) / (2.0 * np.pi)).astype(np.int64)
        before = angles + 2.0 * np.pi * turns
    return q, turns


def _followed(model: Model, state: State, way: _Way, dependent: int) -> list[Floats]:
    """Positions q along the way, or at its end alone.

    Beside a singular position another branch is near. A mechanism with one freedom can be at one
    place only: the steps are halved until two ways end there. Raises AssemblyError if the body
    cannot be at the end, or no two ways end at one place.
    """
    steps = max(1, math.ceil(way.steps))
    before: list[Floats] = []
    for _ in range(_HALVED + 1):
        path = way.at(_FIRST / steps, *(k / steps for k in range(1, steps + 1)))
        try:
            found = assembly.follow(model, path, state.q, TOLERANCE)
        except AssemblyError:
            # Somewhere on the way it may not be able to be: then at once.
            return _at_once(model, state, way)
        if model.n - (len(model.row_names) - dependent) > 1:
            return found
        if before and np.abs(found[-1] - before[-1]).max() <= _SAME * model.size:
            return found
        before, steps = found, 2 * steps
    raise AssemblyError(
        f'{way.body.name} cannot be there: a singular position is so near that the branch is not '
        'determined'
    )


def _at_once(model: Model, state: State, way: _Way) -> list[Floats]:
    """The position q at the end of the way, without the way."""
    try:
        return assembly.follow(model, way.at(1.0), state.q, TOLERANCE)
    except AssemblyError as error:
        message = error.message.removeprefix('the mechanism cannot be closed: ')
        raise AssemblyError(f'{way.body.name} cannot be there: {message}') from None


def _led_to(
    model: Model, state: State, way: _Way, going: Callable[[Floats], Floats]
) -> tuple[Floats, Floats] | None:
    """q and q̇ at the end of a way that leads into a singular position; None if it does not.

    There the constraints tell neither to more than half of the digits, but before it they do: what
    stands there is extrapolated.
    """
    steps = max(1, math.ceil(way.steps))
    apart = min(_APART / max(way.steps, 1e-300), 1.0 / (_POINTS + 1))
    last = [1.0 - k * apart for k in range(_POINTS, -1, -1)]
    before = [s for s in (_FIRST / steps, *(k / steps for k in range(1, steps))) if s < last[0]]
    try:
        found = assembly.follow(model, way.at(*before, *last), state.q, TOLERANCE)
        # equally spaced: the next difference is zero
        weights = [(-1) ** (k + 1) * math.comb(_POINTS, k) for k in range(_POINTS, 0, -1)]
        near = found[-_POINTS - 1 : -1]
        q = sum((w * x for w, x in zip(weights, near, strict=True)), 0.0 * state.q)
        q = assembly.close(model, {}, q)
        qd = sum((w * going(x) for w, x in zip(weights, near, strict=True)), 0.0 * state.qd)
    except AssemblyError:
        return None
    fastest = max(np.abs(qd).max(), np.abs(state.qd).max())
    if assembly.opening(model, q, qd) > TOLERANCE * fastest:
        return None
    return q, qd


def _given(body: Body, origin: Floats, axes: Floats) -> assembly.Given:
    """The points (m) and vectors of a body with this frame."""
    points = (origin + axes @ np.array(local) for local in body.local)
    vectors = (axes @ np.array(axis) for axis in body.axes)
    named = [*zip(body.points, points, strict=True), *zip(body.vectors, vectors, strict=True)]
    return {name: values.tolist() for name, values in named}


class _Way:
    """The way s = 0 .. 1 of a body from where it is, in q, to where its frame shall be.

    With R_s = exp(s δ×) and V_s its mean over the way there, the place x of a body goes to R_s x +
    s V_s u; δ (rad) is the whole turn, and u (m) so that the whole way leads there. `steps`: its
    length in longest steps.
    """

    def __init__(self, model: Model, q: Floats, body: Body, origin: Floats, axes: Floats) -> None:
        layout, D = model.layout, model.layout.dimension
        places = q.reshape(-1, D)
        self.body, self._end = body, (origin, axes)
        self._first = np.pad(places[layout.of_body[body.name][0]], (0, 3 - D))
        self._now = _present(layout, body.name, places)
        last, whole = np.pad(origin, (0, 3 - D)), np.eye(3)
        whole[:D, :D] = axes
        self._delta = _turn_between(self._now, whole, layout.turns(body.name))
        missing = last - _turned(self._delta) @ self._first
        self._u = np.linalg.solve(_mean_turn(self._delta), missing)
        wheels = [each.advance for each in integrals(layout, teeth=True)]
        away = float(np.linalg.norm(last - self._first))
        turned = float(np.linalg.norm(self._delta))
        self.steps = max(turned / _TURN, away / min([_MOVE * model.size, *wheels]))
        most = _MOST
        if D == 3 and wheels:  # threads and such, which turn often for a short way of anything
            self.steps = max(self.steps, (away + turned * model.size) / min(wheels))
            most = _MOST_ON_THREADS
        self.steps = min(most, self.steps)

    def at(self, *s: float) -> list[tuple[float, assembly.Given]]:
        """The given values of the body on its way."""
        return [(each, _given(self.body, *self._frame(each))) for each in s]

    def _frame(self, s: float) -> tuple[Floats, Floats]:
        if s == 1.0:
            return self._end
        D, R = len(self._end[0]), _turned(s * self._delta)
        place = R @ self._first + s * _mean_turn(s * self._delta) @ self._u
        return place[:D], (R @ self._now)[:D, :D]


def _present(layout: Layout, body: str, places: Floats) -> Floats:
    """(3, 3) axes of a body; for a body without orientation the axes in `orientation`."""
    if layout.dimension == 3:
        return _axes(orientation(layout, body, places))
    axes = np.eye(3)
    if layout.turns(body):
        x = layout.direction(body, (1.0, 0.0)).value(places)
        axes[:2, :2] = np.column_stack([x, TURN @ x]) / np.linalg.norm(x)
    return axes


def _turn_between(now: Floats, whole: Floats, turns: bool) -> Floats:
    """(3,) rad: the shortest turn from axes to axes; of a rod, from its x axis to the other."""
    if turns:
        x, y, z, w = quaternion(whole @ now.T)
        axis, angle = np.array([x, y, z]), 2.0 * math.atan2(math.hypot(x, y, z), w)
    else:
        a, b = now[:, 0], whole[:, 0]
        axis = np.cross(a, b)
        angle = math.atan2(float(np.linalg.norm(axis)), float(a @ b))
        if not axis.any():
            axis = now[:, 2]  # half a turn about whatever is across, or none
    length = float(np.linalg.norm(axis))
    return axis * (angle / length) if length > 0.0 else np.zeros(3)


def _turned(delta: Floats) -> Floats:
    """exp(δ×), (3, 3)."""
    angle, K = float(np.linalg.norm(delta)), _cross(delta)
    if angle < 1e-4:
        return np.eye(3) + K + 0.5 * K @ K
    return np.asarray(
        np.eye(3) + math.sin(angle) / angle * K + (1.0 - math.cos(angle)) / angle**2 * (K @ K)
    )


def _mean_turn(delta: Floats) -> Floats:
    """The mean of exp(s δ×) for s from 0 to 1, (3, 3)."""
    angle, K = float(np.linalg.norm(delta)), _cross(delta)
    if angle < 1e-4:
        return np.eye(3) + 0.5 * K + K @ K / 6.0
    once, twice = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + once * K + twice * (K @ K))


def _angles(model: Model, q: Floats) -> Floats:
    """(angles,) rad, of all that is counted, without turns."""
    rows = model.system.angles
    values = np.zeros(rows.c.size)
    kernel.violation(model.unit, rows, q, values)
    return np.arctan2(values[1::2] + 0.0, values[::2])  # as a sample has them


# ----------------------------------------------------------------------------------------- speeds


def _set_going(
    model: Model, state: State, t: float, q: Floats, body: Body, speeds: Floats, beside: bool
) -> Floats:
    """q̇ with the body moving as it shall, the rest as after an impulse on the body; `beside` as
    for `assembly.complete`."""
    D = model.layout.dimension
    given = _moving(model, q, body, speeds[:D], speeds[D:])
    qd = assembly.complete(model, q, given, t, state.qd, TOLERANCE, beside)
    # of the constraints nothing is left
    return assembly.complete(model, q, {}, t, qd, beside=beside)


def _going_on(model: Model, state: State, t: float, q: Floats, body: Body, beside: bool) -> Floats:
    """q̇ with the body moving as before, or as nearly as the constraints allow there."""
    layout, D = model.layout, model.layout.dimension
    rates = np.pad(state.qd.reshape(-1, D), ((0, 0), (0, 3 - D)))
    first = layout.of_body[body.name][0]
    d, turning = (
        _directions(layout, body, np.pad(x.reshape(-1, D), ((0, 0), (0, 3 - D))))
        for x in (state.q, state.qd)
    )
    omega = spin(d, turning)[2:] if D == 2 else spin(d, turning)
    given = _moving(model, q, body, rates[first, :D], omega)
    try:
        qd = assembly.complete(model, q, given, t, state.qd, TOLERANCE, beside)
    except AssemblyError:
        qd = state.qd
    return assembly.complete(model, q, {}, t, qd, beside=beside)


def _moving(model: Model, q: Floats, body: Body, linear: Floats, omega: Floats) -> assembly.Given:
    """Velocities of the points (m/s) and vectors of a body with this twist, in q."""
    layout, D = model.layout, model.layout.dimension
    d = _directions(layout, body, q.reshape(-1, D))
    turning = omega * d @ TURN.T if D == 2 else np.cross(omega, d)
    points = [np.zeros(D), *turning[: len(body.points) - 1]]
    vectors = turning[len(body.points) - 1 :] / layout.length
    named = [*zip(body.points, linear + points, strict=True)]
    named += zip(body.vectors, vectors, strict=True)
    return {name: values.tolist() for name, values in named}


def _directions(layout: Layout, body: Body, places: Floats) -> Floats:
    """(k, D) from the first point of a body to its others, and its vectors, m; or their rates."""
    first, *others = (places[block] for block in layout.of_body[body.name])
    points = len(body.points) - 1
    found = [at - first for at in others[:points]] + others[points:]
    return np.array(found).reshape(-1, places.shape[1])
