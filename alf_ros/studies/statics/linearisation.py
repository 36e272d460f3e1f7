"""`alf_ros.linearise`: the linear model of a mechanism about rest, a motion, or any instant.

Coordinates of neighbouring motions are η = Yᵀ M (q - q₀) and ν = Zᵀ M q̇. What q and q̇ change
besides is at right angles to Y and Z in the metric of M, so that no derivative of a mass appears,
and the following is exact to first order. With J = [Φ_q; N], δJ its change along δq, and λ the
multipliers of the instant:

    δq = Y δη,   δq̇ = Z δν + U δη,   J U δη = -δJ q̇₀,
    δν̇ = Zᵀ [(∂Q/∂q - L) δq + ∂Q/∂q̇ δq̇],   L δq = δJᵀ λ.

The rows that are redundant agree on δJ q̇₀, and L does not depend on which of their λ is taken.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, argument_of
from alf_ros.inspection.run import Run
from alf_ros.model import assembly, ordinary_positions
from alf_ros.model.carried_positions import blocks_of
from alf_ros.model.singular_branches import SMOOTH, position
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import texts
from alf_ros.simulation.named_inputs import NamedInput, named_inputs
from alf_ros.simulation.quantities import open_components
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.creeping_friction import creeping
from alf_ros.studies.statics.descent import moved
from alf_ros.studies.statics.difference_slopes import slope_at_zero
from alf_ros.studies.statics.frozen_time import read_at, standing_still
from alf_ros.studies.statics.held_to_second_order import held_to_second_order
from alf_ros.studies.statics.instant import Instant, Loads, forces
from alf_ros.studies.statics.linear_model import LinearModel
from alf_ros.studies.statics.positions_of_rest import (
    Equilibrium,
    equilibrium,
    in_order,
)

# of a typical length, and of it a second: stiff contacts are micrometres deep
_AWAY = (3e-3, 3e-4, 3e-5, 3e-6, 3e-7, 3e-8, 3e-9, 3e-10, 3e-11)
# of the largest slope of a row nearby: from there on an error means that there is no slope
_KINKED = 1e-2
_FORCES = {'N', 'N m', 'W'}  # units of what a force is felt in
_TARGET = 1e-4  # of the typical size of a target, of a difference: a motor may reach its limit
# of the terms that a number is the sum of: what rounding may leave of it, beside the longest step
_CANCELLED = 1e-11
_ROUNDED = 1e-12  # of the largest in a row of C or D, that is rounding of the differences
_MOVING = (
    'about an instant of a motion: its directions do not turn with the bodies, so a wheel that '
    'turns steadily has a frequency, and eigenvalues do not say whether the motion is stable'
)


def linearise(
    about: SceneSource | Simulation | Equilibrium,
    *,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """The linear model about the present of a simulation, about a position of rest, or about the
    equilibrium of a scene.

    inputs: names such as 'joints.crank_pin.effort', 'wrenches.coupler.force.x',
    'targets.crank_pin.position'. outputs: names of quantities as of a `Run`, such as
    'joints.knee.position', 'points.B.x', 'reactions.knee.force.x'; the positions of all joints if
    absent. Ends of names that only one has are enough. The loads of dry friction are held.

    Raises InputError for unknown names and an input named twice, in a singular position, where a
    free motion has no mass, and for more than 1200 coordinates; and what `equilibrium` raises.
    """
    inputs = texts(inputs, 'inputs')
    outputs = None if outputs is None else texts(outputs, 'outputs')
    simulation, state, t = _instant_of(about)
    sample = simulation._sample(t, state, False)
    loads = Loads(simulation)
    rubbing = sample.friction_loads if loads.applied.load_count else np.zeros(0)
    instant = Instant(loads, t, state.q, state.qd, state.turns, rubbing)
    refuse_singular(instant)
    named = named_inputs(loads.model, loads.effects, inputs)
    for k, each in enumerate(named):
        if each in named[:k]:
            raise InputError('named twice', key='inputs', value=each.name)
    A, stiffness, damping, drift = _motion(instant, sample)
    charted = _Charted(instant, simulation, state)
    names, units = _outputs(sample, outputs)
    C = charted.slopes(names, units)
    notes = ['the loads of friction are held'] if rubbing.size else []
    notes += creeping(instant)
    notes += held_to_second_order(instant)
    if instant.qd.any():
        notes.append(_MOVING)
    if not isinstance(about, Simulation):
        notes += standing_still(instant.model, t)
    notes += read_at(instant)
    if instant.is_kinked:
        notes.append('a force has a kink here: the model holds on one side of it')
    elif not _FORCES.isdisjoint(units) and instant.bends:
        notes.append('a force begins here: slopes of outputs that feel it are inexact')
    if instant.is_kinked_in_speed:
        notes.append('a force has a kink at this velocity: the damping is of one side of it')
    kinked = [name for name, row in zip(names, C, strict=True) if np.isnan(row).any()]
    if kinked:
        notes.append(f'in a kink, without a slope (NaN): {", ".join(kinked)}')
    shared = [name for name in names if open_components(sample, _quantity(sample, name)).any()]
    if shared:
        notes.append(f'joints are redundant, and one solution of many: {", ".join(shared)}')
    B = np.zeros((len(A), len(named)))
    places = instant.position_directions.shape[1]
    sizes = _sizes(instant, sample, A, named)
    for k, each in enumerate(named):
        B[places:, k] = instant.velocity_directions.T @ _pushed_by(instant, each, sizes[k])
    return LinearModel(
        A=A,
        B=B,
        C=C,
        D=_direct(simulation, state, t, names, named, sizes),
        stiffness=stiffness,
        damping=damping,
        drift=drift,
        directions=in_order(instant.model, instant.position_directions.T),
        inputs=tuple(each.name for each in named),
        outputs=names,
        input_units=tuple(each.unit for each in named),
        output_units=units,
        t=t,
        notes=tuple(notes),
    )


def _instant_of(
    about: SceneSource | Simulation | Equilibrium,
) -> tuple[Simulation, State, float]:
    if isinstance(about, Simulation):
        return copy.copy(about), about.state, about.t
    rest = about if isinstance(about, Equilibrium) else equilibrium(about)
    simulation = copy.copy(rest.simulation)
    return simulation, rest.state, rest.t


def refuse_singular(instant: Instant) -> None:
    """Raises InputError in a singular position, where there is no linear model."""
    model = instant.model
    dependent = len(model.row_names) - round(model.system.rank)
    lost = instant.rank < round(model.system.rank)
    if lost or ordinary_positions.within(model, instant.q, dependent):
        found = position(model, instant.q, instant.t)
        kind = found.kind if found.kind != SMOOTH else 'rank lost'
        raise InputError(
            f'a singular position ({kind}) has no linear model',
            key='linearise',
            value=f't = {instant.t:g} s',
        )


def _motion(instant: Instant, sample: Sample) -> tuple[Floats, Floats, Floats, Floats]:
    """A, and stiffness and damping of unit mass; and ẋ of the instant."""
    model, n = instant.model, instant.model.n
    Y, Z = instant.position_directions, instant.velocity_directions
    lam = np.empty(len(model.row_names))
    lam[model.row] = sample.lam
    g, f = Y.shape[1], Z.shape[1]
    U = np.zeros((n, g))
    if instant.qd.any():
        solve = ConstrainedSolve(model, ())
        solve.factorise(instant.M, instant.J_of_movable, instant.q)
        for y, u in zip(Y.T, U.T, strict=True):
            u[:] = solve.solve(np.zeros(n), -(instant.turning @ y))[0]
    force = instant.K @ Y + instant.curvature(lam) @ Y + instant.C @ U
    stiffness, damping = Z.T @ force, Z.T @ (instant.C @ Z)
    A = np.block([[Y.T @ (instant.M @ U), Y.T @ (instant.M @ Z)], [-stiffness, -damping]]).reshape(
        g + f, g + f
    )
    acceleration = blocks_of(model, sample.qdd)[:n]
    rates = [Y.T @ (instant.M @ instant.qd[:n]), Z.T @ (instant.M @ acceleration)]
    if g != f:
        stiffness = damping = np.zeros((0, 0))
    return A, stiffness, damping, np.concatenate(rates)


def _sizes(
    instant: Instant, sample: Sample, A: Floats, named: Sequence[NamedInput]
) -> list[float]:
    """Of each input a size that counts beside the forces of the instant, and beside those that a
    displacement of a typical length makes; of the speed of a target, one of its own motions."""
    length, angular = instant.loads.tangents.length, instant.model.layout.length
    mass = float(instant.M.diagonal().sum()) / instant.model.layout.dimension
    places = instant.position_directions.shape[1]
    square = float(np.abs(A[places:, :places]).max(initial=0.0))  # 1/s²
    acting = [instant.Q, sample.constraint_forces]
    largest = [float(np.abs(forces).max(initial=0.0)) for forces in acting]
    force, rate = max(*largest, mass * length * square) or 1.0, np.sqrt(square) or 1.0
    sizes = {'N': force, 'N m': force * angular, 'm': length, 'rad': 1.0}
    sizes |= {'m/s': length * rate, 'rad/s': rate}
    return [sizes[each.unit] for each in named]


def _pushed_by(instant: Instant, each: NamedInput, size: float) -> Floats:
    """(n,) ∂Q/∂u."""
    found, held = [], instant.loads.inputs
    h = size * (_TARGET if each.name.startswith('targets.') else 1.0)
    for sign in (1.0, -1.0):
        try:
            effects = instant.loads.with_inputs(each.added(held, sign * h))
        except ValueError as error:
            raise InputError(str(error), key='inputs', value=each.name) from None
        at = instant.t, instant.q, instant.qd, instant.near, instant.rubbing
        found.append(forces(effects, *at))
    return np.asarray((found[0] - found[1])[: instant.model.n] / (2.0 * h))


def _outputs(
    sample: Sample, outputs: Sequence[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of numbers and their units. Raises InputError for an unknown one."""
    if outputs is None:
        outputs = [f'joints.{name}.position' for name in sample.model.coordinate_names]
    if not outputs:
        return (), ()
    run = Run([sample])
    with argument_of('outputs', 'name'):
        names = tuple(run.columns(*outputs))
    return names, tuple(run.unit(name) for name in names)


class _Charted:
    """Samples at states beside an instant."""

    def __init__(self, instant: Instant, simulation: Simulation, state: State) -> None:
        self._instant, self._simulation, self._state = instant, simulation, state
        Y, Z = instant.position_directions, instant.velocity_directions
        self._directions = [*Y.T, *Z.T]
        self._places = Y.shape[1]

    def away(self, k: int, size: float) -> Sample:
        """The sample at a distance along state k."""
        instant = self._instant
        q, turns, qd = instant.q, instant.turns, np.array(instant.qd)
        n = instant.model.n
        if k < self._places:
            there = moved(instant, size * self._directions[k])
            q, turns = there.q, there.turns
        else:
            qd[:n] += size * self._directions[k]
        if qd.any():
            qd = assembly.complete(instant.model, q, {}, instant.t, near=qd)
        state = self._state.moved(q, qd, turns)
        return self._simulation._sample(instant.t, state, False)

    def slopes(self, names: tuple[str, ...], units: tuple[str, ...]) -> Floats:
        """(names, states) slopes of quantities; NaN where there is none, as in a kink."""
        shape = len(names), len(self._directions)
        found, errors, largest = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        length = self._instant.loads.tangents.length
        for k, direction in enumerate(self._directions if names else ()):
            longest = float(np.abs(direction).max(initial=1e-300))
            steps = [step * length / longest for step in _AWAY]
            near = slope_at_zero(partial(self._values, names, k), steps)
            found[:, k], _, largest[:, k] = near
            # rounding is all that a number has that is always zero, and looks like a kink
            rounding = _CANCELLED * self._terms(self.away(k, steps[0]), units) / steps[0]
            errors[:, k] = np.where(near.errors > rounding, near.errors, 0.0)
        steepest = largest.max(axis=1, initial=0.0, keepdims=True)
        return np.asarray(
            np.where(errors <= _KINKED * steepest, _rounded(found, steepest), np.nan)
        )

    def _values(self, names: tuple[str, ...], k: int, size: float) -> Floats:
        return _read([self.away(k, size)], names)[:, 0]

    def _terms(self, sample: Sample, units: tuple[str, ...]) -> Floats:
        """(units,) how large the terms are that a number of this unit is the sum of."""
        length, state = sample.model.layout.length, sample.state
        place, speed, *forces = (
            float(np.abs(numbers).max(initial=0.0))
            for numbers in (state.q, state.qd, self._instant.Q, sample.constraint_forces)
        )
        force = max(forces)
        angle, rate, torque = place / length, speed / length, force * length
        sizes = {
            **{'m': place, 'm/s': speed, 'N': force, 'J': force * place, 'W': force * speed},
            **{'rad': angle, 'rad/s': rate, 'N m': torque, '': 1.0},
        }
        return np.array([sizes[unit] for unit in units])


def _read(samples: Sequence[Sample], names: tuple[str, ...]) -> Floats:
    """(names, samples)."""
    columns = Run(samples, only=sorted({_quantity(samples[0], name) for name in names}))
    return np.array([columns.columns(name)[name] for name in names])


def _quantity(sample: Sample, name: str) -> str:
    """The quantity that a number is a component of."""
    axis = name.rpartition('.')[2]
    is_component = axis in ('x', 'y', 'z', 'angle', 'qx', 'qy', 'qz', 'qw')
    return name.rpartition('.')[0] if is_component else name


def _direct(
    simulation: Simulation,
    state: State,
    t: float,
    names: tuple[str, ...],
    named: Sequence[NamedInput],
    sizes: Sequence[float],
) -> Floats:
    """D (outputs, inputs)."""
    found = np.zeros((len(names), len(named)))

    def values(each: NamedInput, change: float) -> Floats:
        pushed = replace(state, inputs=each.added(state.inputs, change))
        other = copy.copy(simulation)
        other.restore(pushed)
        return _read([other._sample(t, pushed, False)], names)[:, 0]

    for k, (each, size) in enumerate(zip(named, sizes, strict=True) if names else ()):
        found[:, k] = slope_at_zero(partial(values, each), [size * step for step in _AWAY]).slopes
    return _rounded(found, np.abs(found).max(axis=1, initial=0.0, keepdims=True))


def _rounded(slopes: Floats, largest: Floats) -> Floats:
    """Without what differences leave of zeros; `largest` (rows, 1): slope of each row."""
    return np.asarray(np.where(np.abs(slopes) > _ROUNDED * largest, slopes, 0.0))
