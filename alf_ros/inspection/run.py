"""A run as a table: quantities of a simulation over time, and their ways out.

run = alf_ros.record(simulation, 2.0, every=5)
run['knee.force']            # (N, 2) N
run.plot('knee.force')
run.csv('run.csv')

matplotlib, pandas, pyarrow and xarray are imported where they are asked for; CSV needs none.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alf_ros import paths
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.full_names import full_name
from alf_ros.simulation.named_values import read_only
from alf_ros.simulation.quantities import (
    ONE_OF_MANY,
    Group,
    Quantity,
    groups,
    may_be_open,
    open_components,
)
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class _Quantity:
    """values (N,), or (N, components); a unit for each component."""

    values: Floats
    units: tuple[str, ...]
    components: tuple[str, ...]


class RunReader:
    """Reads samples one by one, for runs that are stepped in turns. It keeps their numbers, and no
    sample: a sample holds memory for all quantities of the mechanism."""

    def __init__(self, only: Sequence[str] | None = None) -> None:
        self._only = only
        self._has_open = False
        self.times: list[float] = []
        self.rows: list[tuple[Floats, ...]] = []
        self.wanted: list[tuple[Group, list[int]]] = []
        self.of_rank: dict[int, Sample] = {}  # a sample of each number of redundant rows
        self.last: Sample | None = None

    def read(self, sample: Sample) -> None:
        """Read the next sample. Raises InputError as `Run` does."""
        if not isinstance(sample, Sample):
            raise InputError('not a sample', key='samples', value=sample)
        if not self.times:
            self.wanted = _wanted(groups(sample), self._only)
            self._has_open = any(may_be_open(group.names[0]) for group, _ in self.wanted)
        if self._has_open:
            self.of_rank.setdefault(sample.diagnostics.redundant, sample)
            self.last = sample
        self.times.append(sample.t)
        self.rows.append(tuple(group.read(sample)[which] for group, which in self.wanted))

    def run(self) -> Run:
        """The run so far. Raises InputError if there are no samples."""
        found = Run.__new__(Run)
        found._take(self)
        return found


class Run:
    """Quantities of N samples, by name; SI, world frame, read-only.

    `t` (N,) s. `names` are paths in `Sample`: 'energy', 'points.B', 'joints.knee.position',
    'reactions.knee.force'. Every call with a name accepts a unique end of it ('knee.force'), and
    one component ('knee.force.x').
    """

    t: Floats
    names: tuple[str, ...]

    def __init__(self, samples: Iterable[Sample], only: Sequence[str] | None = None) -> None:
        """Read each sample as it comes, and keep numbers only.

        `only`: the quantities that are read, all others cost nothing. Raises InputError for an
        unknown name, for something else than samples, and if there are no samples.
        """
        reader = RunReader(only)
        for sample in samples:
            reader.read(sample)
        self._take(reader)

    def _take(self, reader: RunReader) -> None:
        if not reader.times:
            raise InputError('no samples', key='samples', expected='one or more')
        self._of_rank, self._last = reader.of_rank, reader.last
        quantities: dict[str, _Quantity] = {}
        for k, (group, which) in enumerate(reader.wanted):
            values = read_only(np.array([row[k] for row in reader.rows], dtype=float))
            for n, at in enumerate(which):
                found = _Quantity(values[:, n], group.units, group.components)
                quantities[group.names[at]] = found
        self._keep(read_only(np.array(reader.times)), quantities)

    def _keep(self, t: Floats, quantities: dict[str, _Quantity]) -> None:
        self.t, self._quantities = t, quantities
        self.names = tuple(self._quantities)
        self._places: dict[str, tuple[str, int | None]] = {
            name: (name, None) for name in self.names
        }
        for name, quantity in self._quantities.items():
            for n, axis in enumerate(quantity.components):
                self._places[f'{name}.{axis}'] = name, n

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return (
            f'<Run of {len(self)} samples, t = {self.t[0]:.6g} to {self.t[-1]:.6g} s, '
            f'{len(self.names)} quantities>'
        )

    def __getitem__(self, name: str) -> Floats:
        """The values (N,), or (N, components). Raises InputError."""
        full, component = self._found(name)
        values = self._quantities[full].values
        return values if component is None else values[:, component]

    def unit(self, name: str) -> str:
        """The unit of a quantity; '' for a number without unit. Raises InputError.

        Where the components have different units, such as a pose in the plane, 'm, rad'.
        """
        full, component = self._found(name)
        units = self._quantities[full].units
        return ', '.join(dict.fromkeys(units)) if component is None else units[component]

    def columns(self, *names: str) -> dict[str, Floats]:
        """The numbers one by one (N,), each component by its name; of all quantities without
        `names`. Raises InputError."""
        found: dict[str, Floats] = {}
        for name in names or self.names:
            full, component = self._found(name)
            quantity = self._quantities[full]
            if not quantity.components:
                found[full] = quantity.values
            for n, axis in enumerate(quantity.components):
                if component in (None, n):
                    found[f'{full}.{axis}'] = quantity.values[:, n]
        return found

    def _found(self, name: str) -> tuple[str, int | None]:
        """The full name of a quantity, and which of its components is meant."""
        if isinstance(name, str) and name in self._places:
            return self._places[name]
        return self._places[full_name(name, tuple(self._places), 'name')]

    @cached_property
    def indeterminate(self) -> tuple[str, ...]:
        """The reactions and efforts that are one of many that balance, because constraints are
        redundant: in the first or the last sample, or where the number of redundant rows
        changes."""
        samples = [*self._of_rank.values(), *([self._last] if self._last else [])]
        return tuple(
            name
            for name in filter(may_be_open, self.names)
            if any(open_components(sample, name).any() for sample in samples)
        )

    def is_indeterminate(self, name: str) -> bool:
        """Whether a quantity is in `indeterminate`; of a component, whether its quantity is.
        Raises InputError for an unknown name."""
        full = self._found(name)[0]
        return may_be_open(full) and full in self.indeterminate

    # ------------------------------------------------------------------------------ the ways out

    def plot(self, *names: str, file: str | Path | None = None) -> tuple[Axes, ...]:
        """Draw quantities over time, one panel for each unit; returns the panels.

        With `file` (.png, .svg, .pdf) the picture is written there; otherwise
        `matplotlib.pyplot.show()` shows it, in a notebook the cell shows it. Raises InputError for
        an unknown name, without matplotlib, and if the file cannot be written.
        """
        from alf_ros.inspection import run_plot

        if not names:
            raise InputError('nothing to draw', key='plot', choices=self.names)
        panels: dict[str, dict[str, Floats]] = {}
        for name in names:
            for label, values in self.columns(name).items():
                told = f'{label}, one of many' if self.is_indeterminate(label) else label
                panels.setdefault(self.unit(label), {})[told] = values
        return run_plot.draw(self.t, panels, None if file is None else paths.named(file))

    def csv(self, path: str | Path) -> Path:
        """Write `t` and all columns; numbers read back exactly. Returns the path.

        Raises InputError if the file cannot be written.
        """
        return write_columns({'t': self.t, **self.columns()}, path)

    def parquet(self, path: str | Path) -> Path:
        """Write `t` and all columns, each with `unit`, and `indeterminate` if it is one of many,
        as metadata. Returns the path.

        Raises InputError without pyarrow, and if the file cannot be written.
        """
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            raise _missing('Parquet', 'pyarrow') from None
        file, columns = paths.named(path), {'t': self.t, **self.columns()}
        fields = [
            pyarrow.field(label, pyarrow.float64(), metadata=self._about(label))
            for label in columns
        ]
        arrays = [np.ascontiguousarray(column) for column in columns.values()]
        table = pyarrow.table(arrays, schema=pyarrow.schema(fields))
        try:
            pyarrow.parquet.write_table(table, file)
        except OSError as error:
            raise _unwritten(file, error) from None
        return file

    def _about(self, label: str) -> dict[str, str]:
        if label == 't':
            return {'unit': 's'}
        flag = {'indeterminate': ONE_OF_MANY} if self.is_indeterminate(label) else {}
        return {'unit': self.unit(label), **flag}

    def frame(self) -> pandas.DataFrame:
        """All columns as a pandas DataFrame with the index t (s). Raises InputError without it."""
        try:
            import pandas
        except ImportError:
            raise _missing('a DataFrame', 'pandas') from None
        return pandas.DataFrame(self.columns(), index=pandas.Index(self.t, name='t'))

    def xarray(self) -> xarray.Dataset:
        """All quantities as an xarray Dataset along `t` (s), with `units` as attributes.

        Components lie along the dimension 'axis' (x, y, z), and components of poses along 'pose'.
        Reactions and efforts that are one of many have the attribute `indeterminate`.
        Raises InputError without xarray.
        """
        try:
            import xarray
        except ImportError:
            raise _missing('a Dataset', 'xarray') from None
        axes: dict[str, Any] = {'t': ('t', self.t, {'units': 's'})}
        variables = {}
        for name, quantity in self._quantities.items():
            dims: tuple[str, ...] = ('t',)
            if quantity.components:
                along = 'pose' if name.startswith('body_poses.') else 'axis'
                dims, axes[along] = ('t', along), list(quantity.components)
            told = {'units': self.unit(name)}
            if self.is_indeterminate(name):
                told['indeterminate'] = ONE_OF_MANY
            variables[name] = (dims, quantity.values, told)
        return xarray.Dataset(variables, axes)


def record(
    simulation: Simulation,
    duration: float,
    *,
    every: int | None = None,
    period: float | None = None,
    only: Sequence[str] | None = None,
) -> Run:
    """Advance by `duration` (s) and return the samples on the way.

    A sample now and after every `every` steps, or every `period` (s), which need not be a multiple
    of the step; without either after every step. `only`: the quantities that are read. Raises
    InputError for what cannot be used, before a step is taken, and what `Simulation.run` raises:
    the simulation is then at the last whole step.
    """
    if not isinstance(simulation, Simulation):
        raise InputError(
            'not a simulation', key='simulation', value=simulation, expected='Simulation(…)'
        )
    if every is not None and period is not None:
        raise InputError('`every` states it already', key='period', value=period)
    if only is not None:
        _wanted(groups(simulation.sample()), only)
    if period is None:
        return Run(simulation.run(duration, 1 if every is None else every), only)
    period, begin = check.number(period, 'period', 0.0), simulation.t
    if period == 0.0:
        raise InputError('not usable', key='period', value=period, expected='s, more than 0')
    count = check.samples_of(check.number(duration, 'duration', 0.0), period)
    times = [begin + n * period for n in range(count + 1)]
    return Run(simulation.run(duration, at=times), only)


def run_of_arrays(t: Floats, quantities: Mapping[Quantity, Floats]) -> Run:
    """The run of samples that were read elsewhere, at t (N,) s: the values of each quantity, (N,)
    or (N, components)."""
    values = {
        each.name: _Quantity(read_only(array), each.units, each.components)
        for each, array in quantities.items()
    }
    run = Run.__new__(Run)
    run._of_rank, run._last = {}, None
    run._keep(read_only(t), values)
    return run


class RunsTogether:
    """Runs of members that were read at the same times t (N,) s, with the names of a `Run`."""

    def __init__(self, t: Floats, quantities: Mapping[Quantity, Floats]) -> None:
        """`quantities`: the values of each, (members, N) or (members, N, components)."""
        self.t, self._quantities = read_only(t), quantities
        self._values = {each.name: array for each, array in quantities.items()}
        self._first = self.run(0)

    def __getitem__(self, name: str) -> Floats:
        """The values (members, N), or (members, N, components). Raises InputError."""
        full, component = self._first._found(name)
        values = self._values[full]
        return values if component is None else values[:, :, component]

    def run(self, m: int) -> Run:
        """The run of member m."""
        return run_of_arrays(self.t, {each: a[m] for each, a in self._quantities.items()})


def _wanted(known: Sequence[Group], only: Sequence[str] | None) -> list[tuple[Group, list[int]]]:
    """The groups that are read, and which of their quantities."""
    if only is None:
        return [(group, list(range(len(group.names)))) for group in known]
    if isinstance(only, str) or not isinstance(only, Sequence):
        raise InputError('not a list of names', key='only', value=only)
    owner = {name: name for group in known for name in group.names}
    for group in known:
        owner |= {f'{name}.{axis}': name for name in group.names for axis in group.components}
    asked = {owner[full_name(name, tuple(owner), 'only')] for name in only}
    found = [
        (group, [n for n, name in enumerate(group.names) if name in asked]) for group in known
    ]
    return [(group, which) for group, which in found if which]


def write_columns(columns: Mapping[str, Floats], path: str | Path) -> Path:
    """Write columns of one length as CSV; numbers read back exactly. Returns the path.

    Raises InputError if the file cannot be written.
    """
    file, lists = paths.named(path), (column.tolist() for column in columns.values())
    try:
        with (
            paths.replacing(file) as target,
            open(target, 'w', newline='', encoding='utf-8') as stream,
        ):
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(zip(*lists, strict=True))
    except OSError as error:
        raise _unwritten(file, error) from None
    return file


def _missing(what: str, package: str) -> InputError:
    return InputError(f"{what} needs {package}: pip install 'alf_ros[table]'")


def _unwritten(file: Path, error: OSError) -> InputError:
    return InputError(f'cannot be written: {error.strerror or error}', file=str(file))
