"""Which numbers a member has: from the seed and the index of the member alone.

Every sampling is a function `values(k)`, so a member needs no member before it. The scheme, where
u is a number in (0, 1) for each varied name:

- `random`: u is word k of the Philox4x64 stream of numpy with the key (seed, digest of the name),
  so what else varies, and the number of members, change nothing;
- `lhs`: a Latin hypercube. u = (π(k) + r) / n, where π is a permutation of the n members from such
  a stream, and r word k of another. The number of members is part of the scheme;
- `sobol`: point k of the Sobol' sequence of scipy, scrambled with the seed;
- `saltelli`: the points A, B and AB_1 ... AB_d from which Sobol' indices are estimated, of a
  Sobol' sequence in 2 d dimensions: member k is number k mod (d + 2) of point k // (d + 2);
- `grid`: all combinations of lists, of which the last name changes fastest;
- `table`: row k of lists that are equally long.

From a list the first four take each value equally likely.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.simulation.input_checks import choice
from alf_ros.studies.ensemble.distributions import Distribution, Value, value

SAMPLINGS = ('random', 'lhs', 'sobol', 'saltelli', 'grid', 'table')
COUNTED = ('grid', 'table')  # they say themselves how many members there are
MOST_MEMBERS = 2**30  # what the Sobol' sequence of scipy has

_WORDS = 256  # of a stream that are read at once, four of each block

Varied = Distribution | tuple[Value, ...]


def sampling_named(kind: object) -> None:
    """Raises InputError for what names no sampling."""
    choice(kind, 'sampling', SAMPLINGS, 'no such sampling')


class Sampling:
    """The varied values of each of `members` members. Raises InputError for what cannot be."""

    def __init__(
        self, kind: str, vary: Mapping[str, Varied], members: int | None, seed: int
    ) -> None:
        sampling_named(kind)
        if not vary:
            raise InputError('nothing varies', key='vary', expected='{name: distribution or list}')
        self.kind, self.seed, self.names = kind, seed, tuple(vary)
        self._vary = dict(vary)
        counted = self._counted() if kind in COUNTED else None
        if members is None and counted is None:
            raise InputError('how many?', key='members', expected='a whole number')
        self.members: int = counted or 0 if members is None else members
        if counted is not None and self.members > counted:
            raise InputError(
                f'a {kind} has fewer', key='members', value=members, expected=f'{counted} at most'
            )
        if not 1 <= self.members <= MOST_MEMBERS:
            raise InputError('not usable', key='members', value=members, expected='1 to 2^30')
        if kind == 'saltelli':
            base = self.members / (len(vary) + 2)
            if base != int(base) or math.log2(base) % 1.0:
                raise InputError(
                    'not usable for Sobol indices',
                    key='members',
                    value=members,
                    expected=f'{len(vary) + 2} times a power of 2',
                )

    def _counted(self) -> int:
        lengths = {}
        for name, varied in self._vary.items():
            if isinstance(varied, Distribution):
                text = f'a distribution in a {self.kind}'
                raise InputError(text, key=f'vary.{name}', expected='a list')
            lengths[name] = len(varied)
        if self.kind == 'grid':
            return math.prod(lengths.values())
        if len(set(lengths.values())) > 1:
            raise InputError('lists of other lengths', key='vary', value=lengths)
        return min(lengths.values())

    def values(self, k: int) -> dict[str, Value]:
        """The value of each name for member k, as `fork --set` takes it."""
        if self.kind == 'table':
            return {name: self._listed(name)[k] for name in self.names}
        if self.kind == 'grid':
            found = {}
            for name in reversed(self.names):
                k, at = divmod(k, len(self._listed(name)))
                found[name] = self._listed(name)[at]
            return {name: found[name] for name in self.names}
        return {
            name: _value(self._vary[name], u)
            for name, u in zip(self.names, self.unit(k).tolist(), strict=True)
        }

    def _listed(self, name: str) -> tuple[Value, ...]:
        varied = self._vary[name]
        assert not isinstance(varied, Distribution)
        return varied

    def unit(self, k: int) -> Floats:
        """u of each name for member k, (names,), of the samplings that have one."""
        if self.kind == 'random':
            return np.array([self._word(name, k) for name in self.names])
        if self.kind == 'lhs':
            within = [self._word(f'within {name}', k) for name in self.names]
            order = [order[k] for order in self._orders.values()]
            return np.minimum((np.array(order) + within) / self.members, 1.0 - 2.0**-53)
        names = len(self.names)
        if self.kind == 'sobol':
            return self._sobol(k, names)
        point, role = divmod(k, names + 2)
        both = self._sobol(point, 2 * names)
        a, b = both[:names], both[names:]
        if role < 2:
            return b if role else a
        a[role - 2] = b[role - 2]
        return a

    def _word(self, name: str, k: int) -> float:
        """Word k of the stream of a name, as a number in (0, 1): its 52 high bits, and a half."""
        first = k - k % _WORDS
        known = self._words.get(name)
        if known is None or known[0] != first:
            stream = np.random.Philox(key=[self.seed, _key(name)], counter=first // 4)
            known = self._words[name] = first, stream.random_raw(_WORDS).tolist()
        return (known[1][k - first] >> 12) * 2.0**-52 + 2.0**-53

    @cached_property
    def _words(self) -> dict[str, tuple[int, list[int]]]:
        """Of each stream the words read last, and the number of the first of them."""
        return {}

    @cached_property
    def _orders(self) -> dict[str, Integers]:
        return {
            name: np.random.Generator(
                np.random.Philox(key=[self.seed, _key(f'order {name}')])
            ).permutation(self.members)
            for name in self.names
        }

    def _sobol(self, k: int, dimensions: int) -> Floats:
        # A sequence is walked forwards: from the member before, or else from the first.
        engine, at = self._sequence
        if engine is None or at > k:
            from scipy.stats import qmc

            engine, at = qmc.Sobol(dimensions, scramble=True, rng=self.seed), 0
        if k > at:
            engine.fast_forward(k - at)
        found: Floats = engine.random(1)[0]
        self._sequence = engine, k + 1
        return found + 2.0**-31  # the middle of a cell: 0 has no quantile

    _sequence: tuple[Any, int] = (None, 0)


def _value(varied: Varied, u: float) -> Value:
    if isinstance(varied, Distribution):
        return value(varied.at(u), varied.law)
    return varied[min(int(u * len(varied)), len(varied) - 1)]


def _key(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], 'little')
