"""A recording of a machine: measurements over time, and the inputs that acted.

Times are in the simulated time of the scene, s. A log of this package has this time; other
recordings begin at 0 with the first measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.simulation.input_checks import by_name, text
from alf_ros.simulation.simulation import Simulation

KINDS = ('position', 'velocity')
FARTHEST = 1e9  # rad or m, and per s: no joint is there, and none is that fast
Numbers: TypeAlias = Sequence[float] | NDArray[Any]


@dataclass(frozen=True, eq=False)
class MeasuredChannel:
    """One measured quantity: `kind` of KINDS of a joint coordinate, rad or m, per s.

    t (N,) s, ascending; values (N,), finite.
    """

    joint: str
    kind: str
    t: Floats
    values: Floats

    @property
    def name(self) -> str:
        """The joint, and '.velocity' behind it for a velocity."""
        return self.joint if self.kind == 'position' else f'{self.joint}.velocity'


@dataclass(frozen=True, eq=False)
class HeldInput:
    """An input that acts from t (s) on, until another of the same kind and name replaces it.

    kind: 'effort', 'wrench' or 'target'; `said`: arguments of `Simulation.apply_<kind>`.
    """

    t: float
    kind: str
    name: str
    said: Mapping[str, Any]

    @property
    def entry(self) -> dict[str, Any]:
        """The entry of a journal."""
        said = {key: list(x) if isinstance(x, tuple) else x for key, x in self.said.items()}
        if self.kind == 'target':
            said = {'position': None, 'velocity': None, **said}
        if self.kind == 'wrench':
            said = {'torque': 0.0, 'frame': 'world', **said}
        said = {key: x.pieces if isinstance(x, Curve) else x for key, x in said.items()}
        return {'kind': self.kind, 'cause': 'command', 'name': self.name, **said}

    def apply(self, simulation: Simulation) -> None:
        """Hold it from the next step on. Raises InputError if it cannot act there."""
        if self.kind == 'effort':
            simulation.apply_effort(self.name, **self.said)
        elif self.kind == 'target':
            simulation.apply_target(self.name, **self.said)
        else:
            simulation.apply_wrench(self.name, **self.said)


@dataclass(frozen=True, eq=False)
class Recording:
    """`unused`: recorded names that no channel has; `damage`: a place that cannot be read, ''
    without one; `origin`: the stamp at which time is zero, ns, None if there are no stamps."""

    name: str
    channels: tuple[MeasuredChannel, ...]
    inputs: tuple[HeldInput, ...] = ()
    unused: tuple[str, ...] = ()
    damage: str = ''
    origin: int | None = None

    def __repr__(self) -> str:
        channels = ', '.join(each.name for each in self.channels[:6])
        more = ', ...' if len(self.channels) > 6 else ''
        return f'<Recording {self.name}: {channels}{more}; {len(self.inputs)} inputs>'

    @property
    def begin(self) -> float:
        """The first time at which all positions are measured, s."""
        return max(each.t[0] for each in self._positions)

    @property
    def end(self) -> float:
        """The last time at which all positions are measured, s."""
        return min(each.t[-1] for each in self._positions)

    def by_step(self, first: int, last: int, h: float) -> tuple[tuple[int, HeldInput], ...]:
        """The inputs of a run from step `first` to `last`, of h (s), each with the step from which
        it acts: the nearest one. Those held before act from `first` on; of several at a step the
        last one acts."""
        before: dict[tuple[str, str], tuple[int, HeldInput]] = {}
        inside: dict[tuple[int, str, str], tuple[int, HeldInput]] = {}
        for each in self.inputs:
            step = round(each.t / h)
            if step <= first:
                before[each.kind, each.name] = first, each
            elif step < last:
                inside[step, each.kind, each.name] = step, each
        return (*before.values(), *inside.values())

    def beside_steps(self, h: float) -> float:
        """How far inputs act from their times at most, s, at steps of h (s)."""
        acting = [each.t for each in self.inputs if self.begin <= each.t <= self.end]
        return max((abs(t - round(t / h) * h) for t in acting), default=0.0)

    @property
    def _positions(self) -> list[MeasuredChannel]:
        return [each for each in self.channels if each.kind == 'position']


def recorded(
    t: Numbers,
    positions: Mapping[str, Numbers],
    velocities: Mapping[str, Numbers] | None = None,
    inputs: Sequence[HeldInput] = (),
    name: str = 'recording',
) -> Recording:
    """A recording from arrays: t (N,) s, ascending; values (N,) by joint, NaN where none was
    measured. Raises InputError."""
    times = _array(t, 't')
    if times.ndim != 1 or not np.isfinite(times).all() or not (np.diff(times) > 0.0).all():
        raise InputError('times do not ascend', key='t', expected='(N,) s, finite')
    channels = []
    given_by_kind = (
        by_name(positions, 'positions', '{joint: values}'),
        by_name(velocities, 'velocities', '{joint: values}'),
    )
    for kind, each in zip(KINDS, given_by_kind, strict=True):
        for joint, given in each.items():
            values = _array(given, joint)
            if values.shape != times.shape:
                raise InputError(
                    'as many values as times',
                    key=joint,
                    value=values.shape,
                    expected=f'{times.shape}',
                )
            known = np.isfinite(values)
            if not known.any():
                raise InputError('nothing measured', key=joint, expected='finite numbers')
            if np.abs(values[known]).max() >= FARTHEST:
                far = float(values[known][np.abs(values[known]).argmax()])
                expected = f'less than {FARTHEST:g}'
                raise InputError(f'not a {kind}', key=joint, value=far, expected=expected)
            channels.append(MeasuredChannel(joint, kind, times[known], values[known]))
    if not given_by_kind[0]:
        raise InputError('no joint', key='positions', expected='{joint: values}')
    if not isinstance(inputs, (list, tuple)) or not all(isinstance(x, HeldInput) for x in inputs):
        raise InputError('not inputs', key='inputs', value=inputs, expected='[HeldInput(…), …]')
    return Recording(text(name, 'name'), tuple(channels), tuple(inputs))


def _array(given: Any, key: str) -> Floats:
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError('not numbers', key=key, value=given, expected='(N,)') from None
