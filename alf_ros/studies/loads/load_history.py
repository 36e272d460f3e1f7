"""LoadHistory: efforts and reactions along a motion, with peaks, tables and curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid
from scipy.interpolate import make_interp_spline

from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve, through
from alf_ros.errors import InputError
from alf_ros.inspection.run import Run, write_columns
from alf_ros.simulation.input_checks import text
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation

POSSIBLE = 1e-7  # of the largest forces, that efforts of a possible motion leave at most
_TIE = 1e-9  # part by which values count as equally large
_POWER = 5  # of the splines between instants


@dataclass(frozen=True)
class Peak:
    """largest: with its sign, at t (s); rms: the root of the mean square over time; of a vector,
    of its length."""

    largest: float
    t: float
    rms: float
    unit: str


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Loads along a motion.

    t (T,), s. names (a,): the actuators, with `units`. efforts (T, a), N or N m; NaN where they
    are not determined. short (T,): the forces that the efforts leave, as a part of the largest
    forces of the motion, in the metric of the mass: rounding if the actuators can make the motion.
    missing (T, joint coordinates), rad/s² or m/s²: the accelerations that are left. notes:
    conditions of the result, a sentence each.
    """

    t: Floats
    names: tuple[str, ...]
    units: tuple[str, ...]
    efforts: Floats
    short: Floats
    missing: Floats
    notes: tuple[str, ...]
    sampled: Callable[[], list[Sample]] = field(repr=False)

    def __repr__(self) -> str:
        span = f't = {self.t[0]:.6g} to {self.t[-1]:.6g} s'
        return f'<LoadHistory of {len(self.names)} actuators, {len(self.t)} instants, {span}>'

    def __getitem__(self, name: str) -> Floats:
        """The effort of an actuator (T,), N or N m. Raises InputError."""
        if text(name, 'name') not in self.names:
            raise InputError('no such actuator', key='name', value=name, choices=self.names)
        return self.efforts[:, self.names.index(name)]

    @property
    def is_possible(self) -> bool:
        """Whether the actuators can make the motion, where their efforts are determined."""
        return not bool((np.nan_to_num(self.short) > POSSIBLE).any())

    @cached_property
    def run(self) -> Run:
        """All quantities of the motion under these efforts, reactions among them, by name, at all
        instants but those in singular positions.

        Where the efforts cannot make the motion, the reactions belong to the accelerations that
        the efforts make. Raises InputError if there is no such instant.
        """
        samples = self.sampled()
        if not samples:
            raise InputError('all instants lie in singular positions', key='times')
        return Run(samples)

    @cached_property
    def peaks(self) -> Mapping[str, Peak]:
        """The largest value and the rms of each effort, and of the force and the torque of each
        reaction ('reactions.knee.force')."""
        found = {
            name: _peak(self.t, values, unit)
            for name, values, unit in zip(self.names, self.efforts.T, self.units, strict=True)
        }
        for name in self.run.names:
            if name.startswith('reactions.'):
                values = self.run[name]
                sizes = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
                found[name] = _peak(self.run.t, sizes, self.run.unit(name))
        return found

    def curve(self, name: str) -> Curve:
        """The effort over time, for `Simulation.apply_effort`: a spline of fifth power through the
        instants. Raises InputError for an unknown name, or where an effort is not determined."""
        values = self[name]
        if np.isnan(values).any():
            raise InputError('not determined at every instant', key='curve', value=name)
        if len(self.t) <= _POWER:
            raise InputError(
                'too few instants', key='times', value=len(self.t), expected=f'> {_POWER}'
            )
        spline = make_interp_spline(self.t, values, _POWER)
        knots = np.column_stack([spline(self.t, power) for power in range(3)])
        return through(self.t.tolist(), knots.tolist())

    def apply_to(self, simulation: Simulation) -> None:
        """Hold the efforts over time on the joints of a simulation: the forward run repeats the
        motion. Raises InputError for actuators that are wrenches."""
        if not isinstance(simulation, Simulation):
            raise InputError(
                'not a simulation', key='simulation', value=simulation, expected='Simulation(…)'
            )
        for name in self.names:
            simulation.apply_effort(name, self.curve(name))

    def csv(self, path: str | Path) -> Path:
        """Write t, efforts, `short` and all reactions. Returns the path. Raises InputError."""
        run, known = self.run, np.isin(self.t, self.run.t)
        reactions = [name for name in run.names if name.startswith('reactions.')]
        columns = {f'{name}.effort': self[name] for name in self.names}
        rest = {}
        for name, values in run.columns(*reactions).items():
            rest[name] = np.full(self.t.size, math.nan)
            rest[name][known] = values
        columns = {'t': self.t, **columns, 'short': self.short, **rest}
        return write_columns(columns, path)


def _peak(t: Floats, values: Floats, unit: str) -> Peak:
    known = ~np.isnan(values)
    if not known.any():
        return Peak(math.nan, math.nan, math.nan, unit)
    sizes = np.nan_to_num(np.abs(values))
    k = int(np.argmax(sizes >= (1.0 - _TIE) * sizes.max()))  # the first, if a limit is held
    times, squares = t[known], values[known] ** 2
    span = float(times[-1] - times[0])
    mean = float(trapezoid(squares, times)) / span if span > 0.0 else float(squares.mean())
    return Peak(float(values[k]), float(t[k]), math.sqrt(mean), unit)
