"""The numbers that are fitted: where each begins, its bounds and its prior."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, argument_of
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.input_checks import is_number
from alf_ros.simulation.input_slopes import is_input
from alf_ros.simulation.tangent_following import checked_names
from alf_ros.studies.identification.weighed_windows import UNSEEN

DELAY = 'delay'
LONGEST_DELAY = 0.1  # s, either way
_BEYOND = 0.01  # s, by which a delay may change that is known roughly
_OTHER_SIGN = -1e-3  # of a number, to see whether a scene can have the other sign
Pair = tuple[float, float]


@dataclass(frozen=True)
class Shared:
    """The shared numbers, of the scene and then the delay (s): where each begins, its
    bounds, its prior: mean and standard deviation, which is infinite without one, and its size."""

    begin: Floats
    lower: Floats
    upper: Floats
    mean: Floats
    deviation: Floats
    size: Floats

    @property
    def weight(self) -> Floats:
        """Of the difference to the mean, in the fit."""
        return 1.0 / np.minimum(self.deviation, UNSEEN * self.size)


def names_to_fit(fit: object) -> tuple[str, ...]:
    """Names of numbers of a scene, each once. Raises InputError."""
    with argument_of('fit', 'tangents'):
        names = checked_names(fit)
    if not names:
        raise InputError('nothing to fit', key='fit', expected="['coupler.mass', …]")
    return names


def scene_to_fit(scene: Scene, names: Sequence[str]) -> Scene:
    """The scene with an effect of zero for each effort and each wrench from outside among the
    names (`overrides.with_inputs`). Raises InputError for one that the scene cannot take, and for
    one that acts in some steps alone."""
    for name in names:
        whole, steps, _ = name.partition('[')
        if steps and is_input(name, scene):
            over_time = ', or a motor with a table of its effort' * whole.startswith('joints.')
            raise InputError(
                'acts in some of the steps: a scene has no number of it',
                key='fit',
                value=name,
                expected=f'{whole}, which acts in the whole recording{over_time}',
            )
    try:
        return overrides.with_inputs(scene, names)
    except InputError as error:
        raise error.about(f'fit.{error.key}' if error.key in names else 'fit') from None


def shared_numbers(
    scene: Scene,
    names: Sequence[str],
    bounds: Mapping[str, Pair],
    priors: Mapping[str, Pair],
    delay: bool,
) -> Shared:
    """`bounds`: least and largest value by name; `priors`: mean and standard deviation.

    A number keeps its sign if the scene refuses the other one, as it does for masses and
    stiffnesses. Other scenes that cannot be, such as bodies with impossible principal moments,
    are refused where the fit tries them.
    """
    all_ = [*names, DELAY] if delay else list(names)
    for what, given in (('bounds', bounds), ('priors', priors)):
        for name, pair in given.items():
            if name not in all_:
                raise InputError('is not fitted', key=what, value=name, choices=all_)
            _check_pair(what, name, pair)
    begin = [overrides.number(scene, name, 'fit') for name in names] + [0.0] * delay
    together = {name: repr(value) for name, value in zip(names, begin, strict=False)}
    overrides.with_changes(scene, together, 'fit ')  # refuses two names of one number
    lower, upper = np.full(len(all_), -np.inf), np.full(len(all_), np.inf)
    mean, deviation = np.array(begin), np.full(len(all_), np.inf)
    for k, name in enumerate(all_):
        if delay and name == DELAY:
            lower[k], upper[k] = -LONGEST_DELAY, LONGEST_DELAY
        elif begin[k] != 0.0 and _keeps_sign(scene, name, begin[k]):
            lower[k], upper[k] = (0.0, np.inf) if begin[k] > 0.0 else (-np.inf, 0.0)
        lower[k], upper[k] = bounds.get(name, (lower[k], upper[k]))
        mean[k], deviation[k] = priors.get(name, (mean[k], deviation[k]))
        if not lower[k] < begin[k] < upper[k]:
            raise InputError(
                'the scene begins outside the bounds',
                key=f'bounds.{name}',
                value=begin[k],
                expected=f'more than {lower[k]:g} and less than {upper[k]:g}',
            )
    size = _sizes(np.array(begin), upper - lower, deviation)
    return Shared(np.array(begin), lower, upper, mean, deviation, size)


def widest_margin(shared: Shared, delay: bool) -> float:
    """The margin (s) at the ends of windows, for any delay within its bounds."""
    if not delay:
        return 0.0
    widest = float(np.abs([shared.lower[-1], shared.upper[-1]]).max())
    return widest if np.isfinite(widest) else LONGEST_DELAY


def near_margin(shared: Shared, delay: float) -> float:
    """The same for delays (s) near this one."""
    return min(widest_margin(shared, True), abs(delay) + _BEYOND)


def within_margin(shared: Shared, margin: float) -> Shared:
    """With bounds of the delay within a margin (s)."""
    lower, upper = shared.lower.copy(), shared.upper.copy()
    lower[-1], upper[-1] = max(lower[-1], -margin), min(upper[-1], margin)
    return replace(shared, lower=lower, upper=upper)


def _keeps_sign(scene: Scene, name: str, value: float) -> bool:
    try:
        overrides.with_changes(scene, {name: repr(_OTHER_SIGN * value)})
    except InputError:
        return True
    return False


def _sizes(begin: Floats, width: Floats, deviation: Floats) -> Floats:
    """The size of each number: its value in the scene; of a number that is zero there, the
    deviation of its prior or the width of its bounds, else 1 in its unit."""
    found = np.abs(begin)
    for k in np.flatnonzero(found == 0.0):
        found[k] = next(x for x in (deviation[k], width[k], 1.0) if np.isfinite(x))
    return np.asarray(found)


def _check_pair(what: str, name: str, pair: Any) -> None:
    expected = {
        'bounds': '(least, largest), least < largest',
        'priors': '(mean, standard deviation), deviation above 0',
    }[what]
    good = isinstance(pair, Sequence) and len(pair) == 2 and all(_is_bound(x) for x in pair)
    fits = good and (pair[0] < pair[1] if what == 'bounds' else is_number(pair[0]) and pair[1] > 0)
    if not fits:
        message = 'not usable' if good else 'not two numbers'
        raise InputError(message, key=f'{what}.{name}', value=pair, expected=expected)


def _is_bound(x: Any) -> bool:
    return is_number(x) or (isinstance(x, float) and math.isinf(x))
