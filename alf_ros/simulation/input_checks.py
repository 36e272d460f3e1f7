"""Checks of arguments: made once, before anything changes.

Numbers are real numbers of Python or numpy; truth values and text are refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND
from alf_ros.model.compile import Model
from alf_ros.simulation.input_values import Inputs, Target, Wrench
from alf_ros.simulation.state import State

MOST_SAMPLES = 10_000_000  # of one run whose instants are listed before it begins
MOST_STEPS = 2**53  # up to which t = step h is exact to the last digit of the step
CLOSE = 1e-6  # of a step: an instant that near to a grid point is one


def is_number(value: object) -> bool:
    """Whether it is a finite real number, and not the truth of something."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond what a float can be
        return False


def choice(value: Any, key: str, known: Sequence[str], message: str) -> str:
    """One of the `known` names. Raises InputError with the message, and if nothing is given."""
    if isinstance(value, str) and value in known:
        return value
    said = 'nothing given' if value is None else message
    raise InputError(said, key=key, value=value, choices=known)


def whole(value: Any, key: str, least: int, most: int = MOST_STEPS) -> int:
    """A whole number from `least` to `most`. Raises InputError."""
    if isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most:
        return int(value)
    raise InputError(
        'not usable', key=key, value=value, expected=f'a whole number from {least} to {most}'
    )


def number(value: Any, key: str, least: float = -math.inf) -> float:
    """A finite number, not less than `least`. Raises InputError."""
    if is_number(value) and value >= least:
        return float(value)
    wanted = 'a finite number' if least == -math.inf else f'a finite number, {least:g} or more'
    raise InputError('not usable', key=key, value=value, expected=wanted)


def numbers(
    value: Any, key: str, count: int | None = None, largest: float = math.inf
) -> tuple[float, ...]:
    """Finite numbers, up to `largest`, in a sequence or an array (count,). Raises InputError."""
    array = isinstance(value, np.ndarray) and value.ndim == 1
    if array or (isinstance(value, Sequence) and not isinstance(value, (str, bytes))):
        listed = value.tolist() if array else list(value)
        fit = all(is_number(each) and abs(each) <= largest for each in listed)
        if fit and count in (None, len(listed)):
            return tuple(map(float, listed))
    wanted = 'a list of finite numbers' if count is None else f'{count} finite numbers'
    raise InputError('not usable', key=key, value=value, expected=wanted)


def closed(given: str, key: str) -> str:
    """The text, such as 'max(norm(knee.force))'. Raises InputError if one of its parentheses has
    no other half, with the text as it may be meant."""
    begun: list[int] = []
    for n, character in enumerate(given):
        if character == '(':
            begun.append(n)
        elif character == ')' and begun:
            begun.pop()
        elif character == ')':
            raise InputError(
                f"the ')' behind {given[:n]!r} closes nothing",
                key=key,
                value=given,
                expected=repr(given[:n] + given[n + 1 :]),
            )
    if begun:
        raise InputError(
            f"nothing closes the '(' behind {given[: begun[-1]]!r}",
            key=key,
            value=given,
            expected=repr(given + ')' * len(begun)),
        )
    return given


def steps_of(duration: Any, h: float, before: int) -> int:
    """How many steps of h (s) a duration (s) is, after those `before`. Raises InputError."""
    steps = number(duration, 'duration', 0.0) / h
    if before + steps > MOST_STEPS:
        raise InputError(
            'too many steps', key='duration', value=duration, expected=f'{MOST_STEPS} at most'
        )
    return math.floor(steps + CLOSE)


def steps_between(steps: int, samples: int) -> int:
    """How many steps to take between samples, so that about as many samples are taken in all
    `steps`: if possible, a whole part of these."""
    near = range(max(1, steps // (2 * samples)), max(1, 2 * steps // samples) + 1)
    whole = [count for count in near if steps % count == 0]
    if not whole:
        return max(1, round(steps / samples))
    return min(whole, key=lambda count: abs(math.log(steps / (count * samples))))


def samples_of(duration: float, period: float) -> int:
    """How many whole periods (s) are in a duration (s). Raises InputError if they are too many."""
    if not duration <= MOST_SAMPLES * period:
        raise InputError(
            'too many samples', key='period', value=period, expected=f'{MOST_SAMPLES} at most'
        )
    return math.floor(duration / period + CLOSE)


def times(given: Any, now: float, h: float, key: str = 'at') -> tuple[float, ...]:
    """Instants (s) that ascend from now on, for steps of h (s). Raises InputError."""
    listed, before = numbers(given, key, largest=MOST_STEPS * h), now - CLOSE * h
    for t in listed:
        if t < before:
            raise InputError(
                'lies in the past', key=key, value=t, expected='times that ascend from now on'
            )
        before = t
    return listed


def by_name(value: Any, key: str, expected: str) -> Mapping[str, Any]:
    """Values by name; none of None. Raises InputError."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise InputError('not values by name', key=key, value=value, expected=expected)
    return value


def text(value: Any, key: str) -> str:
    """A name. Raises InputError."""
    if isinstance(value, str):
        return value
    raise InputError('not a name', key=key, value=value, expected='text')


def texts(value: Any, key: str) -> tuple[str, ...]:
    """Names in a sequence. Raises InputError."""
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        return tuple(text(each, key) for each in value)
    raise InputError('not a list of names', key=key, value=value, expected='a list of names')


def truth(value: Any, key: str) -> bool:
    """Yes or no. Raises InputError."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise InputError('neither True nor False', key=key, value=value)


def checked_wrench_of(
    model: Model, name: Any, force: Any, torque: Any, at: Any, frame: Any
) -> Wrench:
    """The wrench that a call gives, if it can act there. Raises InputError."""
    D = model.layout.dimension
    named = text(name, 'name')
    vector = (0.0,) * D if force is None else numbers(force, 'force')
    moment = number(torque, 'torque') if isinstance(torque, Real) else numbers(torque, 'torque')
    point = None if at is None else text(at, 'at')
    return checked_wrench(model, named, Wrench(vector, moment, point, text(frame, 'frame')))


def checked_inputs(model: Model, effects: Sequence[Effect], inputs: Any) -> Inputs:
    """The held inputs, if all can act on this mechanism. Raises InputError."""
    if not isinstance(inputs, Inputs):
        raise InputError('not the held inputs', key='state.inputs', value=inputs)
    for kind, held, wanted in (
        ('wrenches', inputs.wrenches, Wrench),
        ('added', inputs.added, Wrench),
        ('efforts', inputs.efforts, (Real, Curve)),
        ('targets', inputs.targets, Target),
    ):
        if not isinstance(held, Mapping):
            raise InputError('not the held inputs', key=f'state.inputs.{kind}', value=held)
        for name, what in held.items():
            if not isinstance(what, wanted):
                raise InputError('not the held inputs', key=text(name, kind), value=what)
    for name, wrench in inputs.all_wrenches:
        checked_wrench_of(model, name, wrench.force, wrench.torque, wrench.at, wrench.frame)
    for name, effort in inputs.efforts.items():
        checked_effort(model, text(name, 'joint'), effort)
    for name, target in inputs.targets.items():
        checked_target(model, effects, text(name, 'joint'), target)
    return inputs


def checked_state(
    model: Model, effects: Sequence[Effect], state: Any, like: State, accounts: Sequence[str]
) -> State:
    """The state, if a run of this mechanism can continue from it; `like`: its first state.

    Works and loads may be missing, because older versions lack them. Raises InputError.
    """
    if not isinstance(state, State):
        raise InputError('not a state', key='state', value=state, expected='State')
    whole(state.step, 'state.step', 0)
    number(state.pace, 'state.pace', 0.0)
    if isinstance(state.h, float) and math.isnan(state.h):
        raise InputError('lies between two steps', key='state', expected='one of a whole step')
    number(state.h, 'state.h', 0.0)
    for name in ('q', 'qd', 'turns', 'carried'):
        _checked_array(getattr(state, name), getattr(like, name), f'state.{name}')
    if like.tangents.size:
        _checked_array(state.tangents, like.tangents, 'state.tangents')
    if not isinstance(state.works, Mapping):
        raise InputError('not works by name', key='state.works', value=state.works)
    if not isinstance(state.loads, np.ndarray) or not _is_finite(state.loads):
        raise InputError('not finite numbers', key='state.loads', value=state.loads)
    for name in accounts:
        if name in state.works:
            number(state.works[name], f'state.works.{name}')
    checked_inputs(model, effects, state.inputs)
    return state


def _checked_array(array: Any, like: np.ndarray[Any, Any], key: str) -> None:
    """Raises InputError unless it is an array of the same shape and kind, finite."""
    if not isinstance(array, np.ndarray) or array.dtype != like.dtype:
        raise InputError('not an array', key=key, value=array, expected=f'{like.dtype}')
    if array.shape != like.shape:
        raise InputError(
            'of another scene, or of other settings: as many numbers',
            key=key,
            value=array.shape,
            expected=f'{like.shape}',
        )
    if not _is_finite(array):
        raise InputError('not finite', key=key, expected='finite numbers')


def _is_finite(array: Floats) -> bool:
    return array.dtype.kind in 'fi' and bool(np.isfinite(array).all())


def controlled(model: Model, effects: Sequence[Effect]) -> dict[str, tuple[bool, bool]]:
    """Of each joint coordinate, and of each tendon that is controlled, whether an effect follows
    positions, and velocities."""
    found = dict.fromkeys(model.coordinate_names, (False, False))
    for effect in effects:
        module, name = registry.load(effect.kind), effect.target(model.coordinate_names)
        if hasattr(module, 'follows') and name is not None:
            positions, velocities = module.follows(effect.parameters)
            known = found.get(name, (False, False))
            if name in found or positions or velocities:
                found[name] = positions or known[0], velocities or known[1]
    return found


def checked_target(model: Model, effects: Sequence[Effect], joint: str, target: Target) -> Target:
    """The target, if a motor on that joint can follow it. Raises InputError otherwise."""
    known = controlled(model, effects)
    if joint not in known:
        raise InputError('unknown joint', key='target', value=joint, choices=known)
    for wanted, found, gain in zip(
        (target.position, target.velocity),
        known[joint],
        ('position_gain', 'velocity_gain'),
        strict=True,
    ):
        if not (wanted is None or isinstance(wanted, Curve) or is_number(wanted)):
            raise InputError('not a target', key=joint, value=wanted, expected='a finite number')
        if wanted is not None and not found:
            raise InputError(f'no motor with a {gain} on it', key=joint)
    return target


def checked_wrench(model: Model, name: str, wrench: Wrench) -> Wrench:
    """The wrench, if it can act on that body or point. Raises InputError otherwise."""
    layout = model.layout
    choices = [*model.body_names, *(p.name for p in model.mechanism.points if not p.fixed)]
    if name not in choices:
        raise InputError('unknown body or point', key='wrench', value=name, choices=choices)
    D = layout.dimension
    torque = wrench.torque if isinstance(wrench.torque, tuple) else (wrench.torque,)
    given = [*wrench.force, *torque]
    sizes = (D, 1 if D == 2 else 3)
    torque_fits = len(torque) == sizes[1] or not any(torque)
    if len(wrench.force) != D or not torque_fits or not all(map(is_number, given)):
        expected = 'a finite torque' if D == 2 else '3 finite torques'
        message = f'{D} finite forces and {expected}'
        raise InputError('not a wrench', key=name, value=given, expected=message)
    if wrench.frame not in ('world', 'body'):
        raise InputError('unknown frame', key=name, value=wrench.frame, choices=('world', 'body'))
    if not layout.turns(name) and (any(torque) or wrench.frame == 'body'):
        raise InputError('has no orientation: no torque on it, and no frame of its own', key=name)
    if wrench.at is not None:
        points = layout.body[name].points if name in layout.body else ()
        if wrench.at not in points:
            raise InputError('not a point of this body', key=name, value=wrench.at, choices=points)
    return wrench


def checked_effort(model: Model, joint: str, effort: float | Curve) -> float | Curve:
    """The effort, if that joint coordinate can take one. Raises InputError otherwise."""
    names = model.coordinate_names
    if joint not in names:
        raise InputError('unknown joint', key='effort', value=joint, choices=names)
    if not isinstance(effort, Curve) and not is_number(effort):
        raise InputError('not an effort', key=joint, value=effort, expected='a finite number')
    coordinate = model.coordinates[names.index(joint)]
    for name in (coordinate.joint.child, coordinate.joint.parent):
        if coordinate.is_angle and name != GROUND and not model.layout.turns(name):
            raise InputError(f'{name!r} has no orientation: no torque on it', key=joint)
    return effort if isinstance(effort, Curve) else float(effort)
