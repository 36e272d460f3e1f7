"""Outputs of each member: numbers and histories of the quantities that a `Run` has.

An output reads some quantities and makes arrays of them whose shape is known beforehand. The names
of quantities are the names of `alf_ros.record`, and `norm(crank_pin.force)` is the magnitude of
one.

    max(norm(crank_pin.force))            the largest value, and when it is reached
    min(energy), final(energy), mean(energy), integral(energy)
    energy                                its history, at the period of the study
    {at: [0.5, 1.0], of: points.B}        its values at instants, s
    {crossing: joints.knee.position, value: 0.5}     when it goes through a value
    {passes: 3}                           when singular positions are passed, the first 3
    {function: 'peaks.py:peak', reads: [energy]}     a number that a function makes of the Run
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.inspection.run import Run, RunsTogether
from alf_ros.simulation.input_checks import CLOSE, choice, closed
from alf_ros.simulation.quantities import ONE_OF_MANY
from alf_ros.simulation.singular_passes import Pass
from alf_ros.studies.ensemble.user_function import UserFunction

_CALL = re.compile(r'(\w+)\((.+)\)')
_FOLDED = ('max', 'min', 'final', 'mean', 'integral')
_TOGETHER = ('history', 'final', 'max', 'min', 'at')  # read of many members at once
_KEYS = ('at', 'crossing', 'passes', 'function')
_OPTIONS = {
    'at': ('of',),
    'crossing': ('value', 'direction', 'count'),
    'passes': (),
    'function': ('reads',),
}
_CALLS = (*_FOLDED, 'norm')
_NAMES = {*_KEYS, *_CALLS, *(name for names in _OPTIONS.values() for name in names)}
DIRECTIONS = ('both', 'up', 'down')
LABEL = re.compile(r'[A-Za-z][\w.-]*')
_OF_STORES = ('member', 'reason', 't')


@dataclass(frozen=True)
class LabelledArray:
    """One array of a Dataset: for each member numbers of this shape, along `dims` by name.

    `along`: the coordinates of those dims that have some. `text`: characters of each, if it holds
    texts. `is_indeterminate`: it follows from reactions that are one of many.
    """

    name: str
    shape: tuple[int, ...] = ()
    dims: tuple[str, ...] = ()
    unit: str = ''
    along: Mapping[str, Sequence[float | str]] = field(default_factory=dict)
    text: int = 0
    is_indeterminate: bool = False

    @property
    def dtype(self) -> str:
        """Of the array, as numpy and zarr write it."""
        return f'<U{self.text}' if self.text else '<f8'

    @property
    def attributes(self) -> dict[str, str]:
        """Of the array in a Dataset."""
        units = {'units': self.unit} if self.unit else {}
        return {**units, 'indeterminate': ONE_OF_MANY} if self.is_indeterminate else units

    @property
    def numbers(self) -> dict[str, tuple[int, ...]]:
        """Where its single numbers are, by name; of a history, or of values at instants, none."""
        if self.dims and self.dims[0] in ('t', f't_{self.name}'):
            return {}
        found: dict[str, tuple[int, ...]] = {}
        for place in np.ndindex(*self.shape):
            ends = [
                str(self.along[dim][n] if dim in self.along else n + 1)
                for dim, n in zip(self.dims, place, strict=True)
            ]
            found['.'.join([self.name, *ends])] = place
        return found


@dataclass(frozen=True)
class KeptOutput:
    """One output, as data: `kind` of `_FOLDED`, 'history', or of `_KEYS`.

    `quantity`: what it reads; `norm`: of which the magnitude is taken. `times` (s), `value`,
    `direction`, `count`, `function` and `reads` belong to single kinds.
    """

    label: str
    kind: str
    quantity: str = ''
    norm: bool = False
    times: tuple[float, ...] = ()
    value: float = 0.0
    direction: str = 'both'
    count: int = 1
    function: UserFunction | None = None
    reads: tuple[str, ...] = ()

    @property
    def data(self) -> dict[str, Any]:
        """The same as plain data, for the manifest of a store."""
        found = {name: value for name, value in vars(self).items() if name in _FIELDS}
        found['function'] = self.function.digest if self.function else None
        return found

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that are read."""
        return (self.quantity,) if self.quantity else self.reads

    @property
    def reads_all(self) -> bool:
        """Whether it reads the samples of the whole period."""
        return self.kind not in ('final', 'at', 'passes')

    def variables(self, run: Run, times: Floats) -> tuple[LabelledArray, ...]:
        """The arrays it makes; `run`: one sample of the scene; `times` (s) of the study's period.

        Raises InputError for a quantity that the scene does not have, or of the wrong shape.
        """
        is_open = any(run.is_indeterminate(name) for name in self.quantities)
        return tuple(replace(each, is_indeterminate=is_open) for each in self._arrays(run, times))

    def _arrays(self, run: Run, times: Floats) -> tuple[LabelledArray, ...]:
        label = self.label
        if self.kind == 'passes':
            number = LabelledArray(f'{label}_number')
            return number, LabelledArray(f'{label}_t', (self.count,), (f'{label}_n',), 's')
        if self.kind == 'function':
            for name in self.reads:
                run[name]
            return (LabelledArray(label),)
        axes, unit, axis = self._axes(run)
        shape = (len(axes),) if axes else ()
        along: dict[str, Sequence[float | str]] = {axis: axes} if axes else {}
        dims = tuple(along)
        if self.kind == 'crossing':
            if axes:
                raise InputError('not a single number', key=label, value=self.quantity)
            return (LabelledArray(f'{label}_t', (self.count,), (f'{label}_n',), 's'),)
        if self.kind in ('history', 'at'):
            mine = 't' if self.kind == 'history' else f't_{label}'
            instants = times.tolist() if self.kind == 'history' else list(self.times)
            along = {mine: instants, **along}
            return (LabelledArray(label, (len(instants), *shape), (mine, *dims), unit, along),)
        if self.kind == 'integral':
            unit = ', '.join(f'{each} s'.strip() for each in unit.split(', '))
        values = LabelledArray(label, shape, dims, unit, along)
        if self.kind in ('max', 'min'):
            return values, LabelledArray(f'{label}_t', shape, dims, 's', along)
        return (values,)

    def _axes(self, run: Run) -> tuple[tuple[str, ...], str, str]:
        """The components of the quantity, its unit, and the name of the axis along which the
        components lie."""
        unit, columns = run.unit(self.quantity), tuple(run.columns(self.quantity))
        axis = 'pose' if columns[0].startswith('body_poses.') else 'axis'
        if run[self.quantity].ndim == 1:
            if self.norm:
                raise InputError('a single number has no norm', key=self.label)
            return (), unit, axis
        if self.norm and axis == 'pose':
            raise InputError('a pose has no norm: its components have other units', key=self.label)
        names = tuple(name.rpartition('.')[2] for name in columns)
        return (() if self.norm else names), unit, axis

    def read(self, run: Run, grid: Integers, passes: Sequence[Pass]) -> tuple[Floats, ...]:
        """The arrays of one member. `grid`: the samples of the study's period in `run`; `passes`
        of the whole run. What a function raises comes through."""
        if self.kind == 'passes':
            return np.array(float(len(passes))), _first([each.t for each in passes], self.count)
        if self.kind == 'function':
            assert self.function is not None
            return (np.array(float(self.function.called(run)), dtype=float),)
        t, values = run.t, run[self.quantity]
        if self.norm:
            values = np.sqrt((values * values).sum(axis=1))
        if self.kind == 'at':
            return (values[np.searchsorted(t, np.array(self.times) - SAME)],)
        t, values = t[grid], values[grid]  # what other outputs are looked at changes nothing
        if self.kind == 'crossing':
            return (_first(self._crossings(t, values), self.count),)
        if self.kind == 'history':
            return (values,)
        if self.kind == 'final':
            return (values[-1],)
        if self.kind in ('max', 'min'):
            place = values.argmax(axis=0) if self.kind == 'max' else values.argmin(axis=0)
            return np.take_along_axis(values, place[None], axis=0)[0], t[place]
        total = integral(t, values)
        return (total / (t[-1] - t[0]) if self.kind == 'mean' else total,)

    def read_together(self, runs: RunsTogether, grid: Integers) -> tuple[Floats, ...] | None:
        """`read` of many members, with members first; None if each is read by itself."""
        if self.kind not in _TOGETHER:
            return None
        t, values = runs.t, runs[self.quantity]
        if self.norm:
            values = np.ascontiguousarray(values)  # a sum in the order of one member
            values = np.sqrt((values * values).sum(axis=2))
        if self.kind == 'at':
            return (values[:, np.searchsorted(t, np.array(self.times) - SAME)],)
        t, values = t[grid], values[:, grid]
        if self.kind == 'history':
            return (values,)
        if self.kind == 'final':
            return (values[:, -1],)
        place = values.argmax(axis=1) if self.kind == 'max' else values.argmin(axis=1)
        return np.take_along_axis(values, place[:, None], axis=1)[:, 0], t[place]

    def _crossings(self, t: Floats, values: Floats) -> list[float]:
        """When the values go through `value`: of the cubic through the four nearest samples."""
        off = values - self.value
        up, down = (off[:-1] < 0.0) & (off[1:] >= 0.0), (off[:-1] > 0.0) & (off[1:] <= 0.0)
        wanted = {'up': up, 'down': down, 'both': up | down}[self.direction]
        return [_root(t, off, n) for n in np.flatnonzero(wanted)[: self.count].tolist()]


_FIELDS = tuple(KeptOutput.__dataclass_fields__)
SAME = 1e-9  # s


def _first(found: Sequence[float], count: int) -> Floats:
    """The first `count`; NaN for those that are not there."""
    row = np.full(count, math.nan)
    row[: len(found)] = found[:count]
    return row


def _root(t: Floats, off: Floats, n: int) -> float:
    """Where `off` vanishes between samples n and n + 1, by bisection of the interpolant."""
    first = min(max(n - 1, 0), max(t.size - 4, 0))
    ts, ys = t[first : first + 4], off[first : first + 4]
    low, high, falls = float(t[n]), float(t[n + 1]), bool(off[n] > 0.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        weights = [
            math.prod((middle - b) / (a - b) for b in ts.tolist() if b != a) for a in ts.tolist()
        ]
        here = math.fsum(w * y for w, y in zip(weights, ys.tolist(), strict=True))
        if (here > 0.0) == falls and here != 0.0:
            low = middle
        else:
            high = middle
    return high


def integral(t: Floats, values: Floats) -> Floats:
    """∫ dt over equally spaced samples, by Simpson's rule; of an odd number of intervals the last
    three by the 3/8 rule, and of a single one by the trapezoid. A first or a last interval
    that is shorter has the integral of the parabola through the three samples at its end."""
    parts = [
        factor * np.tensordot(weights, values[places], axes=(0, 0))
        for places, weights, factor in _rules(t)
    ]
    return np.asarray(sum(parts[1:], parts[0]))


def integral_weights(t: Floats) -> Floats:
    """(N,) derivatives of `integral` by the values at N samples, s."""
    found = np.zeros(t.size)
    for places, weights, factor in _rules(t):
        found[places] += factor * weights
    return found


def _rules(t: Floats, first: int = 0) -> Iterator[tuple[Integers, Floats, float]]:
    """The rules of an integral over samples, which are counted from `first` on: of each its
    places among them, the weights of the values there, and a common factor (s)."""
    n = t.size - 1
    places = np.arange(first, first + n + 1)
    is_short_last = n > 1 and t[-1] - t[-2] < (1.0 - CLOSE) * (t[-2] - t[-3])
    is_short_first = n > 1 and t[1] - t[0] < (1.0 - CLOSE) * (t[2] - t[1])
    if n == 2 and (is_short_first or is_short_last):  # both have the parabola
        yield places[::-1], *_last_interval(-t[::-1])
        yield places, *_last_interval(t)
    elif is_short_last:
        yield from _rules(t[:-1], first)
        yield places[-3:], *_last_interval(t[-3:])
    elif is_short_first:
        yield places[2::-1], *_last_interval(-t[2::-1])
        yield from _rules(t[1:], first + 1)
    elif n < 2:
        yield places[[0, -1]], np.ones(2), float(t[-1] - t[0]) * 0.5
    else:
        weights = np.zeros(n + 1)
        even = n if n % 2 == 0 else n - 3
        weights[1:even:2] = 4 / 3
        weights[0:even:2] += 1 / 3
        weights[2 : even + 1 : 2] += 1 / 3
        if even < n:
            weights[even:] += (3 / 8, 9 / 8, 9 / 8, 3 / 8)
        yield places, weights, float(t[-1] - t[0]) / n


def _last_interval(t: Floats) -> tuple[Floats, float]:
    """Weights and factor (s) of ∫ dt of the parabola through three samples over the second of
    their intervals."""
    a, b = np.diff(t)
    weights = np.array([-(b**2) / (a * (a + b)), (3.0 * a + b) / a, (3.0 * a + 2.0 * b) / (a + b)])
    return weights, float(b) / 6.0


# ----------------------------------------------------------------------------------------- reading


def outputs(data: Any) -> tuple[KeptOutput, ...]:
    """The outputs of a list of names and mappings, or of a mapping by label; a Python function
    may stand for `{function: …}`. Raises InputError."""
    if isinstance(data, Mapping):
        found = [_output(item, str(label)) for label, item in data.items()]
    elif isinstance(data, Sequence) and not isinstance(data, str):
        found = [_output(item, None) for item in data]
    else:
        raise InputError('not a list', key='outputs', value=data, expected='names of quantities')
    if not found:
        raise InputError('nothing to keep', key='outputs', expected='names of quantities')
    for one in found:
        if not LABEL.fullmatch(one.label):
            expected = 'letters, digits, . _ -, beginning with a letter'
            raise InputError('not a label', key='outputs', value=one.label, expected=expected)
        if one.label in _OF_STORES:
            raise InputError(
                'a label that each store has', key='outputs', value=one.label, expected='another'
            )
    labels = [one.label for one in found]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise InputError('two outputs of one label', key='outputs', value=twice)
    return tuple(found)


def _output(data: Any, label: str | None) -> KeptOutput:
    if isinstance(data, KeptOutput):
        return data
    if isinstance(data, str):
        return _called(data, label)
    if callable(data):
        data = {'function': data}
    key = next((key for key in _KEYS if isinstance(data, Mapping) and key in data), None)
    if key is None:
        slips = [name for name in data if name not in _NAMES] if isinstance(data, Mapping) else []
        if slips:
            key, choices = label or 'outputs', (*_KEYS, *_CALLS)
            raise InputError('unknown key', key=key, value=slips[0], choices=choices)
        if isinstance(data, Mapping) and len(data) == 1:
            ((kind, of),) = data.items()
            return _called(f'{kind}({of})', label)
        raise InputError('not an output', key=label or 'outputs', value=data, expected='max(NAME)')
    for name in data:
        if name != key and name not in _OPTIONS[key]:
            raise InputError('unknown key', key=key, value=name, choices=_OPTIONS[key])
    return _READ[key](data, label)


def _called(text: str, label: str | None) -> KeptOutput:
    """`max(norm(knee.force))`, or a name alone: its history."""
    kind, inner = 'history', closed(text.strip(), 'outputs')
    found = _CALL.fullmatch(inner)
    if found and found[1] != 'norm':
        kind, inner = found[1], found[2].strip()
        if kind not in _FOLDED:
            raise InputError('no such output', key='outputs', value=kind, choices=_CALLS)
    quantity, norm = _measured(inner)
    named = '_'.join((['norm'] if norm else []) + [quantity])
    return KeptOutput(
        label or (named if kind == 'history' else f'{kind}_{named}'), kind, quantity, norm
    )


def _measured(text: Any, key: str = 'outputs') -> tuple[str, bool]:
    """The quantity in `norm(quantity)`, or in a plain name; and whether the norm is meant."""
    if not isinstance(text, str):
        raise InputError('not the name of a quantity', key=key, value=text)
    found = _CALL.fullmatch(closed(text.strip(), key))
    if found is None:
        return text.strip(), False
    if found[1] != 'norm':
        raise InputError('no such function', key='outputs', value=found[1], choices=('norm',))
    return found[2].strip(), True


def _number(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError('not a number', key=f'outputs.{key}', value=value)
    return float(value)


def _count(value: Any, key: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 1000:
        raise InputError('not a count', key=f'outputs.{key}', value=value, expected='1 to 1000')
    return value


def _at(data: Mapping[str, Any], label: str | None) -> KeptOutput:
    given = data['at'].tolist() if hasattr(data['at'], 'tolist') else data['at']
    given = given if isinstance(given, Sequence) else [given]
    times = tuple(_number(t, 'at') for t in given)
    if not times or any(b <= a for a, b in zip(times, times[1:], strict=False)) or times[0] < 0:
        raise InputError(
            'not instants', key='at', value=data['at'], expected='ascending s, from 0'
        )
    quantity, norm = _measured(data.get('of'), 'outputs.of')
    named = '_'.join((['norm'] if norm else []) + [quantity])
    return KeptOutput(label or f'{named}_at', 'at', quantity, norm, times=times)


def _crossing(data: Mapping[str, Any], label: str | None) -> KeptOutput:
    quantity, norm = _measured(data['crossing'])
    direction = data.get('direction', 'both')
    choice(direction, 'direction', DIRECTIONS, 'no direction')
    return KeptOutput(
        label or f'{quantity}_crossing',
        'crossing',
        quantity,
        norm,
        value=_number(data.get('value', 0.0), 'value'),
        direction=direction,
        count=_count(data.get('count', 1), 'count'),
    )


def _passes(data: Mapping[str, Any], label: str | None) -> KeptOutput:
    return KeptOutput(label or 'passes', 'passes', count=_count(data['passes'], 'passes'))


def _function(data: Mapping[str, Any], label: str | None) -> KeptOutput:
    function = UserFunction.of(data['function'])
    reads = data.get('reads', [])
    listed = isinstance(reads, Sequence) and not isinstance(reads, str)
    if not listed or not all(isinstance(name, str) for name in reads):
        raise InputError('not a list of names', key='reads', value=reads)
    return KeptOutput(label or function.name, 'function', function=function, reads=tuple(reads))


_READ: dict[str, Callable[[Mapping[str, Any], str | None], KeptOutput]] = {
    'at': _at,
    'crossing': _crossing,
    'passes': _passes,
    'function': _function,
}
