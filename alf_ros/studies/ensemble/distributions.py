"""Values of a varied name: a distribution, or a list.

A distribution is a function from u in (0, 1) to a number, its quantile function. It is evaluated
for one member at a time, never on an array: so the number of a member has the same bits in every
process and beside any other members.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import special

from alf_ros.errors import InputError

Value = str  # of a varied name, as `fork --set` takes it: text in YAML
_NEAR = 0.8  # a slip of the pen: scipy has so many laws that another name is near most words
_OPEN = {'.inf': math.inf, '+.inf': math.inf, '-.inf': -math.inf}  # in YAML


def _uniform(u: float, low: float, high: float) -> float:
    return low + u * (high - low)


def _normal(u: float, mean: float, deviation: float) -> float:
    return mean + deviation * float(special.ndtri(u))


def _lognormal(u: float, median: float, sigma: float) -> float:
    return median * math.exp(sigma * float(special.ndtri(u)))


def _triangular(u: float, low: float, mode: float, high: float) -> float:
    part = (mode - low) / (high - low)
    if u < part:
        return low + math.sqrt(u * (high - low) * (mode - low))
    return high - math.sqrt((1.0 - u) * (high - low) * (high - mode))


@dataclass(frozen=True)
class _Law:
    """A quantile function, its numbers by name, and what they must satisfy."""

    quantile: Callable[..., float]
    numbers: tuple[str, ...]
    fits: Callable[..., bool]
    expected: str


LAWS = {
    'uniform': _Law(_uniform, ('low', 'high'), lambda a, b: a < b, 'low < high'),
    'normal': _Law(
        _normal, ('mean', 'deviation'), lambda _, s: s > 0.0, 'mean, deviation above 0'
    ),
    'lognormal': _Law(
        _lognormal, ('median', 'sigma'), lambda m, s: m > 0.0 < s, 'median and sigma above 0'
    ),
    'triangular': _Law(
        _triangular,
        ('low', 'mode', 'high'),
        lambda a, m, b: a <= m <= b and a < b,
        'low <= mode <= high, low < high',
    ),
}


@dataclass(frozen=True)
class Distribution:
    """A law of `LAWS`, or a continuous distribution of scipy.stats, with its numbers by name.

    Raises InputError for an unknown law, numbers that are missing or too many, or that the law
    does not take.
    """

    law: str
    numbers: tuple[tuple[str, float], ...]

    def __post_init__(self) -> None:
        given = {name: _plain(number, f'{self.law}.{name}') for name, number in self.numbers}
        object.__setattr__(self, 'numbers', tuple(given.items()))
        for name, number in given.items():  # a side of `truncnorm` may be open
            if math.isnan(number) or (math.isinf(number) and self.law in LAWS):
                key, expected = f'{self.law}.{name}', 'a finite number'
                raise InputError('not finite', key=key, value=number, expected=expected)
        if self.law in LAWS:
            law = LAWS[self.law]
            if set(given) != set(law.numbers):
                raise InputError(
                    'wrong parameters',
                    key=self.law,
                    value=sorted(given),
                    expected=str(law.numbers),
                )
            if not law.fits(*(given[name] for name in law.numbers)):
                raise InputError(
                    'impossible parameters', key=self.law, value=given, expected=law.expected
                )
            return
        names = _names_of_scipy(self.law)
        for name in given:
            if name not in names:
                raise InputError('unknown key', key=self.law, value=name, choices=names)
        missing = [name for name in names if name not in (*given, 'loc', 'scale')]
        if missing:
            raise InputError(f'missing key {missing[0]!r}', key=self.law)
        if not math.isfinite(self.at(0.5)):
            raise InputError('impossible parameters', key=self.law, value=given)

    @cached_property
    def _quantile(self) -> Callable[[float], float]:
        given = dict(self.numbers)
        if self.law in LAWS:
            law = LAWS[self.law]
            ordered = [float(given[name]) for name in law.numbers]
            return lambda u: law.quantile(u, *ordered)
        frozen = _of_scipy(self.law)(**given)
        return lambda u: float(frozen.ppf(u))

    def __getstate__(self) -> dict[str, Any]:
        return {'law': self.law, 'numbers': self.numbers}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)

    def at(self, u: float) -> float:
        """The quantile of u, 0 < u < 1: infinite or NaN where it exceeds the range of numbers, or
        where scipy does not find it. No scene takes such a number, so the member says it."""
        try:
            with np.errstate(all='ignore'):
                return self._quantile(u)
        except OverflowError:
            return math.inf
        except (ArithmeticError, RuntimeError, ValueError):  # of a root that scipy searches
            return math.nan

    @property
    def data(self) -> Any:
        """Plain data from which `distribution` makes the same distribution."""
        return {self.law: dict(self.numbers)}


def _plain(number: Any, key: str) -> float:
    """A number of Python, numpy or YAML as one of Python. Raises InputError."""
    found = number.item() if isinstance(number, np.generic) else number
    if isinstance(found, str):
        found = _OPEN.get(found.lower(), found)
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise InputError('not a number', key=key, value=number, expected='a number')
    return found


def _of_scipy(law: str) -> Any:
    """A continuous distribution of scipy.stats. Raises InputError if it has none of this name."""
    from scipy import stats

    found = getattr(stats, law, None)
    if not isinstance(found, stats.rv_continuous):
        near = difflib.get_close_matches(law, vars(stats), 1, _NEAR)
        near = [name for name in near if isinstance(getattr(stats, name), stats.rv_continuous)]
        raise InputError('no such distribution', value=law, choices=[*LAWS, *near])
    return found


def _names_of_scipy(law: str) -> tuple[str, ...]:
    """The names of the numbers of a distribution of scipy.stats, in its order."""
    shapes = (_of_scipy(law).shapes or '').replace(' ', '').split(',')
    return (*filter(None, shapes), 'loc', 'scale')


def uniform(low: float, high: float) -> Distribution:
    """Equally likely between `low` and `high`."""
    return Distribution('uniform', (('low', low), ('high', high)))


def normal(mean: float, deviation: float) -> Distribution:
    """Gaussian, of this mean and standard deviation."""
    return Distribution('normal', (('mean', mean), ('deviation', deviation)))


def lognormal(median: float, sigma: float) -> Distribution:
    """median e^(sigma z), with z of the standard normal distribution."""
    return Distribution('lognormal', (('median', median), ('sigma', sigma)))


def triangular(low: float, mode: float, high: float) -> Distribution:
    """A density that rises from `low` to `mode` and falls to `high`."""
    return Distribution('triangular', (('low', low), ('mode', mode), ('high', high)))


def distribution(data: Any, key: str) -> Distribution:
    """The distribution of `{law: [numbers]}`, of `{law: {name: number}}`, a Distribution itself,
    or a frozen continuous distribution of scipy.stats. Raises InputError, which says `key`."""
    if isinstance(data, Distribution):
        return data
    try:
        if isinstance(data, Mapping) and len(data) == 1:
            ((law, numbers),) = data.items()
            if isinstance(numbers, Sequence) and not isinstance(numbers, str):
                names = LAWS[law].numbers if law in LAWS else ()
                if not names:
                    _of_scipy(str(law))  # a slip of the pen comes before the form of its numbers
                if len(names) != len(numbers):
                    expected = f'{names}' if names else '{name: number} of scipy.stats'
                    raise InputError('wrong parameters', key=law, value=numbers, expected=expected)
                numbers = dict(zip(names, numbers, strict=True))
            if isinstance(numbers, Mapping):
                return Distribution(str(law), tuple(numbers.items()))
        frozen = getattr(data, 'dist', None)
        if frozen is not None and hasattr(data, 'args') and hasattr(data, 'kwds'):
            known = _of_scipy(frozen.name)
            if type(known) is not type(frozen) or (known.a, known.b) != (frozen.a, frozen.b):
                # one's own law, under the name of another
                raise InputError('not a distribution of scipy.stats', value=frozen.name)
            told = dict(zip(_names_of_scipy(frozen.name), data.args, strict=False))
            given = {**told, **data.kwds}
            numbers = {k: float(_plain(v, f'{frozen.name}.{k}')) for k, v in given.items()}
            if frozen.name == 'uniform':  # ours has other numbers
                low = numbers.get('loc', 0.0)
                return uniform(low, low + numbers.get('scale', 1.0))
            return Distribution(frozen.name, tuple(numbers.items()))
    except InputError as error:
        raise InputError(str(error), key=key) from None
    raise InputError(
        'not a distribution', key=key, value=data, expected='{normal: [mean, deviation]} or a list'
    )


def value(given: Any, key: str) -> Value:
    """A value as the text that `fork --set` takes: numbers keep all their digits."""
    if isinstance(given, bool):
        return 'true' if given else 'false'
    if isinstance(given, str):
        return given
    if hasattr(given, 'tolist'):
        given = given.tolist()
    if isinstance(given, (int, float)):
        return repr(given)
    if isinstance(given, Sequence):
        return f'[{", ".join(value(item, key) for item in given)}]'
    raise InputError('not a value', key=key, value=given, expected='a number, a text or a list')
