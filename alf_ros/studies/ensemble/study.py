"""A study: a scene, the names that vary in it, and the outputs of each member."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import user_file
from alf_ros.errors import InputError
from alf_ros.inspection.run import Run
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.distributions import Distribution, Value
from alf_ros.studies.ensemble.kept_outputs import SAME, KeptOutput, LabelledArray
from alf_ros.studies.ensemble.sampling import Sampling, Varied
from alf_ros.studies.ensemble.structures import Structures
from alf_ros.studies.sent_scene import SentScene

MOST_AT_ONCE = 2**15  # members of a chunk; the values of so many are kept
_NO_ARRAY = re.compile(r'[\s/]')


@dataclass(frozen=True)
class Study(SentScene):
    """All that the members depend on, and that a worker needs.

    `duration` and `period` (s): how long a member runs, and how often it is looked at.
    `chunk`: how many members are one piece of work. `cost`: about how long a member takes, s;
    infinite if nobody knows. Made by `study_of`.
    """

    vary: tuple[tuple[str, Varied], ...]
    members: int
    seed: int
    sampling: str
    duration: float
    period: float
    outputs: tuple[KeptOutput, ...]
    chunk: int
    cost: float

    @cached_property
    def samples(self) -> Sampling:
        """The varied values of each member."""
        return Sampling(self.sampling, dict(self.vary), self.members, self.seed)

    def scene_of(self, k: int) -> Scene:
        """The scene of member k. Raises InputError for values that cannot be."""
        return overrides.with_changes(self.scene, self.values(k), prefix='vary.')

    def scene_of_members(self, members: Sequence[int]) -> Scene | None:
        """The scene of several members, whose numbers are columns; None if more than numbers
        differs. Raises what `overrides.of_members` does."""
        return overrides.of_members(self.scene, [self.values(k) for k in members])

    def values(self, k: int) -> dict[str, Value]:
        """The values of member k by name, as text."""
        found = self._values.get(k)
        if found is None:
            if len(self._values) >= MOST_AT_ONCE:
                self._values.clear()
            found = self._values[k] = self.samples.values(k)
        return found

    @cached_property
    def _values(self) -> dict[int, dict[str, Value]]:
        """Of the members asked for last."""
        return {}

    @cached_property
    def times(self) -> Floats:
        """The instants of the period, and the end, s."""
        count = check.samples_of(self.duration, self.period)
        found = np.asarray(np.arange(count + 1) * self.period, dtype=float)
        is_end = self.duration - found[-1] <= check.CLOSE * self.period
        return found if is_end else np.append(found, self.duration)

    @cached_property
    def instants(self) -> tuple[Floats, Integers]:
        """All instants (s) at which a member is looked at, and which of them are `times`: the last
        of these alone, if no output reads others."""
        times = self.times if any(o.reads_all for o in self.outputs) else self.times[-1:]
        asked = {t for output in self.outputs for t in output.times}
        outside = [t for t in sorted(asked) if np.abs(times - t).min() > SAME]
        merged = np.sort(np.concatenate([times, outside]))
        return merged, np.searchsorted(merged, times)

    @cached_property
    def parameters(self) -> tuple[LabelledArray, ...]:
        """The varied values as arrays: texts where they are no numbers."""
        return tuple(LabelledArray(name, text=_text_length(varied)) for name, varied in self.vary)

    @cached_property
    def variables(self) -> tuple[LabelledArray, ...]:
        """The arrays that the outputs make, in their order. Raises InputError."""
        run = Run([Simulation(self.scene, ledger=self.ledger).sample()])
        found: list[LabelledArray] = []
        for output in self.outputs:
            try:
                found += output.variables(run, self.times)
            except InputError as error:
                raise error.about(f'outputs.{output.label}') from None
        self._check_names(found)
        return tuple(found)

    @property
    def indeterminate(self) -> tuple[str, ...]:
        """The outputs of reactions that are one of many that balance."""
        found = {each.name for each in self.variables if each.is_indeterminate}
        return tuple(each.label for each in self.outputs if each.label in found)

    def _check_names(self, found: Sequence[LabelledArray]) -> None:
        """Raises InputError where arrays, their single numbers, numbers that vary and dimensions
        share a name, and where a number that varies has none for an array."""
        known = {'member': 'the number of a member', 'reason': 'the reason of a failure'}
        for each in self.parameters:
            if each.name in known:
                raise InputError(
                    f'{known[each.name]} has this name too', key='vary', value=each.name
                )
            if _NO_ARRAY.search(each.name):  # its folder; xarray parts the names at spaces
                expected = 'a name without spaces and /'
                raise InputError('not usable', key='vary', value=each.name, expected=expected)
            known[each.name] = 'a number that varies'
        sides: dict[str, tuple[int, object]] = {}
        for variable in found:
            for dim, length in zip(variable.dims, variable.shape, strict=True):
                side = length, list(variable.along.get(dim, ()))
                if sides.setdefault(dim, side) != side:
                    raise InputError('two dimensions of one name', value=dim)
        known |= dict.fromkeys(sides, 'a dimension of an output')
        for variable in found:
            if variable.name in known:
                what = known[variable.name]
                raise InputError(
                    f'a label that {what} has too',
                    value=variable.name,
                    expected='another label',
                )
            known[variable.name] = 'another output'
        singles: set[str] = set()
        for name in (name for variable in found for name in variable.numbers):
            if name in singles:
                expected = 'another label'
                raise InputError('two numbers of one name', value=name, expected=expected)
            singles.add(name)
        for each in self.parameters:
            if each.name in sides:
                raise InputError(
                    'a dimension of an output has the name of a number that varies',
                    value=each.name,
                )

    @cached_property
    def quantities(self) -> tuple[str, ...] | None:
        """The quantities that outputs read; None if a function may read all."""
        if any(o.kind == 'function' and not o.reads for o in self.outputs):
            return None
        return tuple(name for output in self.outputs for name in output.quantities)

    @cached_property
    def idle(self) -> list[Structures]:
        """Memory of this process for members that are made together, while nobody uses it."""
        return []

    @property
    def watch(self) -> bool:
        """Whether passes through singular positions are looked for."""
        return any(output.kind == 'passes' for output in self.outputs)

    @property
    def ledger(self) -> bool:
        """Whether the works of effects are integrated."""
        return any(n.startswith('works.') for o in self.outputs for n in o.quantities)

    @property
    def chunks(self) -> int:
        """How many pieces of work there are."""
        return -(-self.members // self.chunk)

    def indices(self, chunk: int) -> range:
        """The members of a chunk."""
        return range(chunk * self.chunk, min(self.members, (chunk + 1) * self.chunk))

    @property
    def data(self) -> dict[str, Any]:
        """The same as plain data: what a manifest says."""
        files = {name: user_file.digest(name) for name, _ in self.files}
        return {
            'name': self.name,
            'scene': self.text,
            'effects': {**files, **dict(self.code)},
            'vary': {
                name: varied.data if isinstance(varied, Distribution) else list(varied)
                for name, varied in self.vary
            },
            'members': self.members,
            'seed': self.seed,
            'sampling': self.sampling,
            'duration': self.duration,
            'period': self.period,
            'outputs': [output.data for output in self.outputs],
            'chunk': self.chunk,
        }

    @property
    def digest(self) -> str:
        """SHA-256 of `data`."""
        return hashlib.sha256(json.dumps(self.data, sort_keys=True).encode()).hexdigest()


def _text_length(varied: Varied) -> int:
    """How long the texts of a list are; 0 if all are numbers."""
    if isinstance(varied, Distribution):
        return 0
    try:
        [float(text) for text in varied]
    except ValueError:
        return max(map(len, varied))
    return 0
